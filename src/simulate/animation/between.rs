//! The object between two frames of the simulation.
//!
//! The object's centre follows a cubic through both frames. Its slope at a frame is the harmonic mean of the slopes of
//! the intervals before and after (Fritsch and Butland, 1984), or zero if the motion reverses there, so that the cubic is
//! smooth in flight and never goes beyond the two frames. About its centre the object turns steadily, by the rotation
//! that fits its Gaussians best, so that what is rigid keeps its shape between the frames as well. The rest of the
//! Gaussians' motion, and everything else, is interpolated linearly, rotations along the shorter way. Gaussians that are
//! not simulated have no part in this: they stay in place.
//!
//! The frames hold covariances as scales along axes, and which axis comes first, and which way it points, may differ from
//! frame to frame. A Gaussian whose axes differ has the shape that it has in the nearer frame.

use nalgebra::{Point3, Vector3};

use crate::gaussians::{Gaussians, wxyz};
use crate::numeric;
use crate::parallel;

/// The cosine of half the angle between axes up to which they are the same axes: about 50 degrees. A flipped or exchanged
/// axis turns them by 90 degrees or more.
const ALIKE: f64 = 0.9;

/// The frames of a simulation as a motion. Times are counted in frames, with a fraction, and must not decrease from one
/// call to the next.
pub struct Motion<'a, E> {
    frames: usize,
    /// Per Gaussian: whether it is simulated.
    simulated: &'a [bool],
    load: &'a mut dyn FnMut(usize) -> Result<Gaussians, E>,
    /// Index of the first of the two frames.
    first: usize,
    /// The frames `first` and `first + 1`.
    pair: Option<[Gaussians; 2]>,
    /// The centre in the frame before the first.
    before: Option<Point3<f64>>,
    /// Frame `first + 2`.
    next: Option<Gaussians>,
}

impl<'a, E> Motion<'a, E> {
    /// A motion of `frames` frames, at least 2, that `load` returns by their index.
    pub fn new(frames: usize, simulated: &'a [bool], load: &'a mut dyn FnMut(usize) -> Result<Gaussians, E>) -> Self {
        Self { frames, simulated, load, first: 0, pair: None, before: None, next: None }
    }

    /// The Gaussians at `time`.
    ///
    /// # Errors
    /// The errors of `load`.
    pub fn at(&mut self, time: f64) -> Result<Gaussians, E> {
        let first = (time as usize).min(self.frames.saturating_sub(2));
        while self.pair.is_none() || self.first < first {
            self.advance()?;
        }
        let [from, to] = self.pair.as_ref().expect("loaded above");
        let share = (time - first as f64).clamp(0.0, 1.0) as f32;
        let after = self.next.as_ref().map(|next| center(next, self.simulated));
        Ok(between([from, to], self.simulated, [self.before, after], share))
    }

    fn advance(&mut self) -> Result<(), E> {
        let last = self.frames - 1;
        self.pair = Some(match self.pair.take() {
            None => [(self.load)(0)?, (self.load)(1.min(last))?],
            Some([from, to]) => {
                self.first += 1;
                self.before = Some(center(&from, self.simulated));
                [to, self.next.take().expect("only the last pair has no next frame")]
            }
        });
        self.next = if self.first + 2 <= last { Some((self.load)(self.first + 2)?) } else { None };
        Ok(())
    }
}

