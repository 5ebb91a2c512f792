//! A look at a mesh that takes a fraction of the time of [`measure`](super::measure): for checks of many files.
//!
//! Sums over triangles only, no rays and no integration. It is exact for closed surfaces that do not pass through each other;
//! of others it says so.

use nalgebra::{Matrix3, Point3, Vector3};

use super::connected::{Connected, area_of};
use super::frame::Frame;
use super::moments::Moments;
use super::weld::Welded;
use super::{NO_AREA, Shell, SolidError, Topology, check};
use crate::scene::mesh::Triangles;
use crate::units::Estimate;

/// Among more components than this, none is sought inside of another.
const MOST_NESTED: usize = 256;

/// What triangles say about the solid that they bound. Lengths are in the mesh's unit, positions and axes in its frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Survey {
    /// The volume: from that of the largest component to that of all of them, which may overlap. Of an open surface, that
    /// of the cones from its middle, and from 0.
    pub volume: Estimate,
    /// The centre of mass at one density.
    pub center: Point3<f64>,
    /// Inertia about the centre at a density of 1 mass unit per cubed length unit.
    pub inertia: Matrix3<f64>,
    pub shell: Shell,
    pub topology: Topology,
}

/// A set of connected triangles.
struct Component {
    /// As the triangles face: negative if they face inward.
    moments: Moments,
    low: Point3<f64>,
    high: Point3<f64>,
}

impl Component {
    fn is_around(&self, other: &Self) -> bool {
        (0..3).all(|axis| self.low[axis] < other.low[axis] && other.high[axis] < self.high[axis])
    }
}

/// Looks at the solid that a surface bounds.
///
/// # Errors
/// As for [`measure`](super::measure).
pub fn survey(surface: &Triangles) -> Result<Survey, SolidError> {
    check(surface)?;
    let frame = Frame::of(surface);
    let mut welded = Welded::of(surface, &frame);
    let mut connected = Connected::of(&mut welded);
    if welded.close_gaps(&connected.edges.boundary()) {
        connected = Connected::of(&mut welded);
    }
    let corners: Vec<[Point3<f64>; 3]> = (0..welded.triangles.len()).map(|n| welded.corners(n)).collect();
    if corners.iter().all(|corners| area_of(corners) <= NO_AREA) {
        return Err(SolidError::NoArea { triangles: surface.triangles.len() });
    }
    let shell = Shell::of(&corners, &frame);
    let closed = connected.closed(&vec![false; connected.patches.len()]);
    let components = components(&connected, &corners);
    let (volume, moments, inverted) = enclosed(&components);
    let is_closed = closed.iter().all(|closed| *closed);
    let least = if is_closed { volume.low } else { 0.0 };
    let has_volume = moments.volume > 0.0;
    Ok(Survey {
        volume: Estimate::new(frame.volume(least), frame.volume(volume.mid), frame.volume(volume.high)),
        center: if has_volume { frame.point_back(moments.center()) } else { shell.center },
        inertia: if has_volume { frame.inertia(&moments) } else { Matrix3::zeros() },
        shell,
        topology: Topology {
            closed_components: closed.iter().filter(|closed| **closed).count(),
            inverted_components: inverted,
            ..Topology::of(&welded, &connected)
        },
    })
}

/// The components with the moments of the cones from the origin to their triangles. The origin is the middle of the mesh.
fn components(connected: &Connected, corners: &[[Point3<f64>; 3]]) -> Vec<Component> {
    let nothing = || Component {
        moments: Moments::ZERO,
        low: Point3::from(Vector3::repeat(f64::INFINITY)),
        high: Point3::from(Vector3::repeat(f64::NEG_INFINITY)),
    };
    let mut components: Vec<Component> = (0..connected.components).map(|_| nothing()).collect();
    for (corners, patch) in corners.iter().zip(&connected.patch_of) {
        let component = &mut components[connected.patches[*patch as usize].component as usize];
        component.moments = component.moments + Moments::of_cone(corners);
        for corner in corners {
            (component.low, component.high) = (component.low.inf(corner), component.high.sup(corner));
        }
    }
    components
}

/// The volume within the components, its moments, and the number of components that face inward although none is around them.
/// Those within another one that face the other way are voids, and others add nothing.
fn enclosed(components: &[Component]) -> (Estimate, Moments, usize) {
    let around = |inner: &Component| components.iter().find(|outer| outer.is_around(inner));
    let (mut sum, mut largest, mut void, mut inverted) = (Moments::ZERO, 0f64, 0.0, 0);
    for component in components {
        let volume = component.moments.volume;
        match around(component).filter(|_| components.len() <= MOST_NESTED) {
            None => {
                inverted += usize::from(volume < 0.0);
                sum = sum + component.moments * volume.signum();
                largest = largest.max(volume.abs());
            }
            Some(outer) if outer.moments.volume * volume < 0.0 => {
                sum = sum - component.moments * volume.signum();
                void += volume.abs();
            }
            Some(_) => {}
        }
    }
    (Estimate::new((largest - void).clamp(0.0, sum.volume.max(0.0)), sum.volume, sum.volume), sum, inverted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::mesh::solid::measure;

    /// A box, its triangles facing outward.
    fn cuboid(middle: [f64; 3], half: [f64; 3]) -> Triangles {
        let vertex = |n: usize| {
            std::array::from_fn(|axis| middle[axis] + if n >> axis & 1 == 1 { half[axis] } else { -half[axis] })
        };
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = sides.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Triangles { vertices: (0..8).map(vertex).collect(), triangles }
    }

    fn joined(all: &[Triangles]) -> Triangles {
        let mut sum = Triangles::default();
        for one in all {
            let first = sum.vertices.len() as u32;
            sum.vertices.extend(&one.vertices);
            sum.triangles.extend(one.triangles.iter().map(|t| t.map(|v| v + first)));
        }
        sum
    }

    fn inside_out(mut surface: Triangles) -> Triangles {
        surface.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        surface
    }

    #[test]
    fn closed_surfaces_are_measured_as_exactly_as_by_measure() {
        let outer = cuboid([1.0, 2.0, 3.0], [1.0, 2.0, 0.5]);
        let void = inside_out(cuboid([1.5, 2.0, 3.0], [0.25, 0.5, 0.25]));
        let beside = cuboid([9.0, 2.0, 3.0], [0.5; 3]);
        for surface in [outer.clone(), joined(&[outer.clone(), void]), joined(&[outer.clone(), beside])] {
            let (quick, thorough) = (survey(&surface).unwrap(), measure(&surface).unwrap());
            assert!((quick.volume.mid - thorough.volume.mid).abs() < 1e-12 * quick.volume.mid);
            assert!((quick.center - thorough.center).norm() < 1e-12);
            assert!((quick.inertia - thorough.inertia).norm() < 1e-9 * quick.inertia.norm());
            assert_eq!(quick.topology, thorough.topology);
        }
        let turned = survey(&inside_out(outer)).unwrap();
        assert_eq!((turned.topology.inverted_components, (turned.volume.mid * 1e9).round()), (1, 8e9));
    }

    #[test]
    fn a_box_without_a_side_has_no_least_volume() {
        let mut open = cuboid([0.0; 3], [1.0; 3]);
        open.triangles.truncate(10);
        let survey = survey(&open).unwrap();
        assert_eq!((survey.topology.boundary_edges, survey.volume.low), (4, 0.0));
        // The cones to five of six sides.
        assert!((survey.volume.mid - 8.0 * 5.0 / 6.0).abs() < 1e-12);
        assert!(!survey.topology.is_watertight());
    }
}
