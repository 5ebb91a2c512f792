//! Which views to work on: a few that see the object from all around.

use std::num::NonZeroUsize;

use nalgebra::{Point3, Vector3};

use super::{Options, Scene, SceneError, View};

/// Views used where nothing else is asked for.
pub const DEFAULT_VIEWS: NonZeroUsize = NonZeroUsize::new(10).expect("ten is not zero");

impl Scene {
    /// The views that `options` ask for, in the order of the camera file: those listed, or [`Options::views`] of them
    /// spread over the directions from which the object is seen.
    ///
    /// # Errors
    /// [`SceneError::UnknownView`] where a listed name is no view's.
    pub fn chosen_views(&self, options: &Options) -> Result<Vec<View>, SceneError> {
        let mut indices = if options.view_list.is_empty() {
            let center = self.object_bounds().center();
            let directions: Vec<_> = self.views.iter().map(|view| direction(view, center)).collect();
            spread(&directions, options.views.get())
        } else {
            options.view_list.iter().map(|name| self.index_of(name)).collect::<Result<_, _>>()?
        };
        indices.sort_unstable();
        indices.dedup();
        Ok(indices.into_iter().map(|index| self.views[index].clone()).collect())
    }

    fn index_of(&self, name: &str) -> Result<usize, SceneError> {
        let known = || self.views.iter().map(|view| view.name.clone()).collect();
        let found = self.views.iter().position(|view| view.name == name);
        found.ok_or_else(|| SceneError::UnknownView { name: name.to_owned(), known: known() })
    }
}

/// Unit vector from the object to the camera; zero where the camera is at the object's centre.
fn direction(view: &View, center: Point3<f64>) -> Vector3<f64> {
    (view.camera.center_in_world() - center).try_normalize(f64::EPSILON).unwrap_or_default()
}

/// Farthest-point sampling (Gonzalez 1985): from the direction nearest to the mean of all, always on to the one whose angle to
/// those taken is largest; the first of equals. Indices in the order of taking.
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

/// Index of the largest value, the first of equals; `None` where there is none.
fn first_largest(values: impl Iterator<Item = f64>) -> Option<usize> {
    values.enumerate().reduce(|best, next| if next.1 > best.1 { next } else { best }).map(|(index, _)| index)
}
