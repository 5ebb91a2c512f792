//! The masses of all parts and fillings, with the unknowns that they depend on.

use super::Weighable;
use super::moments::Moments;
use super::unknowns::{Belief, Effect, OVERCONFIDENCE, Owner, Quantity, Source, Unknowns, extremes};
use crate::parts::compose::volume::Volume;
use crate::query::Form;
use crate::units::{Estimate, Range};

/// The mass of a part or of a filling.
pub struct Weight {
    /// Index of the part among the weighables.
    pub of: usize,
    pub is_filling: bool,
    /// m3.
    pub volume: Quantity,
    /// kg/m3.
    pub density: Quantity,
    /// kg.
    pub mass: Quantity,
    /// m; only for walls.
    pub wall: Option<Quantity>,
    /// The share of the hollow; only for fillings.
    pub share: Option<Quantity>,
}

/// All masses, before or after the object was weighed.
pub struct Weights {
    unknowns: Unknowns,
    pub belief: Belief,
    /// Parts first, then fillings.
    pub all: Vec<Weight>,
    /// What is weighed with them although no part shows it, kg.
    unseen: Vec<Quantity>,
    /// Metres in a scene unit.
    pub scale: f64,
    /// The same as a quantity, unless it is exact.
    uncertain_scale: Option<Quantity>,
    /// The same as it is after a weighing, if there was one.
    weighed_scale: Option<Estimate>,
}

/// The length of a scene unit.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    pub meters_per_unit: f64,
    /// Its 90 % interval; `None` if it is exact.
    pub range: Option<Range>,
}

impl Scale {
    /// A scale that will be known only from the mass.
    pub fn to_be_found(meters_per_unit: f64) -> Self {
        let factor = ANY_SCALE.exp();
        Self { meters_per_unit, range: Some(Range::new(meters_per_unit / factor, meters_per_unit * factor)) }
    }

    /// What an error of the scale does to a quantity that grows with this power of it; `None` if the scale is exact.
    fn effect(self, power: f64, unknowns: &mut Unknowns) -> Option<(usize, Effect)> {
        let Range { low, high } = self.range?;
        let unknown = unknowns.number(Source::Scale, &Owner::Object);
        Some((unknown, Effect::of(Estimate::new(low, self.meters_per_unit, high)).wider(power)))
    }
}

/// What a kitchen scale shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weighing {
    pub kg: f64,
    /// Half-width of its 90 % interval.
    pub error_kg: f64,
}

impl Weighing {
    /// By how much the reading is outside of these bounds, kg.
    pub fn off(self, [least, most]: [f64; 2]) -> f64 {
        (least - self.kg).max(self.kg - most).max(0.0)
    }

    /// Whether it may be of something with these bounds.
    pub fn is_possible(self, bounds: [f64; 2]) -> bool {
        self.off(bounds) <= self.error_kg
    }

    /// The half-width of the interval of its logarithm.
    pub fn relative_error(self) -> f64 {
        self.error_kg / self.kg
    }
}

/// The mass of a thing that no part shows and that has this number.
pub fn unseen(number: usize, mass_kg: Range, unknowns: &mut Unknowns) -> Quantity {
    let unknown = unknowns.number(Source::Unnumbered, &Owner::Thing(number));
    let mass = mass_kg.geometric_estimate();
    Quantity { mid: mass.mid, effects: vec![(unknown, Effect::of(mass))] }
}

/// What all fillings of an object weigh together by what is printed on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrintedContents {
    pub kg: f64,
    /// Of its interval, on a logarithmic scale.
    pub half_width: f64,
}

impl PrintedContents {
    /// The mass of a filling that has this share in it.
    pub fn share(self, share: f64, unknowns: &mut Unknowns) -> Quantity {
        let unknown = unknowns.number(Source::Filling, &Owner::Object);
        let effect = Effect { low: -self.half_width, high: self.half_width };
        Quantity { mid: self.kg * share, effects: vec![(unknown, effect)] }
    }
}

/// Logarithm of the factor by which an unknown scale may be off.
const ANY_SCALE: f64 = 7.0;