/// The Gaussians at the `share` of the way between two frames. `around` are the centres before and after them.
fn between([from, to]: [&Gaussians; 2], simulated: &[bool], around: [Option<Point3<f64>>; 2], share: f32) -> Gaussians {
    let mix = |a: f32, b: f32| a + share * (b - a);
    let centers = [center(from, simulated), center(to, simulated)];
    let slope = centers[1] - centers[0];
    let (before, after) =
        (around[0].map_or(slope, |before| centers[0] - before), around[1].map_or(slope, |after| after - centers[1]));
    let middle = Point3::from(Vector3::from_fn(|a, _| {
        cubic([centers[0][a], centers[1][a]], [tangent(before[a], slope[a]), tangent(slope[a], after[a])], share.into())
    }));
    let turn = numeric::rigid_motion(moving(simulated).map(|i| (from.center(i), to.center(i)))).rotation;
    let (turned, back) = (turn.powf(share.into()), turn.inverse());
    let position = |i: usize| {
        if !simulated[i] {
            return from.positions[i];
        }
        let (a, b) = (from.center(i) - centers[0], back * (to.center(i) - centers[1]));
        (middle + turned * a.lerp(&b, share.into())).map(|x| x as f32).into()
    };
    let shape = |i: usize| {
        if !simulated[i] {
            return (from.rotations[i], from.log_scales[i]);
        }
        let (a, b) = (from.rotation(i), back * to.rotation(i));
        let scales = [from.log_scales[i], to.log_scales[i]];
        let (own, scales) = if a.coords.dot(&b.coords).abs() > ALIKE {
            (a.slerp(&b, share.into()), std::array::from_fn(|c| mix(scales[0][c], scales[1][c])))
        } else if share < 0.5 {
            (a, scales[0])
        } else {
            (b, scales[1])
        };
        let q = turned * own;
        (wxyz(&q), scales)
    };
    let (rotations, log_scales) = parallel::map_range(from.len(), shape).into_iter().unzip();
    Gaussians {
        positions: parallel::map_range(from.len(), position),
        log_scales,
        rotations,
        opacity_logits: to.opacity_logits.clone(),
        sh_dc: to.sh_dc.clone(),
        sh_degree: to.sh_degree,
        sh_rest: parallel::map_range(from.sh_rest.len(), |n| mix(from.sh_rest[n], to.sh_rest[n])),
        antialiased: to.antialiased,
        extra: Vec::new(),
        set_aside: to.set_aside.clone(),
        surface: to.surface.clone(),
    }
}

/// The Gaussians that move with the object.
fn moving(simulated: &[bool]) -> impl Iterator<Item = usize> + Clone {
    (0..simulated.len()).filter(move |&i| simulated[i])
}

/// The mean position of the Gaussians that move with the object.
fn center(gaussians: &Gaussians, simulated: &[bool]) -> Point3<f64> {
    let sum: Vector3<f64> = moving(simulated).map(|i| gaussians.center(i).coords).sum();
    (sum / moving(simulated).count().max(1) as f64).into()
}

/// The slope at the frame between two intervals.
fn tangent(before: f64, after: f64) -> f64 {
    if before * after > 0.0 { 2.0 * before * after / (before + after) } else { 0.0 }
}

