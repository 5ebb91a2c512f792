//! Refines a similarity by the Levenberg-Marquardt method: its seven parameters are changed so that the sum of squared
//! differences between the photos and the splat's pictures falls. Derivatives are differences of pictures; these are drawn
//! in less detail than what is compared with the photos, since they only say which way to go.

use nalgebra::{Point3, SMatrix, SVector, Similarity3, Translation3, UnitQuaternion, Vector3};

use super::pictures::{blur, drawn, sketched};
use crate::gaussians::Gaussians;
use crate::inspect::verdict::Small;
use crate::parallel;

/// Three of rotation (radians), three of shift (radii of the object), the logarithm of the scale.
const PARAMETERS: usize = 7;
type Step = SVector<f64, PARAMETERS>;
type Normal = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// A refinement ends if a step lowers the sum by less than this share: a hundredth of a decibel is 0.0023.
const LEAST_GAIN: f64 = 1e-3;
/// Number of times the damping is raised tenfold before a step is given up.
const ATTEMPTS: usize = 3;

/// The photos and the splat that a similarity is to bring together.
pub(super) struct Problem<'a> {
    pub cloud: &'a Gaussians,
    /// The same in fewer Gaussians, for the derivatives.
    pub sketch: &'a Gaussians,
    /// Blurred `passes` times.
    pub views: &'a [Small],
    /// How often what is drawn is blurred before it is compared: thin things that do not overlap attract each other only if
    /// they are blurred.
    pub passes: usize,
    /// About which the similarity is turned and scaled, in the splat's world.
    pub center: Point3<f64>,
    /// The unit of shifts.
    pub radius: f64,
}

/// A similarity from the cameras' world to the splat's, and the mean squared difference of photos and splat with it.
#[derive(Clone, Copy)]
pub(super) struct Fitted {
    pub similarity: Similarity3<f64>,
    pub error: f64,
}

/// The sum of squared differences with what a step changes.
struct Slope {
    sum: f64,
    gradient: Step,
    normal: Normal,
}

impl Problem<'_> {
    /// The similarity after at most `steps` steps from `start`, none of which raises the error.
    pub fn refined(&self, start: Similarity3<f64>, steps: usize) -> Fitted {
        let values: usize = self.views.iter().map(|view| view.picture.len()).sum();
        let mut similarity = start;
        let mut damping = 1e-2;
        let mut slope = self.slope(&similarity);
        let mut sum = slope.sum;
        for step in 0..steps {
            let Some((next, lower)) = self.lower(&similarity, &slope, &mut damping) else { break };
            let gain = sum - lower;
            (similarity, sum) = (next, lower);
            if gain < LEAST_GAIN * slope.sum || step + 1 == steps {
                break;
            }
            slope = self.slope(&similarity);
        }
        Fitted { similarity, error: sum / values.max(1) as f64 }
    }

    /// The similarity with a lower sum, and that sum; `None` if no step lowers it.
    fn lower(&self, from: &Similarity3<f64>, slope: &Slope, damping: &mut f64) -> Option<(Similarity3<f64>, f64)> {
        for _ in 0..ATTEMPTS {
            let damped =
                slope.normal + Normal::from_diagonal(&(slope.normal.diagonal().add_scalar(f64::EPSILON) * *damping));
            let step = damped.cholesky().map(|solver| solver.solve(&-slope.gradient));
            if let Some(next) = step.map(|step| self.stepped(from, &step)) {
                let sum = self.sum(&next);
                if sum < slope.sum {
                    *damping = (*damping / 10.0).max(1e-7);
                    return Some((next, sum));
                }
            }
            *damping *= 10.0;
        }
        None
    }

    /// The similarity turned, shifted and scaled about the middle of the object.
    fn stepped(&self, from: &Similarity3<f64>, step: &Step) -> Similarity3<f64> {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[0], step[1], step[2]));
        let shift = Vector3::new(step[3], step[4], step[5]) * self.radius;
        let about_origin = Similarity3::from_parts(Translation3::from(shift), turn, step[6].exp());
        let to_center = Translation3::from(self.center.coords);
        to_center * about_origin * to_center.inverse() * from
    }

    fn drawn(&self, view: &Small, similarity: &Similarity3<f64>) -> Vec<f32> {
        self.blurred(view, drawn(self.cloud, &view.camera, similarity))
    }

    fn sketched(&self, view: &Small, similarity: &Similarity3<f64>) -> Vec<f32> {
        self.blurred(view, sketched(self.sketch, &view.camera, similarity))
    }

    fn blurred(&self, view: &Small, mut picture: Vec<f32>) -> Vec<f32> {
        blur(&mut picture, view.camera.intrinsics.width as usize, self.passes);
        picture
    }

    fn sum(&self, similarity: &Similarity3<f64>) -> f64 {
        let of_view = |view: &Small| -> f64 {
            let drawn = self.drawn(view, similarity);
            drawn.iter().zip(&view.picture).map(|(a, b)| f64::from(a - b).powi(2)).sum()
        };
        parallel::map(self.views, of_view).into_iter().sum()
    }

    fn slope(&self, similarity: &Similarity3<f64>) -> Slope {
        let of_view = |view: &Small| self.slope_of_view(view, similarity);
        let slopes: Vec<Slope> = parallel::map(self.views, of_view);
        let none = Slope { sum: 0.0, gradient: Step::zeros(), normal: Normal::zeros() };
        // In the order of the views, whatever the number of threads.
        slopes.into_iter().fold(none, |all, one| Slope {
            sum: all.sum + one.sum,
            gradient: all.gradient + one.gradient,
            normal: all.normal + one.normal,
        })
    }

    fn slope_of_view(&self, view: &Small, similarity: &Similarity3<f64>) -> Slope {
        let pictured = self.drawn(view, similarity);
        // About a pixel's worth of movement at the edge of the object.
        let difference = 2.0 / f64::from(view.camera.intrinsics.width.max(view.camera.intrinsics.height));
        let unchanged = self.sketched(view, similarity);
        let changed: Vec<Vec<f32>> = (0..PARAMETERS)
            .map(|parameter| {
                let mut step = Step::zeros();
                step[parameter] = difference;
                self.sketched(view, &self.stepped(similarity, &step))
            })
            .collect();
        let mut slope = Slope { sum: 0.0, gradient: Step::zeros(), normal: Normal::zeros() };
        for (at, (value, photo)) in pictured.iter().zip(&view.picture).enumerate() {
            let residual = f64::from(value - photo);
            let along = Step::from_fn(|parameter, _| f64::from(changed[parameter][at] - unchanged[at]) / difference);
            slope.sum += residual * residual;
            slope.gradient += along * residual;
            slope.normal += along * along.transpose();
        }
        slope
    }
}
