//! Which parts move as rigid bodies, and which of them as one.
//!
//! A part is rigid if the strain that the scenario causes in it is invisible: less than [`INVISIBLE`]. The strain is
//! estimated as v / c + rho a l / E. The first term is the strain behind the wave that a stop from the speed v sends
//! through the material, c = sqrt(E / rho) (St. Venant; Goldsmith, *Impact*, 1960); the second is that of a column as
//! long as the object, l, under the acceleration a.
//!
//! A softer part is rigid too if it is a layer on rigid parts: one that lies within a grid cell of them moves with the
//! nodes that it shares with them, and the grid cannot show how it deforms. And so is one whose strain is hardly visible,
//! less than [`HARDLY_VISIBLE`], if the simulation would take too long otherwise: to soften it would be further from the
//! truth, because the strain of an impact grows with the root of the factor.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::super::error::SimulateError;
use super::super::filling::Parcel;
use super::super::material::Material;
use super::super::script::{Step, What, all_names, names_of_parts, parts_named};
use crate::materials::Law;

/// Strain below which a change of shape cannot be seen: in a film of 720 lines that the object fills, less than a pixel.
pub const INVISIBLE: f64 = 1e-3;

/// Share of a part's particles that must lie on rigid parts for it to be a layer.
const LAYER: f64 = 0.5;

/// Strain below which a change of shape is hardly visible: a few pixels of such a film.
pub const HARDLY_VISIBLE: f64 = 1e-2;

/// Half-cell cubes within which two particles share most of their nodes: a grid cell.
const NEAR_CUBES: i64 = 2;

/// The words of `--rigid` that are not parts.
pub const AUTO: &str = "auto";
pub const NEVER: &str = "never";

/// The load on the object in the scenario.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// The speed at which it hits the ground.
    pub impact_m_s: f64,
    /// Gravity, and what the scenario adds to it.
    pub acceleration_m_s2: f64,
    /// The object's longest side.
    pub longest_m: f64,
    /// Whether the scenario moves some places of the object relative to others.
    pub is_forced: bool,
}

impl Load {
    /// The load of a drop from `height_m` and of `steps`.
    pub fn new(height_m: f64, gravity_m_s2: f64, longest_m: f64, steps: &[Step]) -> Self {
        let norm = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let added = steps.iter().map(|step| match step.what {
            What::Force { weights } => norm(weights) * gravity_m_s2.abs(),
            What::Shake { acceleration_m_s2, .. } => norm(acceleration_m_s2),
            What::Wind { velocity_m_s, response_s } => norm(velocity_m_s) / response_s,
            What::Hold | What::Move { .. } | What::Draw { .. } | What::Turn { .. } => 0.0,
        });
        let guided: Vec<What> = steps.iter().map(|step| step.what).filter(What::guides).collect();
        Self {
            impact_m_s: (2.0 * gravity_m_s2.abs() * height_m).sqrt(),
            acceleration_m_s2: gravity_m_s2.abs() + added.fold(0.0, f64::max),
            longest_m,
            is_forced: guided.iter().any(|what| *what != guided[0]),
        }
    }

    /// The estimated strain of a part.
    pub fn strain(&self, material: &Material) -> f64 {
        let (density, stiffness) = (material.density_kg_m3, material.youngs_modulus_pa);
        self.impact_m_s * (density / stiffness).sqrt() + density * self.acceleration_m_s2 * self.longest_m / stiffness
    }
}

/// Whether a material flows under any load.
fn flows(material: &Material) -> bool {
    matches!(material.law, Law::Fluid | Law::DruckerPrager { .. } | Law::Snow { .. })
}

/// The rigid parts.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Per label: the number of the body that it belongs to; `None` if it deforms.
    pub body_of: Vec<Option<u32>>,
    /// Per label: why it is rigid; `None` if it deforms.
    pub reasons: Vec<Option<Reason>>,
}

/// Why a part is rigid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// Its deformation would be invisible.
    Stiff,
    /// It is a layer on rigid parts, too thin for the grid.
    Layer,
    /// Its deformation would be hardly visible, and computing it would take too long.
    TooSlow,
    /// The user asked for it.
    Asked,
    /// It fills a rigid shell.
    InShell,
}

