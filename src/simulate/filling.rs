//! From Gaussians and the filled interior to parcels of matter with a volume.
//!
//! Space is divided into cubes of half a grid cell, because MPM wants eight particles per cell. The interior's volume
//! in a cube is divided equally among the Gaussians of the same part in it; if there are none, it goes to one new
//! particle at the volume's centre. So solids are full, shells stay shells, and every part keeps its volume up to
//! rounding.

use std::collections::BTreeMap;

use super::error::SimulateError;

/// A place in the object's inside: a cell from the parts stage, or from any other model of the inside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FillPoint {
    /// World frame, scene units.
    pub position: [f64; 3],
    /// Label of the part that fills it.
    pub label: u32,
    /// Volume of the matter in it, scene units cubed.
    pub volume: f64,
}

/// A parcel of matter, which becomes a particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parcel {
    /// World frame, m.
    pub position_m: [f64; 3],
    pub label: u32,
    pub volume_m3: f64,
    /// True if the part's inside reaches it or is unknown; other parcels are strays of the cloud.
    pub backed: bool,
}

/// The parcels: one per Gaussian, in the Gaussians' order, then those of the interior.
#[derive(Debug, Clone, PartialEq)]
pub struct Filled {
    pub parcels: Vec<Parcel>,
    /// Labels of parts whose inside is unknown: each cube that holds one of their Gaussians counts as full.
    pub assumed_full: Vec<u32>,
}

/// A cube of half a grid cell, for one part.
#[derive(Debug, Default, Clone)]
struct Cube {
    volume_m3: f64,
    /// Sum of volume times position.
    moment: [f64; 3],
    gaussians: Vec<u32>,
}

/// Gives every Gaussian a volume and adds particles where the interior has no Gaussian. `spacing_m` is the grid's.
///
/// # Errors
/// If a fill point has no finite position or an invalid volume.
pub fn fill(
    positions_m: &[[f64; 3]],
    labels: &[u32],
    interior: &[FillPoint],
    meters_per_unit: f64,
    spacing_m: f64,
) -> Result<Filled, SimulateError> {
    let side_m = spacing_m / 2.0;
    let mut cubes = Cubes { side_m, cubes: BTreeMap::new() };
    let known = cubes.take(interior, meters_per_unit)?;
    let mut assumed_full = Vec::new();
    for (i, (&label, &position)) in labels.iter().zip(positions_m).enumerate() {
        let cube = cubes.at(label, position);
        cube.gaussians.push(i as u32);
        if !known.contains_key(&label) {
            cube.volume_m3 = side_m.powi(3);
            assumed_full.push(label);
        }
    }
    assumed_full.sort_unstable();
    assumed_full.dedup();
    let mut parcels: Vec<Parcel> = labels
        .iter()
        .zip(positions_m)
        .map(|(&label, &position_m)| Parcel { position_m, label, volume_m3: 0.0, backed: false })
        .collect();
    cubes.share_out(&mut parcels);
    give_strays_a_volume(&mut parcels, &known);
    Ok(Filled { parcels, assumed_full })
}

/// The space of the object in cubes, by part and place.
struct Cubes {
    side_m: f64,
    cubes: BTreeMap<(u32, [i64; 3]), Cube>,
}

impl Cubes {
    /// The cube of a part at a place.
    fn at(&mut self, label: u32, position_m: [f64; 3]) -> &mut Cube {
        let place = position_m.map(|x| (x / self.side_m).floor() as i64);
        self.cubes.entry((label, place)).or_default()
    }

    /// Takes in the object's inside; returns the volume of each part that has any.
    fn take(&mut self, interior: &[FillPoint], meters_per_unit: f64) -> Result<BTreeMap<u32, f64>, SimulateError> {
        let mut known = BTreeMap::<u32, f64>::new();
        for (index, point) in interior.iter().enumerate() {
            if !(point.volume.is_finite() && point.volume > 0.0) {
                return Err(SimulateError::Volume { index, volume: point.volume });
            }
            if point.position.iter().any(|x| !x.is_finite()) {
                return Err(SimulateError::Position { what: "interior point", index, position: point.position });
            }
            let position_m = point.position.map(|x| x * meters_per_unit);
            let volume_m3 = point.volume * meters_per_unit.powi(3);
            let cube = self.at(point.label, position_m);
            cube.volume_m3 += volume_m3;
            for (moment, x) in cube.moment.iter_mut().zip(position_m) {
                *moment += volume_m3 * x;
            }
            *known.entry(point.label).or_default() += volume_m3;
        }
        Ok(known)
    }

    /// Shares each cube's volume out to its Gaussians, or adds a parcel where it has none.
    fn share_out(&self, parcels: &mut Vec<Parcel>) {
        for ((label, _), cube) in &self.cubes {
            let share = cube.volume_m3 / cube.gaussians.len().max(1) as f64;
            for &i in &cube.gaussians {
                (parcels[i as usize].volume_m3, parcels[i as usize].backed) = (share, share > 0.0);
            }
            if cube.gaussians.is_empty() {
                let position_m = cube.moment.map(|m| m / cube.volume_m3);
                parcels.push(Parcel { position_m, label: *label, volume_m3: cube.volume_m3, backed: true });
            }
        }
    }
}

/// Gaussians without a volume, because their part's inside does not reach them, get the mean of their part's parcels;
/// then the part is scaled back to its volume.
fn give_strays_a_volume(parcels: &mut [Parcel], known: &BTreeMap<u32, f64>) {
    let mut with_volume = BTreeMap::<u32, f64>::new();
    let mut strays = BTreeMap::<u32, f64>::new();
    for parcel in parcels.iter() {
        let counts = if parcel.volume_m3 > 0.0 { &mut with_volume } else { &mut strays };
        *counts.entry(parcel.label).or_default() += 1.0;
    }
    for parcel in parcels {
        let (Some(count), Some(strays)) = (with_volume.get(&parcel.label), strays.get(&parcel.label)) else { continue };
        let volume = if parcel.volume_m3 > 0.0 { parcel.volume_m3 } else { known[&parcel.label] / count };
        parcel.volume_m3 = volume * count / (count + strays);
    }
}
