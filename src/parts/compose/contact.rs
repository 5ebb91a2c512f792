//! Contacts between parts: connected patches of the seam between two parts, each fitted by a plane.

use nalgebra::{Point3, Vector3};

use crate::parts::assign::Labelled;
use crate::parts::grid::surface::NONE;

/// A connected patch of the seam between two parts, as the plane that fits it.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    pub from: u32,
    pub to: u32,
    /// Area of the patch projected along its normal, scene units squared.
    pub area: f64,
    pub center: Point3<f64>,
    /// Unit vector from the first part into the other.
    pub normal: Vector3<f64>,
}

impl Contact {
    /// The cells of the other part's body at the contact, connected across faces, edges and corners.
    pub fn body_beyond(&self, cells: &Labelled) -> Vec<usize> {
        let is_other = |i: usize| cells.label[i] == self.to;
        let distance = |i: usize| (cells.grid.center(cells.grid.coords(i)) - self.center).norm_squared();
        let touching = (0..cells.label.len())
            .filter(|&i| is_other(i) && cells.grid.neighbours(i).any(|n| cells.label[n] == self.from));
        let Some(seed) = touching.min_by(|&a, &b| distance(a).total_cmp(&distance(b))) else { return Vec::new() };
        patch(cells, seed, &mut vec![false; cells.label.len()], is_other)
    }
}

/// A patch whose faces, projected along the mean normal, keep less than this of their area is not a plane. Faces of
/// cells on an oblique plane keep at least 1/sqrt(3).
const PLANARITY: f64 = 0.45;

/// All planar contacts from cells of `from` to cells of any other label: by that label, then by each patch's first cell.
pub fn contacts(cells: &Labelled, from: u32) -> Vec<Contact> {
    let is_rim = |i: usize, to: u32| cells.label[i] == from && cells.grid.neighbours(i).any(|n| cells.label[n] == to);
    let mut others: Vec<u32> = Vec::new();
    for i in (0..cells.label.len()).filter(|&i| cells.label[i] == from) {
        for n in cells.grid.neighbours(i).filter(|&n| cells.is_seam(i, n)) {
            if let Err(place) = others.binary_search(&cells.label[n]) {
                others.insert(place, cells.label[n]);
            }
        }
    }
    let mut found = Vec::new();
    for to in others {
        let mut done = vec![false; cells.label.len()];
        for seed in 0..cells.label.len() {
            if !done[seed] && is_rim(seed, to) {
                found.extend(plane_of(cells, &patch(cells, seed, &mut done, |i| is_rim(i, to)), from, to));
            }
        }
    }
    found
}

/// The cells for which `wanted` is true that are connected with `seed` across faces, edges and corners.
fn patch(cells: &Labelled, seed: usize, done: &mut [bool], wanted: impl Fn(usize) -> bool) -> Vec<usize> {
    let mut members = Vec::new();
    let mut open = vec![seed];
    done[seed] = true;
    while let Some(i) = open.pop() {
        members.push(i);
        let [x, y, z] = cells.grid.coords(i);
        for step in 0..27 {
            let beside = [x + step % 3, y + step / 3 % 3, z + step / 9].map(|c| c.wrapping_sub(1));
            if (0..3).any(|axis| beside[axis] >= cells.grid.dims[axis]) {
                continue;
            }
            let n = cells.grid.index(beside);
            if !done[n] && wanted(n) {
                done[n] = true;
                open.push(n);
            }
        }
    }
    members.sort_unstable();
    members
}

/// The plane through a patch's faces; `None` if the patch bends too much.
fn plane_of(cells: &Labelled, patch: &[usize], from: u32, to: u32) -> Option<Contact> {
    let grid = &cells.grid;
    let (mut sum, mut middle, mut faces) = (Vector3::zeros(), Vector3::zeros(), 0.0);
    for &i in patch {
        let center = grid.center(grid.coords(i));
        for n in grid.neighbours(i).filter(|&n| cells.label[n] == to) {
            let other = grid.center(grid.coords(n));
            sum += (other - center) / grid.cell;
            middle += nalgebra::center(&center, &other).coords;
            faces += 1.0;
        }
    }
    debug_assert!(from != NONE && to != NONE);
    let length: f64 = sum.norm();
    (length >= PLANARITY * faces).then(|| Contact {
        from,
        to,
        area: length * grid.cell * grid.cell,
        center: Point3::from(middle / faces),
        normal: sum / length,
    })
}
