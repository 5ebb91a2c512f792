//! A rigid body on the ground.
//!
//! The body may touch the ground with the points of its surface that are outermost in some direction. Those that would
//! pass through the plane within the step get impulses that make them end on it: j_n >= 0, and Coulomb friction
//! |j_t| <= mu j_n against the remaining slip. The impulses are found by projected Gauss-Seidel iteration (Moreau 1988;
//! Catto, *Iterative Dynamics with Temporal Coherence*, 2005). Nothing rebounds, because how much an object
//! does depends on where it lands and how it rings, which is not known; and nothing sinks, because the constraint is on the gap at the end of the step.
//!
//! The pressure of an impact cannot be read from such impulses, which have no duration. It is that of a flat punch of
//! the contact's area A on an elastic half space (Johnson, *Contact Mechanics*, 1985, section 3.4): stiffness k = 2 a E
//! / (1 - nu^2) with a = sqrt(A / pi), so that a mass m that arrives at v presses with at most v sqrt(k m). The mass is
//! the one that the impulse stopped, m = J / v; the ground is taken to be rigid. Of v, the share that gravity and the
//! scenario's forces add within the step is not an impact, since a body at rest has it too: it counts as a steady force
//! instead, F = v0 sqrt(k m) + m (v - v0) / dt. What other bodies and the grid add counts as an impact.

use nalgebra::{Matrix3, Matrix3x6, Matrix6, Point2, Point3, Vector2, Vector3};

use super::body::{Body, Velocities};
use super::coupling::about_center;
use crate::mpm::boundary::{Boundary, Contact};
use crate::numeric::hull::planar;

/// Gap below which a point counts as touching, as a share of the body's radius: a body that rolls over a corner moves
/// it by the square of the angle turned in a step.
const TOUCHING: f64 = 1e-4;

/// Sweeps over the contacts; each brings the impulses of a resting body nearer to balance.
const SWEEPS: usize = 200;

/// Change of velocity in a sweep, as a share of g dt, below which the impulses have converged.
const CONVERGED: f64 = 1e-7;

/// A point of a body that may touch the ground within the step.
struct Touch {
    face: usize,
    /// From the centre of mass.
    arm: Vector3<f64>,
    gap_m: f64,
    /// Whether it lies on the ground already.
    landed: bool,
    /// Velocity of the point per impulse at it.
    compliance: Matrix3<f64>,
    /// Along the normal and two tangents.
    impulse: Vector3<f64>,
    /// Speed towards the ground before the impulses.
    approach_m_s: f64,
    /// The share of it that the scenario's forces have added in this step.
    loaded_m_s: f64,
}

/// The ground as rigid bodies meet it.
#[derive(Debug, Clone, Copy)]
pub struct Ground {
    point_m: Point3<f64>,
    normal: Vector3<f64>,
    tangents: [Vector3<f64>; 2],
    contact: Contact,
}

impl From<&Boundary> for Ground {
    fn from(boundary: &Boundary) -> Self {
        let normal = Vector3::from(boundary.normal.map(f64::from)).normalize();
        let across = if normal.x.abs() < 0.5 { Vector3::x() } else { Vector3::y() };
        let tangent = normal.cross(&across).normalize();
        Self {
            point_m: boundary.point_m.map(f64::from).into(),
            normal,
            tangents: [tangent, normal.cross(&tangent)],
            contact: boundary.contact,
        }
    }
}

impl Ground {
    /// Height of a point above the ground.
    fn gap_m(&self, point_m: Vector3<f64>) -> f64 {
        (point_m - self.point_m.coords).dot(&self.normal)
    }

