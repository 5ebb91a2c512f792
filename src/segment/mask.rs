//! Binary masks as runs of set pixels, row by row. A segment's mask takes a few kilobytes at any picture size, and
//! area, overlap, connected regions and painting are all computed on runs instead of pixels.

use std::ops::Range;

/// A rectangle of pixels. Its upper left corner is inclusive, its lower right one exclusive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rect {
    pub x0: u32,
    pub y0: u32,
    pub x1: u32,
    pub y1: u32,
}

impl Rect {
    /// The rectangle of a whole picture.
    pub fn of_size(width: u32, height: u32) -> Self {
        Self { x0: 0, y0: 0, x1: width, y1: height }
    }

    pub fn width(&self) -> u32 {
        self.x1 - self.x0
    }

    pub fn height(&self) -> u32 {
        self.y1 - self.y0
    }

    /// Whether a place, in pixels, lies within it.
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        (f64::from(self.x0)..f64::from(self.x1)).contains(&x) && (f64::from(self.y0)..f64::from(self.y1)).contains(&y)
    }
}

/// A binary picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mask {
    width: u32,
    /// The index in `runs` at which each row's runs begin; one entry more than there are rows.
    row_starts: Vec<u32>,
    /// Half-open column ranges of set pixels: ascending within a row, neither empty nor touching.
    runs: Vec<(u32, u32)>,
}

/// Makes a mask from its runs in reading order.
#[derive(Debug)]
pub struct MaskBuilder {
    mask: Mask,
}

impl MaskBuilder {
    pub fn new(width: u32) -> Self {
        Self { mask: Mask { width, row_starts: vec![0], runs: Vec::new() } }
    }

    /// Sets columns `start..end` of the current row, which must not lie before the row's last run. Touching runs merge.
    pub fn push(&mut self, start: u32, end: u32) {
        debug_assert!(end <= self.mask.width);
        if start >= end {
            return;
        }
        let row_start = *self.mask.row_starts.last().expect("never empty") as usize;
        match self.mask.runs[row_start..].last_mut() {
            Some(last) if last.1 >= start => last.1 = last.1.max(end),
            _ => self.mask.runs.push((start, end)),
        }
    }

    pub fn end_row(&mut self) {
        self.mask.row_starts.push(self.mask.runs.len() as u32);
    }

    pub fn finish(self) -> Mask {
        self.mask
    }
}

impl Mask {
    /// The mask of the pixels for which `is_set(x, y)` is true.
    pub fn from_fn(width: u32, height: u32, is_set: impl Fn(u32, u32) -> bool) -> Self {
        let mut builder = MaskBuilder::new(width);
        for y in 0..height {
            for x in (0..width).filter(|&x| is_set(x, y)) {
                builder.push(x, x + 1);
            }
            builder.end_row();
        }
        builder.finish()
    }

    pub fn width(&self) -> u32 {
        self.width
    }

    pub fn height(&self) -> u32 {
        self.row_starts.len() as u32 - 1
    }

    /// The runs of row `y`, as half-open column ranges.
    pub fn row(&self, y: u32) -> &[(u32, u32)] {
        &self.runs[self.row_range(y)]
    }

    /// The range of row `y`'s runs in [`Mask::runs`].
    pub fn row_range(&self, y: u32) -> Range<usize> {
        self.row_starts[y as usize] as usize..self.row_starts[y as usize + 1] as usize
    }

    /// All runs in reading order.
    pub fn runs(&self) -> &[(u32, u32)] {
        &self.runs
    }

    /// True if the pixel is set.
    pub fn contains(&self, x: u32, y: u32) -> bool {
        let row = self.row(y);
        row.get(row.partition_point(|run| run.1 <= x)).is_some_and(|run| run.0 <= x)
    }

    /// Number of set pixels.
    pub fn area(&self) -> u64 {
        self.runs.iter().map(|&(start, end)| u64::from(end - start)).sum()
    }

    /// The smallest rectangle around the set pixels; `None` if there are none.
    pub fn bounds(&self) -> Option<Rect> {
        let filled = |y: &u32| !self.row(*y).is_empty();
        let (top, bottom) = ((0..self.height()).find(filled)?, (0..self.height()).rev().find(filled)?);
        let x0 = self.runs.iter().map(|run| run.0).min()?;
        let x1 = self.runs.iter().map(|run| run.1).max()?;
        Some(Rect { x0, y0: top, x1, y1: bottom + 1 })
    }

    /// Number of pixels set in both. The masks must have the same size.
    pub fn overlap(&self, other: &Self) -> u64 {
        let mut area = 0;
        self.for_each_common_run(other, |_, start, end| area += u64::from(end - start));
        area
    }

    /// Intersection over union; 0 if both are empty.
    pub fn iou(&self, other: &Self) -> f64 {
        let overlap = self.overlap(other);
        let union = self.area() + other.area() - overlap;
        if union == 0 { 0.0 } else { overlap as f64 / union as f64 }
    }

    /// The pixels set in both. The masks must have the same size.
    pub fn intersected(&self, other: &Self) -> Self {
        let mut builder = MaskBuilder::new(self.width);
        let mut row = 0;
        self.for_each_common_run(other, |y, start, end| {
            while row < y {
                builder.end_row();
                row += 1;
            }
            builder.push(start, end);
        });
        for _ in row..self.height() {
            builder.end_row();
        }
        builder.finish()
    }

