//! Parts that continue inside others, where no view shows them: the handle within a rubber grip, the shaft through a
//! head.
//!
//! There are two rules, both based on the visible seams:
//!
//! - **through**: a solid that meets another on two facing patches in line, as a shaft does on both sides of a head,
//!   goes through it with their mean cross-section (a wire with its true one), if the other surrounds it there: a bar
//!   between two dumbbell heads is as thick as the patches and ends at them;
//! - **sleeve**: the void of a shell is filled by the solid that enters it, if the solid is a peg and the shell its
//!   sleeve: the peg is at least as long as their contact is wide, the sleeve at least twice that, and contact, peg and
//!   void have cross-sections of one size. So a grip is filled by its handle, but a cushion not by the seat it lies on,
//!   nor a lamp's base by its thin stem. A shell of which the filling is known has no core.

use std::collections::BTreeSet;

use nalgebra::{Point3, Vector3};

use super::contact::{Contact, contacts};
use super::wire::Wire;
use crate::numeric::upper_median;
use crate::parts::assign::Labelled;
use crate::parts::grid::surface::NONE;

/// Cosine of the largest angle at which patches still count as facing each other and being in line.
const IN_LINE: f64 = 0.9;
/// Cross-sections count as the same size if they differ by no more than this factor.
const SAME_SIZE: f64 = 2.0;
/// A peg keeps at least this share of its contact's cross-section over a length equal to the width of the contact.
const PEG_SHARE: f64 = 0.6;
/// A part surrounds a passage if, in a cylinder of twice the passage's cross-section, it fills at least this share of what
/// is not the passage. A collar does so whose wall is an eighth of the passage's radius.
const SURROUNDS: f64 = 0.25;
/// A sleeve is at least this many times as long as its mouth is wide. A bulb on its socket is shorter.
const SLEEVE_LENGTH: f64 = 2.0;
/// A wire's cross-section where it enters another part is that within this many widths of the patch: right beside the
/// other part, no photo shows its edges against the background.
const NEAR_WIDTHS: f64 = 4.0;
/// A patch of less than this many cells' faces is too rough to have a direction.
const PATCH_FACES_MIN: f64 = 12.0;

/// Assigns to solids that go through other solids the cells along their way; a wire, measured in `wires` per cell, goes on
/// with its true cross-section. Returns for each such solid its label and that of the part it goes through.
pub fn run_through(cells: &mut Labelled, is_solid: &[bool], wires: &[Wire]) -> BTreeSet<(u32, u32)> {
    let mut passages = BTreeSet::new();
    for peg in (0..is_solid.len() as u32).filter(|&l| is_solid[l as usize]) {
        let patches: Vec<Contact> = sizeable(cells, peg).filter(|c| is_solid[c.to as usize]).collect();
        let own: Vec<usize> = (0..cells.label.len()).filter(|&i| cells.label[i] == peg).collect();
        for (k, a) in patches.iter().enumerate() {
            for b in patches[k + 1..].iter().filter(|b| b.to == a.to && in_line(a, b)) {
                let section = wire_share(cells, &own, wires, [a, b]);
                let taken = cells_between(cells, a, b, section);
                let around = cells_between(cells, a, b, 2.0 * section).len() - taken.len();
                // A wire much thinner than the cells may take none of them.
                if !taken.is_empty() && around as f64 >= SURROUNDS * taken.len() as f64 {
                    taken.iter().for_each(|&i| cells.label[i] = peg);
                    passages.insert((peg, a.to));
                }
            }
        }
    }
    passages
}

/// Per label, the solid that fills the void of this shell, if any. `is_void` tells which cells of shells are not wall,
/// `is_material` which cells of solids are not in strong doubt.
pub fn cores(
    cells: &Labelled,
    is_solid: &[bool],
    is_void: impl Fn(usize) -> bool,
    is_material: impl Fn(usize) -> bool,
) -> Vec<Option<u32>> {
    let mut best: Vec<Option<(f64, u32)>> = vec![None; is_solid.len()];
    for peg in (0..is_solid.len() as u32).filter(|&l| is_solid[l as usize]) {
        for contact in sizeable(cells, peg).filter(|c| !is_solid[c.to as usize]) {
            let known = &mut best[contact.to as usize];
            if is_peg_in_sleeve(cells, &contact, &is_void, &is_material)
                && known.is_none_or(|(area, _)| contact.area > area)
            {
                *known = Some((contact.area, peg));
            }
        }
    }
    best.into_iter().map(|found| found.map(|(_, peg)| peg)).collect()
}

fn sizeable(cells: &Labelled, label: u32) -> impl Iterator<Item = Contact> + use<> {
    let least = PATCH_FACES_MIN * cells.grid.cell * cells.grid.cell;
    contacts(cells, label).into_iter().filter(move |c| c.area >= least)
}

fn same_size(a: f64, b: f64) -> bool {
    a <= SAME_SIZE * b && b <= SAME_SIZE * a
}

