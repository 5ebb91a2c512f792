//! Ranks the rotations of an anchor. The splat is drawn once from many directions; each photo, turned about its axis in
//! steps, is compared with all of these pictures; and the score of a rotation is looked up: the mean, over the photos, of the
//! correlation with the picture from the nearest direction at the nearest turn.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

use super::anchor::Anchor;
use super::merge::merged;
use super::pictures::Reduced;
use crate::camera::{Camera, Distortion, Intrinsics};
use crate::gaussians::Gaussians;
use crate::inspect::verdict::{Small, picture};
use crate::numeric::{all_rotations, evenly, sphere_directions, upper_median};
use crate::parallel;
use crate::render::RenderOptions;

/// Side of the pictures compared, in pixels.
const SIDE: usize = 16;
const PIXELS: usize = SIDE * SIDE;
/// Number of Gaussians in them: two for each pixel.
const GAUSSIANS: usize = 2 * PIXELS;
/// Neighbouring directions are about 12 degrees apart, and so are neighbouring rotations.
const DIRECTIONS: usize = 300;
const ROLLS: usize = 30;
const ROTATIONS: usize = 8000;
/// Side of the photos that are sampled, in pixels: with [`SUBSAMPLES`]^2 samples in each pixel, none of theirs is missed.
const PHOTO_SIDE: u32 = 48;
const SUBSAMPLES: usize = 3;
/// Maximum number of photos.
const PHOTOS: usize = 8;
/// A photo takes part if at least this share of the picture around the focus is in it.
const LEAST_IN_PHOTO: f32 = 0.3;
/// With fewer photos, many rotations would do.
const LEAST_PHOTOS: usize = 2;

/// A rotation from the cameras' world to the splat's, and its score, -1 to 1.
#[derive(Clone, Copy)]
pub(super) struct Scored {
    pub rotation: UnitQuaternion<f64>,
    pub score: f64,
}

/// The photos around one focus, and where each rotation looks their pictures up. It serves all anchors with this focus.
pub(super) struct Templates {
    /// In few Gaussians.
    cloud: Gaussians,
    /// The cameras' median distance from the focus, in their unit.
    distance: f64,
    patches: Vec<Patch>,
    directions: Vec<Axes>,
    rotations: Vec<Lookup>,
}

struct Lookup {
    rotation: UnitQuaternion<f64>,
    /// For each patch, the index of a direction, and of a turn of this patch among those of all.
    seen: Vec<(usize, usize)>,
}

impl Templates {
    /// `None` if too few photos show the anchor.
    pub fn new(cloud: &Gaussians, photos: &[Reduced], anchor: &Anchor) -> Option<Self> {
        let distances = photos.iter().map(|photo| (photo.camera.center_in_world() - anchor.focus).norm());
        let distance = upper_median(distances.collect())?;
        let few: Vec<&Reduced> = evenly(photos, PHOTOS).collect();
        let patches: Vec<Option<Patch>> = parallel::map(&few, |photo| Patch::new(&photo.at(PHOTO_SIDE), anchor));
        let patches: Vec<Patch> = patches.into_iter().flatten().collect();
        if patches.len() < LEAST_PHOTOS {
            return None;
        }
        let directions: Vec<Axes> = sphere_directions(DIRECTIONS).map(|toward| Axes::new(toward, None)).collect();
        let lookup = |&rotation: &UnitQuaternion<f64>| {
            let seen = |(index, patch): (usize, &Patch)| {
                let (direction, turn) = patch.seen(&rotation, &directions);
                (direction, index * ROLLS + turn)
            };
            Lookup { rotation, seen: patches.iter().enumerate().map(seen).collect() }
        };
        let rotations: Vec<_> = all_rotations(ROTATIONS).collect();
        let rotations = parallel::map(&rotations, lookup);
        Some(Self { cloud: merged(cloud, GAUSSIANS), distance, patches, rotations, directions })
    }

