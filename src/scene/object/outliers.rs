//! Outliers: Gaussians that no cloud of this object can contain, and that would spoil every measurement on it. A single
//! one of 28,736 that is a metre wide hides the object in every view, stretches the grid that volumes are measured on,
//! and makes a hammer weigh 45 kg. Outliers are set aside: they stay in the cloud and in `field.ply`, at their indices,
//! but count as transparent.
//!
//! A trained Gaussian lies among others: at the ends of its ellipsoid (the solid one of the same covariance, whose
//! semi-axes are `sqrt(5)` standard deviations) there is another Gaussian close by, whether it is a flat one on a plain
//! wall or a long one on an edge. So two numbers are computed for each Gaussian that is large for this cloud or lies
//! outside of it:
//!
//! - its *reach*: how far the farthest of its six ends is from the nearest other centre;
//! - its *excess*: that reach divided by the size of its neighbours, the median of the largest semi-axes of the 16
//!   nearest.
//!
//! The size of the neighbours is a median, and the object's size is taken from quantiles of positions, so the two
//! numbers stay right even if one Gaussian in ten is wrong in any way. The limits come from the ten clouds that gprop
//! was calibrated on: the four fixtures and six scanned objects, of 16,967 to 36,491 Gaussians each. Among their
//! 241,179 Gaussians the largest reach is 0.115 of the object's size and the largest excess is 4.5, and in no cloud do
//! more than one in a thousand have an excess above 2. None of them is set aside.

use std::fmt;

use nalgebra::{Matrix3, Point3};
use thiserror::Error;

use crate::gaussians::{ELLIPSOID_DEVIATIONS, Gaussians};
use crate::numeric::nearest::Nearest;
use crate::numeric::upper_median;
use crate::parallel;
use crate::words::output::{agreeing, thousands};
use crate::words::progress::Progress;
use crate::words::readable::significant;

/// With fewer Gaussians it is not possible to say what is usual among them.
const LEAST_GAUSSIANS: usize = 32;
/// Share of the centres left out at either end of each axis when the object's size is measured: that many may lie
/// anywhere.
const TRIMMED: f64 = 0.1;
/// Number of neighbours that define what is usual around a Gaussian.
const NEIGHBOURS: usize = 16;
/// A Gaussian in the object that is less than this many times as large as the cloud's median one does no harm.
const LARGE: f64 = 2.0;
/// A Gaussian is examined, however small it is, if its centre lies farther outside of the box from which the object's
/// size is measured than this share of that size.
const OUTSIDE: f64 = 0.25;

/// Searches of a Gaussian that is examined: its neighbours, and the nearest centre of each of its six ends.
const SEARCHES: usize = 7;
/// All searches together take at most this many visits for each Gaussian of the cloud, so that the time does not grow with the square of
/// their number if a stranger makes half of them huge.
const VISITS: usize = 1024;
/// Each may take at least this many.
const LEAST_VISITS: usize = 512;
/// So many suspects may take seconds, so the user is told.
const MANY: usize = 100_000;
/// From an end that is farther from the box around all centres than this many times its size, all centres are equally far: the
/// distance of the box is that of the nearest one, within a thousandth.
const FAR: f64 = 1000.0;

/// A Gaussian that reaches farther than the object's size cannot belong to the object, whatever its neighbours are
/// like. If it reaches that far past the box around all centres, nothing is searched.
const REACH_MOST: f64 = 1.0;
/// Twice the largest excess measured.
const EXCESS_MOST: f64 = 9.0;
/// Twice the largest reach measured, as a share of the object's size. A longer one is too much if the excess is unusual
/// as well.
const LONG_REACH: f64 = 0.23;
/// An excess above this is unusual: one Gaussian in a thousand has it. In coarse clouds Gaussians reach far without
/// such an excess.
const UNUSUAL_EXCESS: f64 = 2.0;
/// If more than this share of the cloud (five times the share measured) has an unusual excess, many Gaussians went
/// wrong together, and all that have such an excess are set aside.
const CROWD: f64 = 0.005;

