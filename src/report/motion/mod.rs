//! The simulation for the page's viewer: how the Gaussians of its cloud move from frame to frame, in few bytes.
//!
//! 1. [`Still`]s are taken from the frames, at most [`FRAMES`] of them.
//! 2. [`rigid`]: the Gaussians of a part that move together share one path.
//! 3. [`tracks`]: the others have a track of their own. If these are too large for a page, fewer of them are shown.

mod rigid;
mod tracks;

use nalgebra::{Point3, UnitQuaternion};

use super::cloud::{Cloud, Sphere, gzip};
use crate::gaussians::Gaussians;
use crate::simulate::SimulationReport;
pub use rigid::Path;
use tracks::Tracks;

/// Most frames on a page; the viewer interpolates between them.
const FRAMES: usize = 60;
/// Most bytes of the compressed tracks: 8 MB in base64.
const LIMIT: usize = 6_000_000;
/// Deviation from a part's rigid motion that is too small to see, as a share of the radius of the object: a third of a
/// pixel.
const UNSEEN: f64 = 1e-3;

/// How the Gaussians of a cloud move.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Time of each frame on the page, s.
    pub times_s: Vec<f64>,
    /// Number of frames of the simulation.
    pub of_frames: usize,
    /// World z of the ground, scene units.
    pub ground_z: f64,
    /// Contains the object in every frame.
    pub sphere: Sphere,
    /// The path of each part, by label.
    pub paths: Vec<Path>,
    pub tracks: Tracks,
    /// Gzip of one byte per Gaussian of the cloud ([`tracks::Kind`]), then the tracks.
    pub gzip: Vec<u8>,
}

/// A cloud's Gaussians at one moment.
#[derive(Debug, Clone, PartialEq)]
struct Still {
    /// World frame, scene units.
    centers: Vec<Point3<f64>>,
    log_scales: Vec<[f32; 3]>,
    rotations: Vec<UnitQuaternion<f64>>,
}

impl Still {
    fn of(gaussians: &Gaussians, chosen: &[usize]) -> Self {
        Self {
            centers: chosen.iter().map(|&i| gaussians.center(i)).collect(),
            log_scales: chosen.iter().map(|&i| gaussians.log_scales[i]).collect(),
            rotations: chosen.iter().map(|&i| gaussians.rotation(i)).collect(),
        }
    }
}

impl Motion {
    /// The motion of `cloud`, which shows `gaussians`; `load` returns the Gaussians of a frame by its index.
    ///
    /// # Errors
    /// The errors of `load`.
    pub fn new<E>(
        cloud: &Cloud,
        gaussians: &Gaussians,
        report: &SimulationReport,
        load: &mut dyn FnMut(usize) -> Result<Gaussians, E>,
    ) -> Result<Self, E> {
        let frames = evenly(FRAMES, report.frames.len());
        let at_rest = Still::of(gaussians, &cloud.chosen);
        let stills = frames.iter().map(|&frame| Ok(Still::of(&load(frame)?, &cloud.chosen)));
        let stills = stills.collect::<Result<Vec<_>, E>>()?;
        let unseen = UNSEEN * cloud.sphere.radius;
        let (paths, follows) = rigid::paths(&at_rest, &stills, &cloud.labels, cloud.sphere.center, unseen);
        let (tracks, gzip) = (0..)
            .map(|halvings| {
                let tracks = Tracks::new(&follows, 1 << halvings, &at_rest, &stills);
                let gzip = gzip(&tracks.bytes(&stills));
                (tracks, gzip)
            })
            .find(|(tracks, gzip)| gzip.len() <= LIMIT || tracks.shown.is_empty())
            .expect("enough halvings leave no track");
        let [low, high] = report.bounds().map(Point3::from);
        Ok(Self {
            times_s: frames.iter().map(|&frame| report.frames[frame].t_s).collect(),
            of_frames: report.frames.len(),
            ground_z: report.ground_z_m / report.meters_per_unit,
            sphere: Sphere { center: nalgebra::center(&low, &high), radius: 0.5 * (high - low).norm() },
            paths,
            tracks,
            gzip,
        })
    }
}

/// At most `most` of the numbers below `count`, evenly chosen, with the first and the last.
fn evenly(most: usize, count: usize) -> Vec<usize> {
    if count <= most {
        return (0..count).collect();
    }
    (0..most).map(|k| k * (count - 1) / (most - 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_frames_are_thinned_evenly_with_both_ends() {
        assert_eq!(evenly(60, 3), [0, 1, 2]);
        assert_eq!(evenly(4, 10), [0, 3, 6, 9]);
        let kept = evenly(60, 241);
        assert_eq!((kept.len(), kept[0], kept[59]), (60, 0, 240));
    }
}
