//! A box of cells within a grid, whose values are stored in their own list.

use std::ops::Range;

use crate::parts::grid::Grid;

/// The cells with `first <= coords < end`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    pub first: [usize; 3],
    pub end: [usize; 3],
}

impl Region {
    /// One cell.
    pub fn of(at: [usize; 3]) -> Self {
        Self { first: at, end: at.map(|c| c + 1) }
    }

    pub fn include(&mut self, at: [usize; 3]) {
        for (axis, at) in at.into_iter().enumerate() {
            self.first[axis] = self.first[axis].min(at);
            self.end[axis] = self.end[axis].max(at + 1);
        }
    }

    pub fn grown(self, by: usize, grid: &Grid) -> Self {
        let end = std::array::from_fn(|axis| (self.end[axis] + by).min(grid.dims[axis]));
        Self { first: self.first.map(|c| c.saturating_sub(by)), end }
    }

    pub fn common(self, other: Self) -> Self {
        let first = std::array::from_fn(|axis| self.first[axis].max(other.first[axis]));
        Self { first, end: std::array::from_fn(|axis| self.end[axis].min(other.end[axis])) }
    }

    pub fn dims(self) -> [usize; 3] {
        std::array::from_fn(|axis| self.end[axis] - self.first[axis])
    }

    /// The index of `at` in a list of the box.
    pub fn offset(self, at: [usize; 3]) -> usize {
        let [width, height, _] = self.dims();
        let [x, y, z] = std::array::from_fn(|axis| at[axis] - self.first[axis]);
        (z * height + y) * width + x
    }

    /// The first cell of each of its rows along x.
    pub fn starts(self) -> impl Iterator<Item = [usize; 3]> + Clone {
        (self.first[2]..self.end[2]).flat_map(move |z| self.starts_of_layer(z))
    }

    pub fn starts_of_layer(self, z: usize) -> impl Iterator<Item = [usize; 3]> + Clone {
        let is_inside = (self.first[2]..self.end[2]).contains(&z);
        (self.first[1]..self.end[1]).filter(move |_| is_inside).map(move |y| [self.first[0], y, z])
    }

    /// Its rows: the range of each in a list of the box, and in a list of the grid.
    pub fn rows(self, grid: &Grid) -> impl Iterator<Item = (Range<usize>, Range<usize>)> + Clone {
        self.starts().map(move |start| self.row(start, grid))
    }

    pub fn row(self, start: [usize; 3], grid: &Grid) -> (Range<usize>, Range<usize>) {
        let ([width, ..], own, at) = (self.dims(), self.offset(start), grid.index(start));
        (own..own + width, at..at + width)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    #[test]
    fn rows_are_the_cells_of_the_box_in_the_order_of_its_list() {
        let grid = Grid { origin: Point3::origin(), cell: 1.0, dims: [5, 4, 3] };
        let region = Region { first: [1, 0, 1], end: [4, 2, 3] };
        let is_inside = |cell: &usize| Region::of(grid.coords(*cell)).common(region) == Region::of(grid.coords(*cell));
        let inside: Vec<usize> = (0..grid.len()).filter(is_inside).collect();
        let (own, at): (Vec<_>, Vec<_>) = region.rows(&grid).unzip();
        assert_eq!(at.into_iter().flatten().collect::<Vec<_>>(), inside);
        assert!(own.into_iter().flatten().eq(0..inside.len()));
        assert!(inside.iter().enumerate().all(|(place, cell)| region.offset(grid.coords(*cell)) == place));
        let mut around = Region::of([3, 1, 2]);
        around.include([1, 0, 1]);
        assert_eq!(around, region);
        assert_eq!(region.grown(2, &grid), Region { first: [0; 3], end: [5, 4, 3] });
    }
}
