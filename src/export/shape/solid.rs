//! The object as a solid: a part for every cell of it, and no voids.

use std::collections::VecDeque;

use nalgebra::{Point3, Vector3};

use crate::parts::{FILLING, Grid, Interior, OUTSIDE, VOID};
use crate::vote::FieldPart;

/// The cells of the object.
pub struct Solid {
    pub grid: Grid,
    /// Per cell: the id of the part that fills it, of the shell whose filling does or, in a void, of the part whose wall is
    /// nearest; [`OUTSIDE`] elsewhere.
    pub part: Vec<u32>,
}

impl Solid {
    /// Gives fillings to their shells, and each cell of a void to the part from which the fewest steps lead to it.
    pub fn of(interior: &Interior, labels: &[FieldPart]) -> Self {
        let grid = interior.grid;
        let owner = |content: &u32| match *content {
            VOID | OUTSIDE => *content,
            label => labels[(label & !FILLING) as usize].id,
        };
        let mut part: Vec<u32> = interior.part.iter().map(owner).collect();
        let is_wall = |i: &usize| part[*i] < VOID && grid.neighbours(*i).any(|n| part[n] == VOID);
        let mut queue: VecDeque<usize> = (0..part.len()).filter(is_wall).collect();
        while let Some(i) = queue.pop_front() {
            for n in grid.neighbours(i) {
                if part[n] == VOID {
                    part[n] = part[i];
                    queue.push_back(n);
                }
            }
        }
        part.iter_mut().filter(|part| **part == VOID).for_each(|part| *part = OUTSIDE);
        Self { grid, part }
    }

    /// The parts that own cells, by id.
    pub fn parts(&self) -> Vec<u32> {
        let mut parts: Vec<u32> = self.part.iter().copied().filter(|part| *part != OUTSIDE).collect();
        parts.sort_unstable();
        parts.dedup();
        parts
    }

    /// The part behind a triangle of the surface: that of the first cell of the object found inward of its middle.
    pub fn part_at(&self, corners: &[Point3<f64>; 3]) -> u32 {
        let middle = Point3::from(corners.iter().map(|p| p.coords).sum::<Vector3<f64>>() / 3.0);
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).try_normalize(0.0);
        let inward = -normal.unwrap_or_else(Vector3::zeros) * self.grid.cell;
        let along = (0..12).filter_map(|n| self.grid.cell_at(middle + inward * (0.5 * f64::from(n))));
        let own = along.map(|cell| self.part[cell]).find(|part| *part != OUTSIDE);
        own.unwrap_or_else(|| self.parts().first().copied().unwrap_or(0))
    }

    /// The cells of some parts, or of the whole object.
    pub fn mask(&self, of: Option<&[u32]>) -> Vec<bool> {
        self.part.iter().map(|part| of.map_or(*part != OUTSIDE, |wanted| wanted.contains(part))).collect()
    }
}
