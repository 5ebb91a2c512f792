//! The simulation on disk: one frame and checkpoint at a time, so that a killed run continues at its last frame.

use std::io::{BufWriter, IntoInnerError, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use rayon::prelude::*;

use crate::camera::Camera;
use crate::error::UsageError;
use crate::gaussians::Gaussians;
use crate::parts::{Interior, Parts};
use crate::scene;
use crate::scene::splat::ply;
use crate::simulate::animation::{Film, Shooting};
use crate::simulate::checkpoint::{Checkpoint, Snapshot};
use crate::simulate::filling::FillPoint;
use crate::simulate::material::Material;
use crate::simulate::{self, Fillings, Frame, Input, Options, SimulationReport, plot, script};
use crate::vote::{Contents, MaterialField};
use crate::workdir::{Artifact, Checksum, Checksumming, Standing, WorkDir};

use super::record::Output;
use super::scene::file_digest;
use super::{Done, Pipeline, Stage};

/// Context for an error of the work folder.
pub(super) const NOT_KEPT: &str = "a frame could not be kept";

impl Pipeline {
    pub(super) fn simulate_key(&self) -> String {
        // The limit decides whether a run ends, not what it results in: a stopped run goes on under a higher limit, and a
        // finished one is not done again under a lower one.
        let max_simulation_minutes = Options::default().max_simulation_minutes;
        let options = Options { max_simulation_minutes, ..self.options.simulate.clone() };
        let hasher = self.key_after_inputs(Stage::Simulate);
        if script::is_name(&options.scenario) {
            return hasher.with_json(&options).hex();
        }
        // The file's content counts, and its name, which the report shows, but not how its path is written.
        let file = Path::new(&options.scenario);
        let scenario = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let content = file_digest(file).unwrap_or_default();
        hasher.with_json(&Options { scenario, ..options }).with(&content).hex()
    }

    pub(super) fn do_simulate(&self, key: &str) -> Result<Done> {
        let photo = self.filming_camera()?;
        let field = self.stored_field()?;
        let (materials, interior) = self.matter(field)?;
        let input = Input {
            gaussians: &self.scene.gaussians,
            labels: &field.part_label,
            materials: &materials,
            interior: &interior,
            meters_per_unit: self.metric_scale()?.map(|scale| scale.meters_per_unit),
        };
        let save = |frame: &Frame, snapshot: &Snapshot| {
            let splat =
                || self.work.write_with(Artifact::Frame(frame.index), |out| ply::write(out, &frame.gaussians, &[]));
            let states = || self.work.write_with(Artifact::States(frame.index), |out| snapshot.write_states(out));
            let (splat, states) = rayon::join(splat, states);
            splat.and(states)?;
            self.save_checkpoint(key, frame.index, snapshot)
        };
        let mut save = |frame: &Frame, snapshot: &Snapshot| save(frame, snapshot).context(NOT_KEPT);
        let options = &self.options.simulate;
        let report = simulate::simulate(&input, options, self.checkpoint(key), &mut save, self.progress)?;

        let mut load = |index| -> Result<Gaussians> {
            Ok(Gaussians { set_aside: self.scene.gaussians.set_aside.clone(), ..self.frame(index)? })
        };
        let simulated = simulate::simulated(&self.scene.gaussians);
        let films = Shooting::new(&report, &options.viewpoint, photo, &simulated).films(&mut load, self.progress)?;
        self.work.write(Artifact::Animation, &films.animation)?;
        let film = self.write_film(films.film)?;
        if let Some(error) = films.failure {
            self.progress.line(&format!("the film is a GIF instead of an MP4: {error}"));
        }
        self.work.write(Artifact::Plot, plot::svg(&report).as_bytes())?;
        self.work.write_json(Artifact::Simulation, &report)?;
        remove_frames_from(&self.work, report.frames.len())?;
        self.work.remove(Artifact::Checkpoint)?;
        let frames = (0..report.frames.len()).map(Artifact::Frame);
        let states = (0..report.frames.len()).map(Artifact::States);
        let others = [Artifact::Animation, Artifact::Plot, Artifact::Simulation].into_iter().chain([film]);
        let done = Done::writing(frames.chain(states).chain(others));
        Ok(done.warning(report.warnings))
    }

    /// The camera of the photo that the user wants to film from.
    fn filming_camera(&self) -> Result<Option<&Camera>> {
        let Some(name) = &self.options.simulate.viewpoint.film_from else { return Ok(None) };
        let index = scene::index_of(&self.scene.views, name);
        let index = index.map_err(|unknown| UsageError(format!("--film-from: {unknown}")))?;
        Ok(Some(&self.scene.views[index].camera))
    }

    /// Writes the film and removes that of an earlier run in the other format.
    fn write_film(&self, film: Film) -> Result<Artifact<'static>> {
        let (artifact, bytes, other) = match film {
            Film::Mp4(bytes) => (Artifact::FilmMp4, bytes, Artifact::FilmGif),
            Film::Gif(bytes) => (Artifact::FilmGif, bytes, Artifact::FilmMp4),
        };
        self.work.write(artifact, &bytes)?;
        if self.work.size(other).is_some() {
            self.work.remove(other)?;
        }
        Ok(artifact)
    }

    /// The Gaussians of a stored frame.
    pub(super) fn frame(&self, index: usize) -> Result<Gaussians> {
        let frame = ply::read(&self.work.path(Artifact::Frame(index)))?.gaussians;
        self.require_all_gaussians(Artifact::Frame(index), frame.len())?;
        Ok(frame)
    }

    /// The stored report of the simulation.
    pub(super) fn stored_simulation(&self) -> Result<SimulationReport> {
        Ok(self.work.read_json(Artifact::Simulation)?)
    }

    /// Saves everything needed to continue after the frame `last`, including the checksums of the frames so far.
    fn save_checkpoint(&self, key: &str, last: usize, snapshot: &Snapshot) -> Result<()> {
        let files = frame_files(last + 1).map(|path| Ok(Output { checksum: self.work.checksum(&path)?, path }));
        let files = serde_json::to_vec(&files.collect::<Result<Vec<_>>>()?)?;
        Ok(self.work.write_with(Artifact::Checkpoint, |out| {
            out.write_all(key.as_bytes())?;
            let mut sealed = BufWriter::new(Checksumming::new(&mut *out));
            sealed.write_all(&(files.len() as u64).to_le_bytes())?;
            sealed.write_all(&files)?;
            snapshot.write(&mut sealed)?;
            let seal = sealed.into_inner().map_err(IntoInnerError::into_error)?.finish().sha256;
            out.write_all(seal.as_bytes())
        })?)
    }

    /// The state in which a killed run of this stage stopped: a checkpoint begins with the key of its stage. It is not
    /// used if it or one of its frames was changed.
    fn checkpoint(&self, key: &str) -> Option<Checkpoint> {
        let bytes = self.work.read(Artifact::Checkpoint).ok().filter(|_| !self.must_redo(Stage::Simulate))?;
        let rest = bytes.strip_prefix(key.as_bytes())?;
        let again = "the simulation starts at its first frame";
        let Some((files, snapshot)) = opened(rest) else {
            self.work.warn_changed(&Artifact::Checkpoint.path(), again);
            return None;
        };
        let checkpoint = Checkpoint::from_bytes(snapshot).ok()?;
        let standing: Vec<Standing> =
            files.par_iter().map(|file| self.work.standing(&file.path, &file.checksum)).collect();
        for (file, _) in files.iter().zip(&standing).filter(|(_, standing)| **standing == Standing::Changed) {
            self.work.warn_changed(&file.path, again);
        }
        standing.iter().all(|standing| *standing == Standing::Whole).then_some(checkpoint)
    }

    /// The materials of the labels, then those of the fillings; and the object's inside, cell by cell.
    fn matter(&self, field: &MaterialField) -> Result<(Vec<Material>, Vec<FillPoint>)> {
        let interior = self.interior()?;
        let cell_volume = interior.grid.cell.powi(3);
        let point = |(index, label, share): (usize, u32, f64)| FillPoint {
            position: interior.grid.center(interior.grid.coords(index)).into(),
            label,
            volume: share * cell_volume,
        };
        let mut materials: Vec<Material> = field.labels.iter().map(Material::from).collect();
        let mut points: Vec<FillPoint> = interior.filled().map(point).collect();
        let fillings = self.options.simulate.fillings;
        let (Some(parts), Some(scale)) = (self.stored_parts()?, self.metric_scale()?) else {
            return Ok((materials, points));
        };
        if parts.are_weighed() {
            set_densities(&mut materials, &parts, interior, scale.meters_per_unit);
        }
        if fillings == Fillings::Ignore {
            return Ok((materials, points));
        }
        for filling in &parts.fillings {
            let shell = (0..).zip(&field.labels).find(|(_, label)| label.id == filling.inside_of);
            let Some((shell_label, shell)) = shell else { continue };
            let Some(Contents::Filled(filled)) = &shell.inside else { continue };
            let own: Vec<_> = interior.fillings().filter(|(_, of, _)| *of == shell_label).collect();
            let shares: f64 = own.iter().map(|(.., share)| share).sum();
            if shares <= 0.0 {
                continue;
            }
            // Cells at the wall hold only wall material; a higher density in the other cells makes up for the filling that
            // is missing there.
            let shown_m3 = shares * cell_volume * scale.meters_per_unit.powi(3);
            let label = materials.len() as u32;
            let moves_with = (fillings == Fillings::Weigh).then_some(shell_label);
            let material = Material::of_filling(filled, shell, moves_with);
            materials.push(Material { density_kg_m3: filling.mass_kg.mid / shown_m3, ..material });
            points.extend(own.into_iter().map(|(index, _, share)| point((index, label, share))));
        }
        Ok((materials, points))
    }
}

