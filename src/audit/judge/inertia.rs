//! Inertia: that a body can have it at all, that mass within the shape can, and that it is near the shape's own.

use nalgebra::{Matrix3, Vector3};

use super::super::hull::{Hull, extent};
use super::{Finding, Kind, Subject, words};
use crate::numeric::principal;
use crate::scene::mesh::containers::{Inertial, Mobility};

/// How far the stated moments may be off the shape's own. A thin shell has up to 5/3 times the inertia of a solid of the same
/// shape and mass (box, ball: 5/3; cylinder: up to 2), and a dense core a fraction of it.
const OFF: f64 = 3.0;
/// Moments that are stated with two digits may break the triangle inequality by this share.
const ROUNDING: f64 = 0.01;
/// By this share of its size, the hull of what is modelled may be too small: meshes are coarse.
const COARSE: f64 = 0.02;
/// Equal moments within this factor of the shape's own are those of a ball or a cube.
const NEAR: f64 = 1.5;

/// The moments about the principal axes, in rising order, and the axes as columns.
struct Principal {
    moments: [f64; 3],
    axes: Matrix3<f64>,
}

impl Principal {
    /// `None` as for [`principal`].
    fn of(inertia: &Matrix3<f64>) -> Option<Self> {
        let eigen = principal(inertia)?;
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        Some(Self {
            moments: order.map(|n| eigen.eigenvalues[n]),
            axes: Matrix3::from_columns(&order.map(|n| eigen.eigenvectors.column(n).into_owned())),
        })
    }
}

pub fn judge(subject: &Subject) -> Option<Finding> {
    let inertial = subject.inertial()?;
    let mass = subject.mass.kg().filter(|mass| *mass > 0.0);
    let Some(inertia) = inertial.inertia_in_body() else {
        let needs_one = mass.is_some() && subject.body.mobility != Mobility::Static && !subject.engines_fill_in();
        let problem = || "it has a mass and no inertia".to_owned();
        return needs_one
            .then(|| subject.finding(Kind::InertiaMissing, &inertial.place, problem(), subject.remedy_of_shape()));
    };
    // What does not move has no use for an inertia, and a body without mass has none.
    let is_nothing = inertia.iter().all(|number| *number == 0.0);
    if is_nothing && (mass.is_none() || subject.body.mobility == Mobility::Static) {
        return None;
    }
    let principal = Principal::of(&inertia)?;
    let compared = mass.and_then(|mass| Compared::of(subject, inertial, &inertia, mass));
    let (kind, problem) = impossible_anywhere(&principal)
        .map(|problem| (Kind::InertiaImpossible, problem))
        .or_else(|| placeholder(inertial, compared.as_ref()).map(|problem| (Kind::InertiaPlaceholder, problem)))
        .or_else(|| {
            let problem = impossible_within(subject, inertial, &principal, mass?)?;
            Some((Kind::InertiaImpossible, problem))
        })
        .or_else(|| compared.and_then(|compared| compared.off()).map(|problem| (Kind::InertiaOff, problem)))?;
    Some(subject.finding(kind, &inertial.inertia_place, problem, subject.remedy_of_shape()))
}

/// A moment is the integral of squared distances from an axis, so it is positive, and none exceeds the sum of the others.
fn impossible_anywhere(principal: &Principal) -> Option<String> {
    let [a, b, c] = principal.moments;
    let moments = words::list(principal.moments);
    match () {
        () if c == 0.0 && a == 0.0 => Some("its inertia is 0".to_owned()),
        () if a <= 0.0 => Some(format!("its inertia is not positive: its principal moments are {moments} kg m2")),
        () if a + b < c * (1.0 - ROUNDING) => Some(format!(
            "its inertia breaks the triangle inequality: of the principal moments {moments} kg m2, the largest exceeds the sum of the others"
        )),
        () => None,
    }
}

/// An inertia that no mass within the hull has.
///
/// Along a principal axis let the hull reach from a to b, and the centre of mass be at c. Of all distributions within with
/// that centre, the variance is largest if all mass lies at the ends, where it is (c - a)(b - c) (Bhatia and Davis 2000, "A
/// better bound on the variance"). The principal second moments J are those variances times the mass, and follow from the
/// moments by J = tr(I) / 2 - I. There is no bound from below: all mass may lie at the centre.
fn impossible_within(subject: &Subject, inertial: &Inertial, principal: &Principal, mass: f64) -> Option<String> {
    let hull = subject.size.hull.as_ref()?;
    let center = inertial.center_m();
    let half_trace = principal.moments.iter().sum::<f64>() / 2.0;
    let slack = COARSE * extent(&hull.corners).norm();
    (0..3).find_map(|n| {
        let axis: Vector3<f64> = principal.axes.column(n).into_owned();
        let [low, high] = reach(hull, &axis);
        let at = axis.dot(&center).clamp(low, high);
        let most = mass * (at - low + slack) * (high - at + slack);
        let stated = half_trace - principal.moments[n];
        let problem = || {
            format!(
                "no distribution of {} within its shape has an inertia of {} kg m2: along {}, its second moment could be {} kg m2 at most, and is {}",
                words::mass(mass),
                words::list(principal.moments),
                direction(&axis),
                words::list([most]),
                words::list([stated])
            )
        };
        (stated > most).then(problem)
    })
}

