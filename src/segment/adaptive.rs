//! Which points of the grid are worth a prompt: those on the foreground, coarse ones first, finer ones only where the masks
//! found so far do not already say what is there.

use super::automatic::Candidate;
use super::mask::Mask;

/// Every how many points of the grid a pass asks, along rows and columns. What an earlier pass asked is not asked again.
const STRIDES: [usize; 3] = [4, 2, 1];
/// A point is explained by this many masks around it. One alone may have swallowed a smaller part.
const EXPLAINING_MASKS: usize = 2;
/// A mask with less of its area on the foreground is of the background and explains nothing.
const LEAST_SHARE_ON_FOREGROUND: f64 = 0.5;

/// What tells which points to ask at.
pub struct Adaptive<'a> {
    /// The object.
    pub foreground: &'a Mask,
    /// A mask that covers this share of the foreground is the whole object, which explains nothing of its parts.
    pub whole_object: f64,
}

impl Adaptive<'_> {
    /// The passes over a grid of `per_side` x `per_side` points: indices of its points, row by row, by pass.
    pub fn passes(per_side: usize) -> Vec<Vec<usize>> {
        let pass_of = |index: usize| {
            let (row, column) = (index / per_side, index % per_side);
            let on = |stride: usize| row % stride == stride / 2 && column % stride == stride / 2;
            STRIDES.iter().position(|&stride| on(stride)).unwrap_or(STRIDES.len() - 1)
        };
        let mut passes = vec![Vec::new(); STRIDES.len()];
        for index in 0..per_side * per_side {
            passes[pass_of(index)].push(index);
        }
        passes
    }

    /// Whether a mask says something about the pixels in it.
    pub fn explains(&self, candidate: &Candidate) -> bool {
        let on_foreground = candidate.mask.overlap(self.foreground) as f64;
        on_foreground >= LEAST_SHARE_ON_FOREGROUND * candidate.mask.area() as f64
            && on_foreground < self.whole_object * self.foreground.area() as f64
    }

    /// Whether to ask at pixel (`x`, `y`), given what explains something so far.
    pub fn is_worth_asking(&self, x: u32, y: u32, explaining: &[&Candidate]) -> bool {
        let covering = explaining.iter().filter(|candidate| candidate.mask.contains(x, y));
        self.foreground.contains(x, y) && covering.take(EXPLAINING_MASKS).count() < EXPLAINING_MASKS
    }
}
