//! The things that masses depend on and that are not known exactly: the surface, walls, unseen depths, densities,
//! fillings.
//!
//! Each unknown z is normal, with a standard deviation of 1 / 1.645, so that it lies within -1 to 1 with a probability
//! of 90 %. The logarithm of a [`Quantity`] (a volume, a mass) changes in proportion to each unknown, with one slope
//! below its middle and another above. Unknowns are independent: their contributions to the width of an interval add up
//! in quadrature.
//!
//! A reading of a kitchen scale is a measurement of the sum of masses. [`Belief::after`] finds the most likely unknowns
//! given the reading (Gauss-Newton on the posterior, each step halved until that no longer helps) and their covariance there
//! (Laplace's approximation): everything that has a share in the mass is then known better, and the most uncertain things
//! move most.

use serde::{Deserialize, Serialize};

use crate::units::Estimate;

/// Factor by which the model's ranges are widened if they are about something that no view shows: a wall's thickness,
/// how full a hollow is, the density of a mixed part. Ranges that people call 90 % sure hold the truth in about half of
/// the cases (Klayman et al., Organizational Behavior and Human Decision Processes 79, 1999), that is out to 0.67
/// instead of 1.64 standard deviations.
pub const OVERCONFIDENCE: f64 = 2.4;
/// How far the contents of a package are from what is printed on it, as the half-width of a 90 % interval of the logarithm:
/// the tolerable error of a package of 100 g to 1 kg is 1.5 to 4.5 % (Council Directive 76/211/EEC, annex I), and what is weighed is
/// seldom fresh from the shop.
pub const PRINTED_ERROR: f64 = 0.04;

/// A cause of an interval's width.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// How accurately the views and the splat show the surface.
    Method,
    /// The thickness of walls.
    Wall,
    /// How deep a part goes where no view sees it, and whether a shell is closed there.
    UnseenDepth,
    /// The density of a material, or of a mixed part.
    Density,
    /// How much of a filling there is, and its density.
    Filling,
    /// The length of a scene unit, if it has an interval.
    Scale,
    /// Things that no part shows.
    Unnumbered,
}

/// The change of a logarithm at the low and the high end of an unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effect {
    pub low: f64,
    pub high: f64,
}

impl Effect {
    pub const NONE: Self = Self { low: 0.0, high: 0.0 };

    /// The effect on a quantity with this estimate if the unknown is all that it depends on.
    pub fn of(estimate: Estimate) -> Self {
        let ln = |end: f64| if end > 0.0 && estimate.mid > 0.0 { (end / estimate.mid).ln() } else { 0.0 };
        Self { low: ln(estimate.low), high: ln(estimate.high) }
    }

    /// The same effect with ends that are farther apart by this factor.
    pub fn wider(self, factor: f64) -> Self {
        Self { low: self.low * factor, high: self.high * factor }
    }

    /// The same effect with ends that raise the logarithm by no more than `limit`.
    pub fn at_most(self, limit: f64) -> Self {
        Self { low: self.low.min(limit), high: self.high.min(limit) }
    }

    /// Both effects together, the other with this weight.
    fn and(self, other: Self, weight: f64) -> Self {
        Self { low: self.low + weight * other.low, high: self.high + weight * other.high }
    }

    fn at(self, z: f64) -> f64 {
        if z > 0.0 { self.high * z } else { -self.low * z }
    }

    /// How far the logarithm goes up, or down, at the end of the unknown that moves it there; 0 if neither end does.
    pub fn reach(self, raises: bool) -> f64 {
        let sign = if raises { 1.0 } else { -1.0 };
        (sign * self.high).max(sign * self.low).max(0.0)
    }

    /// The effect of going from `z` to one above and one below it, or as far as the bounds allow.
    fn around(self, z: f64, [low, high]: [f64; 2]) -> Self {
        let change = |to: f64| self.at(to) - self.at(z);
        Self { low: change((z - 1.0).max(low)), high: change((z + 1.0).min(high)) }
    }

