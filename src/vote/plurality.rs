//! Counts votes and finds the winner: ties go to the larger sum of votes times confidence, then to the lowest number.

/// Candidates with their votes and votes times confidence, in the order of their first vote: rarely more than three.
pub(super) type Tally = Vec<(u32, f64, f64)>;

pub(super) fn add(tally: &mut Tally, for_what: u32, votes: f64, confidence: f64) {
    match tally.iter_mut().find(|(known, ..)| *known == for_what) {
        Some((_, sum, sure)) => {
            *sum += votes;
            *sure += votes * confidence;
        }
        None => tally.push((for_what, votes, votes * confidence)),
    }
}

/// The candidate with most votes, and its votes; ties as described above.
pub(super) fn winner(tally: &Tally) -> Option<(u32, f64)> {
    let order =
        |a: &&(u32, f64, f64), b: &&(u32, f64, f64)| a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2)).then(b.0.cmp(&a.0));
    tally.iter().max_by(order).map(|&(what, votes, _)| (what, votes))
}