impl Weights {
    /// The masses of `weighables` in kilograms.
    pub fn new(weighables: &[Weighable], scale: Scale) -> Self {
        let mut unknowns = Unknowns::default();
        let all = weights(weighables, scale, &mut unknowns);
        let uncertain_scale = scale.effect(1.0, &mut unknowns);
        let uncertain_scale =
            uncertain_scale.map(|effect| Quantity { mid: scale.meters_per_unit, effects: vec![effect] });
        let (belief, unseen) = (Belief::prior(&unknowns), Vec::new());
        Self { belief, unknowns, all, unseen, scale: scale.meters_per_unit, uncertain_scale, weighed_scale: None }
    }

    /// Takes over what the fillings weigh by what is printed on the object.
    pub fn print(&mut self, contents: PrintedContents) {
        let fillings: Vec<&mut Weight> = self.all.iter_mut().filter(|weight| weight.is_filling).collect();
        let all: f64 = fillings.iter().map(|weight| weight.mass.mid).sum();
        for weight in fillings {
            weight.density = Quantity { mid: weight.density.mid * contents.kg / all, effects: Vec::new() };
            weight.mass = contents.share(weight.mass.mid / all, &mut self.unknowns);
        }
        self.belief = Belief::prior(&self.unknowns);
    }

    /// Takes over the mass that parts and fillings are believed to have together.
    pub fn believe(&mut self, together_kg: Estimate) {
        self.belief = Belief::in_which(&self.unknowns, &self.masses(), together_kg);
    }

    /// The bounds of the mass of everything, which no combination of the unknowns' ends goes beyond.
    pub fn bounds(&self) -> [f64; 2] {
        extremes(&self.unknowns, &self.masses())
    }

    /// The mass of everything.
    pub fn expected(&self) -> Estimate {
        self.belief.of_sum(&self.masses())
    }

    /// Takes into account what a kitchen scale shows. On it are also the things that no part shows: number and mass of each.
    pub fn weigh(&mut self, weighing: Weighing, things: &[(usize, Range)]) {
        self.unseen = things.iter().map(|(number, mass)| unseen(*number, *mass, &mut self.unknowns)).collect();
        self.belief = Belief::after(&self.unknowns, &self.masses(), weighing.kg, weighing.relative_error());
        self.weighed_scale = self.uncertain_scale.as_ref().map(|scale| self.of(scale));
    }

    /// By how much everything is heavier than parts and fillings, as a factor.
    pub fn unseen_factor(&self) -> f64 {
        let unseen: f64 = self.unseen.iter().map(|mass| self.of(mass).mid).sum();
        let shown: f64 = self.all.iter().map(|weight| self.of(&weight.mass).mid).sum();
        1.0 + unseen / shown
    }

    /// Metres in a scene unit, unless they are exact: as they were given, or after a weighing. What is otherwise believed of the mass
    /// changes volumes, as an error of the surface does, but no length: whatever is measured or drawn in metres, of this object and
    /// of those beside it, has the scale that was given.
    pub fn uncertain_scale(&self) -> Option<Estimate> {
        let given = || Some(Belief::prior(&self.unknowns).of(self.uncertain_scale.as_ref()?));
        self.weighed_scale.or_else(given)
    }

    /// Metres in a scene unit.
    pub fn length(&self) -> f64 {
        self.uncertain_scale().map_or(self.scale, |scale| scale.mid)
    }

    /// The moments of everything together, weighted by mass in kg; `None` if nothing has mass. World frame, scene units.
    pub fn whole(&self, weighables: &[Weighable]) -> Option<Moments> {
        let mut all = Vec::new();
        for weight in &self.all {
            let weighable = &weighables[weight.of];
            let mass = self.of(&weight.mass).mid;
            let moments: Vec<Moments> = match weighable.hollow.filter(|_| weight.is_filling) {
                Some(hollow) => vec![hollow.moments],
                None => weighable.bodies.iter().map(|body| body.moments).collect(),
            };
            let volume: f64 = moments.iter().map(|moments| moments.volume).sum();
            all.extend(moments.into_iter().map(|moments| (mass / volume, moments)));
        }
        Moments::combined(&all)
    }

    pub fn of(&self, quantity: &Quantity) -> Estimate {
        self.belief.of(quantity)
    }

    pub fn masses(&self) -> Vec<Quantity> {
        self.all.iter().map(|weight| &weight.mass).chain(&self.unseen).cloned().collect()
    }

    /// The interval of a mass if only the unknowns of one source were uncertain.
    pub fn by_source(&self, mass: &Quantity) -> Vec<(Source, Estimate)> {
        self.sum_by_source(std::slice::from_ref(mass))
    }