    /// Whether the unknown goes up from its middle for the quantity to rise (or to fall), or down: to the side on which it
    /// does so faster; `None` if it does the opposite on both.
    fn side(self, raises: bool) -> Option<bool> {
        let (gain_above, gain_below) = if raises { (self.high, self.low) } else { (-self.high, -self.low) };
        let is_opposite_on_both = gain_above < 0.0 && gain_below < 0.0;
        let rises_more_above = self.high >= self.low;
        if is_opposite_on_both { None } else { Some(rises_more_above == raises) }
    }

    /// The slope above the middle, or below it.
    fn slope(self, above: bool) -> f64 {
        if above { self.high } else { -self.low }
    }

    /// The slope at `z`; next to the middle, that of the side on which the quantity rises (or falls), or 0 if it does so on
    /// neither.
    fn slope_towards(self, z: f64, raises: bool) -> f64 {
        if z.abs() > AT_MIDDLE { self.slope(z > 0.0) } else { self.side(raises).map_or(0.0, |above| self.slope(above)) }
    }
}

/// An unknown this near to its middle can go to either side.
const AT_MIDDLE: f64 = 1e-3;

/// The thing that an unknown belongs to. Users name materials and fillings, so a name never stands for a part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Owner {
    /// The whole object: all of its parts share the unknown.
    Object,
    /// The part with this id.
    Part(u32),
    /// The material with this name.
    Material(String),
    /// The filling with this name.
    Filling(String),
    /// The thing that no part shows with this index.
    Thing(usize),
}

/// The unknowns, each by its source and its owner.
#[derive(Debug, Default)]
pub struct Unknowns {
    owners: Vec<(Source, Owner)>,
    /// How far each may go, down and up.
    bounds: Vec<[f64; 2]>,
}

impl Unknowns {
    /// The number of the unknown with this source and owner.
    pub fn number(&mut self, source: Source, owner: &Owner) -> usize {
        let known = self.owners.iter().position(|(s, known)| *s == source && known == owner);
        known.unwrap_or_else(|| {
            self.owners.push((source, owner.clone()));
            self.bounds.push([f64::NEG_INFINITY, f64::INFINITY]);
            self.owners.len() - 1
        })
    }

    /// Keeps an unknown within the range in which its effect raises the logarithm by no more than `most`.
    pub fn limit(&mut self, number: usize, Effect { low, high }: Effect, most: f64) {
        let [down, up] = &mut self.bounds[number];
        if high > 0.0 {
            *up = up.min(most / high);
        }
        if low > 0.0 {
            *down = down.max(-most / low);
        }
    }

    pub fn source(&self, number: usize) -> Source {
        self.owners[number].0
    }

    fn count(&self) -> usize {
        self.owners.len()
    }
}

/// A volume or a mass: its middle, and the unknowns that it depends on.
#[derive(Debug, Clone, Default)]
pub struct Quantity {
    pub mid: f64,
    pub effects: Vec<(usize, Effect)>,
}

impl Quantity {
    /// The logarithm of the factor by which it differs from its middle.
    fn log_factor(&self, z: &[f64]) -> f64 {
        self.effects.iter().map(|(unknown, effect)| effect.at(z[*unknown])).sum()
    }
}

/// The belief about the unknowns: their middle, and what was weighed.
#[derive(Debug, Clone)]
pub struct Belief {
    middle: Vec<f64>,
    reading: Option<Reading>,
}

/// A measurement of the sum of all masses.
#[derive(Debug, Clone)]
struct Reading {
    /// By unknown, how the logarithm of the sum changes around the middle.
    effects: Vec<Effect>,
    /// Relative, at 90 %.
    error: f64,
    /// By unknown, how far it may go, down and up.
    bounds: Vec<[f64; 2]>,
}

/// A relative error so small that the most likely unknowns give the sum exactly.
const EXACT: f64 = 1e-3;
/// Steps of Gauss-Newton; a few suffice for any mass that the bounds allow.
const STEPS: usize = 100;
/// The number of places that are tried on the way of a step.
const PLACES: i32 = 14;
/// The search ends when a step improves the fit by no more than this share.
const LEAST_GAIN: f64 = 1e-6;
/// Rounds of finding the sides to which the unknowns go, which depend on the slopes there.
const SIDES: usize = 4;

impl Belief {
    /// The belief before anything was weighed.
    pub fn prior(unknowns: &Unknowns) -> Self {
        Self { middle: vec![0.0; unknowns.count()], reading: None }
    }

