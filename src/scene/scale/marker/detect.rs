//! Finds the markers of a family in a picture.
//!
//! Quadrilaterals are sought in the picture and in ever smaller copies of it, in which large or blurred markers have
//! sharp edges; each is then refined and read in the picture itself.

use nalgebra::center;

use super::decode::{has_border, read};
use super::edges::{Lens, Refined, refine};
use super::families::Family;
use super::plane::Plane;
use super::quads::{Quad, quads};

/// The smallest copy has at least this many pixels along its shorter side.
const LEAST_COPY: usize = 64;

/// A marker in a picture.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Detection {
    pub id: usize,
    /// From the marker's upper left corner clockwise, in pixels of a pinhole camera with the photo's focal length.
    pub corners: Quad,
    /// As in [`Refined`].
    pub sharpness: f64,
}

/// The markers of `family` in the picture; each place is listed once.
pub(super) fn detect(plane: &Plane, lens: &Lens, family: &Family) -> Vec<Detection> {
    let codes = family.codes();
    let halved = |copy: &Plane| (copy.width.min(copy.height) > 2 * LEAST_COPY).then(|| copy.halved());
    let mut found: Vec<Detection> = Vec::new();
    let mut copy = halved(plane);
    let mut scale = 1.0;
    let mut candidates = quads(plane);
    loop {
        for quad in &candidates {
            let quad = quad.map(|corner| lens.ideal(scale * corner));
            let [Some(a), Some(b), Some(c), Some(d)] = quad else { continue };
            if let Some(detection) = look(plane, lens, [a, b, c, d], family, &codes)
                && !found.iter().any(|known| is_same(known, &detection))
            {
                found.push(detection);
            }
        }
        let Some(smaller) = copy else { break };
        candidates = quads(&smaller);
        scale *= 2.0;
        copy = halved(&smaller);
    }
    found
}

fn look(plane: &Plane, lens: &Lens, quad: Quad, family: &Family, codes: &[u64]) -> Option<Detection> {
    if !has_border(plane, lens, &quad, family.cells()) {
        return None;
    }
    let Refined { quad, sharpness } = refine(plane, lens, quad, family.cells())?;
    let found = read(plane, lens, &quad, family, codes)?;
    let corners = std::array::from_fn(|corner| quad[(found.upper_left + corner) % 4]);
    Some(Detection { id: found.id, corners, sharpness })
}

/// Whether two detections are of one marker at one place: their centres are less than half a side apart.
fn is_same(a: &Detection, b: &Detection) -> bool {
    let middle = |quad: &Quad| center(&quad[0], &quad[2]);
    let side = (a.corners[0] - a.corners[1]).norm();
    a.id == b.id && (middle(&a.corners) - middle(&b.corners)).norm() < 0.5 * side
}

/// The mean length of a marker's sides in pixels.
pub(super) fn side(corners: &Quad) -> f64 {
    0.25 * (0..4).map(|n| (corners[n] - corners[(n + 1) % 4]).norm()).sum::<f64>()
}
