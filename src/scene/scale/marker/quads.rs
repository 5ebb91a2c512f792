//! Dark quadrilaterals of a picture: where a marker may be.
//!
//! 1. [`dark`]: a pixel is dark if it is clearly darker than its neighbourhood;
//! 2. [`outlines`]: dark pixels that touch form a blob, which has a convex hull;
//! 3. [`quad`]: a hull that is close to a quadrilateral is one.

use nalgebra::Point2;

use super::plane::Plane;
use crate::numeric::forest::Forest;
use crate::numeric::hull::{planar, turn};

/// A pixel's neighbourhood is a square that extends this far from it. It must reach beyond the border of a small marker;
/// larger ones are found in the halved pictures.
const REACH: usize = 15;
/// How much darker than the mean of its neighbourhood a dark pixel is, of 255; that of OpenCV's detector.
const CONTRAST: u32 = 7;
/// The least height and width of a blob, in pixels: a marker has at least six cells per side, and cells smaller than a
/// pixel cannot be told apart. Seen obliquely, one of the two sides is shorter.
const LEAST_SIDE: usize = 6;
/// The least share of a hull that its largest quadrilateral has to fill. The corners of a small or blurred marker are
/// round; a disc's largest square fills 0.64 of it.
const LEAST_FILLED: f64 = 0.85;

/// Four corners, clockwise as seen (x to the right, y down), in pixels.
pub(super) type Quad = [Point2<f64>; 4];

/// Every dark quadrilateral of the picture.
pub(super) fn quads(plane: &Plane) -> Vec<Quad> {
    if plane.width < LEAST_SIDE || plane.height < LEAST_SIDE {
        return Vec::new();
    }
    outlines(&dark(plane), plane.width).iter().filter_map(|outline| quad(outline)).collect()
}

/// For each pixel, whether it is dark.
fn dark(plane: &Plane) -> Vec<bool> {
    let Plane { width, height, values } = plane;
    let row = |y: usize| &values[y * width..(y + 1) * width];
    let mut columns = vec![0u32; *width];
    (0..REACH.min(*height))
        .for_each(|y| columns.iter_mut().zip(row(y)).for_each(|(sum, value)| *sum += u32::from(*value)));
    let mut dark = Vec::with_capacity(values.len());
    for y in 0..*height {
        if y + REACH < *height {
            columns.iter_mut().zip(row(y + REACH)).for_each(|(sum, value)| *sum += u32::from(*value));
        }
        if y > REACH {
            columns.iter_mut().zip(row(y - REACH - 1)).for_each(|(sum, value)| *sum -= u32::from(*value));
        }
        let rows = (y + REACH).min(height - 1) - y.saturating_sub(REACH) + 1;
        let mut sum: u32 = columns[..REACH.min(*width)].iter().sum();
        for (x, value) in row(y).iter().enumerate() {
            if x + REACH < *width {
                sum += columns[x + REACH];
            }
            if x > REACH {
                sum -= columns[x - REACH - 1];
            }
            let count = (rows * ((x + REACH).min(width - 1) - x.saturating_sub(REACH) + 1)) as u32;
            dark.push((u32::from(*value) + CONTRAST) * count < sum);
        }
    }
    dark
}

/// Dark pixels of a row that touch: from `start` up to but not including `end`.
struct Run {
    row: usize,
    start: usize,
    end: usize,
}

/// The points at the left and right ends of each row of each blob of dark pixels that does not touch the picture's edge.
fn outlines(dark: &[bool], width: usize) -> Vec<Vec<Point2<f64>>> {
    let height = dark.len() / width;
    let mut runs: Vec<Run> = Vec::new();
    let mut touching: Vec<(usize, usize)> = Vec::new();
    let mut above = 0..0;
    for (row, pixels) in dark.chunks_exact(width).enumerate() {
        let first = runs.len();
        let mut x = 0;
        while let Some(start) = pixels[x..].iter().position(|dark| *dark).map(|at| x + at) {
            x = pixels[start..].iter().position(|dark| !*dark).map_or(width, |at| start + at);
            runs.push(Run { row, start, end: x });
        }
        let mut upper = above;
        for run in first..runs.len() {
            while !upper.is_empty() && runs[upper.start].end <= runs[run].start {
                upper.start += 1;
            }
            let below = upper.clone().take_while(|other| runs[*other].start < runs[run].end);
            touching.extend(below.map(|other| (run, other)));
        }
        above = first..runs.len();
    }
    let mut joined = Forest::of(runs.len());
    for (run, other) in touching {
        joined.join(run, other, false);
    }
    // A blob's number is that of its first run.
    let mut blobs: Vec<Vec<usize>> = vec![Vec::new(); runs.len()];
    for run in 0..runs.len() {
        let blob = joined.root(run).0;
        blobs[blob].push(run);
    }
    let ends = |blob: Vec<usize>| {
        let (top, bottom) = (runs[*blob.first()?].row, runs[*blob.last()?].row);
        let left = blob.iter().map(|run| runs[*run].start).min()?;
        let right = blob.iter().map(|run| runs[*run].end).max()?;
        let is_small = right - left < LEAST_SIDE || bottom + 1 - top < LEAST_SIDE;
        if is_small || left == 0 || top == 0 || right == width || bottom + 1 == height {
            return None;
        }
        let mut rows = vec![(usize::MAX, 0); bottom + 1 - top];
        for run in &blob {
            let (start, end) = &mut rows[runs[*run].row - top];
            (*start, *end) = ((*start).min(runs[*run].start), (*end).max(runs[*run].end));
        }
        let corners = |(row, (start, end)): (usize, (usize, usize))| {
            [(start, row), (end, row), (start, row + 1), (end, row + 1)].map(|(x, y)| Point2::new(x as f64, y as f64))
        };
        Some((top..).zip(rows).flat_map(corners).collect())
    };
    blobs.into_iter().filter_map(ends).collect()
}

/// The largest quadrilateral whose corners are among those of the outline's hull, if it fills most of the hull.
fn quad(outline: &[Point2<f64>]) -> Option<Quad> {
    let hull = planar(outline.to_vec());
    let count = hull.len();
    if count < 4 {
        return None;
    }
    let area = |quad: &Quad| 0.5 * (turn(quad[0], quad[1], quad[2]) + turn(quad[0], quad[2], quad[3]));
    let mut best: Option<(f64, Quad)> = None;
    for first in 0..count - 2 {
        // As the diagonal's end moves on, so do the corners that are farthest from it on either side.
        let (mut second, mut fourth) = (first + 1, first + 3);
        for third in first + 2..count {
            let on = |at: usize| hull[at % count];
            let height = |at: usize| turn(on(first), on(at), on(third)).abs();
            while second + 1 < third && height(second + 1) >= height(second) {
                second += 1;
            }
            fourth = fourth.max(third + 1);
            while fourth + 1 < first + count && height(fourth + 1) >= height(fourth) {
                fourth += 1;
            }
            if fourth >= first + count {
                break;
            }
            let quad = [on(first), on(second), on(third), on(fourth)];
            let found = area(&quad);
            if best.as_ref().is_none_or(|(most, _)| found > *most) {
                best = Some((found, quad));
            }
        }
    }
    let whole: f64 = 0.5 * (1..count - 1).map(|i| turn(hull[0], hull[i], hull[i + 1])).sum::<f64>();
    best.filter(|(found, _)| *found >= LEAST_FILLED * whole).map(|(_, quad)| quad)
}
