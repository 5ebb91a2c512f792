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
        let [mid, ..] = readings;
        let surface = effect(mid, mid - slack, mid + slack);
        let method = Effect { low: -surface.low.hypot(spread), high: surface.high.hypot(spread) };
        Self::measured(readings, method)
    }

    /// The volume with these [`READINGS`], if `method` is all by which its surface may be off.
    pub fn measured(readings: [f64; READINGS.len()], method: Effect) -> Self {
        let [mid, thin, thick, least, most] = readings;
        let wall = effect(mid, thin, thick).wider(OVERCONFIDENCE);
        Self { mid, method, wall, wall_most: f64::INFINITY, unseen: effect(mid, least, most) }
    }

    /// The same volume of a wall or of a hollow, if no thickness of the wall can make it larger than `most`, the volume inside
    /// the part's surface.
    pub fn within(self, most: f64) -> Self {
        let wall_most = if self.mid > 0.0 { (most / self.mid).ln().max(0.0) } else { 0.0 };
        Self { wall: self.wall.at_most(wall_most), wall_most, ..self }
    }

    /// The same volume as that of what is behind walls: it loses what they gain, and gains what they lose.
    pub fn behind<'a>(self, walls: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let rest = |end: fn(&Effect) -> f64| {
            let gained: f64 = walls.clone().map(|wall| wall.mid * (end(&wall.wall).exp() - 1.0)).sum();
            (1.0 - gained / self.mid).clamp(1.0 / FARTHEST, FARTHEST).ln()
        };
        if self.mid > 0.0 && walls.clone().next().is_some() {
            Self { wall: Effect { low: rest(|wall| wall.low), high: rest(|wall| wall.high) }, ..self }
        } else {
            self
        }
    }

    /// Its bounds at 90 %: the three causes are independent.
    pub fn interval(&self) -> Estimate {
        let width = |raises: bool| {
            let reaches = [self.method, self.wall, self.unseen].map(|effect| effect.reach(raises));
            reaches.iter().map(|reach| reach * reach).sum::<f64>().sqrt().exp()
        };
        Estimate::new(self.mid / width(false), self.mid, self.mid * width(true))
    }
}

/// The change of the logarithm of a volume from its middle to its ends.
fn effect(mid: f64, low: f64, high: f64) -> Effect {
    let ln = |volume: f64| (volume / mid).clamp(1.0 / FARTHEST, FARTHEST).ln();
    if mid > 0.0 { Effect { low: ln(low), high: ln(high) } } else { Effect::NONE }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_and_what_is_behind_it_fill_what_they_enclose_at_both_ends() {
        // 3 and 7 enclose 10; the wall is between 2 and 4.
        let wall = Volume::of([3.0, 2.0, 4.0, 3.0, 3.0], 0.0, 0.1).within(10.0);
        let behind = Volume::of([7.0, 8.0, 6.0, 7.0, 7.0], 0.0, 0.1).behind(std::iter::once(&wall));
        for end in [|effect: Effect| effect.low, |effect: Effect| effect.high] {
            let [shell, hollow] = [&wall, &behind].map(|volume| volume.mid * end(volume.wall).exp());
            assert!((shell + hollow - 10.0).abs() < 1e-9, "{shell} + {hollow}");
        }
        assert!(wall.wall.low < (2.0f64 / 3.0).ln() && behind.wall.low > 0.0 && behind.wall.high < 0.0);
        let alone = Volume::of([7.0, 8.0, 6.0, 7.0, 7.0], 0.0, 0.1);
        assert_eq!(alone.behind(std::iter::empty()), alone);
    }
}
