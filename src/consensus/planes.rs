//! The surface on either side of a border between pieces, as a plane through centres of Gaussians.
//!
//! Under a printed pattern the shortest axes of Gaussians are noisy, as a trainer also shapes Gaussians to fit the
//! print; their centres still lie on the surface.

use nalgebra::Vector3;

use super::linkage::{Border, NONE};
use crate::gaussians::Gaussians;
use crate::numeric::nearest::Nearest;
use crate::numeric::scatter;
use crate::parallel;

/// A plane goes through up to [`MOST`] Gaussians of the same piece, found among this many nearest ones.
const OF_NEAREST: usize = 48;
const MOST: usize = 24;
/// With fewer, there is no plane.
const LEAST: usize = 6;
/// The surface goes on smoothly if this is the largest angle in degrees between the planes, and between either and the
/// line that joins the means of their points: where the surface has a step, that line is steeper.
const SMOOTH_DEG: f64 = 20.0;

/// The planes at the Gaussians of pairs that lie in different pieces. These are few, so the planes are kept in a list.
pub(super) struct Planes {
    /// Sorted by Gaussian.
    by_gaussian: Vec<(u32, Plane)>,
}

struct Plane {
    /// The mean of its points.
    mean: Vector3<f64>,
    /// On the side of the views.
    normal: Vector3<f64>,
}

impl Planes {
    /// `piece_of` is each Gaussian's piece, and `nearest` holds the positions of `seen`.
    pub fn new(
        gaussians: &Gaussians,
        seen: &[u32],
        nearest: &Nearest,
        toward_views: &[Vector3<f32>],
        piece_of: &[u32],
        borders: impl Iterator<Item = (u32, u32, Border)>,
    ) -> Self {
        let mut is_end = vec![false; gaussians.len()];
        for (a, b, _) in borders.filter(|border| crosses(border, piece_of)) {
            is_end[a as usize] = true;
            is_end[b as usize] = true;
        }
        let plane = |&gaussian: &u32| {
            let i = gaussian as usize;
            let same_side = nearest
                .find(gaussians.positions[i], OF_NEAREST)
                .into_iter()
                .map(|(_, n)| seen[n as usize] as usize)
                .filter(|&other| piece_of[other] == piece_of[i] && toward_views[other].dot(&toward_views[i]) > 0.0);
            let centers: Vec<Vector3<f64>> = same_side.take(MOST).map(|other| gaussians.center(other).coords).collect();
            Some((gaussian, Plane::through(&centers, &toward_views[i].cast())?))
        };
        let ends: Vec<u32> = (0..).zip(&is_end).filter(|(_, is_end)| **is_end).map(|(gaussian, _)| gaussian).collect();
        Self { by_gaussian: parallel::flat_map(&ends, plane) }
    }

    fn at(&self, gaussian: u32) -> Option<&Plane> {
        let place = self.by_gaussian.binary_search_by_key(&gaussian, |(of, _)| *of).ok()?;
        Some(&self.by_gaussian[place].1)
    }

    /// The pairs that cross between pieces, as borders that only count planes.
    pub fn borders(
        &self,
        piece_of: &[u32],
        borders: impl Iterator<Item = (u32, u32, Border)>,
    ) -> impl Iterator<Item = (u32, u32, Border)> {
        borders.filter(|border| crosses(border, piece_of)).filter_map(|(a, b, _)| {
            let smooth = u32::from(self.at(a)?.continues_in(self.at(b)?));
            Some((a, b, Border { planes: 1, smooth, ..Border::default() }))
        })
    }
}

/// Whether a pair lies a few Gaussians apart, in different pieces.
fn crosses(&(a, b, border): &(u32, u32, Border), piece_of: &[u32]) -> bool {
    let [of_a, of_b] = [a, b].map(|i| piece_of[i as usize]);
    border.angles > 0 && of_a != of_b && of_a != NONE && of_b != NONE
}

impl Plane {
    /// The plane that fits the points best; `None` if there are too few.
    fn through(points: &[Vector3<f64>], toward_views: &Vector3<f64>) -> Option<Self> {
        if points.len() < LEAST {
            return None;
        }
        let (mean, spread) = scatter(points.iter());
        let eigen = spread.symmetric_eigen();
        let normal: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
        Some(Self { mean, normal: if normal.dot(toward_views) < 0.0 { -normal } else { normal } })
    }

    /// Whether the surface goes on smoothly from this plane to the other.
    fn continues_in(&self, other: &Self) -> bool {
        let between = (other.mean - self.mean).try_normalize(0.0).unwrap_or_default();
        let (sin, cos) = SMOOTH_DEG.to_radians().sin_cos();
        let is_level = |plane: &Self| plane.normal.dot(&between).abs() <= sin;
        self.normal.dot(&other.normal) >= cos && is_level(self) && is_level(other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: Vector3<f64> = Vector3::new(0.0, 0.0, 1.0);

    /// A plane through 25 points around `center` that is tilted about y by `tilt_deg`, seen from above.
    fn tilted(center: [f64; 3], tilt_deg: f64) -> Plane {
        let (sin, cos) = tilt_deg.to_radians().sin_cos();
        let point = |n: i32| {
            let [along, across] = [f64::from(n % 5 - 2), f64::from(n / 5 - 2)];
            Vector3::from(center) + Vector3::new(along * cos, across, -along * sin)
        };
        Plane::through(&(0..25).map(point).collect::<Vec<_>>(), &UP).unwrap()
    }

    #[test]
    fn a_surface_goes_on_unless_it_turns_or_has_a_step() {
        let flat = tilted([0.0; 3], 0.0);
        assert!(flat.normal.dot(&UP) > 0.999);
        let goes_on = |center, tilt_deg| {
            let other = tilted(center, tilt_deg);
            assert_eq!(flat.continues_in(&other), other.continues_in(&flat));
            flat.continues_in(&other)
        };
        assert!(goes_on([5.0, 0.0, 0.0], 0.0), "one plane");
        assert!(goes_on([5.0, 0.0, -0.6], 15.0), "a wide curve");
        assert!(!goes_on([5.0, 0.0, -0.6], 25.0), "an edge");
        assert!(goes_on([5.0, 0.0, 1.5], 0.0), "within the noise of a splat");
        assert!(!goes_on([5.0, 0.0, 2.5], 0.0), "a step");
    }

    #[test]
    fn a_few_points_are_no_plane() {
        let points: Vec<Vector3<f64>> = (0..5).map(|n| Vector3::new(f64::from(n), f64::from(n * n), 0.0)).collect();
        assert!(Plane::through(&points, &UP).is_none());
    }
}