    /// As [`Self::by_source`], of a sum.
    pub fn sum_by_source(&self, masses: &[Quantity]) -> Vec<(Source, Estimate)> {
        self.belief.by_source(&self.unknowns, masses)
    }
}

/// The masses of `weighables` in kilograms: parts first, then fillings. Those of other weighables over the same unknowns can be
/// added to them.
pub fn weights(weighables: &[Weighable], scale: Scale, unknowns: &mut Unknowns) -> Vec<Weight> {
    let meters = scale.meters_per_unit;
    let mut all = Vec::new();
    for (of, weighable) in weighables.iter().enumerate() {
        all.push(part(of, weighable, meters, unknowns));
    }
    for (of, weighable) in weighables.iter().enumerate() {
        all.extend(filling(of, weighable, meters, unknowns));
    }
    for weight in &mut all {
        // The area of a wall grows with the square of the scale, its thickness not at all.
        let power = if weight.wall.is_some() { 2.0 } else { 3.0 };
        let effect = scale.effect(power, unknowns);
        weight.volume.effects.extend(effect);
        weight.mass.effects.extend(effect);
    }
    all
}

fn part(of: usize, weighable: &Weighable, scale: f64, unknowns: &mut Unknowns) -> Weight {
    let label = weighable.label;
    let owner = Owner::Part(label.id);
    let wall_of = Owner::Part(weighable.sleeve.unwrap_or(label.id));
    let volume = volume(weighable.volume, scale, &owner, &wall_of, unknowns);
    // A mixed part has a density of its own; all parts of one material have the same.
    let (dense, guessed) = match label.form {
        Form::Mixed => (owner.clone(), OVERCONFIDENCE),
        Form::Solid | Form::Shell { .. } => (Owner::Material(label.material.clone()), 1.0),
    };
    let density = Quantity {
        mid: label.density_kg_m3.mid,
        effects: vec![(unknowns.number(Source::Density, &dense), Effect::of(label.density_kg_m3).wider(guessed))],
    };
    let wall = weighable.shape.thickness.filter(|_| weighable.is_wall).map(|thickness| Quantity {
        mid: thickness.mid * scale,
        effects: vec![(unknowns.number(Source::Wall, &owner), Effect::of(thickness).wider(OVERCONFIDENCE))],
    });
    Weight { of, is_filling: false, mass: product(&volume, &density), volume, density, wall, share: None }
}

fn filling(of: usize, weighable: &Weighable, scale: f64, unknowns: &mut Unknowns) -> Option<Weight> {
    let (hollow, filled) = weighable.filling()?;
    let owner = Owner::Part(weighable.label.id);
    let full = (1.0 / filled.share.mid).ln();
    let likely = Effect::of(filled.share).wider(OVERCONFIDENCE).at_most(full);
    let number = unknowns.number(Source::Filling, &owner);
    unknowns.limit(number, likely, full);
    let share = Quantity { mid: filled.share.mid, effects: vec![(number, likely)] };
    let volume = product(&volume(&hollow.volume, scale, &owner, &owner, unknowns), &share);
    let density = Quantity {
        mid: filled.density_kg_m3.mid,
        effects: vec![(
            unknowns.number(Source::Filling, &Owner::Filling(filled.filling.clone())),
            Effect::of(filled.density_kg_m3),
        )],
    };
    Some(Weight {
        of,
        is_filling: true,
        mass: product(&volume, &density),
        volume,
        density,
        wall: None,
        share: Some(share),
    })
}

/// The volume of the part `owner`, which depends on the wall of `wall_of`.
fn volume(volume: &Volume, scale: f64, owner: &Owner, wall_of: &Owner, unknowns: &mut Unknowns) -> Quantity {
    let wall = unknowns.number(Source::Wall, wall_of);
    unknowns.limit(wall, volume.wall, volume.wall_most);
    let effects = [
        (unknowns.number(Source::Method, &Owner::Object), volume.method),
        (wall, volume.wall),
        (unknowns.number(Source::UnseenDepth, owner), volume.unseen),
    ];
    Quantity {
        mid: volume.mid * scale.powi(3),
        effects: effects.into_iter().filter(|(_, e)| *e != Effect::NONE).collect(),
    }
}

fn product(a: &Quantity, b: &Quantity) -> Quantity {
    Quantity { mid: a.mid * b.mid, effects: [a.effects.clone(), b.effects.clone()].concat() }
}
