//! A volume, and the causes that widen its bounds.

use crate::parts::mass::unknowns::{Effect, OVERCONFIDENCE};
use crate::units::{Estimate, Reading};

/// Error of the volume of a solid or a hollow that no other rule covers, as the half-width of a 90 % interval of its
/// logarithm: surfaces dented by reflections, seams slightly off. `docs/parts.md` says how this number and the
/// next were fitted.
pub const SOLID_SPREAD: f64 = 0.10;
/// The same for the area of a wall, to which the roughness of a splat adds.
pub const WALL_SPREAD: f64 = 0.15;

/// A bound is at most this factor away from the middle.
const FARTHEST: f64 = 20.0;

/// The readings of the walls and of what no view sees with which volumes are computed: the middle, then each of the two
/// at its ends while the other is in the middle.
pub const READINGS: [(Reading, Reading); 5] = [
    (Reading::Mid, Reading::Mid),
    (Reading::Low, Reading::Mid),
    (Reading::High, Reading::Mid),
    (Reading::Mid, Reading::Low),
    (Reading::Mid, Reading::High),
];

/// A volume, scene units cubed, and the change of its logarithm at the ends of each thing that it depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volume {
    pub mid: f64,
    /// How accurately the views and the splat show the surface.
    pub method: Effect,
    /// The thickness of the wall, with [`OVERCONFIDENCE`].
    pub wall: Effect,
    /// The logarithm of the greatest factor by which `wall` may make the volume larger.
    pub wall_most: f64,
    /// How deep a part goes where no view sees it, and whether a shell is closed there.
    pub unseen: Effect,
}

impl Volume {
    /// The volume with these [`READINGS`]; `slack` is the volume that the uncertainty of the surface may add or remove,
    /// `spread` the error that no other rule covers.
    pub fn of(readings: [f64; READINGS.len()], slack: f64, spread: f64) -> Self {
        let [mid, thin, thick, least, most] = readings;
        let ln = |volume: f64| (volume / mid).clamp(1.0 / FARTHEST, FARTHEST).ln();
        let effect =
            |low: f64, high: f64| if mid > 0.0 { Effect { low: ln(low), high: ln(high) } } else { Effect::NONE };
        let surface = effect(mid - slack, mid + slack);
        let method = Effect { low: -surface.low.hypot(spread), high: surface.high.hypot(spread) };
        let wall = effect(thin, thick).wider(OVERCONFIDENCE);
        Self { mid, method, wall, wall_most: f64::INFINITY, unseen: effect(least, most) }
    }

    /// The same volume, if no thickness of a wall can make it larger than `most`, the volume inside the part's surface.
    pub fn within(self, most: f64) -> Self {
        let wall_most = if self.mid > 0.0 { (most / self.mid).ln().max(0.0) } else { 0.0 };
        Self { wall: self.wall.at_most(wall_most), wall_most, ..self }
    }

    /// Its bounds at 90 %: the three causes are independent.
    pub fn interval(&self) -> Estimate {
        let width = |raises: bool| {
            let slopes = [self.method, self.wall, self.unseen].map(|effect| effect.slope(raises));
            slopes.iter().map(|slope| slope * slope).sum::<f64>().sqrt().exp()
        };
        Estimate::new(self.mid / width(false), self.mid, self.mid * width(true))
    }
}