    /// The belief after the sum of `masses` was found to be `reading`, within the relative `error` at 90 %.
    pub fn after(unknowns: &Unknowns, masses: &[Quantity], reading: f64, error: f64) -> Self {
        let posterior = Posterior { unknowns, masses, reading, error };
        let count = unknowns.count();
        let ends =
            (0..count).flat_map(|n| [-1.0, 1.0].map(|end| (0..count).map(move |m| if m == n { end } else { 0.0 })));
        // An unknown may lower the sum on both sides of its middle and raise it farther out.
        let starts = std::iter::once(vec![0.0; count]).chain(ends.map(Iterator::collect));
        let likely = starts.map(|start| posterior.most_likely_near(start));
        let (middle, _) = likely.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
        let reading = Reading { effects: effects(masses, &middle), error, bounds: unknowns.bounds.clone() };
        Self { reading: Some(reading), middle }
    }

    /// The belief in which the sum of `masses` is `mass`: each unknown is where it most likely is if the sum is the middle, and as
    /// uncertain as it is if the sum has this interval, or as before if that is narrower.
    pub fn in_which(unknowns: &Unknowns, masses: &[Quantity], mass: Estimate) -> Self {
        let half_width = |of: Estimate| 0.5 * (of.high / of.low).ln();
        let mut belief = Self::after(unknowns, masses, mass.mid, EXACT);
        let before = half_width(Self { reading: None, ..belief.clone() }.of_sum(masses));
        let after = half_width(mass);
        if let Some(reading) = &mut belief.reading {
            // The reading that, with what was believed before, leaves this interval.
            reading.error =
                if after < before { (after.powi(-2) - before.powi(-2)).sqrt().recip() } else { f64::INFINITY };
        }
        belief
    }

    /// The quantity as it is believed to be.
    pub fn of(&self, quantity: &Quantity) -> Estimate {
        self.around(quantity.mid * quantity.log_factor(&self.middle).exp(), &quantity.effects)
    }

    /// The sum of quantities as it is believed to be.
    pub fn of_sum(&self, quantities: &[Quantity]) -> Estimate {
        let sum = self.sum(quantities);
        self.around(sum.mid, &sum.effects)
    }

    /// The sum as one quantity: its effects are the changes of its logarithm if a single unknown moves by one. After a
    /// weighing, the unknowns that matter can move only a little, so its effects are the derivatives at their middles.
    fn sum(&self, quantities: &[Quantity]) -> Quantity {
        match self.reading {
            None => summed(quantities, &self.middle),
            Some(_) => Quantity {
                mid: total(quantities, &self.middle),
                effects: effects(quantities, &self.middle).into_iter().enumerate().collect(),
            },
        }
    }

    /// The interval of a sum if only the unknowns of one source were uncertain, for each source that has a share in it.
    pub fn by_source(&self, unknowns: &Unknowns, quantities: &[Quantity]) -> Vec<(Source, Estimate)> {
        let mut sum = self.sum(quantities);
        sum.effects.retain(|(_, effect)| *effect != Effect::NONE);
        let mut sources: Vec<Source> = sum.effects.iter().map(|(unknown, _)| unknowns.source(*unknown)).collect();
        sources.sort_unstable();
        sources.dedup();
        let caused_by = |source: Source| {
            let own = sum.effects.iter().filter(|(unknown, _)| unknowns.source(*unknown) == source);
            let mut alone = self.clone();
            for (unknown, effect) in alone.reading.iter_mut().flat_map(|reading| reading.effects.iter_mut().enumerate())
            {
                if unknowns.source(unknown) != source {
                    *effect = Effect::NONE;
                }
            }
            (source, alone.around(sum.mid, &own.copied().collect::<Vec<_>>()))
        };
        sources.into_iter().map(caused_by).filter(|(_, estimate)| estimate.low < estimate.high).collect()
    }

    fn around(&self, mid: f64, effects: &[(usize, Effect)]) -> Estimate {
        let factor = |raises: bool| self.width(effects, raises).exp();
        Estimate::new(mid / factor(false), mid, mid * factor(true))
    }