    /// All rotations, in a fixed order.
    pub fn scored(&self, anchor: &Anchor) -> Vec<Scored> {
        let correlations = |axes: &Axes| -> Vec<f32> {
            let template = picture(&self.cloud, &axes.camera(anchor, self.distance), &RenderOptions::default());
            self.patches.iter().flat_map(|patch| &patch.turns).map(|turn| turn.correlation(&template)).collect()
        };
        let table: Vec<Vec<f32>> = parallel::map(&self.directions, correlations);
        let score = |lookup: &Lookup| {
            let sum: f32 = lookup.seen.iter().map(|(direction, turn)| table[*direction][*turn]).sum();
            Scored { rotation: lookup.rotation, score: f64::from(sum) / lookup.seen.len() as f64 }
        };
        self.rotations.iter().map(score).collect()
    }
}

/// A camera's frame that looks at the focus.
struct Axes {
    /// From the focus towards the camera.
    toward: Vector3<f64>,
    right: Vector3<f64>,
    down: Vector3<f64>,
}

impl Axes {
    /// With an axis down that is near to `down`, if one is given.
    fn new(toward: Vector3<f64>, down: Option<Vector3<f64>>) -> Self {
        let near = down.unwrap_or_else(|| Vector3::ith(toward.iamin(), 1.0));
        let across = near - toward * toward.dot(&near);
        let down = across.try_normalize(1e-3).unwrap_or_else(|| {
            let other = Vector3::ith(toward.iamin(), 1.0);
            (other - toward * toward.dot(&other)).normalize()
        });
        Self { toward, right: down.cross(&-toward), down }
    }

    /// The camera in the splat's world that looks from here at the anchor; `distance` is in the cameras' unit.
    fn camera(&self, anchor: &Anchor, distance: f64) -> Camera {
        let eye: Point3<f64> = anchor.place + self.toward * (anchor.scale * distance);
        let rows = Matrix3::from_columns(&[self.right, self.down, -self.toward]).transpose();
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows));
        let side = SIDE as u32;
        let (focal, middle) = (0.5 * SIDE as f64 * distance / anchor.half_width, 0.5 * SIDE as f64);
        let intrinsics = Intrinsics {
            width: side,
            height: side,
            fx: focal,
            fy: focal,
            cx: middle,
            cy: middle,
            distortion: Distortion::None,
        };
        Camera { intrinsics, camera_from_world: Isometry3::from_parts((rotation * -eye.coords).into(), rotation) }
    }
}

/// What a photo shows around the focus, at all turns.
struct Patch {
    axes: Axes,
    turns: Vec<Turned>,
}

/// A patch at one turn: three values for each pixel.
struct Turned {
    /// 1 on pixels that are in the photo, 0 on others.
    weights: Vec<f32>,
    /// The photo less its mean, times the weights.
    centered: Vec<f32>,
    norm: f32,
}

impl Patch {
    /// `None` if the photo does not show enough of the anchor.
    fn new(photo: &Small, anchor: &Anchor) -> Option<Self> {
        let offset = photo.camera.center_in_world() - anchor.focus;
        let distance = offset.norm();
        let down = photo.camera.camera_from_world.rotation.inverse() * Vector3::y();
        let axes = Axes::new(offset.try_normalize(f64::EPSILON)?, Some(down));
        let turn = |roll: usize| {
            let (sin, cos) = (TAU * roll as f64 / ROLLS as f64).sin_cos();
            let turned = Axes {
                toward: axes.toward,
                right: axes.right * cos + axes.down * sin,
                down: axes.down * cos - axes.right * sin,
            };
            turned.sampled(photo, anchor.half_width / distance)
        };
        let turns: Vec<Turned> = (0..ROLLS).map(turn).collect();
        let seen: f32 = turns[0].weights.iter().sum();
        (seen >= LEAST_IN_PHOTO * (3 * PIXELS) as f32).then_some(Self { axes, turns })
    }

