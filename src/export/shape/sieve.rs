//! Sorts out most of the Gaussians that a line does not meet, eight at a time.
//!
//! A Gaussian is a ball of radius 1 once space is stretched by the square root of its precision, W. A line through a place
//! o from its centre, along n, is then `|W o x W n| / |W n|` from its middle. Computed like this, rounding has the effect of
//! moving the line by a few ten-millionths of the distances that occur (each row of W belongs to one axis of the Gaussian,
//! so errors are in proportion to its size along that axis), for which the limit below is raised. So no Gaussian is sorted out
//! that the exact computation meets, and results do not depend on the processor.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::simd::{LANES, Lanes, LanesKernel, run_lanes};

/// What rounding adds to distances, relative to the largest length that occurs over the smallest size of the Gaussian: some
/// twenty operations, each of which is off by half of this at most.
const OFF: f64 = 32.0 * f32::EPSILON as f64;
/// The same for the exact computation, whose squared distance is off in proportion to the square of that ratio.
const EXACTLY_OFF: f64 = 1e-12;

/// A Gaussian as the sieve needs it.
#[derive(Clone, Copy)]
pub struct Stretched {
    /// The rows of W; 0 if they are not known, so that the Gaussian is never sorted out.
    rows: Matrix3<f64>,
    /// How many standard deviations from the centre it has ended.
    ended: f64,
    /// The largest singular value of W.
    most: f64,
}

impl Stretched {
    /// `certain` is false if rounding may have spoiled the precision; `ended` is squared.
    pub fn of(precision: Matrix3<f64>, certain: bool, ended: f64) -> Self {
        let eigen = precision.symmetric_eigen();
        let roots = eigen.eigenvalues.map(f64::sqrt);
        let rows = Matrix3::from_diagonal(&roots) * eigen.eigenvectors.transpose();
        let is_known = certain && rows.iter().all(|v| v.is_finite());
        let rows = if is_known { rows } else { Matrix3::zeros() };
        Self { rows, ended: ended.max(0.0).sqrt(), most: if is_known { roots.max() } else { 0.0 } }
    }
}

/// Numbers of each Gaussian: the centre, the rows of W, and the squared limit.
const NUMBERS: usize = 13;

/// The Gaussians near a patch of a surface.
pub struct Sieve {
    /// All Gaussians' first number, then their second, and so on. Lengths are in `unit` from `middle`.
    numbers: Vec<f32>,
    /// Length of each list of numbers.
    len: usize,
    middle: Point3<f64>,
    unit: f64,
}

impl Sieve {
    /// Of Gaussians with these centres, for lines through places from which all that matters is within `extent` of `middle`.
    pub fn new(
        gaussians: impl ExactSizeIterator<Item = (Point3<f64>, Stretched)>,
        middle: Point3<f64>,
        extent: f64,
        unit: f64,
    ) -> Self {
        let len = gaussians.len().next_multiple_of(LANES);
        let mut numbers = vec![0.0; NUMBERS * len];
        // What fills the last eight up is never met.
        for (k, number) in [(3, 1.0), (7, 1.0), (11, 1.0), (12, -1.0)] {
            numbers[k * len + gaussians.len()..(k + 1) * len].fill(number);
        }
        for (n, (center, Stretched { rows, ended, most })) in gaussians.enumerate() {
            let from_middle = (center - middle) / unit;
            let longest = (extent / unit + from_middle.norm()) * most * unit;
            let limit = ended + OFF * longest + EXACTLY_OFF * longest * longest;
            let rows = rows.transpose() * unit;
            let limit = if most > 0.0 { limit * limit * (1.0 + 1e-5) } else { 0.0 };
            let all = from_middle.iter().chain(rows.iter()).chain([&limit]);
            all.enumerate().for_each(|(k, number)| numbers[k * len + n] = *number as f32);
        }
        Self { numbers, len, middle, unit }
    }

    /// Appends the numbers of the Gaussians that a line along the unit vector `normal` through `at` may meet, in their order.
    pub fn sift(&self, at: Point3<f64>, normal: Vector3<f64>, left: &mut Vec<usize>) {
        let Self { numbers, len, middle, unit } = self;
        let at = ((at - middle) / *unit).map(|c| c as f32).into();
        run_lanes(Sift { numbers, len: *len, at, normal: normal.map(|c| c as f32).into(), left });
    }
}

struct Sift<'a> {
    numbers: &'a [f32],
    len: usize,
    at: [f32; 3],
    normal: [f32; 3],
    left: &'a mut Vec<usize>,
}