    fn width(&self, effects: &[(usize, Effect)], raises: bool) -> f64 {
        let Some(reading) = &self.reading else {
            return effects.iter().map(|(_, effect)| effect.reach(raises).powi(2)).sum::<f64>().sqrt();
        };
        let mut own = vec![Effect::NONE; self.middle.len()];
        for (unknown, effect) in effects {
            own[*unknown] = own[*unknown].and(*effect, 1.0);
        }
        // An unknown may go past its own middle, where its slope changes, but not past its bounds.
        let around = |effects: &[Effect]| -> Vec<Effect> {
            let place = self.middle.iter().zip(&reading.bounds);
            effects.iter().zip(place).map(|(effect, (z, bounds))| effect.around(*z, *bounds)).collect()
        };
        let (own, sum) = (around(&own), around(&reading.effects));
        let mut sides: Vec<Option<bool>> = own.iter().map(|effect| effect.side(raises)).collect();
        let mut variance = 0.0;
        for _ in 0..SIDES {
            let slopes = |effects: &[Effect]| -> Vec<f64> {
                effects.iter().zip(&sides).map(|(effect, side)| side.map_or(0.0, |above| effect.slope(above))).collect()
            };
            let (own_slopes, sum_slopes) = (slopes(&own), slopes(&sum));
            let norm = dot(&sum_slopes, &sum_slopes) + reading.error * reading.error;
            let shared = if norm > 0.0 { dot(&own_slopes, &sum_slopes) / norm } else { 0.0 };
            variance = dot(&own_slopes, &own_slopes) - shared * dot(&own_slopes, &sum_slopes);
            // Where the unknowns are when the quantity is at this end of its interval.
            sides = own.iter().zip(&sum).map(|(own, sum)| own.and(*sum, -shared).side(raises)).collect();
        }
        variance.max(0.0).sqrt()
    }
}

/// The probability of unknowns given a reading of the sum of `masses`, within the relative `error` at 90 %.
struct Posterior<'a> {
    unknowns: &'a Unknowns,
    masses: &'a [Quantity],
    reading: f64,
    error: f64,
}

impl Posterior<'_> {
    /// The logarithm of the factor that the sum lacks.
    fn lacking(&self, z: &[f64]) -> f64 {
        (self.reading / total(self.masses, z)).ln()
    }

    /// The negative logarithm of the probability, up to a factor and a constant.
    fn misfit(&self, z: &[f64]) -> f64 {
        self.error * self.error * dot(z, z) + self.lacking(z).powi(2)
    }

    /// The most likely unknowns that are found from `z` uphill, and their misfit.
    fn most_likely_near(&self, mut z: Vec<f64>) -> (Vec<f64>, f64) {
        let bounds = &self.unknowns.bounds;
        z.iter_mut().zip(bounds).for_each(|(z, [low, high])| *z = z.clamp(*low, *high));
        let mut misfit = self.misfit(&z);
        for _ in 0..STEPS {
            let lacking = self.lacking(&z);
            let effects = effects(self.masses, &z);
            let slopes: Vec<f64> =
                effects.iter().zip(&z).map(|(effect, z)| effect.slope_towards(*z, lacking > 0.0)).collect();
            let goal = goal(bounds, &z, &slopes, lacking, self.error);
            let (next, of_next) = self.best_on_the_way(&z, misfit, &goal);
            let gain = misfit - of_next;
            if gain > 0.0 {
                (z, misfit) = (next, of_next);
            }
            if gain.is_nan() || gain <= LEAST_GAIN * (misfit + gain) {
                break;
            }
        }
        (z, misfit)
    }

    /// The best of the places that halve the way from `z`, whose misfit is `start`, to `goal` again and again, and its misfit.
    /// Once one is better than `z`, the first that is no improvement ends the search.
    fn best_on_the_way(&self, z: &[f64], start: f64, goal: &[f64]) -> (Vec<f64>, f64) {
        let place_after = |halvings: i32| {
            let share = 0.5f64.powi(halvings);
            // Beyond the middle, the slope is another one.
            let stepped = |(z, goal): (&f64, &f64)| match z + share * (goal - z) {
                beyond if z.abs() > AT_MIDDLE && beyond * z < 0.0 => 0.0,
                stepped => stepped,
            };
            let place: Vec<f64> = z.iter().zip(goal).map(stepped).collect();
            let misfit = self.misfit(&place);
            (place, misfit)
        };
        let mut best = place_after(0);
        for halvings in 1..PLACES {
            let next = place_after(halvings);
            if next.1 < best.1 {
                best = next;
            } else if best.1 < start {
                break;
            }
        }
        best
    }
}