/// True if two patches face each other along the line between them.
fn in_line(a: &Contact, b: &Contact) -> bool {
    let Some(way) = (b.center - a.center).try_normalize(0.0) else { return false };
    a.normal.dot(&way) >= IN_LINE && -b.normal.dot(&way) >= IN_LINE && same_size(a.area, b.area)
}

/// The cells of the outer part that lie in the cylinder between two patches whose cross-section is that of the patches
/// times `section`.
fn cells_between(cells: &Labelled, a: &Contact, b: &Contact, section: f64) -> Vec<usize> {
    let (way, radius2) = (b.center - a.center, section * 0.5 * (a.area + b.area) / std::f64::consts::PI);
    let axis = way.normalize();
    let inside = |&i: &usize| {
        let from_a = cells.grid.center(cells.grid.coords(i)) - a.center;
        let along = from_a.dot(&axis);
        let (slack, off_axis2) = (cells.grid.cell, from_a.norm_squared() - along * along);
        cells.label[i] == a.to && (-slack..=way.norm() + slack).contains(&along) && off_axis2 <= radius2
    };
    (0..cells.label.len()).filter(inside).collect()
}

/// The true cross-section of a solid over the carved one, near two patches of it: the median over its `own` cells there;
/// 1 unless it is a wire.
fn wire_share(cells: &Labelled, own: &[usize], wires: &[Wire], patches: [&Contact; 2]) -> f64 {
    let is_near = |&&i: &&usize| {
        let center = cells.grid.center(cells.grid.coords(i));
        patches.iter().any(|patch| (center - patch.center).norm_squared() <= NEAR_WIDTHS.powi(2) * patch.area)
    };
    let shares = own
        .iter()
        .filter(is_near)
        .map(|&i| if wires[i].share > 0.0 { f64::from(wires[i].share).min(1.0) } else { 1.0 });
    upper_median(shares.collect()).unwrap_or(1.0)
}

fn is_peg_in_sleeve(
    cells: &Labelled,
    contact: &Contact,
    is_void: impl Fn(usize) -> bool,
    is_material: impl Fn(usize) -> bool,
) -> bool {
    let width = contact.area.sqrt();
    let volume = |members: &[Point3<f64>]| members.len() as f64 * cells.grid.cell_volume();
    let along = |p: &Point3<f64>| contact.normal.dot(&(p - contact.center));
    let near = |p: &Point3<f64>| (p - contact.center).cross(&contact.normal).norm() <= 2.0 * width;
    let members = |label: u32| {
        let of_label = (0..cells.label.len()).filter(move |&i| cells.label[i] == label);
        of_label.map(|i| (i, cells.grid.center(cells.grid.coords(i))))
    };
    debug_assert!(contact.from != NONE && contact.normal != Vector3::zeros());
    let peg: Vec<_> = members(contact.from)
        .filter(|(i, _)| is_material(*i))
        .map(|(_, p)| p)
        .filter(|p| near(p) && (-width..=0.0).contains(&along(p)))
        .collect();
    let body = contact.body_beyond(cells);
    let void: Vec<_> =
        body.into_iter().filter(|i| is_void(*i)).map(|i| cells.grid.center(cells.grid.coords(i))).collect();
    let length = void.iter().map(along).fold(0.0, f64::max);
    if void.is_empty() || length < SLEEVE_LENGTH * width {
        return false;
    }
    volume(&peg) / width >= PEG_SHARE * contact.area && same_size(contact.area, volume(&void) / length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parts::grid::Grid;
    use crate::parts::grid::surface::Surface;

    /// A rod of 4 x 4 cells on both sides of a drum of 12 x 12 cells that is 8 cells long.
    fn rod_and_drum() -> Labelled {
        let grid = Grid { origin: Point3::origin(), cell: 1.0, dims: [16, 16, 24] };
        let label = |i: usize| {
            let [x, y, z] = grid.coords(i);
            let is_within = |low: usize, high: usize| (low..high).contains(&x) && (low..high).contains(&y);
            match ((8..16).contains(&z), is_within(2, 14), is_within(6, 10)) {
                (true, true, _) => 1,
                (false, _, true) => 0,
                _ => NONE,
            }
        };
        let label = (0..grid.len()).map(label).collect();
        let surface =
            Surface { cells: vec![], points: vec![], normals: vec![], areas: vec![], depth: vec![], nearest: vec![] };
        Labelled { grid, surface, label, seen: vec![] }
    }

    /// The centres of the cells nearest to the axis are 0.7 cells away from it; the wire's radius is 0.5 cells.
    #[test]
    fn a_wire_that_takes_no_cell_does_not_go_through() {
        for (share, goes_through) in [(1.0, true), (0.05, false)] {
            let mut cells = rod_and_drum();
            let before = cells.label.clone();
            let wires = vec![Wire { share, error: 0.1 }; before.len()];
            let passages = run_through(&mut cells, &[true; 2], &wires);
            assert_eq!((passages.contains(&(0, 1)), cells.label != before), (goes_through, goes_through), "{share}");
        }
    }
}
