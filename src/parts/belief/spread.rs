//! What is believed of a mass: a density of its logarithm.

use crate::units::{Estimate, Range};

/// A density of the logarithm of a mass, with half of its probability on either side of the middle. Each half is that of
/// Student's t with three degrees of freedom: a shape, or a model's guess, is now and then off by much more than its interval
/// says, and where two of them disagree, neither should be explained away by a tail that falls as fast as a normal one's
/// (O'Hagan, *On outlier rejection phenomena in Bayes inference*, 1979).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// ln(kg).
    middle: f64,
    /// Scale of the half below, and of the one above.
    below: f64,
    above: f64,
}

/// The 95th percentile of Student's t with three degrees of freedom.
const END: f64 = 2.353_363;
/// The 95th percentile of a normal density.
const NORMAL_END: f64 = 1.644_853_6;
/// 2 / (pi sqrt(3)): its density at 0.
const PEAK: f64 = 0.367_552_6;
/// No mass is known better than this from a shape or a guess: the half-width of an interval's logarithm.
const NARROWEST: f64 = 0.005;
/// A part whose wall has no thickness weighs nothing, which has no logarithm: less than any scale shows stands for it.
const LEAST_KG: f64 = 1e-9;

impl Spread {
    /// The belief whose 5th, 50th and 95th percentiles are those of the estimate, kg.
    pub fn of(mass_kg: Estimate) -> Self {
        let half = |ratio: f64| if ratio > 0.0 && ratio.is_finite() { ratio.ln().max(NARROWEST) / END } else { 1.0 };
        let Estimate { low, mid, high } = mass_kg;
        Self { middle: mid.max(LEAST_KG).ln(), below: half(mid / low), above: half(high / mid) }
    }

    /// The belief whose 5th and 95th percentiles are the ends of the range, kg, and which is symmetric in the logarithm.
    pub fn of_range(range: Range) -> Self {
        Self::of(Estimate::new(range.low, range.geometric_mid(), range.high))
    }

    /// The density of ln(kg).
    pub fn density(&self, ln_kg: f64) -> f64 {
        let scale = if ln_kg < self.middle { self.below } else { self.above };
        let u = (ln_kg - self.middle) / scale;
        PEAK / (1.0 + u * u / 3.0).powi(2) / scale
    }

    /// The mass, kg, below which this share of the belief lies, in (0, 1).
    pub fn quantile(&self, share: f64) -> f64 {
        let scale = if share < 0.5 { self.below } else { self.above };
        (self.middle + scale * student_quantile(share)).exp()
    }

    /// The same belief about a mass whose middle is that of `other`.
    pub fn moved_to(&self, other: &Self) -> Self {
        Self { middle: other.middle, ..*self }
    }

    /// Logarithms between which nearly all of it lies.
    fn reach(&self) -> [f64; 2] {
        // Less than 0.1 % is beyond on either side.
        const FAR: f64 = 12.0;
        [self.middle - FAR * self.below, self.middle + FAR * self.above]
    }
}

/// The power of the densities in a product. Without it, two of these densities that agree would have an interval of 0.53 of the width of
/// each, as if tails that are there for errors made agreement say more. With it, it is 0.70 of the width, as for two normal
/// densities, whose product needs no power.
const POWER: f64 = 0.7;

/// The density of what two beliefs say together, up to a factor; that of the first if it is the only one.
pub fn joint(a: f64, b: Option<f64>) -> f64 {
    b.map_or(a, |b| (a * b).powf(POWER))
}

/// The mean of a density over a normal one of the logarithm, in which 90 % are within `half_width` of the middle: how probable a reading is
/// that may be off by as much.
pub fn mean_density(density: impl Fn(f64) -> f64, middle: f64, half_width: f64) -> f64 {
    /// A step is far smaller than either density is wide, unless the reading is useless.
    const STEPS: i32 = 1000;
    /// Standard deviations, beyond which less than 0.01 % lies.
    const FAR: f64 = 4.0;
    let deviation = half_width / NORMAL_END;
    let (mut sum, mut weights) = (0.0, 0.0);
    for step in 0..=STEPS {
        let z = FAR * (2.0 * f64::from(step) / f64::from(STEPS) - 1.0);
        let weight = (-0.5 * z * z).exp();
        sum += weight * density(middle + z * deviation);
        weights += weight;
    }
    sum / weights
}

