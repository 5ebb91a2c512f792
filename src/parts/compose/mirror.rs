//! The underside of an object that lies on a table, from its top.
//!
//! Space that no view shows stays full when the object is carved, down to where its Gaussians end: a hammer on its side comes
//! out as thick as if it were cast onto the table. But many things are alike above and below. The plane of symmetry is
//! taken halfway between the two ends of the object along the direction of its unseen side; the lower end is where it
//! was supported. If nearly all of the surface that is seen on the lower half has its mirror image on or in the upper one,
//! the object is taken to be symmetric, and cells whose mirror image lies outside of it are in strong doubt: the middle
//! volume does without them, the high one keeps them.

use nalgebra::{Point3, Vector3};

use super::unseen::Doubt;
use crate::parallel;
use crate::parts::assign::Labelled;
use crate::parts::grid::surface::NONE;

/// The unseen surface is one side of the object if its normals agree at least this well: the length of their mean.
const ONE_SIDE: f64 = 0.5;
/// Less of the surface than this is a gap between views rather than a side.
const LEAST_UNSEEN: f64 = 0.02;
/// Share of the seen surface on the far half, next to the unseen side, whose mirror image must lie on or in the object:
/// the near half is well seen, so an image there is a real test; an image on the far half mostly falls into cells that
/// carving left full.
const SYMMETRIC: f64 = 0.85;
/// If less of the seen surface than this is on the far half, the test says nothing.
const LEAST_EVIDENCE: f64 = 0.1;
/// Cells by which a mirror image may miss the object: the surface is known to a cell or two, and so is the plane.
const NEAR_CELLS: isize = 2;
/// Cells less deep than this below a seen surface are material, whatever their mirror image is.
const SEEN_CELLS: f64 = 1.5;

/// A plane of symmetry: the points x with x . normal = offset.
struct Mirror {
    normal: Vector3<f64>,
    offset: f64,
}

impl Mirror {
    fn image(&self, point: Point3<f64>) -> Point3<f64> {
        point + self.normal * (2.0 * (self.offset - point.coords.dot(&self.normal)))
    }
}

/// Puts the cells of solids that a symmetric object would not have in strong doubt. Returns whether the object is taken
/// to be symmetric.
pub fn doubt_unlike_the_seen_side(cells: &Labelled, is_solid: &[bool], doubt: &mut [Doubt]) -> bool {
    let Some(mirror) = mirror(cells) else { return false };
    let is_inside = |point: Point3<f64>| cells.grid.cell_at(point).is_some_and(|i| cells.label[i] != NONE);
    let (mut seen, mut far, mut alike) = (0.0, 0.0, 0.0);
    for s in (0..cells.surface.cells.len()).filter(|&s| cells.seen[s]) {
        let (point, area) = (cells.surface.points[s], cells.surface.areas[s]);
        seen += area;
        if point.coords.dot(&mirror.normal) > mirror.offset {
            far += area;
            if is_near(mirror.image(point), cells.grid.cell, is_inside) {
                alike += area;
            }
        }
    }
    if far < LEAST_EVIDENCE * seen || alike < SYMMETRIC * far {
        return false;
    }
    let depth_of_seen = SEEN_CELLS * cells.grid.cell;
    parallel::for_each_mut(doubt, |i, doubt| {
        let label = cells.label[i];
        if label == NONE || !is_solid[label as usize] || is_inside(mirror.image(center(cells, i))) {
            return;
        }
        let nearest = cells.surface.nearest[i];
        let is_seen = nearest != NONE && cells.seen[nearest as usize];
        if !is_seen || f64::from(cells.surface.depth[i]) > depth_of_seen {
            *doubt = (*doubt).max(Doubt::Strong);
        }
    });
    true
}

fn center(cells: &Labelled, i: usize) -> Point3<f64> {
    cells.grid.center(cells.grid.coords(i))
}

/// Halfway through the object along the mean normal of its unseen surface; `None` if that is no single side.
fn mirror(cells: &Labelled) -> Option<Mirror> {
    let surface = &cells.surface;
    let total: f64 = surface.areas.iter().sum();
    let (mut unseen, mut sum) = (0.0, Vector3::zeros());
    for s in (0..surface.cells.len()).filter(|&s| !cells.seen[s]) {
        unseen += surface.areas[s];
        sum += surface.normals[s] * surface.areas[s];
    }
    if unseen < LEAST_UNSEEN * total || sum.norm() < ONE_SIDE * unseen {
        return None;
    }
    let normal = sum.normalize();
    let along =
        (0..cells.label.len()).filter(|&i| cells.label[i] != NONE).map(|i| center(cells, i).coords.dot(&normal));
    let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    Some(Mirror { normal, offset: 0.5 * (low + high) })
}

/// Whether the point, or one within [`NEAR_CELLS`] along an axis, is inside.
fn is_near(point: Point3<f64>, cell: f64, is_inside: impl Fn(Point3<f64>) -> bool) -> bool {
    let steps = || (-NEAR_CELLS..=NEAR_CELLS).map(|n| n as f64 * cell);
    (0..3).any(|axis| {
        steps().any(|step| {
            let mut beside = point;
            beside[axis] += step;
            is_inside(beside)
        })
    })
}