impl LanesKernel for Sift<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { numbers, len, at, normal, left } = self;
        let (none, one) = (L::splat(0.0), L::splat(1.0));
        let along = [L::splat(normal[0]), L::splat(normal[1]), L::splat(normal[2])];
        let mut start = 0;
        while start < len {
            let mut offset = [none; 3];
            for axis in 0..3 {
                offset[axis] = L::splat(at[axis]) - L::load(&numbers[axis * len + start..]);
            }
            let (mut place, mut line) = ([none; 3], [none; 3]);
            for row in 0..3 {
                for axis in 0..3 {
                    let factor = L::load(&numbers[(3 + 3 * row + axis) * len + start..]);
                    place[row] = factor.mul_add(offset[axis], place[row]);
                    line[row] = factor.mul_add(along[axis], line[row]);
                }
            }
            let x = place[1] * line[2] - place[2] * line[1];
            let y = place[2] * line[0] - place[0] * line[2];
            let z = place[0] * line[1] - place[1] * line[0];
            let apart = x * x + y * y + z * z;
            let length = line[0] * line[0] + line[1] * line[1] + line[2] * line[2];
            let limit = L::load(&numbers[12 * len + start..]) * length;
            // Not the other way round: what is not a number is left.
            let may_meet = L::select(limit.less(apart), none, one);
            if L::any(none.less(may_meet)) {
                let mut lanes = [0.0; LANES];
                may_meet.store(&mut lanes);
                for (lane, may_meet) in lanes.iter().enumerate() {
                    if *may_meet > 0.0 {
                        left.push(start + lane);
                    }
                }
            }
            start += LANES;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flat and long Gaussians included, every one that a line comes as close to as its limit is left, and few others are.
    #[test]
    fn what_a_line_meets_is_left() {
        let mut random = fastrand::Rng::with_seed(1);
        let mut number = |from: f64, to: f64| from + (to - from) * random.f64();
        let ended: f64 = 9.0;
        let (mut met, mut left, mut far) = (0, 0, 0);
        for _ in 0..300 {
            let mut gaussians = Vec::new();
            for _ in 0..21 {
                let axis = Vector3::new(number(-1.0, 1.0), number(-1.0, 1.0), number(-1.0, 1.0));
                let turned = nalgebra::Rotation3::new(3.0 * axis);
                let sizes = [0, 1, 2].map(|_| 10f64.powf(number(-3.0, 0.5)));
                let precision = Matrix3::from_diagonal(&Vector3::from(sizes).map(|size| size.powi(-2)));
                let precision = turned * precision * turned.inverse();
                let center = Point3::new(number(0.0, 4.0), number(0.0, 4.0), number(0.0, 4.0));
                gaussians.push((center, Stretched::of(precision, true, ended), precision));
            }
            let middle = Point3::new(2.0, 2.0, 2.0);
            let members: Vec<_> = gaussians.iter().map(|(center, stretched, _)| (*center, *stretched)).collect();
            let sieve = Sieve::new(members.into_iter(), middle, 6.0, 0.7);
            for _ in 0..20 {
                let normal = Vector3::new(number(-1.0, 1.0), number(-1.0, 1.0), number(-1.0, 1.0)).normalize();
                let at = Point3::new(number(1.0, 3.0), number(1.0, 3.0), number(1.0, 3.0));
                let mut found = Vec::new();
                sieve.sift(at, normal, &mut found);
                assert!(found.is_sorted() && found.iter().all(|n| *n < gaussians.len()));
                left += found.len();
                for (n, (center, _, precision)) in gaussians.iter().enumerate() {
                    let offset = at - center;
                    let across = precision * normal;
                    let place = -across.dot(&offset) / across.dot(&normal);
                    let nearest = offset + normal * place;
                    let distance2 = nearest.dot(&(precision * nearest));
                    if distance2 <= ended && place.abs() <= 4.0 {
                        met += 1;
                        assert!(found.contains(&n), "{distance2}");
                    }
                    far += usize::from(distance2 > 1.1 * ended);
                }
            }
        }
        assert!(met > 1000 && far > met, "{met} {far}");
        assert!(left < 3 * met / 2, "{left} left, {met} met");
    }

    #[test]
    fn what_is_not_certain_is_left() {
        let unknown = Stretched::of(Matrix3::identity(), false, 9.0);
        let broken = Stretched::of(Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0)), true, 9.0);
        let certain = Stretched::of(Matrix3::identity(), true, 9.0);
        let far = Point3::new(50.0, 0.0, 0.0);
        let members = [unknown, broken, certain].map(|stretched| (far, stretched));
        let mut found = Vec::new();
        Sieve::new(members.into_iter(), Point3::origin(), 1.0, 1.0).sift(Point3::origin(), Vector3::z(), &mut found);
        assert_eq!(found, [0, 1]);
    }
}
