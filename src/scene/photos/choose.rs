//! Chooses the views to work on: a few sharp ones that show the whole object, from all around.

use std::num::NonZeroUsize;

use nalgebra::{Point3, Vector3};

use super::flaws::Flaw;
use crate::scene::photos::view_names;
use crate::scene::{Options, Scene, SceneError, View};

/// Photos examined per chosen view: enough to leave out the blurred ones, few enough not to decode all of a long
/// capture.
const CANDIDATES_PER_VIEW: usize = 3;

/// A view whose coverage of the object is less than this share of the best view's cuts the object off.
const LEAST_COVERAGE: f64 = 0.8;

impl Scene {
    /// The views that `options` ask for, in the order of the camera file: those listed, or [`Options::views`] of them
    /// spread over the directions from which the object is seen, leaving out those with a [flaw](super::flaws::Flaw), and those that
    /// cut the object off as long as there are enough others.
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
    pub fn spread_views(&self, count: NonZeroUsize) -> Vec<View> {
        let all: Vec<usize> = (0..self.views.len()).collect();
        self.spread_among(&all, count.get()).into_iter().map(|index| self.views[index].clone()).collect()
    }

    fn spread_indices(&self, count: usize) -> Result<Vec<usize>, SceneError> {
        let candidates = if self.views.len() <= count {
            (0..self.views.len()).collect()
        } else {
            let covering = best(&self.coverages(&self.views), LEAST_COVERAGE, count);
            self.spread_among(&covering, CANDIDATES_PER_VIEW * count)
        };
        let views: Vec<View> = candidates.iter().map(|index| self.views[*index].clone()).collect();
        let flaws = self.flaws(&views)?;
        let is_sound = |(index, flaw): (&usize, &Option<Flaw>)| flaw.is_none().then_some(*index);
        let sound: Vec<usize> = candidates.iter().zip(&flaws).filter_map(is_sound).collect();
        Ok(self.spread_among(if sound.is_empty() { &candidates } else { &sound }, count))
    }

    /// `count` of the views at these indices, spread over the directions from which the object is seen.
    fn spread_among(&self, indices: &[usize], count: usize) -> Vec<usize> {
        let center = self.object_bounds().center();
        let directions: Vec<_> = indices.iter().map(|index| direction(&self.views[*index], center)).collect();
        let mut chosen: Vec<usize> = spread(&directions, count).into_iter().map(|at| indices[at]).collect();
        chosen.sort_unstable();
        chosen
    }

    /// For each view, the share of the object's Gaussians whose centres it shows.
    pub(super) fn coverages(&self, views: &[View]) -> Vec<f64> {
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
        views.iter().map(|view| share(view) / centers.len().max(1) as f64).collect()
    }
}

/// Indices, in order, of the values that reach `share` of the largest; of the `count` largest if fewer do.
fn best(values: &[f64], share: f64, count: usize) -> Vec<usize> {
    let least = share * values.iter().copied().fold(0.0, f64::max);
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