/// The Gaussians that were set aside.
#[derive(Debug, Clone, PartialEq)]
pub struct SetAside {
    /// Number of Gaussians set aside.
    pub count: usize,
    /// Number of Gaussians in the cloud.
    pub of: usize,
    /// Index in the cloud of the first of them.
    pub first: usize,
    /// Its centre, world frame, scene units.
    pub center: Point3<f64>,
    /// Its reach, scene units.
    pub reach: f64,
    /// Its excess: the reach divided by the size of its neighbours.
    pub excess: f64,
    /// The object's size: the diagonal of the box around most of its centres, scene units.
    pub size: f64,
}

/// Up to this share of a cloud, outliers are the strays that training leaves, and their absence changes no result.
const FEW: f64 = 0.001;

impl SetAside {
    /// True if they are so few that the user need not look.
    pub fn are_few(&self) -> bool {
        self.count as f64 <= FEW * self.of as f64
    }
}

/// The error that no Gaussian of a cloud is left.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("nothing is left of the splat: {0}; train it again, or export it in the units that its positions are in")]
pub struct AllSetAside(Box<SetAside>);

/// Marks the Gaussians that no cloud of this object can contain; `None` if there are none. Many suspects take seconds, which
/// `progress` shows.
///
/// # Errors
/// [`AllSetAside`] if no other Gaussian is left.
pub fn set_aside(gaussians: &mut Gaussians, progress: Progress) -> Result<Option<SetAside>, AllSetAside> {
    gaussians.set_aside.clear();
    let count = gaussians.len();
    let Some(core) = Core::of(gaussians) else { return Ok(None) };
    let Some(Outliers { indices, first }) = find(gaussians, &core, progress) else { return Ok(None) };
    let center = gaussians.center(first.index);
    let set_aside = SetAside {
        count: indices.len(),
        of: count,
        first: first.index,
        center,
        reach: first.reach,
        excess: first.excess,
        size: core.size(),
    };
    if indices.len() == count {
        return Err(AllSetAside(Box::new(set_aside)));
    }
    gaussians.set_aside = vec![false; count];
    indices.into_iter().for_each(|index| gaussians.set_aside[index] = true);
    Ok(Some(set_aside))
}

/// A Gaussian with its reach and excess.
struct Reaching {
    index: usize,
    /// Scene units.
    reach: f64,
    excess: f64,
}

/// The outliers of a cloud.
struct Outliers {
    /// Ascending.
    indices: Vec<usize>,
    first: Reaching,
}

/// `None` if there are no outliers.
fn find(gaussians: &Gaussians, core: &Core, progress: Progress) -> Option<Outliers> {
    let size = core.size();
    let suspects = suspects(gaussians, size, core);
    if suspects.is_empty() {
        return None;
    }
    let around = Core::around_all(gaussians);
    let reaches_past_all = |&i: &usize| ends(gaussians, i).any(|end| around.distance(end) > REACH_MOST * size);
    let (far, near): (Vec<usize>, Vec<usize>) = suspects.into_iter().partition(reaches_past_all);
    let centers = Centers::of(gaussians, around, near.len());
    let measured = measured(gaussians, &near, &centers, size, progress);
    let unusual = measured.iter().filter(|one| one.excess > UNUSUAL_EXCESS).count();
    let is_crowd = (far.len() + unusual) as f64 > CROWD * gaussians.len() as f64;
    let is_outlier = |one: &&Reaching| {
        one.reach > REACH_MOST * size
            || one.excess > EXCESS_MOST
            || (one.excess > UNUSUAL_EXCESS && (is_crowd || one.reach > LONG_REACH * size))
    };
    let mut indices = far;
    indices.extend(measured.iter().filter(is_outlier).map(|one| one.index));
    indices.sort_unstable();
    let first = Reaching::of(gaussians, *indices.first()?, &centers);
    Some(Outliers { indices, first })
}

/// The Gaussians that are large for this cloud or lie outside of it.
fn suspects(gaussians: &Gaussians, size: f64, core: &Core) -> Vec<usize> {
    let usual = upper_median((0..gaussians.len()).map(|i| gaussians.scale(i).max()).collect()).unwrap_or_default();
    let is_suspect = |i: usize| {
        let largest = gaussians.scale(i).max();
        largest > LARGE * usual
            || ELLIPSOID_DEVIATIONS * largest > REACH_MOST * size
            || core.distance(gaussians.center(i)) > OUTSIDE * size
    };
    parallel::flat_map_range(gaussians.len(), |i| is_suspect(i).then_some(i))
}

