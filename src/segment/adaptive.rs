//! Chooses the grid points that are worth a prompt: those on the foreground. Every other row and column comes first,
//! then the points between them, unless the mask of a neighbouring prompt already covers them.

use super::Level;
use super::candidate::Candidate;
use super::mask::Mask;

/// The spacing of each pass's points in the grid, along rows and columns. Points of an earlier pass are not repeated.
const STRIDES: [usize; 2] = [2, 1];
/// A point with fewer prompted neighbours lies at the object's edge or on a thin part of it, about which little is
/// known.
const LEAST_NEIGHBOURS: usize = 2;

/// The data that decide which points to prompt.
pub struct Adaptive<'a> {
    /// The object.
    pub foreground: &'a Mask,
    /// A mask that covers this share of the foreground is the whole object, which explains nothing about its segments.
    pub whole_object: f64,
    /// Masks of other levels explain nothing: a coarse one may cover details that were not prompted yet.
    pub level: Level,
}

impl Adaptive<'_> {
    /// True if pixel (`x`, `y`) should be prompted, given the masks of each neighbour that was prompted.
    pub fn is_worth_asking(&self, x: u32, y: u32, neighbours: &[&[Candidate]]) -> bool {
        let is_explained = || neighbours.iter().copied().flatten().any(|c| c.mask.contains(x, y) && self.explains(c));
        self.foreground.contains(x, y) && (neighbours.len() < LEAST_NEIGHBOURS || !is_explained())
    }

    /// True if a mask says something about the pixels in it.
    fn explains(&self, candidate: &Candidate) -> bool {
        let area = candidate.mask.overlap(self.foreground);
        candidate.level == self.level
            && candidate.is_on_foreground(area)
            && (area as f64) < self.whole_object * self.foreground.area() as f64
    }
}

/// The passes over a grid of `per_side` x `per_side` points: the indices of each pass's points, row by row.
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

/// The up to eight points around point `index` of a grid.
pub fn neighbours(index: usize, per_side: usize) -> impl Iterator<Item = usize> {
    let (row, column) = (index / per_side, index % per_side);
    let around = move |at: usize| at.saturating_sub(1)..=(at + 1).min(per_side - 1);
    let points = around(row).flat_map(move |row| around(column).map(move |column| row * per_side + column));
    points.filter(move |&other| other != index)
}

#[cfg(test)]
mod tests {
    use super::super::mask::Rect;
    use super::*;

    fn columns(start: u32, end: u32) -> Mask {
        Mask::from_fn(100, 10, |x, _| (start..end).contains(&x))
    }

    fn candidate(start: u32, end: u32) -> Candidate {
        let mask = columns(start, end);
        Candidate {
            bounds: mask.bounds().unwrap(),
            mask,
            predicted_iou: 0.9,
            stability: 0.9,
            level: Level::Middle,
            point: [0.0; 2],
            crop: Rect::of_size(100, 10),
        }
    }

    #[test]
    fn every_point_is_in_one_pass_and_a_quarter_in_the_first() {
        assert_eq!(passes(4), [vec![5, 7, 13, 15], vec![0, 1, 2, 3, 4, 6, 8, 9, 10, 11, 12, 14]]);
        assert_eq!(passes(1), [vec![], vec![0]]);
    }

    #[test]
    fn neighbours_are_around_and_inside_the_grid() {
        assert_eq!(neighbours(0, 3).collect::<Vec<_>>(), [1, 3, 4]);
        assert_eq!(neighbours(4, 3).collect::<Vec<_>>(), [0, 1, 2, 3, 5, 6, 7, 8]);
        assert_eq!(neighbours(0, 1).count(), 0);
    }

    #[test]
    fn what_a_neighbours_mask_covers_is_not_asked_again() {
        let foreground = columns(10, 60);
        let adaptive = Adaptive { foreground: &foreground, whole_object: 0.9, level: Level::Middle };
        let worth = |x, masks: &[&[Candidate]]| adaptive.is_worth_asking(x, 5, masks);
        let segment = [candidate(20, 40)];
        assert!(!worth(30, &[&segment, &[]]));
        assert!(worth(45, &[&segment, &[]]), "beside the mask");
        assert!(worth(30, &[&segment]), "one neighbour is too few");
        assert!(!worth(5, &[]), "off the object");
        assert!(worth(30, &[&[candidate(10, 60)], &[]]), "the whole object is not a segment");
        assert!(worth(55, &[&[candidate(50, 100)], &[]]), "a mask of the background");
    }
}
