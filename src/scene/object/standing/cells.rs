//! Cells of the support, seen from above.

use std::collections::BTreeSet;

/// A set of cells that gaps can be closed in. None of it is at the border of its rectangle.
#[derive(Clone)]
pub(super) struct Cells {
    /// The cell at the corner of the rectangle.
    corner: [i64; 2],
    size: [usize; 2],
    /// Row by row.
    inside: Vec<bool>,
}

impl Cells {
    /// These cells, in a rectangle that leaves room to [grow](Self::grow) by `margin`.
    pub fn new(cells: &BTreeSet<[i64; 2]>, margin: usize) -> Self {
        let margin = margin as i64 + 1;
        let ends = |axis: usize| {
            let (low, high) =
                cells.iter().fold((i64::MAX, i64::MIN), |(low, high), at| (low.min(at[axis]), high.max(at[axis])));
            if low > high { (0, 0) } else { (low - margin, (high - low + 1 + 2 * margin) as usize) }
        };
        let ((left, width), (low, height)) = (ends(0), ends(1));
        let mut all = Self { corner: [left, low], size: [width, height], inside: vec![false; width * height] };
        for at in cells {
            let index = all.index(*at).expect("the rectangle holds all cells");
            all.inside[index] = true;
        }
        all
    }

    pub fn contains(&self, at: [i64; 2]) -> bool {
        self.index(at).is_some_and(|index| self.inside[index])
    }

    /// Number of cells of the rectangle, by whose indices the following go.
    pub fn count(&self) -> usize {
        self.inside.len()
    }

    pub fn holds(&self, index: usize) -> bool {
        self.inside[index]
    }

    /// Column and row in the rectangle.
    pub fn place(&self, index: usize) -> [usize; 2] {
        [index % self.size[0], index / self.size[0]]
    }

    /// The cells of the rectangle within a distance of one, that one among them, with their distances.
    pub fn within(&self, index: usize, distance: usize) -> impl Iterator<Item = (usize, f64)> {
        let [x, y] = self.place(index);
        let [columns, rows] = [(x, self.size[0]), (y, self.size[1])]
            .map(|(at, count)| at.saturating_sub(distance)..(at + distance + 1).min(count));
        let width = self.size[0];
        rows.flat_map(move |row| columns.clone().map(move |column| [column, row])).filter_map(move |[column, row]| {
            let away = (column.abs_diff(x) as f64).hypot(row.abs_diff(y) as f64);
            (away <= distance as f64).then_some((row * width + column, away))
        })
    }

    /// The index of a cell in the rectangle.
    pub fn index(&self, at: [i64; 2]) -> Option<usize> {
        let [x, y] = [0, 1].map(|axis| usize::try_from(at[axis] - self.corner[axis]).unwrap_or(usize::MAX));
        let [width, height] = self.size;
        (x < width && y < height).then(|| y * width + x)
    }

    /// Closes gaps of up to twice this many cells, and what no way leads out of.
    pub fn close(&mut self, cells: usize) {
        (0..cells).for_each(|_| self.grow(true));
        self.fill();
        (0..cells).for_each(|_| self.grow(false));
    }

    /// Adds (`true`) the cells beside those inside, or takes away those beside the others.
    pub fn grow(&mut self, value: bool) {
        let before = self.inside.clone();
        let [width, height] = self.size;
        for y in 1..height.saturating_sub(1) {
            for x in 1..width.saturating_sub(1) {
                let at = y * width + x;
                if [at - 1, at + 1, at - width, at + width].iter().any(|beside| before[*beside] == value) {
                    self.inside[at] = value;
                }
            }
        }
    }

    /// Adds the cells from which no way leads to the border past those inside.
    fn fill(&mut self) {
        let [width, height] = self.size;
        let mut outside = vec![false; self.inside.len()];
        let mut open: Vec<[usize; 2]> = if self.inside.is_empty() { Vec::new() } else { vec![[0, 0]] };
        while let Some([x, y]) = open.pop() {
            let at = y * width + x;
            if std::mem::replace(&mut outside[at], true) || self.inside[at] {
                continue;
            }
            if x > 0 {
                open.push([x - 1, y]);
            }
            if x + 1 < width {
                open.push([x + 1, y]);
            }
            if y > 0 {
                open.push([x, y - 1]);
            }
            if y + 1 < height {
                open.push([x, y + 1]);
            }
        }
        self.inside.iter_mut().zip(outside).for_each(|(inside, outside)| *inside |= !outside);
    }
}