/// The reach and the excess of those Gaussians at `indices` that may be outliers in a cloud of this `size`, in their order.
fn measured(
    gaussians: &Gaussians,
    indices: &[usize],
    centers: &Centers,
    size: f64,
    progress: Progress,
) -> Vec<Reaching> {
    /// Steps of the bar.
    const TOGETHER: usize = 4096;
    if indices.len() >= MANY {
        let (many, all) = (thousands(indices.len() as u64), thousands(gaussians.len() as u64));
        progress.line(&format!(
            "{many} of {all} Gaussians are far larger than the others or lie outside of them; looking at each may take a minute"
        ));
    }
    let bar = progress.bar("outliers", indices.len() as u64).with_message("Gaussians");
    let of_some = |some: &&[usize]| -> Vec<Reaching> {
        let measured = some.iter().filter_map(|&i| Reaching::if_doubtful(gaussians, i, centers, size)).collect();
        bar.inc(some.len() as u64);
        measured
    };
    let measured = parallel::flat_map(&indices.chunks(TOGETHER).collect::<Vec<_>>(), of_some);
    bar.finish_and_clear();
    measured
}

/// The six ends of a Gaussian's ellipsoid.
fn ends(gaussians: &Gaussians, i: usize) -> impl Iterator<Item = Point3<f64>> {
    let center = gaussians.center(i);
    let turn = gaussians.rotation(i).to_rotation_matrix().into_inner();
    let axes = turn * Matrix3::from_diagonal(&(gaussians.scale(i) * ELLIPSOID_DEVIATIONS));
    (0..3).flat_map(move |axis| [center + axes.column(axis), center - axes.column(axis)])
}

impl Reaching {
    fn of(gaussians: &Gaussians, i: usize, centers: &Centers) -> Self {
        Self::among(gaussians, i, &Neighbours::of(gaussians, i, centers), centers)
    }

    /// `None` if it is far from an outlier in a cloud of this `size`, which is much faster to tell.
    fn if_doubtful(gaussians: &Gaussians, i: usize, centers: &Centers, size: f64) -> Option<Self> {
        let around = Neighbours::of(gaussians, i, centers);
        // The centre nearest to its own is no farther from any of its ends than this.
        let most = ELLIPSOID_DEVIATIONS * gaussians.scale(i).max() + around.nearest;
        let is_usual = most <= UNUSUAL_EXCESS * around.size && most <= REACH_MOST * size;
        (!is_usual).then(|| Self::among(gaussians, i, &around, centers))
    }

    fn among(gaussians: &Gaussians, i: usize, around: &Neighbours, centers: &Centers) -> Self {
        let place = gaussians.positions[i];
        let distance = |end: Point3<f64>| match centers.around.distance(end) {
            far if far > FAR * centers.around.size() => far,
            _ => {
                let nearest = centers.near(end.coords.map(|v| v as f32).into(), 1, place).next();
                nearest.map_or(0.0, |(squared, _)| f64::from(squared).sqrt())
            }
        };
        let reach = ends(gaussians, i).map(distance).fold(0.0, f64::max);
        Self { index: i, reach, excess: reach / around.size }
    }
}

/// What is around a Gaussian.
struct Neighbours {
    /// Distance of the nearest other centre, scene units.
    nearest: f64,
    /// The median of the largest semi-axes of the nearest Gaussians, scene units.
    size: f64,
}

impl Neighbours {
    fn of(gaussians: &Gaussians, i: usize, centers: &Centers) -> Self {
        let place = gaussians.positions[i];
        let (squared, largest): (Vec<f32>, Vec<f64>) =
            centers.near(place, NEIGHBOURS, place).map(|(squared, j)| (squared, gaussians.scale(j).max())).unzip();
        let nearest = squared.first().map_or(f64::INFINITY, |squared| f64::from(*squared).sqrt());
        Self { nearest, size: ELLIPSOID_DEVIATIONS * upper_median(largest).unwrap_or_default() }
    }
}

/// The centres to search, each position once: Gaussians at the same point do not count as neighbours of each other.
struct Centers {
    places: Nearest,
    /// The box around all of them.
    around: Core,
    /// How many visits a search may take.
    visits: usize,
    /// For each position, the first Gaussian there.
    first: Vec<u32>,
    positions: Vec<[f32; 3]>,
}

