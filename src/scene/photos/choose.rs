//! Chooses the views to work on: a few sharp ones that show the whole object, from all around.

use std::num::NonZeroUsize;

use nalgebra::{Point3, Vector3};

use super::sharpness::sharpness;
use crate::numeric::upper_median;
use crate::parallel;
use crate::scene::photos::view_names;
use crate::scene::{Options, Scene, SceneError, View};

/// Photos examined per chosen view: enough to leave out the blurred ones, few enough not to decode all of a long
/// capture.
const CANDIDATES_PER_VIEW: usize = 3;

/// A photo with less than this share of the median sharpness is blurred: on a fixture, a Gaussian blur with a
/// standard deviation of one pixel leaves a fifth of the sharpness, while sharp views differ by a twentieth.
const LEAST_SHARPNESS: f64 = 0.5;

/// A view whose coverage of the object is less than this share of the best view's cuts the object off.
const LEAST_COVERAGE: f64 = 0.8;

impl Scene {
    /// The views that `options` ask for, in the order of the camera file: those listed, or [`Options::views`] of them
    /// spread over the directions from which the object is seen, leaving out those that are blurred or cut the object
    /// off as long as there are enough others.
    ///
    /// # Errors
    /// [`SceneError::UnknownView`] if a listed name is not the name of a view; an error if a photo cannot be decoded.
    pub fn chosen_views(&self, options: &Options) -> Result<Vec<View>, SceneError> {
        let mut indices = if options.view_list.is_empty() {
            self.spread_indices(options.views.get())?
        } else {
            options.view_list.iter().map(|name| view_names::index_of(&self.views, name)).collect::<Result<_, _>>()?
        };
        indices.sort_unstable();
        indices.dedup();
        Ok(indices.into_iter().map(|index| self.views[index].clone()).collect())
    }

    /// `count` views spread over all directions, or all views if there are fewer.
    ///
    /// # Errors
    /// If a photo cannot be decoded.
    pub fn spread_views(&self, count: NonZeroUsize) -> Result<Vec<View>, SceneError> {
        Ok(self.spread_indices(count.get())?.into_iter().map(|index| self.views[index].clone()).collect())
    }

    fn spread_indices(&self, count: usize) -> Result<Vec<usize>, SceneError> {
        if self.views.len() <= count {
            return Ok((0..self.views.len()).collect());
        }
        let center = self.object_bounds().center();
        let direction = |index: &usize| direction(&self.views[*index], center);
        let spread_among = |indices: &[usize], count: usize| -> Vec<usize> {
            let directions: Vec<_> = indices.iter().map(direction).collect();
            let mut chosen: Vec<usize> = spread(&directions, count).into_iter().map(|at| indices[at]).collect();
            chosen.sort_unstable();
            chosen
        };
        let covering =
            best(&self.coverages(), LEAST_COVERAGE, count, |values| values.iter().copied().fold(0.0, f64::max));
        let candidates = spread_among(&covering, CANDIDATES_PER_VIEW * count);
        let photo_of = |index: &usize| self.views[*index].photo();
        let sharpness_of = |index| photo_of(index).map(|photo| sharpness(&photo).unwrap_or(0.0));
        let measured = parallel::try_map(&candidates, sharpness_of)?;
        let usual = |values: &[f64]| upper_median(values.to_vec()).unwrap_or_default();
        let sharp = best(&measured, LEAST_SHARPNESS, count, usual);
        let sharp: Vec<usize> = sharp.into_iter().map(|at| candidates[at]).collect();
        Ok(spread_among(&sharp, count))
    }

    /// For each view, the share of the object's Gaussians whose centres it shows.
    fn coverages(&self) -> Vec<f64> {
        /// A thousand points give shares to within a percent or two.
        const SAMPLES: usize = 1000;
        let step = (self.gaussians.len() / SAMPLES).max(1);
        let opaque = |i: &usize| self.gaussians.opacity_logits[*i] >= 0.0 && !self.gaussians.is_set_aside(*i);
        let centers: Vec<_> =
            (0..self.gaussians.len()).step_by(step).filter(opaque).map(|i| self.gaussians.center(i)).collect();
        let shows = |view: &View, center: &Point3<f64>| {
            let pixel = view.camera.pixel(view.camera.point_in_camera(*center));
            let (width, height) = (view.camera.intrinsics.width.into(), view.camera.intrinsics.height.into());
            pixel.is_some_and(|p| (0.0..width).contains(&p.x) && (0.0..height).contains(&p.y))
        };
        let share = |view: &View| centers.iter().filter(|center| shows(view, center)).count() as f64;
        self.views.iter().map(|view| share(view) / centers.len().max(1) as f64).collect()
    }
}

/// Indices, in order, of the values that reach `share` of what `usual` returns; of the `count` largest if fewer do.
fn best(values: &[f64], share: f64, count: usize, usual: impl Fn(&[f64]) -> f64) -> Vec<usize> {
    let least = share * usual(values);
    let good: Vec<usize> = (0..values.len()).filter(|i| values[*i] >= least).collect();
    if good.len() >= count {
        return good;
    }
    let mut ranked: Vec<usize> = (0..values.len()).collect();
    ranked.sort_by(|a, b| values[*b].total_cmp(&values[*a]).then(a.cmp(b)));
    ranked.truncate(count);
    ranked.sort_unstable();
    ranked
}

/// Unit vector from the object to the camera; zero if the camera is at the object's centre.
fn direction(view: &View, center: Point3<f64>) -> Vector3<f64> {
    (view.camera.center_in_world() - center).try_normalize(f64::EPSILON).unwrap_or_default()
}

/// Farthest-point sampling (Gonzalez 1985): starts at the direction nearest to the mean of all, then always takes the
/// one whose angle to those already taken is largest; ties go to the first. Returns indices in the order in which they
/// were taken.
fn spread(directions: &[Vector3<f64>], count: usize) -> Vec<usize> {
    let mean: Vector3<f64> = directions.iter().sum();
    let mut next = first_largest(directions.iter().map(|direction| direction.dot(&mean)));
    let mut nearness = vec![f64::NEG_INFINITY; directions.len()];
    let mut taken = Vec::new();
    while let Some(index) = next {
        taken.push(index);
        if taken.len() >= count.min(directions.len()) {
            break;
        }
        for (nearness, direction) in nearness.iter_mut().zip(directions) {
            *nearness = nearness.max(direction.dot(&directions[index]));
        }
        nearness[index] = f64::INFINITY;
        next = first_largest(nearness.iter().map(|nearness| -nearness));
    }
    taken
}

/// Index of the largest value; ties go to the first; `None` if there are no values.
fn first_largest(values: impl Iterator<Item = f64>) -> Option<usize> {
    values.enumerate().reduce(|best, next| if next.1 > best.1 { next } else { best }).map(|(index, _)| index)
}