/// What several ranges of 90 %, independent of each other, say together of one positive quantity: the product of their densities.
pub fn together(ranges: &[Range]) -> Estimate {
    let spreads: Vec<Spread> = ranges.iter().map(|range| Spread::of_range(*range)).collect();
    let mut curve = Curve::over(spreads.iter());
    let power = if spreads.len() > 1 { POWER } else { 1.0 };
    let of_all = |at: f64| spreads.iter().map(|spread| spread.density(at).powf(power)).product();
    curve.density = curve.places().map(of_all).collect();
    curve.percentiles()
}

/// The quantile of Student's t with three degrees of freedom. Its distribution function is
/// 1/2 + (u / (1 + u^2) + atan u) / pi with u = t / sqrt(3).
fn student_quantile(share: f64) -> f64 {
    const HALVINGS: usize = 80;
    // Only a share of 1e-17 lies beyond.
    let [mut low, mut high] = [-1e6, 1e6];
    for _ in 0..HALVINGS {
        let middle: f64 = 0.5 * (low + high);
        let u = middle / f64::sqrt(3.0);
        if 0.5 + (u / (1.0 + u * u) + u.atan()) / std::f64::consts::PI < share {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// A mixture of densities, on a grid.
#[derive(Debug, Clone)]
pub struct Curve {
    first: f64,
    step: f64,
    density: Vec<f64>,
}

/// Places of a grid: over the four powers of ten that a doubtful object may span, one for every 0.3 %.
const PLACES: usize = 3000;

impl Curve {
    /// Nothing, on a grid that reaches over all of these.
    pub fn over<'a>(spreads: impl Iterator<Item = &'a Spread>) -> Self {
        let whole = |[low, high]: [f64; 2], [from, to]: [f64; 2]| [low.min(from), high.max(to)];
        let [low, high] = spreads.map(Spread::reach).fold([f64::INFINITY, f64::NEG_INFINITY], whole);
        Self { first: low, step: (high - low) / (PLACES - 1) as f64, density: vec![0.0; PLACES] }
    }

    /// The [joint] density of two beliefs, on the same grid.
    pub fn product(&self, a: &Spread, b: Option<&Spread>) -> Self {
        let density = |ln_kg: f64| joint(a.density(ln_kg), b.map(|b| b.density(ln_kg)));
        Self { density: self.places().map(density).collect(), ..*self }
    }

    pub fn integral(&self) -> f64 {
        self.density.iter().sum::<f64>() * self.step
    }

    /// The factor, on the same grid, by which this density becomes its geometric mean with another belief's, up to a constant. That is the
    /// logarithmic opinion pool with equal weights (Genest and Zidek, *Combining probability distributions*, 1986): the weights of judges
    /// who know the same, as two answers of one model do, make 1, so that agreement does not count as if it were news.
    pub fn pooled_with(&self, other: &Spread) -> Self {
        let factor = |(at, density): (f64, &f64)| (other.density(at) / density).sqrt();
        Self { density: self.places().zip(&self.density).map(factor).collect(), ..*self }
    }

    /// Multiplies it by another on the same grid.
    pub fn multiply(&mut self, other: &Self) {
        self.density.iter_mut().zip(&other.density).for_each(|(density, factor)| *density *= factor);
    }

    /// The value at ln(kg), between two places in proportion; beyond the grid, that of its end.
    pub fn at(&self, ln_kg: f64) -> f64 {
        let place = ((ln_kg - self.first) / self.step).clamp(0.0, (PLACES - 1) as f64);
        let below = (place as usize).min(PLACES - 2);
        let share = place - below as f64;
        self.density[below] * (1.0 - share) + self.density[below + 1] * share
    }

    /// Adds another density on the same grid.
    pub fn add(&mut self, other: &Self, weight: f64) {
        self.density.iter_mut().zip(&other.density).for_each(|(sum, more)| *sum += weight * more);
    }

    /// The 5th, 50th and 95th percentiles, kg.
    pub fn percentiles(&self) -> Estimate {
        self.percentiles_unless(0.0)
    }

    /// The same of something that is not there with the probability `nothing`.
    pub fn percentiles_unless(&self, nothing: f64) -> Estimate {
        let all: f64 = self.density.iter().sum();
        let mass_at = |share: f64| -> f64 {
            if share <= nothing {
                return 0.0;
            }
            let share = (share - nothing) / (1.0 - nothing);
            let mut below = 0.0;
            let place = self.density.iter().position(|density| {
                below += density;
                below >= share * all
            });
            // Within the place in which the share is reached.
            let place = place.unwrap_or(0);
            let over = if self.density[place] > 0.0 { (below - share * all) / self.density[place] } else { 0.0 };
            (self.first + self.step * (place as f64 + 0.5 - over)).exp()
        };
        Estimate::new(mass_at(0.05), mass_at(0.5), mass_at(0.95))
    }

    fn places(&self) -> impl Iterator<Item = f64> + use<> {
        let (first, step) = (self.first, self.step);
        (0..self.density.len()).map(move |place| first + step * place as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_those_that_were_given() {
        let given = Estimate::new(0.2, 0.3, 0.7);
        let spread = Spread::of(given);
        for (share, expected) in [(0.05, given.low), (0.5, given.mid), (0.95, given.high)] {
            assert!((spread.quantile(share) / expected).ln().abs() < 1e-6, "{share}: {}", spread.quantile(share));
        }
        let curve = Curve::over(std::iter::once(&spread)).product(&spread, None);
        assert!((curve.integral() - 1.0).abs() < 0.005, "{}", curve.integral());
        let found = curve.percentiles();
        for (found, given) in [(found.low, given.low), (found.mid, given.mid), (found.high, given.high)] {
            assert!((found / given).ln().abs() < 0.02, "{found} for {given}");
        }
    }

    #[test]
    fn a_reading_is_as_probable_as_what_it_may_mean() {
        // Normal densities of 90 % within 0.3 and 0.4 of their middles: their product is one of 0.5 at the distance of these.
        let normal = |half_width: f64, off: f64| {
            let deviation = half_width / NORMAL_END;
            (-0.5 * (off / deviation).powi(2)).exp() / (deviation * std::f64::consts::TAU.sqrt())
        };
        for off in [0.0, 0.5] {
            let found = mean_density(|ln_kg| normal(0.3, ln_kg), off, 0.4);
            assert!((found / normal(0.5, off) - 1.0).abs() < 1e-3, "{found}");
        }
    }

    #[test]
    fn what_may_not_be_there_may_weigh_nothing() {
        let spread = Spread::of_range(Range::new(0.2, 0.3));
        let curve = Curve::over(std::iter::once(&spread)).product(&spread, None);
        let found = curve.percentiles_unless(0.1);
        // The 40th of 90 parts is the middle of all.
        assert!(found.low == 0.0 && (found.mid / spread.quantile(4.0 / 9.0)).ln().abs() < 0.01, "{found:?}");
    }

    #[test]
    fn a_mass_of_nothing_is_a_belief_too() {
        let nothing = Spread::of(Estimate::exactly(0.0));
        let something = Spread::of_range(Range::new(0.1, 0.2));
        let curve = Curve::over([&nothing, &something].into_iter()).product(&nothing, Some(&something));
        let (Estimate { low, mid, high }, agreement) = (curve.percentiles(), curve.integral());
        assert!([low, mid, high, agreement].iter().all(|number| number.is_finite()), "{low} {mid} {high} {agreement}");
    }

    /// Of n ranges around the same middle, the interval is about the square root of n narrower; one that is off moves it little.
    #[test]
    fn several_ranges_say_more_than_one_and_an_outlier_little() {
        let range = |middle: f64| Range::new(middle / 1.3, middle * 1.3);
        let width = |found: Estimate| (found.high / found.low).ln() / (2.0 * 1.3_f64.ln());
        let [one, five] = [1, 5].map(|count| together(&vec![range(0.2); count]));
        assert!((width(one) - 1.0).abs() < 0.02 && (one.mid / 0.2).ln().abs() < 0.01, "{one:?}");
        assert!((0.25..0.5).contains(&width(five)) && (five.mid / 0.2).ln().abs() < 0.01, "{five:?}");
        let with_outlier = together(&[range(0.2), range(0.21), range(0.19), range(0.2), range(0.6)]);
        assert!((with_outlier.mid / 0.2).ln().abs() < 0.05, "{with_outlier:?}");
        // Two that disagree are wider together than one.
        assert!(width(together(&[range(0.1), range(0.9)])) > 1.0);
    }

    #[test]
    fn two_that_agree_are_narrower_together_as_two_normal_densities_are() {
        let both = together(&[Range::new(0.2, 0.3); 2]);
        let ratio = (both.high / both.low).ln() / 1.5_f64.ln();
        assert!((ratio - 0.5_f64.sqrt()).abs() < 0.02, "{ratio}");
    }

    #[test]
    fn of_two_that_disagree_by_far_neither_is_explained_away() {
        let [light, heavy] = [Spread::of_range(Range::new(0.09, 0.11)), Spread::of_range(Range::new(0.9, 1.1))];
        let curve = Curve::over([&light, &heavy].into_iter()).product(&light, Some(&heavy));
        let found = curve.percentiles();
        assert!(found.low < 0.12 && found.high > 0.85, "both are kept in mind: {found:?}");
        let with_itself = curve.product(&light, Some(&light));
        assert!(curve.integral() < 1e-3 * with_itself.integral());
    }
}
