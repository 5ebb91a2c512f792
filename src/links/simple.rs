//! Simple shapes as triangles, of exactly their volume: what is round gets a little larger to make up for its flat sides.

use std::f64::consts::{PI, TAU};

use crate::scene::mesh::Triangles;
use crate::scene::mesh::containers::Geometry;

/// Sides around the axis of what is round, and rings from pole to pole of a ball.
const AROUND: u32 = 64;
const RINGS: u32 = 32;

/// The closed surface of a shape about its own middle; empty for what has no volume or is not simple.
pub fn surface(shape: &Geometry) -> Triangles {
    match *shape {
        Geometry::Box { half } => stretched(&prism(4), half),
        Geometry::Cylinder { radius, half_length } => stretched(&prism(AROUND), [radius, radius, half_length]),
        Geometry::Sphere { radius } => stretched(&ball(0.0), [radius; 3]),
        Geometry::Ellipsoid { half } => stretched(&ball(0.0), half),
        Geometry::Capsule { radius, half_length } => stretched(&ball(half_length / radius), [radius; 3]),
        Geometry::Plane | Geometry::Mesh(_) | Geometry::Own(_) | Geometry::Other(_) => Triangles::default(),
    }
}

/// A prism of height 2 about the z axis with the cross-section of a circle of radius 1; that of four sides is the box of the
/// same half sides.
fn prism(sides: u32) -> Triangles {
    let (radius, turn) = if sides == 4 {
        (2f64.sqrt(), 0.5)
    } else {
        // A polygon of n sides has an area of n/2 sin(2 pi / n) times the square of its radius.
        let sides = f64::from(sides);
        ((TAU / (sides * (TAU / sides).sin())).sqrt(), 0.0)
    };
    revolved(&[[0.0, -1.0], [radius, -1.0], [radius, 1.0], [0.0, 1.0]], sides, turn)
}

/// A ball of radius 1, whose halves are this far from the middle, with a cylinder between them.
fn ball(apart: f64) -> Triangles {
    let ring = |n: u32| {
        let (sin, cos) = (PI * (f64::from(n) / f64::from(RINGS) - 0.5)).sin_cos();
        let half = if n < RINGS / 2 { -apart } else { apart };
        [if n == 0 || n == RINGS { 0.0 } else { cos }, sin + half]
    };
    let middle = (apart > 0.0).then_some([1.0, -apart]);
    let half = RINGS / 2;
    let profile: Vec<[f64; 2]> = (0..half).map(ring).chain(middle).chain((half..=RINGS).map(ring)).collect();
    let ball = revolved(&profile, AROUND, 0.0);
    let lacks = (4.0 / 3.0 * PI + TAU * apart) / volume(&ball);
    stretched(&ball, [lacks.cbrt(); 3])
}

/// The surface that a profile of (radius, height), from axis to axis and upward on the outside, sweeps around the z axis,
/// starting at `turn` of a side.
fn revolved(profile: &[[f64; 2]], sides: u32, turn: f64) -> Triangles {
    let mut surface = Triangles::default();
    for &[radius, height] in profile {
        for side in 0..sides {
            let (sin, cos) = (TAU * (f64::from(side) + turn) / f64::from(sides)).sin_cos();
            surface.vertices.push([radius * cos, radius * sin, height]);
        }
    }
    for (ring, ends) in (0..).zip(profile.windows(2)) {
        for side in 0..sides {
            let [a, b] = [side, (side + 1) % sides].map(|s| ring * sides + s);
            if ends[0][0] > 0.0 {
                surface.triangles.push([a, b, b + sides]);
            }
            if ends[1][0] > 0.0 {
                surface.triangles.push([a, b + sides, a + sides]);
            }
        }
    }
    surface
}

fn stretched(surface: &Triangles, factors: [f64; 3]) -> Triangles {
    let vertex = |vertex: &[f64; 3]| std::array::from_fn(|axis| vertex[axis] * factors[axis]);
    Triangles { vertices: surface.vertices.iter().map(vertex).collect(), triangles: surface.triangles.clone() }
}

/// The volume within a closed surface.
fn volume(surface: &Triangles) -> f64 {
    let corner = |vertex: &u32| nalgebra::Vector3::from(surface.vertices[*vertex as usize]);
    surface.triangles.iter().map(|[a, b, c]| corner(a).dot(&corner(b).cross(&corner(c))) / 6.0).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_have_their_volume() {
        let half = [0.3, 0.2, 0.5];
        for (shape, expected) in [
            (Geometry::Box { half }, 8.0 * 0.03),
            (Geometry::Cylinder { radius: 0.2, half_length: 0.5 }, PI * 0.04),
            (Geometry::Sphere { radius: 0.3 }, 4.0 / 3.0 * PI * 0.027),
            (Geometry::Ellipsoid { half }, 4.0 / 3.0 * PI * 0.03),
            (Geometry::Capsule { radius: 0.2, half_length: 0.5 }, PI * 0.04 + 4.0 / 3.0 * PI * 0.008),
        ] {
            let solid = crate::scene::mesh::solid::measure(&surface(&shape)).unwrap();
            assert!((solid.volume.mid / expected - 1.0).abs() < 1e-9, "{shape:?}: {:?}", solid.volume);
            assert!(solid.doubts.is_empty() && solid.center.coords.norm() < 1e-9, "{shape:?}");
        }
    }
}