    /// The pixels that are not set.
    pub fn complement(&self) -> Self {
        let mut builder = MaskBuilder::new(self.width);
        for y in 0..self.height() {
            let mut gap_start = 0;
            for &(start, end) in self.row(y) {
                builder.push(gap_start, start);
                gap_start = end;
            }
            builder.push(gap_start, self.width);
            builder.end_row();
        }
        builder.finish()
    }

    /// The mask placed in a larger picture of `width` x `height`, with its upper left corner at (`x0`, `y0`).
    pub fn placed(&self, x0: u32, y0: u32, width: u32, height: u32) -> Self {
        debug_assert!(x0 + self.width <= width && y0 + self.height() <= height);
        let mut row_starts = vec![0; y0 as usize];
        row_starts.extend_from_slice(&self.row_starts);
        row_starts.resize(height as usize + 1, self.runs.len() as u32);
        let runs = self.runs.iter().map(|&(start, end)| (start + x0, end + x0)).collect();
        Self { width, row_starts, runs }
    }

    /// The part inside a rectangle, as a separate mask.
    pub fn cropped(&self, rect: &Rect) -> Self {
        let mut builder = MaskBuilder::new(rect.width());
        for y in rect.y0..rect.y1 {
            for &(start, end) in self.row(y) {
                builder.push(start.clamp(rect.x0, rect.x1) - rect.x0, end.clamp(rect.x0, rect.x1) - rect.x0);
            }
            builder.end_row();
        }
        builder.finish()
    }

    fn for_each_common_run(&self, other: &Self, mut visit: impl FnMut(u32, u32, u32)) {
        assert_eq!((self.width, self.height()), (other.width, other.height()), "masks of one picture");
        for y in 0..self.height() {
            let (mut ours, mut theirs) = (self.row(y).iter().peekable(), other.row(y).iter().peekable());
            while let (Some(a), Some(b)) = (ours.peek(), theirs.peek()) {
                let (start, end) = (a.0.max(b.0), a.1.min(b.1));
                if start < end {
                    visit(y, start, end);
                }
                if a.1 < b.1 {
                    ours.next();
                } else {
                    theirs.next();
                }
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A mask drawn with `#`.
    pub fn drawn(rows: &[&str]) -> Mask {
        Mask::from_fn(rows[0].len() as u32, rows.len() as u32, |x, y| rows[y as usize].as_bytes()[x as usize] == b'#')
    }

    fn pixels(mask: &Mask) -> Vec<bool> {
        let mut pixels = vec![false; (mask.width() * mask.height()) as usize];
        for y in 0..mask.height() {
            for &(start, end) in mask.row(y) {
                pixels[(y * mask.width() + start) as usize..(y * mask.width() + end) as usize].fill(true);
            }
        }
        pixels
    }

    fn of_pixels(width: u32, pixels: &[bool]) -> Mask {
        Mask::from_fn(width, pixels.len() as u32 / width, |x, y| pixels[(y * width + x) as usize])
    }

    #[test]
    fn bounds_are_tight_and_absent_for_nothing() {
        let mask = drawn(&["....", ".##.", "..##"]);
        assert_eq!(mask.bounds(), Some(Rect { x0: 1, y0: 1, x1: 4, y1: 3 }));
        assert_eq!(drawn(&["...", "..."]).bounds(), None);
    }

    #[test]
    fn placing_moves_every_pixel() {
        let placed = drawn(&["#.", ".#"]).placed(1, 2, 4, 5);
        assert_eq!(placed, drawn(&["....", "....", ".#..", "..#.", "...."]));
    }

    #[test]
    fn cropping_undoes_placing() {
        let mask = drawn(&["#.#", ".#."]);
        assert_eq!(mask.placed(2, 1, 7, 5).cropped(&Rect { x0: 2, y0: 1, x1: 5, y1: 3 }), mask);
        assert_eq!(drawn(&["####", "#..#"]).cropped(&Rect { x0: 1, y0: 0, x1: 3, y1: 2 }), drawn(&["##", ".."]));
    }

    proptest! {
        #[test]
        fn runs_do_what_pixels_do(a in prop::collection::vec(any::<bool>(), 35), b in prop::collection::vec(any::<bool>(), 35)) {
            let (mask_a, mask_b) = (of_pixels(7, &a), of_pixels(7, &b));
            let both: Vec<bool> = a.iter().zip(&b).map(|(a, b)| *a && *b).collect();
            let not: Vec<bool> = a.iter().map(|a| !a).collect();
            let count = |pixels: &[bool]| pixels.iter().filter(|set| **set).count() as u64;
            prop_assert_eq!(pixels(&mask_a), a.clone());
            prop_assert_eq!(mask_a.area(), count(&a));
            prop_assert_eq!(mask_a.overlap(&mask_b), count(&both));
            prop_assert_eq!(mask_a.intersected(&mask_b), of_pixels(7, &both));
            prop_assert_eq!(mask_a.complement(), of_pixels(7, &not));
        }
    }
}
