//! Holes in the picture of an object that are none in the object.
//!
//! A splat shows a highlight or a mirror image as things that lie behind the surface, and lets the light of these through: there, less
//! than half of the light comes from the object's own Gaussians. Through a real hole, such as that of a mug's handle, next to none
//! does.

use super::FOREGROUND_ALPHA;

/// Mean share of the light that comes from the object in a hole that is none. For a rendered table of five objects, 0.05 to 0.25 give
/// masks whose mean IoU with the true ones is within 0.003 of the best, and 0.2 leaves the hole of a mug's handle open.
const LEAST_SHARE: f32 = 0.2;

/// Raises the share of the object in the light of every pixel, row by row, to [`FOREGROUND_ALPHA`] in holes that are none: where it is
/// less, enclosed by pixels where it is not, and [`LEAST_SHARE`] on average.
pub fn close_holes(share: &mut [f32], width: usize) {
    let height = share.len() / width.max(1);
    let mut is_left: Vec<bool> = share.iter().map(|share| *share < FOREGROUND_ALPHA).collect();
    for start in 0..share.len() {
        if !std::mem::take(&mut is_left[start]) {
            continue;
        }
        let (mut hole, mut next, mut is_enclosed) = (vec![start], 0, true);
        while let Some(&at) = hole.get(next) {
            let (x, y) = (at % width, at / width);
            let sides = [(x > 0, -1), (x + 1 < width, 1), (y > 0, -(width as isize)), (y + 1 < height, width as isize)];
            for (_, step) in sides.iter().filter(|(is_inside, _)| *is_inside) {
                let beside = at.wrapping_add_signed(*step);
                if std::mem::take(&mut is_left[beside]) {
                    hole.push(beside);
                }
            }
            is_enclosed &= sides.iter().all(|(is_inside, _)| *is_inside);
            next += 1;
        }
        let light: f64 = hole.iter().map(|at| f64::from(share[*at])).sum();
        if is_enclosed && light >= f64::from(LEAST_SHARE) * hole.len() as f64 {
            hole.iter().for_each(|at| share[*at] = FOREGROUND_ALPHA);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of 5 x 5 pixels that shows the object, with this share in its middle, in a picture of 7 x 7.
    fn square(middle: f32) -> Vec<f32> {
        let share = |at: usize| match (at % 7, at / 7) {
            (3, 3) => middle,
            (1..6, 1..6) => 0.9,
            _ => 0.3,
        };
        (0..49).map(share).collect()
    }

    #[test]
    fn a_highlight_is_closed_and_a_hole_is_not() {
        for (middle, closed) in [(0.3, FOREGROUND_ALPHA), (0.1, 0.1)] {
            let mut share = square(middle);
            close_holes(&mut share, 7);
            assert_eq!(share, square(closed), "only the middle changes, and what surrounds the square stays");
        }
    }

    #[test]
    fn the_mean_decides_over_the_whole_hole() {
        for (beside, is_closed) in [(0.15, true), (0.05, false)] {
            let mut share = square(0.3);
            share[3 * 7 + 4] = beside;
            close_holes(&mut share, 7);
            assert_eq!(share[3 * 7 + 3] >= FOREGROUND_ALPHA, is_closed);
            assert_eq!(share[3 * 7 + 4] >= FOREGROUND_ALPHA, is_closed);
        }
    }

    #[test]
    fn what_reaches_the_edge_is_no_hole() {
        let mut share = square(0.3);
        (4..7).for_each(|x| share[3 * 7 + x] = 0.4);
        let before = share.clone();
        close_holes(&mut share, 7);
        assert_eq!(share, before);
        close_holes(&mut [], 0);
    }
}
