//! Chooses the grid points that are worth a prompt: those on the foreground. Every fourth row and column comes first.
//! The points between them follow, unless the masks of two prompts nearby already cover them, in passes that halve the
//! distance between points along the diagonals and along the axes by turns.

use super::Level;
use super::candidate::Candidate;
use super::mask::Mask;

/// Spacing of the first pass's points in the grid, along rows and columns.
const FIRST_SPACING: usize = 4;
/// How far away, in rows and columns, prompts count as near: every point of a later pass has points of the first pass on
/// both sides of it.
const NEAR: usize = FIRST_SPACING - 1;
/// One mask may cover a point by mistake; masks of two prompts seldom do.
const PROMPTS_THAT_EXPLAIN: usize = 2;

/// The data that decide which points to prompt.
pub struct Adaptive<'a> {
    /// The object.
    pub foreground: &'a Mask,
    /// A mask that covers this share of the foreground is the whole object, which explains nothing about its segments.
    pub whole_object: f64,
    /// Masks of other levels explain nothing: a coarse one may cover details that were not prompted yet.
    pub level: Level,
    /// True if the grid has no more points than are [worth asking](super::prompts::worth_asking): a photo of a room shows an object
    /// small, with noise and blur.
    pub is_sparse: bool,
}

impl Adaptive<'_> {
    /// True if pixel (`x`, `y`) should be prompted, given the masks of each neighbour that was prompted.
    pub fn is_worth_asking(&self, x: u32, y: u32, neighbours: &[&[Candidate]]) -> bool {
        let explains = |candidates: &[Candidate]| candidates.iter().any(|c| c.mask.contains(x, y) && self.explains(c));
        let explaining = || neighbours.iter().filter(|candidates| explains(candidates)).count();
        self.foreground.contains(x, y) && explaining() < PROMPTS_THAT_EXPLAIN
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
    // A square lattice, then the centres of its squares, then the middles of their sides, which together are a lattice of
    // half the spacing; and so on.
    let pass_of = |index: usize| {
        let (row, column) = (index / per_side + FIRST_SPACING / 2, index % per_side + FIRST_SPACING / 2);
        let on = |spacing: usize| row.is_multiple_of(spacing) && column.is_multiple_of(spacing);
        let mut pass = 0;
        let mut spacing = FIRST_SPACING;
        while !on(spacing) {
            let half = spacing / 2;
            if on(half) && (row / half + column / half).is_multiple_of(2) {
                return pass + 1;
            }
            pass += 2;
            spacing = half;
        }
        pass
    };
    let mut passes = vec![Vec::new(); 2 * FIRST_SPACING.ilog2() as usize + 1];
    for index in 0..per_side * per_side {
        passes[pass_of(index)].push(index);
    }
    passes
}

/// The other points within [`NEAR`] of point `index` of a grid.
pub fn neighbours(index: usize, per_side: usize) -> impl Iterator<Item = usize> {
    let (row, column) = (index / per_side, index % per_side);
    let around = move |at: usize| at.saturating_sub(NEAR)..=(at + NEAR).min(per_side - 1);
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
            crop: Rect::of_size(100, 10),
        }
    }

    #[test]
    fn every_point_is_in_one_pass_and_each_pass_lies_between_the_points_of_earlier_ones() {
        assert_eq!(passes(4), [vec![10], vec![0], vec![2, 8], vec![5, 7, 13, 15], vec![1, 3, 4, 6, 9, 11, 12, 14]]);
        assert_eq!(passes(1), [vec![], vec![0], vec![], vec![], vec![]]);
        let sizes: Vec<usize> = passes(32).iter().map(Vec::len).collect();
        assert_eq!(sizes, [64, 64, 128, 256, 512]);
    }

    #[test]
    fn neighbours_are_around_and_inside_the_grid() {
        assert_eq!(neighbours(4, 3).collect::<Vec<_>>(), [0, 1, 2, 3, 5, 6, 7, 8]);
        assert_eq!((neighbours(0, 32).count(), neighbours(330, 32).count()), (15, 48));
        assert_eq!(neighbours(0, 1).count(), 0);
    }

    #[test]
    fn what_the_masks_of_two_neighbours_cover_is_not_asked_again() {
        let foreground = columns(10, 60);
        let adaptive = Adaptive { foreground: &foreground, whole_object: 0.9, level: Level::Middle, is_sparse: false };
        let worth = |x, mask: [u32; 2]| {
            let masks = [candidate(mask[0], mask[1])];
            adaptive.is_worth_asking(x, 5, &[&masks, &[], &masks])
        };
        assert!(!worth(30, [20, 40]));
        assert!(worth(45, [20, 40]), "beside the masks");
        assert!(
            adaptive.is_worth_asking(30, 5, &[&[candidate(20, 40), candidate(25, 45)], &[]]),
            "masks of one prompt"
        );
        assert!(!worth(5, [20, 40]) && !adaptive.is_worth_asking(5, 5, &[]), "off the object");
        assert!(worth(30, [10, 60]), "the whole object is not a segment");
        assert!(worth(55, [50, 100]), "masks of the background");
    }
}
