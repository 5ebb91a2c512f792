//! Boundary conditions on the grid.

use serde::Serialize;

/// How material interacts with a surface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "contact", rename_all = "snake_case")]
pub enum Contact {
    /// Material that touches the surface sticks to it.
    Sticky,
    /// Material may slide along the surface but never leave it.
    Slip,
    /// Material may leave the surface; while pressed onto it, Coulomb friction holds or slows it.
    Separate { friction: f32 },
}

/// A half space that material cannot enter, in the simulation's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Boundary {
    pub point_m: [f32; 3],
    /// Unit normal, pointing out of the solid.
    pub normal: [f32; 3],
    pub contact: Contact,
}

impl Boundary {
    /// The velocity of a node at `position` after the boundary condition.
    pub fn apply(&self, position_m: [f32; 3], velocity_m_s: [f32; 3]) -> [f32; 3] {
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let away = [0, 1, 2].map(|a| position_m[a] - self.point_m[a]);
        if dot(away, self.normal) > 0.0 {
            return velocity_m_s;
        }
        let outward = dot(velocity_m_s, self.normal);
        let tangent = [0, 1, 2].map(|a| velocity_m_s[a] - outward * self.normal[a]);
        match self.contact {
            Contact::Sticky => [0.0; 3],
            Contact::Slip => tangent,
            Contact::Separate { .. } if outward >= 0.0 => velocity_m_s,
            Contact::Separate { friction } => {
                let speed = dot(tangent, tangent).sqrt();
                let kept = (speed + friction * outward).max(0.0);
                if kept == 0.0 { [0.0; 3] } else { tangent.map(|t| t * (kept / speed)) }
            }
        }
    }
}