impl Centers {
    /// The centres of a cloud, which lie in the box `around`, and to which the ends of this many suspects are searched.
    fn of(gaussians: &Gaussians, around: Core, suspects: usize) -> Self {
        let key = |i: &u32| gaussians.positions[*i as usize].map(|side| (side + 0.0).to_bits());
        let mut first: Vec<u32> = (0..gaussians.len() as u32).collect();
        parallel::sort_unstable_by(&mut first, |a, b| (key(a), a).cmp(&(key(b), b)));
        first.dedup_by_key(|i| key(i));
        let positions: Vec<[f32; 3]> = first.iter().map(|&i| gaussians.positions[i as usize]).collect();
        let visits = visits(gaussians.len(), suspects);
        Self { places: Nearest::new(positions.iter().copied()), around, visits, first, positions }
    }

    /// Squared distance and Gaussian of the `count` positions nearest to a point, excluding the position `own`.
    fn near(&self, to: [f32; 3], count: usize, own: [f32; 3]) -> impl Iterator<Item = (f32, usize)> {
        let found = self.places.find_within(to, count + 1, self.visits).into_iter();
        let others = found.filter(move |(_, place)| self.positions[*place as usize] != own);
        others.take(count).map(|(squared, place)| (squared, self.first[place as usize] as usize))
    }
}

/// How many visits each search may take among this many Gaussians with this many suspects.
fn visits(gaussians: usize, suspects: usize) -> usize {
    (VISITS * gaussians / (SEARCHES * suspects.max(1))).max(LEAST_VISITS)
}

/// The box around most of the centres.
struct Core {
    low: Point3<f64>,
    high: Point3<f64>,
}

impl Core {
    /// `None` if there are too few Gaussians, or most of them lie in one point.
    fn of(gaussians: &Gaussians) -> Option<Self> {
        let count = gaussians.len();
        if count < LEAST_GAUSSIANS {
            return None;
        }
        let cut = (count as f64 * TRIMMED) as usize;
        let (mut low, mut high) = (Point3::origin(), Point3::origin());
        for axis in 0..3 {
            let mut values: Vec<f32> = gaussians.positions.iter().map(|position| position[axis]).collect();
            low[axis] = f64::from(*values.select_nth_unstable_by(cut, f32::total_cmp).1);
            high[axis] = f64::from(*values.select_nth_unstable_by(count - 1 - cut, f32::total_cmp).1);
        }
        let core = Self { low, high };
        (core.size() > 0.0).then_some(core)
    }

    /// The box around all centres.
    fn around_all(gaussians: &Gaussians) -> Self {
        let side = |axis: usize| gaussians.positions.iter().map(move |position| f64::from(position[axis]));
        let low = std::array::from_fn(|axis| side(axis).fold(f64::INFINITY, f64::min)).into();
        let high = std::array::from_fn(|axis| side(axis).fold(f64::NEG_INFINITY, f64::max)).into();
        Self { low, high }
    }

    fn size(&self) -> f64 {
        (self.high - self.low).norm()
    }

    /// The distance of a point outside the box, scene units.
    fn distance(&self, point: Point3<f64>) -> f64 {
        let beyond = (self.low - point).sup(&(point - self.high));
        beyond.map(|side| side.max(0.0)).norm()
    }
}

impl fmt::Display for SetAside {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { count, of, first, center, reach, size, .. } = self;
        write!(
            f,
            "set aside {count} of {of} Gaussians, {} too large or too far away to belong to the object: {} neither drawn nor \
             weighed, and field.ply keeps {}. The first is Gaussian {first} (counted from 0) at \
             {:.3},{:.3},{:.3}, and reaches {} times the object's size beyond the rest",
            agreeing(*count, "a stray,", "strays,"),
            agreeing(*count, "it is", "they are"),
            agreeing(*count, "it", "them"),
            center.x,
            center.y,
            center.z,
            significant(reach / size),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_searches_together_grow_with_the_number_of_gaussians() {
        let most = |count: usize| {
            let suspects = [1, count / 1000, count / 100, count / 10, count / 2, count];
            suspects.map(|suspects| SEARCHES * suspects * visits(count, suspects)).into_iter().max().unwrap()
        };
        for count in [1000, 10_000, 100_000, 1_000_000] {
            assert!(most(10 * count) <= 12 * most(count));
        }
    }
}
