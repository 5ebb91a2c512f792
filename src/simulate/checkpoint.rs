//! The state that a run needs to continue after a frame, as bytes: a run resumed from a checkpoint produces the same
//! bytes as one that was never interrupted.
//!
//! Layout, little endian: magic, version (u32), identity of the run (32 bytes), length of the record (u64), the record
//! as JSON, number of values in the rigid bodies' state (u64), these values (f64), number of deforming particles (u64), then
//! each of them as 42 words.

use std::io::{self, Write};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::error::SimulateError;
use super::object::Particles;
use super::states::{self, State};
use crate::files::json;
use crate::mpm::particles::Particle;
use crate::parallel;

const MAGIC: &[u8; 8] = b"gpropmpm";
const VERSION: u32 = 5;
/// 32-bit words per particle.
const WORDS: usize = 42;

/// A frame in numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct FrameSummary {
    pub t_s: f64,
    /// World frame.
    pub center_of_mass_m: [f64; 3],
    pub kinetic_energy_j: f64,
    /// Stored in elastic strain.
    pub elastic_energy_j: f64,
    /// The object's bounds without a few strays: lowest and highest corner, world frame, scene units.
    pub bounds: [[f64; 3]; 2],
}

/// The results of a run so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Steps taken after the free fall.
    pub substeps: u64,
    /// Longest step taken after the free fall; 0 before the first.
    pub longest_dt_s: f64,
    /// The completed frames; the next one is number `frames.len()`.
    pub frames: Vec<FrameSummary>,
}

/// The state after a frame, as passed to the caller.
pub struct Snapshot<'a> {
    pub(super) identity: &'a [u8; 32],
    pub(super) record: &'a Record,
    pub(super) particles: &'a Particles<'a>,
}

impl Snapshot<'_> {
    /// Writes a checkpoint that [`Checkpoint::from_bytes`] reads.
    ///
    /// # Errors
    /// If writing fails.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let record = json::compact(self.record)?;
        out.write_all(MAGIC)?;
        out.write_all(&VERSION.to_le_bytes())?;
        out.write_all(self.identity)?;
        out.write_all(&(record.len() as u64).to_le_bytes())?;
        out.write_all(record.as_bytes())?;
        let bodies = self.particles.body_numbers();
        out.write_all(&(bodies.len() as u64).to_le_bytes())?;
        bodies.iter().try_for_each(|number| out.write_all(&number.to_le_bytes()))?;
        out.write_all(&(self.particles.deforming().len() as u64).to_le_bytes())?;
        self.particles.deforming().flat_map(|p| words(&p)).try_for_each(|word| out.write_all(&word.to_le_bytes()))
    }

    /// Writes the particles for other programs.
    ///
    /// # Errors
    /// If writing fails.
    pub fn write_states(&self, out: &mut dyn Write) -> io::Result<()> {
        let states: Vec<State> = parallel::map_range(self.particles.count(), |i| self.particles.get(i).into());
        states::write(out, &states)
    }
}

/// The state after a frame, read back.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    pub(super) identity: [u8; 32],
    pub(super) record: Record,
    /// See [`Object::numbers`](super::object::Object::numbers).
    pub(super) bodies: Vec<f64>,
    /// Those that deform.
    pub(super) particles: Vec<Particle>,
}

impl Checkpoint {
    /// Number of completed frames.
    pub fn frames(&self) -> usize {
        self.record.frames.len()
    }

    /// Checks that it belongs to the run with this identity.
    pub(super) fn require_identity(&self, identity: &[u8; 32]) -> Result<(), SimulateError> {
        if self.identity != *identity {
            return Err(SimulateError::Checkpoint("it belongs to another scene or other options".to_owned()));
        }
        Ok(())
    }

    /// Checks that its frames are the first of a run of `frames` frames, at the times that `time_of` gives, and that an object can
    /// be where they say.
    pub(super) fn require_times(&self, frames: usize, time_of: &dyn Fn(usize) -> f64) -> Result<(), SimulateError> {
        let done = &self.record.frames;
        let is_framed = |summary: &FrameSummary| {
            let [low, high] = summary.bounds;
            (0..3).all(|axis| low[axis] <= high[axis] && (high[axis] - low[axis]).is_finite())
        };
        let fits = |(index, summary): (usize, &FrameSummary)| summary.t_s == time_of(index) && is_framed(summary);
        if done.is_empty() || done.len() > frames || !done.iter().enumerate().all(fits) {
            return Err(SimulateError::Checkpoint("its frames are not those of this run".to_owned()));
        }
        Ok(())
    }

