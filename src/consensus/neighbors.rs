//! Pairs of Gaussians that are compared.

use crate::gaussians::Gaussians;
use crate::numeric::nearest::Nearest;
use crate::parallel;

/// Number of nearest neighbours of each Gaussian.
const NEAR: usize = 6;
/// Ranks among a Gaussian's neighbours of those that lie a few Gaussians away. On a border, Gaussians have light on
/// either side; these pairs reach across.
const FAR: [usize; 5] = [16, 24, 32, 40, 48];

/// Pairs of Gaussians, each once.
pub(super) struct Pairs {
    /// Sorted; the lower index first.
    pub pairs: Vec<(u32, u32)>,
    /// True for pairs of which neither is among the [`NEAR`] nearest neighbours of the other.
    pub is_far: Vec<bool>,
}

impl Pairs {
    /// The pairs of the Gaussians in `seen`, whose positions `nearest` holds.
    pub fn new(gaussians: &Gaussians, seen: &[u32], nearest: &Nearest) -> Self {
        let last = FAR[FAR.len() - 1];
        let of_one = |i: &u32| {
            let found = nearest.find(gaussians.positions[*i as usize], last + 1);
            let others = found.into_iter().map(|(_, n)| seen[n as usize]).filter(|other| other != i);
            let ranked = (1usize..).zip(others).filter(|(rank, _)| *rank <= NEAR || FAR.contains(rank));
            ranked.map(|(rank, other)| (*i.min(&other), *i.max(&other), rank > NEAR)).collect::<Vec<_>>()
        };
        let mut all: Vec<(u32, u32, bool)> = parallel::flat_map(seen, of_one);
        // A pair is near if it is near from either side.
        parallel::sort_unstable_by(&mut all, Ord::cmp);
        all.dedup_by_key(|pair| (pair.0, pair.1));
        Self {
            pairs: all.iter().map(|&(a, b, _)| (a, b)).collect(),
            is_far: all.iter().map(|&(.., is_far)| is_far).collect(),
        }
    }
}