/// Chooses the rigid ones of the parts that have `parcels` (metres, with labels), on a grid of `spacing_m`, as `--rigid`
/// says (`asked`). `auto` chooses those that strain by at most `visible`, and the layers on them.
///
/// # Errors
/// [`SimulateError::Rigid`] if `asked` names a part that does not exist or has no parcels; [`SimulateError::RigidAlone`] if
/// it holds a word that is no part, and other values.
pub fn choose(
    asked: &[String],
    load: &Load,
    materials: &[Material],
    parcels: &[Parcel],
    spacing_m: f64,
    visible: f64,
) -> Result<Choice, SimulateError> {
    let cubes = Cubes::new(parcels, spacing_m);
    let mut reasons = match asked {
        [word] if word == NEVER => vec![None; materials.len()],
        [word] if word == AUTO && load.is_forced => vec![None; materials.len()],
        [word] if word == AUTO => {
            let reason = |material: &Material| match load.strain(material) {
                _ if flows(material) => None,
                strain if strain <= INVISIBLE => Some(Reason::Stiff),
                strain => (strain <= visible).then_some(Reason::TooSlow),
            };
            let mut reasons: Vec<Option<Reason>> = materials.iter().map(reason).collect();
            let shares = cubes.share_near(&reasons);
            for (reason, share) in reasons.iter_mut().zip(shares) {
                *reason = reason.or((share >= LAYER).then_some(Reason::Layer));
            }
            reasons
        }
        parts => {
            let simulated: BTreeSet<u32> = parcels.iter().map(|parcel| parcel.label).collect();
            let named = named(parts, &names_of_parts(materials), &simulated)?;
            named.into_iter().map(|named| named.then_some(Reason::Asked)).collect()
        }
    };
    for (label, material) in materials.iter().enumerate() {
        if let Some(shell) = material.moves_with {
            reasons[label] = reasons[label].or(reasons[shell as usize].map(|_| Reason::InShell));
        }
    }
    let body_of = cubes.joined(&reasons.iter().map(Option::is_some).collect::<Vec<_>>());
    Ok(Choice { body_of, reasons })
}

/// Per label, which has these `names`: whether it is `simulated` and one of the `parts` of `--rigid` refers to it.
fn named(parts: &[String], names: &[Vec<&str>], simulated: &BTreeSet<u32>) -> Result<Vec<bool>, SimulateError> {
    let mut rigid = vec![false; names.len()];
    for part in parts {
        let unknown = || match part.as_str() {
            AUTO | NEVER => SimulateError::RigidAlone { word: part.clone() },
            _ => SimulateError::Rigid { part: part.clone(), names: all_names(names, simulated) },
        };
        let found = parts_named(names, simulated, part).ok_or_else(unknown)?;
        for (rigid, found) in rigid.iter_mut().zip(found) {
            *rigid |= found;
        }
    }
    Ok(rigid)
}

/// The labels in each cube of half a grid cell.
struct Cubes {
    labels: BTreeMap<[i64; 3], BTreeSet<u32>>,
    /// Per parcel: its cube and its label.
    parcels: Vec<([i64; 3], u32)>,
}

impl Cubes {
    fn new(parcels: &[Parcel], spacing_m: f64) -> Self {
        let side = spacing_m / 2.0;
        let parcels: Vec<_> = parcels
            .iter()
            .filter(|parcel| parcel.backed)
            .map(|parcel| (parcel.position_m.map(|x| (x / side).floor() as i64), parcel.label))
            .collect();
        let mut labels: BTreeMap<[i64; 3], BTreeSet<u32>> = BTreeMap::new();
        for (cube, label) in &parcels {
            labels.entry(*cube).or_default().insert(*label);
        }
        Self { labels, parcels }
    }

    /// The labels within a grid cell of each occupied cube.
    fn around(&self) -> BTreeMap<[i64; 3], BTreeSet<u32>> {
        let near = |[x, y, z]: [i64; 3]| -> BTreeSet<u32> {
            let along = |a: i64| a - NEAR_CUBES..=a + NEAR_CUBES;
            let columns = along(x).flat_map(|x| along(y).map(move |y| (x, y)));
            columns
                .flat_map(|(x, y)| self.labels.range([x, y, z - NEAR_CUBES]..=[x, y, z + NEAR_CUBES]))
                .flat_map(|(_, labels)| labels.iter().copied())
                .collect()
        };
        self.labels.keys().map(|cube| (*cube, near(*cube))).collect()
    }

    /// Per label: the share of its parcels that lie within a grid cell of a `rigid` part.
    fn share_near(&self, rigid: &[Option<Reason>]) -> Vec<f64> {
        let around = self.around();
        let mut counts = vec![[0.0; 2]; rigid.len()];
        for (cube, label) in &self.parcels {
            let count = &mut counts[*label as usize];
            count[0] += f64::from(u8::from(around[cube].iter().any(|&l| rigid[l as usize].is_some())));
            count[1] += 1.0;
        }
        counts.iter().map(|[near, all]| near / f64::max(*all, 1.0)).collect()
    }

    /// Per label: the number of its body; `rigid` parts that touch have the same one.
    fn joined(&self, rigid: &[bool]) -> Vec<Option<u32>> {
        // Each label points to a smaller one of the same body; the smallest points to itself.
        let mut root: Vec<usize> = (0..rigid.len()).collect();
        fn find(root: &[usize], mut at: usize) -> usize {
            while root[at] != at {
                at = root[at];
            }
            at
        }
        for near in self.around().values() {
            let mut together = near.iter().map(|&l| l as usize).filter(|&l| rigid[l]);
            let Some(first) = together.next() else { continue };
            for other in together {
                let (a, b) = (find(&root, first), find(&root, other));
                root[a.max(b)] = a.min(b);
            }
        }
        let used: BTreeSet<u32> = self.parcels.iter().map(|(_, label)| *label).collect();
        let mut numbers: BTreeMap<usize, u32> = BTreeMap::new();
        (0..rigid.len())
            .map(|label| {
                let is_body = rigid[label] && used.contains(&(label as u32));
                let next = numbers.len() as u32;
                is_body.then(|| *numbers.entry(find(&root, label)).or_insert(next))
            })
            .collect()
    }
}