/// Gives the material of each part the density with which its cells have the mass that is believed after the weighing,
/// which also changes how much of its cells a part fills.
fn set_densities(materials: &mut [Material], parts: &Parts, interior: &Interior, meters_per_unit: f64) {
    let mut shown_m3 = vec![0.0; materials.len()];
    let cell_m3 = (interior.grid.cell * meters_per_unit).powi(3);
    interior.filled().for_each(|(_, label, share)| shown_m3[label as usize] += share * cell_m3);
    for (material, shown_m3) in materials.iter_mut().zip(shown_m3) {
        let Some(part) = parts.of_label(material.part_id) else { continue };
        material.density_kg_m3 = match part.mass_kg {
            Some(mass) if shown_m3 > 0.0 => mass.mid / shown_m3,
            _ => part.density_kg_m3.mid,
        };
    }
}

/// Removes frames of an earlier, longer run, which would be taken for this one's.
pub(super) fn remove_frames_from(work: &WorkDir, first: usize) -> Result<()> {
    let mut index = first;
    while work.size(Artifact::Frame(index)).is_some() {
        work.remove(Artifact::Frame(index))?;
        work.remove(Artifact::States(index))?;
        index += 1;
    }
    Ok(())
}

/// The files of the first frames.
fn frame_files(frames: usize) -> impl Iterator<Item = PathBuf> {
    (0..frames).flat_map(|index| [Artifact::Frame(index).path(), Artifact::States(index).path()])
}

/// A checkpoint's frames with their checksums, and its snapshot; `None` if it is not as it was written.
fn opened(bytes: &[u8]) -> Option<(Vec<Output>, &[u8])> {
    let (sealed, seal) = bytes.split_last_chunk::<{ 2 * 32 }>()?;
    if Checksum::of(sealed).sha256.as_bytes() != seal {
        return None;
    }
    let (length, rest) = sealed.split_first_chunk()?;
    let (files, snapshot) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    Some((serde_json::from_slice(files).ok()?, snapshot))
}
