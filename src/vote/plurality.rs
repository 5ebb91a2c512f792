//! Counting votes, and who has most: ties go to the larger sum of votes times confidence, then to the first by number.

/// Votes and votes times confidence by what they are for, in order of first sight: rarely more than three.
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

/// What has most votes, and how many; ties as the module says.
pub(super) fn winner(tally: &Tally) -> Option<(u32, f64)> {
    let order =
        |a: &&(u32, f64, f64), b: &&(u32, f64, f64)| a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2)).then(b.0.cmp(&a.0));
    tally.iter().max_by(order).map(|&(what, votes, _)| (what, votes))
}