/// The most likely unknowns within their bounds, given what is `lacking` in the logarithm of the sum at `z`, if the sum
/// changed with these slopes everywhere.
fn goal(bounds: &[[f64; 2]], z: &[f64], slopes: &[f64], lacking: f64, error: f64) -> Vec<f64> {
    let mut goal = vec![0.0; z.len()];
    let mut free = slopes.to_vec();
    let mut is_fixed = vec![false; z.len()];
    let mut target = lacking + dot(slopes, z);
    // What would go beyond its bound stays there, and the others have to go farther.
    loop {
        let norm = dot(&free, &free) + error * error;
        let scale = if norm > 0.0 { target / norm } else { 0.0 };
        let is_beyond = |&n: &usize| !is_fixed[n] && !(bounds[n][0]..=bounds[n][1]).contains(&(slopes[n] * scale));
        let beyond: Vec<usize> = (0..z.len()).filter(is_beyond).collect();
        if beyond.is_empty() {
            (0..z.len()).filter(|&n| !is_fixed[n]).for_each(|n| goal[n] = slopes[n] * scale);
            return goal;
        }
        for n in beyond {
            goal[n] = (slopes[n] * scale).clamp(bounds[n][0], bounds[n][1]);
            target -= slopes[n] * goal[n];
            free[n] = 0.0;
            is_fixed[n] = true;
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The least and the greatest sum that any combination of the unknowns' ends gives.
pub fn extremes(unknowns: &Unknowns, masses: &[Quantity]) -> [f64; 2] {
    let used = used(masses);
    let extreme = |raises: bool| {
        let is_beyond = |new: f64, old: f64| if raises { new > old } else { new < old };
        let mut z = vec![0.0; unknowns.count()];
        let mut extreme = total(masses, &z);
        // How an unknown changes the sum depends on where the others are.
        loop {
            let before = extreme;
            for &n in &used {
                for end in [-1.0, 0.0, 1.0] {
                    let old = std::mem::replace(&mut z[n], end);
                    match total(masses, &z) {
                        new if is_beyond(new, extreme) => extreme = new,
                        _ => z[n] = old,
                    }
                }
            }
            if extreme == before {
                return extreme;
            }
        }
    };
    [extreme(false), extreme(true)]
}

fn total(quantities: &[Quantity], z: &[f64]) -> f64 {
    quantities.iter().map(|quantity| quantity.mid * quantity.log_factor(z).exp()).sum()
}

/// The unknowns on which any of the quantities depends, in order.
fn used(quantities: &[Quantity]) -> Vec<usize> {
    let mut used: Vec<usize> = quantities.iter().flat_map(|q| q.effects.iter().map(|(unknown, _)| *unknown)).collect();
    used.sort_unstable();
    used.dedup();
    used
}

/// The sum as one quantity around `z`: its effects are the changes of its logarithm if a single unknown moves by one.
fn summed(quantities: &[Quantity], z: &[f64]) -> Quantity {
    let mid = total(quantities, z);
    let used = used(quantities);
    let moved = |unknown: usize, end: fn(&Effect) -> f64| {
        let moved_quantity = |quantity: &Quantity| {
            let change: f64 = quantity.effects.iter().filter(|(own, _)| *own == unknown).map(|(_, e)| end(e)).sum();
            quantity.mid * (quantity.log_factor(z) + change).exp()
        };
        (quantities.iter().map(moved_quantity).sum::<f64>() / mid).ln()
    };
    let effect = |unknown| (unknown, Effect { low: moved(unknown, |e| e.low), high: moved(unknown, |e| e.high) });
    Quantity { mid, effects: if mid > 0.0 { used.into_iter().map(effect).collect() } else { Vec::new() } }
}

/// By unknown, how the logarithm of the sum changes around `z`: the mean over its terms, weighted by their size. None
/// changes a sum of 0.
fn effects(quantities: &[Quantity], z: &[f64]) -> Vec<Effect> {
    let mid = total(quantities, z);
    let mut sum = vec![Effect::NONE; z.len()];
    if mid <= 0.0 {
        return sum;
    }
    for quantity in quantities {
        let share = quantity.mid * quantity.log_factor(z).exp() / mid;
        for (unknown, effect) in &quantity.effects {
            sum[*unknown] = sum[*unknown].and(*effect, share);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn symmetric(half_width: f64) -> Effect {
        Effect { low: -half_width, high: half_width }
    }

    fn mass(mid: f64, effects: &[(usize, f64)]) -> Quantity {
        Quantity { mid, effects: effects.iter().map(|(unknown, width)| (*unknown, symmetric(*width))).collect() }
    }

    fn unknowns(count: u32) -> Unknowns {
        let mut unknowns = Unknowns::default();
        (0..count).for_each(|n| {
            unknowns.number(if n == 0 { Source::Method } else { Source::Density }, &Owner::Part(n));
        });
        unknowns
    }

    #[test]
    fn independent_unknowns_add_up_in_quadrature() {
        let known = Belief::prior(&unknowns(2)).of(&mass(2.0, &[(0, 0.3), (1, 0.4)]));
        // sqrt(0.09 + 0.16) = 0.5, exactly but for rounding.
        assert!((known.high - 2.0 * 0.5f64.exp()).abs() < 1e-12 && (known.low - 2.0 * (-0.5f64).exp()).abs() < 1e-12);
    }

    #[test]
    fn an_unknown_that_two_masses_share_widens_their_sum_as_each() {
        let unknowns = unknowns(3);
        let prior = Belief::prior(&unknowns);
        let shared = prior.of_sum(&[mass(1.0, &[(0, 0.3)]), mass(3.0, &[(0, 0.3)])]);
        assert!((shared.high - 4.0 * 0.3f64.exp()).abs() < 1e-12);
        let apart = prior.of_sum(&[mass(2.0, &[(1, 0.3)]), mass(2.0, &[(2, 0.3)])]);
        assert!(apart.high < 4.0 * 0.23f64.exp(), "independent errors partly cancel: {apart:?}");
        let [low, high] = extremes(&unknowns, &[mass(2.0, &[(1, 0.3)]), mass(2.0, &[(2, 0.3)])]);
        assert!((high - 4.0 * 0.3f64.exp()).abs() < 1e-12 && (low - 4.0 * (-0.3f64).exp()).abs() < 1e-12);
    }

    /// Closed form of two independent normal logarithms a, b of equal masses with half-widths 0.1 and 0.2, if their sum
    /// is known exactly and is the middle one: to first order da + db = 0, so both have the half-width
    /// 0.1 * 0.2 / sqrt(0.1^2 + 0.2^2).
    #[test]
    fn a_reading_in_the_middle_narrows_all_and_moves_none() {
        let masses = [mass(1.0, &[(1, 0.1)]), mass(1.0, &[(2, 0.2)])];
        let belief = Belief::after(&unknowns(3), &masses, 2.0, 0.0);
        let expected = 0.02 / 0.05f64.sqrt();
        for mass in &masses {
            let known = belief.of(mass);
            assert!((known.mid - 1.0).abs() < 1e-9, "{known:?}");
            assert!((known.high.ln() - expected).abs() < 1e-6, "{known:?}, expected {expected}");
        }
        let sum = belief.of_sum(&masses);
        // What is left is of second order: the sum of e^x and e^-x is not quite 2.
        assert!((sum.high - sum.low).abs() < expected * expected, "{sum:?}");
    }

    #[test]
    fn a_reading_moves_most_what_is_least_known() {
        let masses = [mass(1.0, &[(1, 0.05)]), mass(1.0, &[(2, 0.5)])];
        let belief = Belief::after(&unknowns(3), &masses, 2.4, 0.01);
        let [sure, unsure] = masses.each_ref().map(|mass| belief.of(mass).mid);
        // Against an error of 1 %, the prior weighs (0.01 / 0.25)^2: some 0.2 % of the difference.
        assert!((sure + unsure - 2.4).abs() < 0.003, "{sure} + {unsure}");
        assert!(sure - 1.0 < 0.02 && unsure > 1.38, "{sure}, {unsure}");
    }

    /// A filling that has reached its hollow, and a wall that has to carry the rest of the reading.
    #[test]
    fn an_unknown_at_its_bound_stays_within_the_reading() {
        let mut unknowns = unknowns(3);
        let share = Effect { low: (0.7f64 / 0.8).ln(), high: (0.9f64 / 0.8).ln() }.wider(2.4);
        let full = (1.0f64 / 0.8).ln();
        unknowns.limit(2, share, full);
        let wall = mass(1.0, &[(1, 0.1)]);
        let filling = Quantity { mid: 0.8, effects: vec![(2, share.at_most(full))] };
        let masses = [wall, filling];
        for reading in [1.8, 2.0, 2.08, 2.1] {
            let belief = Belief::after(&unknowns, &masses, reading, 0.01);
            let sum = belief.of_sum(&masses);
            assert!((sum.mid / reading - 1.0).abs() < 0.01, "{sum:?} for {reading}");
            assert!(sum.low > 0.985 * sum.mid && sum.high < 1.015 * sum.mid, "{sum:?} for {reading}");
            assert!(belief.of(&masses[1]).mid <= 1.0 + 1e-9);
        }
    }

    /// The scale is all but unknown; a solid grows with its cube, a wall with its square, and both have a one-sided
    /// unknown that the reading hardly moves.
    #[test]
    fn the_sum_is_as_certain_as_the_reading_whatever_else_is_not() {
        let mass_of = |power: f64, own| Quantity {
            mid: 1.0,
            effects: vec![(0, symmetric(7.0 * power)), (own, Effect { low: -0.1, high: 0.8 })],
        };
        let masses = [mass_of(3.0, 1), mass_of(2.0, 2)];
        for reading in [2.0, 1.5, 3.0] {
            let belief = Belief::after(&unknowns(3), &masses, reading, 0.01);
            let sum = belief.of_sum(&masses);
            assert!((sum.mid / reading - 1.0).abs() < 1e-3, "{sum:?} for {reading}");
            for end in [sum.high / sum.mid, sum.mid / sum.low] {
                assert!((end.ln() / 0.01 - 1.0).abs() < 0.02, "{sum:?} for {reading}");
            }
            // A part can be heavier only if the other is lighter.
            let part = belief.of(&masses[0]);
            assert!(part.high < 1.7 * part.mid && part.low > part.mid / 1.7, "{part:?} for {reading}");
        }
    }

    /// At its middle, a wall makes a filled shell lighter if it gets thinner and if it gets thicker; if it gets much thinner,
    /// the filling outweighs it.
    #[test]
    fn a_reading_is_explained_although_both_slopes_of_an_unknown_lower_the_sum() {
        let wall = Quantity { mid: 1.0, effects: vec![(0, Effect { low: -2.07, high: 0.27 }), (1, symmetric(0.1))] };
        let filling = Quantity { mid: 1.0, effects: vec![(0, Effect { low: 1.0, high: -0.42 }), (2, symmetric(0.2))] };
        let masses = [wall, filling];
        let [least, most] = extremes(&unknowns(3), &masses);
        for step in 0..=20 {
            let reading = least + (most - least) * f64::from(step) / 20.0;
            let sum = Belief::after(&unknowns(3), &masses, reading, 0.01).of_sum(&masses);
            assert!((sum.mid / reading).ln().abs() < 0.01, "{sum:?} for {reading}");
        }
        // The wall alone explains this one, about one half-width from its middle.
        let belief = Belief::after(&unknowns(3), &masses, 2.94, 0.01);
        assert!(dot(&belief.middle, &belief.middle) < 1.1, "{:?}", belief.middle);
    }

    /// A wall whose bound is nearer than where the reading would have it.
    #[test]
    fn a_reading_is_reached_although_an_unknown_meets_its_bound_on_the_way() {
        let mass_of = |mid, effects: &[(usize, f64, f64)]| Quantity {
            mid,
            effects: effects.iter().map(|&(unknown, low, high)| (unknown, Effect { low, high })).collect(),
        };
        let wall =
            [(0, -0.15, 0.15), (1, -2.178_718_75, 1.107_568_49), (2, -0.5, 0.05), (3, -0.030_459_21, 0.029_558_8)];
        let filling = [
            (0, -0.106_585_97, 0.106_138_97),
            (1, 0.038_816_95, -0.094_825_51),
            (2, -0.25, 0.025),
            (4, -0.973_113_16, 0.690_434_97),
            (5, -0.020_202_71, 0.019_802_63),
        ];
        let masses = [mass_of(0.008_456_15, &wall), mass_of(0.003_653_95, &filling)];
        let mut unknowns = unknowns(6);
        unknowns.bounds[1] = [-1.124_884_16, 2.846_750_4];
        unknowns.bounds[4][1] = 1.156_525_11;
        let (reading, error) = (0.001_822_481_845_663_571, 0.007_374);
        let sum = Belief::after(&unknowns, &masses, reading, error).of_sum(&masses);
        assert!((sum.mid / reading).ln().abs() < error, "{sum:?} for {reading}");
    }

    /// One side of its middle, an unknown hardly matters; its interval still reaches over to the other side.
    #[test]
    fn an_interval_after_weighing_does_not_jump_where_a_slope_changes() {
        let kinked = |middle: f64| Belief {
            middle: vec![middle, 0.0],
            reading: Some(Reading {
                effects: vec![Effect { low: -0.02, high: 0.01 }, symmetric(0.5)],
                error: 0.01,
                bounds: unknowns(2).bounds,
            }),
        };
        let part = Quantity { mid: 1.0, effects: vec![(0, Effect { low: -2.58, high: 1.0 })] };
        let [below, above] = [-0.0011, 0.0011].map(|middle| kinked(middle).of(&part));
        assert!(
            (below.low / above.low).ln().abs() < 0.01 && (below.high / above.high).ln().abs() < 0.01,
            "{below:?}, {above:?}"
        );
    }

    #[test]
    fn the_extremes_are_those_of_all_unknowns_together() {
        // A thin wall makes the filling larger, but if that is light, it makes the sum smaller.
        let wall = Quantity { mid: 1.0, effects: vec![(0, symmetric(0.2))] };
        let filling = Quantity { mid: 1.0, effects: vec![(0, Effect { low: 0.2, high: -0.25 }), (1, symmetric(1.0))] };
        let [least, most] = extremes(&unknowns(2), &[wall, filling]);
        let sum_at = |wall: f64, filling: f64| wall.exp() + filling.exp();
        assert!((least - sum_at(-0.2, 0.2 - 1.0)).abs() < 1e-12, "{least}");
        assert!((most - sum_at(-0.2, 0.2 + 1.0)).abs() < 1e-12, "{most}");
    }

    #[test]
    fn an_unknown_whose_ends_both_lower_the_sum_does_not_raise_it() {
        let masses = [Quantity { mid: 1.0, effects: vec![(0, Effect { low: -0.2, high: -0.1 })] }];
        let [least, most] = extremes(&unknowns(1), &masses);
        assert!((least.ln() + 0.2).abs() < 1e-12 && (most - 1.0).abs() < 1e-12, "{least} to {most}");
        let sum = Belief::prior(&unknowns(1)).of_sum(&masses);
        assert!((sum.low.ln() + 0.2).abs() < 1e-12 && (sum.high - 1.0).abs() < 1e-12, "{sum:?}");
        let weighed = Belief::after(&unknowns(1), &masses, 1.0, 0.5).of_sum(&masses);
        assert!((weighed.high - 1.0).abs() < 1e-12 && weighed.low > sum.low, "{weighed:?}");
    }

    #[test]
    fn a_filling_shrinks_as_its_wall_grows() {
        let wall = Quantity { mid: 1.0, effects: vec![(0, Effect { low: -0.5, high: 0.5 })] };
        let filling = Quantity { mid: 1.0, effects: vec![(0, Effect { low: 0.5, high: -0.5 })] };
        let sum = Belief::prior(&unknowns(1)).of_sum(&[wall, filling]);
        // The hyperbolic cosine of 0.5 is 1.128: what one gains the other loses, to first order.
        assert!((sum.high - 2.0 * 0.5f64.cosh()).abs() < 1e-9, "{sum:?}");
    }
}
