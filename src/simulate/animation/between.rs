//! The object between two frames of the simulation.
//!
//! Positions follow a cubic through both frames whose slopes are the harmonic means of the neighbouring intervals'
//! (Fritsch and Butland, 1984), and zero where the motion turns: smooth in flight, and never beyond the two frames, so
//! that nothing sinks into the ground. Everything else is interpolated linearly, rotations along the shorter way.

use rayon::prelude::*;

use crate::scene::gaussians::Gaussians;

/// The frames of a simulation as a motion. Times are frames with a fraction, and must not decrease.
pub struct Motion<'a, E> {
    frames: usize,
    load: &'a mut dyn FnMut(usize) -> Result<Gaussians, E>,
    /// Index of the first of the two frames.
    first: usize,
    /// The frames `first` and `first + 1`.
    pair: Option<[Gaussians; 2]>,
    /// The positions in the frame before the first.
    before: Option<Vec<[f32; 3]>>,
    /// Frame `first + 2`.
    next: Option<Gaussians>,
}

impl<'a, E> Motion<'a, E> {
    /// A motion of `frames` frames, at least 2, that `load` returns by their index.
    pub fn new(frames: usize, load: &'a mut dyn FnMut(usize) -> Result<Gaussians, E>) -> Self {
        Self { frames, load, first: 0, pair: None, before: None, next: None }
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
        let after = self.next.as_ref().map(|next| &next.positions);
        Ok(between([from, to], [self.before.as_ref(), after], share))
    }

    fn advance(&mut self) -> Result<(), E> {
        let last = self.frames - 1;
        self.pair = Some(match self.pair.take() {
            None => [(self.load)(0)?, (self.load)(1.min(last))?],
            Some([from, to]) => {
                self.first += 1;
                self.before = Some(from.positions);
                [to, self.next.take().expect("there is a frame after those in front of the last")]
            }
        });
        self.next = if self.first + 2 <= last { Some((self.load)(self.first + 2)?) } else { None };
        Ok(())
    }
}

/// The Gaussians at the `share` of the way between two frames. `around` are the positions before and after them.
fn between([from, to]: [&Gaussians; 2], around: [Option<&Vec<[f32; 3]>>; 2], share: f32) -> Gaussians {
    let mix = |a: f32, b: f32| a + share * (b - a);
    let position = |(i, (a, b)): (usize, (&[f32; 3], &[f32; 3]))| {
        std::array::from_fn(|axis| {
            let slope = b[axis] - a[axis];
            let before = around[0].map_or(slope, |before| a[axis] - before[i][axis]);
            let after = around[1].map_or(slope, |after| after[i][axis] - b[axis]);
            cubic([a[axis], b[axis]], [tangent(before, slope), tangent(slope, after)], share)
        })
    };
    let rotation = |(a, b): (&[f32; 4], &[f32; 4])| {
        let cosine: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
        let sign = if cosine < 0.0 { -1.0 } else { 1.0 };
        let mixed: [f32; 4] = std::array::from_fn(|c| mix(a[c], sign * b[c]));
        let norm = mixed.iter().map(|c| c * c).sum::<f32>().sqrt();
        if norm > 0.0 { mixed.map(|c| c / norm) } else { *b }
    };
    let triple = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|c| mix(a[c], b[c]));
    Gaussians {
        positions: from.positions.par_iter().zip(&to.positions).enumerate().map(position).collect(),
        log_scales: from.log_scales.par_iter().zip(&to.log_scales).map(triple).collect(),
        rotations: from.rotations.par_iter().zip(&to.rotations).map(rotation).collect(),
        opacity_logits: to.opacity_logits.clone(),
        sh_dc: to.sh_dc.clone(),
        sh_degree: to.sh_degree,
        sh_rest: from.sh_rest.par_iter().zip(&to.sh_rest).map(|(a, b)| mix(*a, *b)).collect(),
        antialiased: to.antialiased,
        extra: Vec::new(),
        set_aside: to.set_aside.clone(),
    }
}

/// The slope between two intervals.
fn tangent(before: f32, after: f32) -> f32 {
    if before * after > 0.0 { 2.0 * before * after / (before + after) } else { 0.0 }
}

/// Hermite's cubic from the first value to the second.
fn cubic([from, to]: [f32; 2], [leaving, arriving]: [f32; 2], t: f32) -> f32 {
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
        let mut motion = Motion::new(8, &mut load);
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

    #[test]
    fn a_rotation_takes_the_shorter_way() {
        let [from, mut to] = [one(0.0, 0.0), one(0.0, 0.2)];
        to.rotations[0] = to.rotations[0].map(|c| -c);
        let half = between([&from, &to], [None; 2], 0.5);
        assert!((half.rotations[0][0] - 0.05f32.cos()).abs() < 1e-5, "{:?}", half.rotations);
    }
}
