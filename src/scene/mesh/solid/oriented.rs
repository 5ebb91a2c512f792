//! A surface whose closed components face outward, and whose open patches face their surroundings.

use nalgebra::Point3;

use super::connected::{Connected, area_of};
use super::facing;
use super::frame::Frame;
use super::moments::Moments;
use super::tree::Tree;
use super::weld::Welded;
use super::{NO_AREA, Topology};
use crate::parallel;
use crate::scene::mesh::Triangles;

/// The direction of a component is unreliable if more than this share of its area had to be reversed.
const UNRELIABLE: f64 = 0.25;

/// A surface, oriented, in the frame of the measurement.
pub struct Oriented {
    pub tree: Tree,
    /// Per triangle.
    pub corners: Vec<[Point3<f64>; 3]>,
    /// Per triangle.
    pub component_of: Vec<u32>,
    pub components: Vec<Component>,
    /// Of the surface as it was, apart from [`Topology::inverted_components`].
    pub topology: Topology,
}

/// Triangles that hang together.
#[derive(Debug, Clone)]
pub struct Component {
    pub triangles: Vec<u32>,
    pub area: f64,
    pub is_closed: bool,
    /// Those of the inside; zero if it is open.
    pub moments: Moments,
    /// Whether it is closed and faced inward in the file.
    pub faced_inward: bool,
    /// Whether so many of its triangles faced the other way that its own direction says little.
    pub is_unreliable: bool,
}

impl Oriented {
    /// Orients a surface that has been checked; `None` if it has no area.
    pub fn of(surface: &Triangles, frame: &Frame) -> Option<Self> {
        let mut welded = Welded::of(surface, frame);
        let mut connected = Connected::of(&mut welded);
        if welded.close_gaps(&connected.edges.boundary()) {
            connected = Connected::of(&mut welded);
        }
        let mut corners: Vec<_> = parallel::map_range(welded.triangles.len(), |n| welded.corners(n));
        if corners.iter().all(|corners| area_of(corners) <= NO_AREA) {
            return None;
        }
        let mut tree = Tree::of(&corners);
        let mut is_reversed = face_surroundings(&connected, &tree, &corners);
        let components = components(&connected, &corners, &mut is_reversed);
        let reversed = |n: &u32| is_reversed[connected.patch_of[*n as usize] as usize];
        (0..).zip(&mut corners).filter(|(n, _)| reversed(n)).for_each(|(_, corners)| corners.swap(1, 2));
        tree.number.iter().zip(&mut tree.corners).filter(|(n, _)| reversed(n)).for_each(|(_, c)| c.swap(1, 2));
        let component_of =
            connected.patch_of.iter().map(|patch| connected.patches[*patch as usize].component).collect();
        let closed_components = components.iter().filter(|component| component.is_closed).count();
        let topology = Topology { closed_components, ..Topology::of(&welded, &connected) };
        Some(Self { tree, corners, component_of, components, topology })
    }
}

/// Per patch, whether it must be reversed to face its surroundings; false in components that are closed as they are.
fn face_surroundings(connected: &Connected, tree: &Tree, corners: &[[Point3<f64>; 3]]) -> Vec<bool> {
    let patches = &connected.patches;
    let closed = connected.closed(&vec![false; patches.len()]);
    if closed.iter().all(|closed| *closed) {
        return vec![false; patches.len()];
    }
    let triangles_of = grouped(connected.patch_of.iter().copied(), patches.len());
    facing::is_backward(tree, corners, &triangles_of, |patch| !closed[patches[patch].component as usize])
}

/// The components; those that are closed and face inward are reversed.
fn components(connected: &Connected, corners: &[[Point3<f64>; 3]], is_reversed: &mut [bool]) -> Vec<Component> {
    let patches = &connected.patches;
    let component_of = connected.patch_of.iter().map(|patch| patches[*patch as usize].component);
    let triangles_of = grouped(component_of, connected.components);
    let closed = connected.closed(is_reversed);
    let cone = |n: &u32| {
        let cone = Moments::of_cone(&corners[*n as usize]);
        if is_reversed[connected.patch_of[*n as usize] as usize] { cone * -1.0 } else { cone }
    };
    let inside = |n: usize| {
        let cones = triangles_of[n].iter().map(cone);
        if closed[n] { cones.fold(Moments::ZERO, |sum, cone| sum + cone) } else { Moments::ZERO }
    };
    let moments = parallel::map_range(triangles_of.len(), inside);
    let (mut area, mut mended) = (vec![0.0; connected.components], vec![0.0; connected.components]);
    for (patch, reversed) in patches.iter().zip(is_reversed.iter_mut()) {
        let component = patch.component as usize;
        area[component] += patch.area;
        mended[component] += if *reversed { patch.area - patch.mended_area } else { patch.mended_area };
        *reversed ^= moments[component].volume < 0.0;
    }
    let component = |(n, triangles): (usize, Vec<u32>)| Component {
        triangles,
        area: area[n],
        is_closed: closed[n],
        moments: moments[n] * moments[n].volume.signum(),
        faced_inward: moments[n].volume < 0.0,
        is_unreliable: mended[n] > UNRELIABLE * area[n],
    };
    triangles_of.into_iter().enumerate().map(component).collect()
}

/// The numbers of the items of each group.
fn grouped(group_of: impl Iterator<Item = u32>, groups: usize) -> Vec<Vec<u32>> {
    let mut items = vec![Vec::new(); groups];
    (0..).zip(group_of).for_each(|(item, group)| items[group as usize].push(item));
    items
}
