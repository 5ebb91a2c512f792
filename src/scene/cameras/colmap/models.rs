//! COLMAP's camera models: number, name, and meaning of the parameters (`colmap/sensor/models.h` and its
//! documentation).

use super::Problem;
use crate::camera::{Distortion, Polynomial};
use crate::scene::cameras::frame::{Declared, Focal};

/// Name and parameter count of each model, in the order of COLMAP's model numbers.
const MODELS: [(&str, usize); 17] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    ("SIMPLE_DIVISION", 4),
    ("DIVISION", 5),
    ("SIMPLE_FISHEYE", 3),
    ("FISHEYE", 4),
    ("EUCM", 6),
];

/// Name and parameter count of COLMAP's model `number`.
pub(super) fn of_number(id: u32, number: i32) -> Result<(&'static str, usize), Problem> {
    let model = usize::try_from(number).ok().and_then(|number| MODELS.get(number));
    model.copied().ok_or_else(|| Problem::Model { id, model: format!("number {number}") })
}

/// A camera from its model and parameters.
pub(super) fn declared(id: u32, model: &str, size: (u64, u64), parameters: &[f64]) -> Result<Declared, Problem> {
    let known = MODELS.iter().find(|(name, _)| *name == model);
    let (name, expected) = *known.ok_or_else(|| Problem::Model { id, model: model.chars().take(40).collect() })?;
    if parameters.len() != expected {
        return Err(Problem::Parameters { id, model: name.to_owned(), expected, found: parameters.len() });
    }
    let bad = |reason| Problem::Camera { id, reason };
    if parameters.iter().any(|value| !value.is_finite()) {
        return Err(bad("a parameter is not a number"));
    }
    let side = |side: u64| u32::try_from(side).ok().filter(|side| *side > 0);
    let (width, height) = side(size.0).zip(side(size.1)).ok_or(bad("its width or height makes no sense"))?;
    // The simple models have a single focal length, and so do RADIAL and RADIAL_FISHEYE.
    let (fx, fy, rest) = match (name.starts_with("SIMPLE_") || name.starts_with("RADIAL"), parameters) {
        (true, [f, rest @ ..]) => (f, f, rest),
        (false, [fx, fy, rest @ ..]) => (fx, fy, rest),
        _ => return Err(bad("it has no focal length")),
    };
    let [cx, cy, lens @ ..] = rest else { return Err(bad("it has no principal point")) };
    if !(*fx > 0.0 && *fy > 0.0) {
        return Err(bad("its focal length is not above zero"));
    }
    Ok(Declared {
        size: Some((width, height)),
        fx: Focal::Pixels(*fx),
        fy: Some(Focal::Pixels(*fy)),
        cx: Some(*cx),
        cy: Some(*cy),
        distortion: distortion(name, lens).ok_or(bad("its lens parameters make no sense"))?,
    })
}

/// The lens distortion of a model; `lens` are its parameters after the principal point.
fn distortion(model: &str, lens: &[f64]) -> Option<Distortion> {
    let radial = |k: &[f64]| std::array::from_fn(|i| k.get(i).copied().unwrap_or(0.0));
    let polynomial = match *lens {
        [] => Polynomial::default(),
        [omega] if model == "FOV" => {
            return (omega > 0.0 && omega < std::f64::consts::PI).then_some(Distortion::FieldOfView { omega });
        }
        [k] if model.ends_with("DIVISION") => {
            return Some(if k == 0.0 { Distortion::None } else { Distortion::Division { k } });
        }
        [alpha, beta] if model == "EUCM" => {
            let sound = (0.0..=1.0).contains(&alpha) && beta > 0.0;
            return sound.then_some(Distortion::EnhancedUnified { alpha, beta });
        }
        [k1] => Polynomial { radial: radial(&[k1]), ..Default::default() },
        [k1, k2] => Polynomial { radial: radial(&[k1, k2]), ..Default::default() },
        [k1, k2, k3, k4] if model == "OPENCV_FISHEYE" => {
            Polynomial { radial: radial(&[k1, k2, k3, k4]), ..Default::default() }
        }
        [k1, k2, p1, p2] => Polynomial { radial: radial(&[k1, k2]), tangential: [p1, p2], ..Default::default() },
        [k1, k2, p1, p2, k3, k4, k5, k6] if model == "FULL_OPENCV" => Polynomial {
            radial: radial(&[k1, k2, k3]),
            divisor: [k4, k5, k6],
            tangential: [p1, p2],
            ..Default::default()
        },
        [k1, k2, p1, p2, k3, k4, sx1, sy1] => Polynomial {
            radial: radial(&[k1, k2, k3, k4]),
            tangential: [p1, p2],
            prism: [sx1, 0.0, sy1, 0.0],
            ..Default::default()
        },
        // Project Aria orders its tangential parameters the other way round: p0 goes with x.
        [k0, k1, k2, k3, k4, k5, p0, p1, s0, s1, s2, s3] => Polynomial {
            radial: [k0, k1, k2, k3, k4, k5],
            tangential: [p1, p0],
            prism: [s0, s1, s2, s3],
            prism_after_radial: true,
            ..Default::default()
        },
        _ => return None,
    };
    Some(if model.ends_with("FISHEYE") { Distortion::Fisheye(polynomial) } else { Distortion::perspective(polynomial) })
}