/// How far the hull reaches along a direction, to both sides.
fn reach(hull: &Hull, axis: &Vector3<f64>) -> [f64; 2] {
    let along = hull.corners.iter().map(|corner| axis.dot(corner));
    along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)])
}

/// A direction by the axis that it is nearest to.
fn direction(axis: &Vector3<f64>) -> String {
    let (nearest, along) = (0..3).map(|n| (n, axis[n].abs())).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 1.0));
    let name = ["x", "y", "z"][nearest];
    if along > 0.99 { name.to_owned() } else { format!("({:.2}, {:.2}, {:.2})", axis.x, axis.y, axis.z) }
}

/// The stated inertia beside the one of the shape with that mass and one density.
struct Compared {
    /// The least and the largest ratio over all axes.
    ratios: [f64; 2],
    of_shape: [f64; 3],
    stated: [f64; 3],
}

impl Compared {
    /// The ratios are the generalised eigenvalues of the two: those of L^-1 I L^-T, with L L^T the shape's own.
    fn of(subject: &Subject, inertial: &Inertial, inertia: &Matrix3<f64>, mass: f64) -> Option<Self> {
        let uniform = subject.uniform_inertia(mass)?;
        let inverse = uniform.cholesky()?.l().try_inverse()?;
        let ratios = Principal::of(&(inverse * inertia * inverse.transpose()))?.moments;
        let stated = inertial.inertia_kg_m2?;
        let rotation = inertial.body_from_inertial.rotation.to_rotation_matrix();
        let of_shape = rotation.matrix().transpose() * uniform * rotation.matrix();
        let diagonal = |matrix: &Matrix3<f64>| [matrix[(0, 0)], matrix[(1, 1)], matrix[(2, 2)]];
        Some(Self { ratios: [ratios[0], ratios[2]], of_shape: diagonal(&of_shape), stated: diagonal(&stated) })
    }

    fn is_near(&self) -> bool {
        self.ratios[0] > 1.0 / NEAR && self.ratios[1] < NEAR
    }

    /// The ratio that is farthest from 1.
    fn worst(&self) -> f64 {
        let [least, most] = self.ratios;
        if least * most < 1.0 { least } else { most }
    }

    fn times(&self) -> String {
        let worst = self.worst();
        let by = if worst < 1.0 { "too small" } else { "too large" };
        format!("up to {} times {by}", words::factor(worst))
    }

    fn off(&self) -> Option<String> {
        let is_off = self.ratios[0] < 1.0 / OFF || self.ratios[1] > OFF;
        is_off.then(|| {
            format!(
                "its inertia ({} kg m2) is {}: with one density, the shape has {}",
                words::list(self.stated),
                self.times(),
                words::list(self.of_shape)
            )
        })
    }
}

/// Moments that nobody computed: all equal and a power of ten, or all equal although the shape's own are not.
fn placeholder(inertial: &Inertial, compared: Option<&Compared>) -> Option<String> {
    let stated = inertial.inertia_kg_m2?;
    let moment = stated[(0, 0)];
    let is_even = (stated - Matrix3::identity() * moment).iter().all(|number| *number == 0.0);
    let power = moment.log10();
    let is_power_of_ten = (power - power.round()).abs() < 1e-9;
    let is_computed = compared.is_some_and(Compared::is_near);
    let of_shape = compared.map(|compared| Vector3::from(compared.of_shape));
    let shape_is_uneven = of_shape.is_some_and(|moments| moments.max() > NEAR * moments.min());
    let is_placeholder = is_even && !is_computed && (is_power_of_ten || shape_is_uneven);
    is_placeholder.then(|| {
        let beside = compared.map_or_else(String::new, |compared| {
            format!(", {}: with one density, the shape has {}", compared.times(), words::list(compared.of_shape))
        });
        format!("its inertia is a placeholder ({} kg m2 about every axis){beside}", words::list([moment]))
    })
}