    /// # Errors
    /// [`SimulateError::Checkpoint`] if the bytes are not a complete checkpoint of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SimulateError> {
        let mut rest = bytes;
        if take(&mut rest, MAGIC.len())? != MAGIC {
            return Err(SimulateError::Checkpoint("it is not a checkpoint of a simulation".to_owned()));
        }
        let version = u32::from_le_bytes(array(take(&mut rest, 4)?));
        if version != VERSION {
            return Err(SimulateError::Checkpoint(format!("its version is {version}, not {VERSION}")));
        }
        let identity = array(take(&mut rest, 32)?);
        let length = u64::from_le_bytes(array(take(&mut rest, 8)?));
        let record = json::read(take(&mut rest, usize::try_from(length).unwrap_or(usize::MAX))?)
            .map_err(|error| SimulateError::Checkpoint(format!("its record is damaged ({error})")))?;
        let numbers = u64::from_le_bytes(array(take(&mut rest, 8)?));
        let bytes = usize::try_from(numbers).ok().and_then(|n| n.checked_mul(8)).unwrap_or(usize::MAX);
        let bodies = take(&mut rest, bytes)?.chunks_exact(8).map(|n| f64::from_le_bytes(array(n))).collect();
        let count = u64::from_le_bytes(array(take(&mut rest, 8)?));
        if u64::try_from(rest.len()).ok() != count.checked_mul(4 * WORDS as u64) {
            return Err(SimulateError::Checkpoint(format!("{count} particles do not fit its length")));
        }
        let particles = rest
            .chunks_exact(4 * WORDS)
            .map(|p| particle(&std::array::from_fn(|w| u32::from_le_bytes(array(&p[4 * w..4 * w + 4])))))
            .collect();
        Ok(Self { identity, record, bodies, particles })
    }
}

fn take<'a>(rest: &mut &'a [u8], count: usize) -> Result<&'a [u8], SimulateError> {
    let (head, tail) =
        rest.split_at_checked(count).ok_or_else(|| SimulateError::Checkpoint("it is cut off".to_owned()))?;
    *rest = tail;
    Ok(head)
}

fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.try_into().expect("taken with this length")
}

/// The identity of a run: a hash of its first particles and of everything that its course depends on.
pub fn identity(particles: &[Particle], setting: &str) -> [u8; 32] {
    let mut hash = Sha256::new();
    for particle in particles {
        for word in words(particle) {
            hash.update(word.to_le_bytes());
        }
    }
    hash.update(setting);
    hash.finalize().into()
}

fn words(p: &Particle) -> [u32; WORDS] {
    let mut words = [0; WORDS];
    let scalars = [p.mass_kg, p.volume_m3, p.mu, p.lambda, p.state];
    let motion = p.position_m.iter().chain(&p.compensation_m).chain(&p.velocity_m_s).chain(&p.affine);
    let floats = motion.chain(&p.elastic).chain(&p.deformation).chain(&scalars);
    for (word, value) in words.iter_mut().zip(floats) {
        *word = value.to_bits();
    }
    words[WORDS - 1] = p.law;
    words
}

fn particle(words: &[u32; WORDS]) -> Particle {
    fn floats<const N: usize>(words: &[u32; WORDS], at: usize) -> [f32; N] {
        std::array::from_fn(|i| f32::from_bits(words[at + i]))
    }
    let [mass_kg, volume_m3, mu, lambda, state] = floats(words, 36);
    Particle {
        position_m: floats(words, 0),
        compensation_m: floats(words, 3),
        velocity_m_s: floats(words, 6),
        affine: floats(words, 9),
        elastic: floats(words, 18),
        deformation: floats(words, 27),
        mass_kg,
        volume_m3,
        mu,
        lambda,
        state,
        law: words[WORDS - 1],
    }
}