    /// Changes the velocity of `body`, which answers impulses with `response`, so that it ends a step of `dt_s` on or
    /// above the ground, and notes how hard its faces were pressed. Gravity has already acted on it in this step, and so
    /// have the scenario's forces, which have changed its velocities by `loads`.
    pub fn act(
        &self,
        body: &mut Body,
        response: &Matrix6<f64>,
        gravity_m_s2: &Vector3<f64>,
        loads: &Velocities,
        dt_s: f64,
    ) {
        let mut touches = self.touches(body, response, loads, dt_s);
        if touches.is_empty() {
            return;
        }
        let frame = Matrix3::from_columns(&[self.normal, self.tangents[0], self.tangents[1]]);
        let (mut velocity, mut spin) = (body.state().velocity_m_s, body.spin());
        let fallen_m_s = -gravity_m_s2.dot(&self.normal) * dt_s;
        let enough = CONVERGED * fallen_m_s.abs();
        for _ in 0..SWEEPS {
            let mut change = 0.0_f64;
            for touch in &mut touches {
                let at_point = frame.transpose() * (velocity + spin.cross(&touch.arm));
                let wanted = self.impulse(touch, at_point, dt_s);
                let more = frame * (wanted - touch.impulse);
                touch.impulse = wanted;
                let changed = response * about_center(&touch.arm, &more);
                let dv: Vector3<f64> = changed.fixed_rows::<3>(0).into();
                let dw: Vector3<f64> = changed.fixed_rows::<3>(3).into();
                velocity += dv;
                spin += dw;
                change = change.max(dv.norm() + dw.norm() * body.radius_m());
            }
            if change <= enough {
                break;
            }
        }
        body.set_motion(velocity, spin);
        self.note_pressures(body, &touches, fallen_m_s, dt_s);
    }

    /// Lifts a body out of the ground. Its depth there is small: it grows with the square of the angle that the body turns
    /// in a step.
    pub fn lift(&self, body: &mut Body) {
        let pose = body.pose();
        let points = body.faces.iter().flat_map(|face| &face.points_m);
        let lowest = points.map(|p| self.gap_m((pose * Point3::from(*p)).coords)).fold(0.0, f64::min);
        body.shift(self.normal * -lowest);
    }

    /// The points that come near the ground within a step.
    fn touches(&self, body: &Body, response: &Matrix6<f64>, loads: &Velocities, dt_s: f64) -> Vec<Touch> {
        let (state, spin) = (body.state(), body.spin());
        if self.gap_m(state.center_m) > body.radius_m() + 2.0 * body.fastest_m_s() * dt_s {
            return vec![];
        }
        let reach = 2.0 * body.fastest_m_s() * dt_s + TOUCHING * body.radius_m();
        let frame = Matrix3::from_columns(&[self.normal, self.tangents[0], self.tangents[1]]);
        let mut touches = Vec::new();
        for (face, points) in body.faces.iter().enumerate() {
            for place in &points.points_m {
                let arm = state.rotation * place;
                let gap_m = self.gap_m(state.center_m + arm);
                if gap_m > reach {
                    continue;
                }
                let mut at_point = Matrix3x6::identity();
                at_point.fixed_view_mut::<3, 3>(0, 3).copy_from(&-arm.cross_matrix());
                let compliance = at_point * response * at_point.transpose();
                let towards = |[velocity, spin]: Velocities| -(velocity + spin.cross(&arm)).dot(&self.normal);
                let compliance = frame.transpose() * compliance * frame;
                let landed = gap_m <= TOUCHING * body.radius_m();
                touches.push(Touch {
                    face,
                    arm,
                    gap_m,
                    landed,
                    compliance,
                    impulse: Vector3::zeros(),
                    approach_m_s: towards([state.velocity_m_s, spin]),
                    loaded_m_s: towards(*loads),
                });
            }
        }
        // Deepest first: these stop the body, the others balance it.
        touches.sort_by(|a, b| a.gap_m.total_cmp(&b.gap_m));
        touches
    }

