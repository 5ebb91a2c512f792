//! Which parts of different views are the same part of the object.
//!
//! Two views' parts are compared on the Gaussians that both views see: their overlap is the number of those that carry both
//! parts over the number that carry either (Jaccard). Parts are joined into 3D parts by average linkage: always the two
//! groups with the largest overlap, summed over their views, as long as it exceeds [`SAME_PART_OVERLAP`]. Two parts of one
//! view share no Gaussian, so they count against a union: a view that took two parts for one does not glue them
//! together as long as most views keep them apart.

use rayon::prelude::*;

use super::ballots::{Ballot, Ballots};

/// Overlap from which two groups are one 3D part. Above one half, a part has at most one partner in another view, whose
/// parts are disjoint; so this is the lowest threshold that leaves no choice.
pub(super) const SAME_PART_OVERLAP: f64 = 0.5;

/// The 3D part of every view's part, and how many Gaussians each view's part is seen on.
pub(super) struct Identity {
    /// Numbered in the order of their first view's part.
    pub part_3d: Vec<u32>,
    pub parts_3d: usize,
    /// Per view's part.
    pub seen: Vec<u64>,
}

impl Identity {
    /// `view_of[p]` is the view of part `p`.
    pub fn new(ballots: &Ballots, view_of: &[usize]) -> Self {
        let both = Counts::of(ballots, view_of);
        let seen: Vec<u64> = (0..view_of.len()).map(|p| both.get(p, p)).collect();
        let (part_3d, parts_3d) = numbered(&Groups::new(&both, view_of).joined());
        Self { part_3d, parts_3d, seen }
    }
}

/// How many Gaussians carry part `a` in one view and part `b` in another; on the diagonal, how many carry `a`.
struct Counts {
    parts: usize,
    counts: Vec<u32>,
}

impl Counts {
    fn of(ballots: &Ballots, view_of: &[usize]) -> Self {
        /// Gaussians counted together: their table must be small beside them.
        const RUN: usize = 1 << 17;
        let parts = view_of.len();
        let runs = ballots.gaussians().div_ceil(RUN);
        // Sums of integers: the order of the runs does not matter.
        let counts = (0..runs).into_par_iter().map(|run| {
            let mut counts = vec![0u32; parts * parts];
            let mut carried = Vec::new();
            for i in run * RUN..ballots.gaussians().min((run + 1) * RUN) {
                main_parts(ballots.of(i), view_of, &mut carried);
                for &a in &carried {
                    for &b in &carried {
                        counts[a as usize * parts + b as usize] += 1;
                    }
                }
            }
            counts
        });
        let add = |mut sum: Vec<u32>, other: Vec<u32>| {
            sum.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
            sum
        };
        Self { parts, counts: counts.reduce(|| vec![0; parts * parts], add) }
    }

    fn get(&self, a: usize, b: usize) -> u64 {
        u64::from(self.counts[a * self.parts + b])
    }
}

/// Of every view that votes for a Gaussian, the part it votes for most; the first of equals.
fn main_parts(ballots: &[Ballot], view_of: &[usize], main: &mut Vec<u32>) {
    main.clear();
    let same_view = |a: &Ballot, b: &Ballot| view_of[a.part as usize] == view_of[b.part as usize];
    for of_view in ballots.chunk_by(same_view) {
        let best = of_view.iter().reduce(|best, next| if next.weight > best.weight { next } else { best });
        main.extend(best.map(|ballot| ballot.part));
    }
}

/// Groups of parts while they are being joined.
struct Groups {
    /// Summed over pairs of parts, one of each group: Gaussians that carry both, and that carry either.
    both: Vec<f64>,
    either: Vec<f64>,
    /// Of every part, the group it belongs to, named by its first part.
    group: Vec<usize>,
    alive: Vec<usize>,
}

impl Groups {
    fn new(counts: &Counts, view_of: &[usize]) -> Self {
        let parts = view_of.len();
        let views = view_of.iter().max().map_or(0, |last| last + 1);
        // Gaussians of a part that another view votes for at all.
        let mut seen_by = vec![0u64; parts * views];
        for a in 0..parts {
            for b in 0..parts {
                seen_by[a * views + view_of[b]] += counts.get(a, b);
            }
        }
        let mut groups = Self {
            both: vec![0.0; parts * parts],
            either: vec![0.0; parts * parts],
            group: (0..parts).collect(),
            alive: (0..parts).collect(),
        };
        for a in 0..parts {
            for b in (0..parts).filter(|&b| b != a) {
                let both = if view_of[a] == view_of[b] { 0 } else { counts.get(a, b) };
                let sum = seen_by[a * views + view_of[b]] + seen_by[b * views + view_of[a]];
                groups.both[a * parts + b] = both as f64;
                groups.either[a * parts + b] = (sum - both) as f64;
            }
        }
        groups
    }

    /// The group of every part after all joins.
    fn joined(mut self) -> Vec<usize> {
        while let Some((a, b)) = self.best_pair() {
            self.join(a, b);
        }
        self.group
    }

    /// The pair with the largest overlap above the threshold; the first of equals.
    fn best_pair(&self) -> Option<(usize, usize)> {
        let parts = self.group.len();
        let mut best = (SAME_PART_OVERLAP, None);
        for (n, &a) in self.alive.iter().enumerate() {
            for &b in &self.alive[n + 1..] {
                // Where no Gaussian speaks, 0 / 0 is no number and greater than nothing.
                let overlap = self.both[a * parts + b] / self.either[a * parts + b];
                if overlap > best.0 {
                    best = (overlap, Some((a, b)));
                }
            }
        }
        best.1
    }

    fn join(&mut self, a: usize, b: usize) {
        let parts = self.group.len();
        self.alive.retain(|&group| group != b);
        for &c in self.alive.iter().filter(|&&c| c != a) {
            for table in [&mut self.both, &mut self.either] {
                let sum = table[a * parts + c] + table[b * parts + c];
                table[a * parts + c] = sum;
                table[c * parts + a] = sum;
            }
        }
        for group in self.group.iter_mut().filter(|group| **group == b) {
            *group = a;
        }
    }
}

/// Numbers groups in the order of their first part.
fn numbered(group: &[usize]) -> (Vec<u32>, usize) {
    let mut firsts = group.to_vec();
    firsts.sort_unstable();
    firsts.dedup();
    let number = |of: &usize| firsts.binary_search(of).expect("every group is listed") as u32;
    (group.iter().map(number).collect(), firsts.len())
}