    /// The direction and the turn at which the splat shows this patch after the rotation.
    fn seen(&self, rotation: &UnitQuaternion<f64>, directions: &[Axes]) -> (usize, usize) {
        let toward = rotation * self.axes.toward;
        let nearer = |a: &(usize, f64), b: &(usize, f64)| a.1.total_cmp(&b.1);
        let cosines = directions.iter().enumerate().map(|(index, axes)| (index, axes.toward.dot(&toward)));
        let nearest = cosines.max_by(nearer).map_or(0, |(index, _)| index);
        let down = directions[nearest].down;
        let angle = (-down.dot(&(rotation * self.axes.right))).atan2(down.dot(&(rotation * self.axes.down)));
        let roll = (angle / TAU * ROLLS as f64).round() as i64;
        (nearest, roll.rem_euclid(ROLLS as i64) as usize)
    }
}

impl Axes {
    /// The photo as a camera with these axes sees it; `tangent` is half of its field of view.
    fn sampled(&self, photo: &Small, tangent: f64) -> Turned {
        let mut values = Vec::with_capacity(3 * PIXELS);
        let mut weights = Vec::with_capacity(3 * PIXELS);
        for pixel in 0..PIXELS {
            let color = self.pixel(photo, tangent, pixel);
            values.extend(color.unwrap_or_default());
            weights.extend([if color.is_some() { 1.0 } else { 0.0 }; 3]);
        }
        let mean = values.iter().sum::<f32>() / weights.iter().sum::<f32>().max(1.0);
        let centered: Vec<f32> = values.iter().zip(&weights).map(|(value, weight)| (value - mean) * weight).collect();
        let norm = centered.iter().map(|value| value * value).sum::<f32>().sqrt();
        Turned { weights, centered, norm }
    }

    /// The mean colour of a pixel; `None` if some of it is not in the photo.
    fn pixel(&self, photo: &Small, tangent: f64, pixel: usize) -> Option<[f32; 3]> {
        const SHARE: f32 = 1.0 / (SUBSAMPLES * SUBSAMPLES) as f32;
        let place = |index: usize, sub: usize| {
            2.0 * (index as f64 + (sub as f64 + 0.5) / SUBSAMPLES as f64) / SIDE as f64 - 1.0
        };
        let mut sum = [0.0; 3];
        for sub in 0..SUBSAMPLES * SUBSAMPLES {
            let (u, v) = (place(pixel % SIDE, sub % SUBSAMPLES), place(pixel / SIDE, sub / SUBSAMPLES));
            let ray = -self.toward + (self.right * u + self.down * v) * tangent;
            let color = color_at(photo, photo.camera.camera_from_world.rotation * ray)?;
            sum.iter_mut().zip(color).for_each(|(sum, value)| *sum += SHARE * value);
        }
        Some(sum)
    }
}

/// The colour of the photo in this direction of the camera's frame.
fn color_at(photo: &Small, direction: Vector3<f64>) -> Option<[f32; 3]> {
    let pixel = photo.camera.pixel(direction.into())?;
    let (width, height) = (photo.camera.intrinsics.width as usize, photo.camera.intrinsics.height as usize);
    let inside = (0.0..width as f64).contains(&pixel.x) && (0.0..height as f64).contains(&pixel.y);
    let at = 3 * (pixel.y as usize * width + pixel.x as usize);
    inside.then(|| [photo.picture[at], photo.picture[at + 1], photo.picture[at + 2]])
}

impl Turned {
    /// Pearson's correlation over the pixels that are in the photo; 0 if either has a single colour there.
    fn correlation(&self, template: &[f32]) -> f32 {
        let (mut product, mut sum, mut squares, mut count) = (0.0f32, 0.0f32, 0.0f32, 0.0f32);
        for ((value, centered), weight) in template.iter().zip(&self.centered).zip(&self.weights) {
            product += value * centered;
            sum += value * weight;
            squares += value * value * weight;
            count += weight;
        }
        let spread = (squares - sum * sum / count.max(1.0)).max(0.0).sqrt();
        let scale = spread * self.norm;
        if scale > 1e-3 { product / scale } else { 0.0 }
    }
}