    /// The impulse at a touch if its point moves with `velocity` (normal and tangents) under the present impulses.
    fn impulse(&self, touch: &Touch, velocity: Vector3<f64>, dt_s: f64) -> Vector3<f64> {
        let (k, old) = (&touch.compliance, touch.impulse);
        let to_surface = old.x - (velocity.x + touch.gap_m.max(0.0) / dt_s) / k.m11;
        let across = |normal: f64| {
            // The change of the normal impulse moves the point sideways as well.
            let slip = Vector2::new(velocity.y, velocity.z) + Vector2::new(k.m21, k.m31) * (normal - old.x);
            // The same factor in every direction, so that friction ends up opposite to the slip that remains; it is that
            // of the most compliant direction, with which the iteration is stable.
            let (mean, half) = ((k.m22 + k.m33) / 2.0, (k.m22 - k.m33) / 2.0);
            Vector2::new(old.y, old.z) - slip / (mean + half.hypot(k.m23))
        };
        let (normal, tangent) = match self.contact {
            Contact::Separate { friction } => {
                let normal = to_surface.max(0.0);
                let (tangent, most) = (across(normal), f64::from(friction) * normal);
                let norm = tangent.norm();
                (normal, if norm > most { tangent * (most / norm) } else { tangent })
            }
            // A point that has landed stays on the ground.
            Contact::Slip if touch.landed => (to_surface, Vector2::zeros()),
            Contact::Slip => (to_surface.max(0.0), Vector2::zeros()),
            Contact::Sticky if touch.landed => (to_surface, across(to_surface)),
            Contact::Sticky => {
                let normal = to_surface.max(0.0);
                (normal, if normal > 0.0 { across(normal) } else { Vector2::zeros() })
            }
        };
        Vector3::new(normal, tangent.x, tangent.y)
    }

    /// Raises each face's peak pressure to that of this step, if it is higher. In the step, gravity alone has added
    /// `fallen_m_s` to the speed towards the ground.
    fn note_pressures(&self, body: &mut Body, touches: &[Touch], fallen_m_s: f64, dt_s: f64) {
        for at in 0..body.faces.len() {
            let pressing = || touches.iter().filter(|touch| touch.face == at && touch.impulse.x > 0.0);
            let impulse: f64 = pressing().map(|touch| touch.impulse.x).sum();
            let fastest = pressing().max_by(|a, b| a.approach_m_s.total_cmp(&b.approach_m_s));
            let Some(fastest) = fastest.filter(|touch| touch.approach_m_s > 0.0) else { continue };
            let (approach, added) = (fastest.approach_m_s, fallen_m_s + fastest.loaded_m_s);
            let patch: Vec<Point2<f64>> = touches
                .iter()
                .filter(|touch| touch.face == at && (touch.landed || touch.gap_m <= approach * dt_s))
                .map(|touch| Point2::from(self.tangents.map(|tangent| touch.arm.dot(&tangent))))
                .collect();
            let face = &mut body.faces[at];
            let area_m2 = area_of_hull(patch).max(face.least_area_m2);
            let stiffness = 2.0 * (area_m2 / std::f64::consts::PI).sqrt() * face.plane_modulus_pa;
            let mass = impulse / approach;
            let impact_n = (approach - added).max(0.0) * (stiffness * mass).sqrt();
            let pressure_pa = (impact_n + mass * added.max(0.0) / dt_s) / area_m2;
            face.peak_pressure_pa = face.peak_pressure_pa.max(pressure_pa);
        }
    }
}

/// Area of the convex hull of points of a plane.
fn area_of_hull(points: Vec<Point2<f64>>) -> f64 {
    let hull = planar(points);
    let twice: f64 = (0..hull.len()).map(|i| hull[i].coords.perp(&hull[(i + 1) % hull.len()].coords)).sum();
    twice / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hull_of_a_square_with_points_inside_and_on_its_sides() {
        let points = [[0.0, 0.0], [2.0, 0.0], [1.0, 0.0], [2.0, 2.0], [0.0, 2.0], [1.0, 1.0], [0.5, 1.5]];
        assert!((area_of_hull(points.map(Point2::from).to_vec()) - 4.0).abs() < 1e-12);
        assert_eq!(area_of_hull(vec![Point2::origin(), Point2::new(3.0, 4.0)]), 0.0);
        assert_eq!(area_of_hull(vec![]), 0.0);
    }
}
