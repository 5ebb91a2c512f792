//! What sinks into a rough surface: the feet of a toy on a bed.
//!
//! A flat surface tells by height what stands on it. One that wrinkles and gives way hides in its spread what is as thin as that, and
//! colours tell what belongs to the object: from its voxels on, Gaussians join it whose colours the surface rarely has. A shadow
//! darkens the surface, so a darker shade of a colour counts as that colour.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::Vector3;

use super::{LEAST_HEIGHT, LEAST_VOXEL, MOST_COMPARED, Region, around};
use crate::gaussians::SH_C0;
use crate::numeric::{evenly, median};

/// How far below the surface things sink, in its thicknesses. This and the rarities were chosen by eye on one real capture, a plush on a bed.
const DEEPEST: f64 = 4.0;
/// A colour is one of the surface's if at least this share of its Gaussians have one like it: a pattern is the surface's, a foot
/// that is taken for it is not.
const LEAST_SHARE: f64 = 0.1;
/// How much rarer than usual for the surface a colour must be: the plush's shoes are, and so are a few ridges of the bed's cover, which do
/// not touch it.
const LEAST_RARITY: f64 = 3.0;
/// The same where such colours are, half as much: for the pale legs between a blue shoe and a white skirt.
const LEAST_RARITY_BESIDE: f64 = 1.5;
/// The deepest shadow leaves this share of the light.
const DEEPEST_SHADOW: f64 = 0.3;

/// Adds to each object, and to its voxels, what touches it, is too low to be an object itself and is of other colours than the surface.
/// On a surface flatter than a voxel, height tells all there is to tell, and nothing is added.
pub(super) fn join(region: &Region, object_of_voxel: &mut BTreeMap<[i64; 3], u32>, object_of_gaussian: &mut [u32]) {
    let thickness = region.surface.thickness;
    if thickness <= LEAST_VOXEL {
        return;
    }
    let Some(surface) = SurfaceColors::of(region, object_of_gaussian) else { return };
    let mut low: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (&i, place) in &region.places {
        if object_of_gaussian[i] == 0 && (-DEEPEST * thickness..=LEAST_HEIGHT * thickness).contains(&place.height) {
            low.entry(region.voxel(place)).or_default().push(i);
        }
    }
    let mut open: VecDeque<([i64; 3], u32)> = object_of_voxel.iter().map(|(at, object)| (*at, *object)).collect();
    while let Some((at, object)) = open.pop_front() {
        for voxel in around(at) {
            let Some(others) = low.remove(&voxel) else { continue };
            let rarities: Vec<f64> = others.iter().map(|i| surface.rarity(&color(region, *i))).collect();
            if rarities.iter().any(|rarity| *rarity >= LEAST_RARITY) {
                for (i, _) in others.iter().zip(&rarities).filter(|(_, rarity)| **rarity >= LEAST_RARITY_BESIDE) {
                    object_of_gaussian[*i] = object;
                }
                object_of_voxel.entry(voxel).or_insert(object);
                open.push_back((voxel, object));
            }
        }
    }
}

/// The colours of the surface.
struct SurfaceColors {
    samples: Vec<Vector3<f64>>,
    /// The median over the surface of the distance from a colour to its [`LEAST_SHARE`] nearest.
    usual: f64,
}

impl SurfaceColors {
    /// `None` if all of the surface is of one colour.
    fn of(region: &Region, object_of_gaussian: &[u32]) -> Option<Self> {
        let is_surface = |i: usize, height: f64| {
            object_of_gaussian[i] == 0 && region.is_solid(i) && height.abs() <= region.surface.thickness
        };
        let places = region.places.iter();
        let surface: Vec<usize> = places.filter(|(i, place)| is_surface(**i, place.height)).map(|(i, _)| *i).collect();
        let samples = evenly(&surface, MOST_COMPARED).map(|i| color(region, *i)).collect();
        let colors = Self { samples, usual: 1.0 };
        let usual = median(colors.samples.iter().map(|color| colors.rarity(color)).collect())?;
        (usual > 0.0).then_some(Self { usual, ..colors })
    }

    /// The distance from a colour within which [`LEAST_SHARE`] of the surface's are, in units of the usual one.
    fn rarity(&self, color: &Vector3<f64>) -> f64 {
        let mut distances: Vec<f64> = self.samples.iter().map(|sample| distance(color, sample)).collect();
        let nearest = (LEAST_SHARE * distances.len() as f64) as usize;
        let (_, within, _) = distances.select_nth_unstable_by(nearest, f64::total_cmp);
        *within / self.usual
    }
}

/// Between a colour and the nearest shade of another.
fn distance(color: &Vector3<f64>, other: &Vector3<f64>) -> f64 {
    let light = (color.dot(other) / other.norm_squared().max(f64::MIN_POSITIVE)).clamp(DEEPEST_SHADOW, 1.0);
    (color - light * other).norm()
}

/// The colour of a Gaussian seen from all sides on average, each channel from 0 to 1.
fn color(region: &Region, i: usize) -> Vector3<f64> {
    Vector3::from(region.gaussians.sh_dc[i]).map(|channel| 0.5 + f64::from(SH_C0 * channel))
}