/// Hermite's cubic from the first value to the second.
fn cubic([from, to]: [f64; 2], [leaving, arriving]: [f64; 2], t: f64) -> f64 {
    let (square, cube) = (t * t, t * t * t);
    from + (3.0 * square - 2.0 * cube) * (to - from) + (cube - 2.0 * square + t) * leaving + (cube - square) * arriving
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One Gaussian at this height, turned about z by an angle.
    fn one(z: f32, angle: f32) -> Gaussians {
        let (sin, cos) = (0.5 * angle).sin_cos();
        Gaussians {
            positions: vec![[0.0, 0.0, z]],
            log_scales: vec![[0.0; 3]],
            rotations: vec![[cos, 0.0, 0.0, sin]],
            opacity_logits: vec![1.0],
            sh_dc: vec![[0.0; 3]],
            ..Gaussians::default()
        }
    }

    #[test]
    fn a_fall_is_smooth_and_ends_on_the_ground() {
        // z = 16 - n^2 until the ground at n = 4, then rest.
        let height = |n: usize| 16.0 - (n.min(4) as f32).powi(2);
        let mut load = |n: usize| Ok::<_, ()>(one(height(n), 0.1 * n as f32));
        let mut motion = Motion::new(8, &[true], &mut load);
        let mut last = f32::INFINITY;
        for step in 0..=70 {
            let time = f64::from(step) / 10.0;
            let now = motion.at(time).unwrap();
            let z = now.positions[0][2];
            assert!((0.0..=last).contains(&z), "{z} at {time}");
            if (1.0..3.0).contains(&time) {
                let true_z = 16.0 - time * time;
                // Linear interpolation would be off by 0.25.
                assert!((f64::from(z) - true_z).abs() < 0.1, "{z}, not {true_z}, at {time}");
            }
            let angle = 2.0 * now.rotations[0][3].atan2(now.rotations[0][0]);
            assert!((f64::from(angle) - 0.1 * time).abs() < 1e-4, "{angle} at {time}");
            last = z;
        }
        assert_eq!(motion.at(7.0).unwrap().positions, [[0.0; 3]]);
    }

    /// A box of Gaussians that turns by a quarter between two frames: halfway, all distances are those of the frames.
    #[test]
    fn what_turns_keeps_its_shape() {
        let corners = || (0..8).map(|n| [(n & 1) as f32, 0.2 * (n >> 1 & 1) as f32, 0.1 * (n >> 2) as f32]);
        let frame = |positions: Vec<[f32; 3]>| Gaussians {
            log_scales: vec![[0.0; 3]; positions.len()],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; positions.len()],
            opacity_logits: vec![1.0; positions.len()],
            sh_dc: vec![[0.0; 3]; positions.len()],
            positions,
            ..Gaussians::default()
        };
        let (mut from, mut to) =
            (frame(corners().collect()), frame(corners().map(|[x, y, z]| [-y, x, z - 3.0]).collect()));
        let sine = std::f32::consts::FRAC_1_SQRT_2;
        to.rotations.fill([sine, 0.0, 0.0, sine]);
        // A needle whose turn by a quarter is written as an exchange of its axes.
        from.log_scales[0] = [0.0, -5.0, -5.0];
        (to.log_scales[0], to.rotations[0]) = ([-5.0, 0.0, -5.0], [1.0, 0.0, 0.0, 0.0]);
        for share in [0.3, 0.5, 0.7] {
            let now = between([&from, &to], &[true; 8], [None; 2], share);
            let needle = now.rotation(0)
                * Vector3::ith(now.log_scales[0].map(f64::from).into_iter().position(|s| s == 0.0).unwrap(), 1.0);
            let angle = needle.y.atan2(needle.x).rem_euclid(std::f64::consts::PI);
            assert!((angle - f64::from(share) * std::f64::consts::FRAC_PI_2).abs() < 1e-6, "{angle} at {share}");
        }
        let half = between([&from, &to], &[true; 8], [None; 2], 0.5);
        for (i, j) in (0..8).flat_map(|i| (0..i).map(move |j| (i, j))) {
            let distance = |g: &Gaussians| (g.center(i) - g.center(j)).norm();
            // f32 at lengths of 3.
            assert!((distance(&half) - distance(&from)).abs() < 1e-6, "{i} {j}: {}", distance(&half));
        }
        let height = |g: &Gaussians| center(g, &[true; 8]).z;
        assert!((height(&half) - (height(&from) - 1.5)).abs() < 1e-6);
    }

    /// A Gaussian that is not simulated, far away, stays in place and has no part in how the others move.
    #[test]
    fn what_is_not_simulated_does_not_bend_the_motion() {
        const STRAY: [f32; 3] = [90.0, -40.0, 70.0];
        let frame = |positions: Vec<[f32; 3]>| Gaussians {
            log_scales: vec![[0.0; 3]; positions.len()],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; positions.len()],
            opacity_logits: vec![1.0; positions.len()],
            sh_dc: vec![[0.0; 3]; positions.len()],
            positions,
            ..Gaussians::default()
        };
        // A right angle that turns by a quarter about z.
        let places = [
            vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
            vec![[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-2.0, 0.0, 0.0]],
        ];
        let [alone, accompanied] = [false, true].map(|with_stray| {
            let [from, to] = places.clone().map(|mut positions| {
                positions.extend(with_stray.then_some(STRAY));
                frame(positions)
            });
            let simulated = [true, true, true, false];
            let between = between([&from, &to], &simulated[..from.len()], [None; 2], 0.5);
            (between.positions, between.rotations)
        });
        assert_eq!((&alone.0[..], &alone.1[..]), (&accompanied.0[..3], &accompanied.1[..3]));
        assert_eq!((accompanied.0[3], accompanied.1[3]), (STRAY, [1.0, 0.0, 0.0, 0.0]));
    }

    #[test]
    fn a_rotation_takes_the_shorter_way() {
        let [from, mut to] = [one(0.0, 0.0), one(0.0, 0.2)];
        to.rotations[0] = to.rotations[0].map(|c| -c);
        let half = between([&from, &to], &[true], [None; 2], 0.5);
        assert!((half.rotations[0][0] - 0.05f32.cos()).abs() < 1e-5, "{:?}", half.rotations);
    }
}
