//! The simulation on disk: one frame and checkpoint at a time, so that a killed run continues at its last frame.

use std::io::{BufWriter, IntoInnerError, Write};
use std::path::{Path, PathBuf};

use crate::camera::Camera;
use crate::error::{Context, Result, UsageError};
use crate::files::json;
use crate::gaussians::Gaussians;
use crate::parallel;
use crate::scene;
use crate::scene::splat::ply;
use crate::simulate::animation::{Film, Shooting};
use crate::simulate::checkpoint::{Checkpoint, Snapshot};
use crate::simulate::filling::FillPoint;
use crate::simulate::material::Material;
use crate::simulate::{self, Fillings, Frame, Input, Options, SimulationReport, plot, script};
use crate::vote::{Contents, MaterialField};
use crate::workdir::{Artifact, Checksum, Checksumming, Standing, WorkDir};

use super::parts::{self, metric_parts};
use super::vote::require_all_gaussians;
use super::{Done, Job, OpenScene, Output, Row, Stage, Stored, never};
use crate::parts::{Interior, Parts};
use crate::pipeline::hasher::{Hasher, file_digest};

pub(super) const ROW: Row = Row {
    inputs: &[Stage::Scene, Stage::Vote, Stage::Parts],
    options: &["simulate"],
    result: Artifact::Simulation,
    key: |open, inputs| Ok(key(&open.options.simulate, inputs)),
    is_stale: never,
    run,
};

/// Context for an error of the work folder.
pub const NOT_KEPT: &str = "a frame could not be kept";

fn key(options: &Options, inputs: Hasher) -> String {
    // The limit decides whether a run ends, not what it results in: a stopped run goes on under a higher limit, and a
    // finished one is not done again under a lower one.
    let max_simulation_minutes = Options::default().max_simulation_minutes;
    let options = Options { max_simulation_minutes, ..options.clone() };
    if script::is_name(&options.scenario) {
        return inputs.with_json(&options).hex();
    }
    // The file's content counts, and its name, which the report shows, but not how its path is written.
    let file = Path::new(&options.scenario);
    let scenario = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let content = file_digest(file).unwrap_or_default();
    inputs.with_json(&Options { scenario, ..options }).with(&content).hex()
}

fn run(open: &OpenScene, job: &Job) -> Result<Done> {
    let photo = filming_camera(open)?;
    let report = simulated(open, job)?;
    let film = film(open, &report, photo)?;
    let work = &open.work;
    work.write(Artifact::Plot, plot::svg(&report).as_bytes())?;
    work.write_json(Artifact::Simulation, &report)?;
    remove_frames_from(work, report.frames.len())?;
    work.remove(Artifact::Checkpoint)?;
    let frames = (0..report.frames.len()).map(Artifact::Frame);
    let states = (0..report.frames.len()).map(Artifact::States);
    let others = [Artifact::Animation, Artifact::Plot, Artifact::Simulation].into_iter().chain([film]);
    Ok(Done::writing(frames.chain(states).chain(others)).warning(report.warnings))
}

/// Simulates the object from the last frame on that an earlier run kept, and keeps each frame.
fn simulated(open: &OpenScene, job: &Job) -> Result<SimulationReport> {
    let (work, field) = (&open.work, open.get::<MaterialField>()?);
    let (materials, interior) = matter(open, &field)?;
    let input = Input {
        gaussians: &open.scene.gaussians,
        labels: &field.part_index,
        materials: &materials,
        interior: &interior,
        meters_per_unit: parts::scale(open)?.map(|scale| scale.meters_per_unit),
    };
    let save = |frame: &Frame, snapshot: &Snapshot| {
        let splat = || work.write_with(Artifact::Frame(frame.index), |out| ply::write(out, &frame.gaussians, &[]));
        let states = || work.write_with(Artifact::States(frame.index), |out| snapshot.write_states(out));
        let (splat, states) = parallel::join(splat, states);
        splat.and(states).context(NOT_KEPT)?;
        save_checkpoint(work, job.key, frame.index, snapshot).context(NOT_KEPT)
    };
    let mut save = |frame: &Frame, snapshot: &Snapshot| -> Result<()> {
        save(frame, snapshot)?;
        Ok(open.progress().check()?)
    };
    simulate::simulate(&input, &open.options.simulate, checkpoint(work, job), &mut save, open.progress())
}

/// The camera of the photo that the user wants to film from.
fn filming_camera(open: &OpenScene) -> Result<Option<&Camera>> {
    let Some(name) = &open.options.simulate.viewpoint.film_from else { return Ok(None) };
    let index = scene::index_of(&open.scene.views, name);
    let index = index.map_err(|unknown| UsageError(format!("--film-from: {unknown}")))?;
    Ok(Some(&open.scene.views[index].camera))
}

/// Films the frames. Writes the animation and the film, removes the film of an earlier run in the other format, and
/// returns the film's file.
fn film(open: &OpenScene, report: &SimulationReport, photo: Option<&Camera>) -> Result<Artifact<'static>> {
    let (work, gaussians) = (&open.work, &open.scene.gaussians);
    let mut load = |index| -> Result<Gaussians> {
        Ok(Gaussians { set_aside: gaussians.set_aside.clone(), ..frame(open, index)? })
    };
    let simulated = simulate::simulated(gaussians);
    let shooting = Shooting::new(report, &open.options.simulate.viewpoint, photo, &simulated);
    let films = shooting.films(&mut load, open.progress())?;
    work.write(Artifact::Animation, &films.animation)?;
    let (artifact, bytes, other) = match films.film {
        Film::Mp4(bytes) => (Artifact::FilmMp4, bytes, Artifact::FilmGif),
        Film::Gif(bytes) => (Artifact::FilmGif, bytes, Artifact::FilmMp4),
    };
    work.write(artifact, &bytes)?;
    if work.size(other).is_some() {
        work.remove(other)?;
    }
    if let Some(error) = films.failure {
        open.progress().line(&format!("the film is a GIF instead of an MP4: {error}"));
    }
    Ok(artifact)
}

/// The Gaussians of a stored frame.
pub fn frame(open: &OpenScene, index: usize) -> Result<Gaussians> {
    let frame = ply::read(&open.work.path(Artifact::Frame(index)))?.gaussians;
    require_all_gaussians(open, Artifact::Frame(index), frame.len())?;
    Ok(frame)
}

impl Stored for SimulationReport {
    const STAGE: Stage = Stage::Simulate;

    fn load(open: &OpenScene) -> Result<Self> {
        let report: Self = open.work.read_json(Artifact::Simulation)?;
        let (frames, most) = (report.frames.len(), open.options.simulate.frames as usize);
        if frames > most {
            let problem = format!("it has {frames} frames, but the run has {most}");
            return Err(open.work.damaged(Artifact::Simulation, problem).into());
        }
        Ok(report)
    }
}

/// Saves everything needed to continue after the frame `last`, including the checksums of the frames so far.
fn save_checkpoint(work: &WorkDir, key: &str, last: usize, snapshot: &Snapshot) -> Result<()> {
    let files = frame_files(last + 1).map(|path| Ok(Output { checksum: work.checksum(&path)?, path }));
    let files = json::compact(&files.collect::<Result<Vec<_>>>()?)?;
    Ok(work.write_with(Artifact::Checkpoint, |out| {
        out.write_all(key.as_bytes())?;
        let mut sealed = BufWriter::new(Checksumming::new(&mut *out));
        sealed.write_all(&(files.len() as u64).to_le_bytes())?;
        sealed.write_all(files.as_bytes())?;
        snapshot.write(&mut sealed)?;
        let seal = sealed.into_inner().map_err(IntoInnerError::into_error)?.finish().sha256;
        out.write_all(seal.as_bytes())
    })?)
}

/// The state in which a killed run of this stage stopped: a checkpoint begins with the key of its stage. It is not
/// used if it or one of its frames was changed.
fn checkpoint(work: &WorkDir, job: &Job) -> Option<Checkpoint> {
    let bytes = work.read(Artifact::Checkpoint).ok().filter(|_| !job.anew)?;
    let rest = bytes.strip_prefix(job.key.as_bytes())?;
    let again = "the simulation starts at its first frame";
    let Some((files, snapshot)) = opened(rest) else {
        work.warn_changed(&Artifact::Checkpoint.path(), again);
        return None;
    };
    let checkpoint = Checkpoint::from_bytes(snapshot).ok()?;
    // Each of its frames must be there, and its checksum known.
    if !files.iter().map(|file| &file.path).eq(frame_files(checkpoint.frames()).collect::<Vec<_>>().iter()) {
        return None;
    }
    let standing: Vec<Standing> = parallel::map(&files, |file| work.standing(&file.path, &file.checksum));
    for (file, _) in files.iter().zip(&standing).filter(|(_, standing)| **standing == Standing::Changed) {
        work.warn_changed(&file.path, again);
    }
    standing.iter().all(|standing| *standing == Standing::Whole).then_some(checkpoint)
}

/// The materials of the labels, then those of the fillings; and the object's inside, cell by cell.
fn matter(open: &OpenScene, field: &MaterialField) -> Result<(Vec<Material>, Vec<FillPoint>)> {
    let interior = open.get::<Interior>()?;
    let cell_volume = interior.grid.cell.powi(3);
    let point = |(index, label, share): (usize, u32, f64)| FillPoint {
        position: interior.grid.center(interior.grid.coords(index)).into(),
        label,
        volume: share * cell_volume,
    };
    let mut materials: Vec<Material> = field.parts.iter().map(Material::from).collect();
    let mut points: Vec<FillPoint> = interior.filled().map(point).collect();
    let fillings = open.options.simulate.fillings;
    let (Some(parts), Some(scale)) = (metric_parts(open)?, parts::scale(open)?) else {
        return Ok((materials, points));
    };
    if parts.are_weighed() {
        set_densities(&mut materials, &parts, &interior, scale.meters_per_unit);
    }
    if fillings == Fillings::Ignore {
        return Ok((materials, points));
    }
    for filling in &parts.fillings {
        let shell = (0..).zip(&field.parts).find(|(_, label)| label.id == filling.inside_of);
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

/// Gives the material of each part the density with which its cells have the mass that is believed after the weighing,
/// which also changes how much of its cells a part fills.
fn set_densities(materials: &mut [Material], parts: &Parts, interior: &Interior, meters_per_unit: f64) {
    let mut shown_m3 = vec![0.0; materials.len()];
    let cell_m3 = (interior.grid.cell * meters_per_unit).powi(3);
    interior.filled().for_each(|(_, label, share)| shown_m3[label as usize] += share * cell_m3);
    for (material, shown_m3) in materials.iter_mut().zip(shown_m3) {
        let Some(part) = parts.part(material.part_id) else { continue };
        material.density_kg_m3 = match part.mass_kg {
            Some(mass) if shown_m3 > 0.0 => mass.mid / shown_m3,
            _ => part.density_kg_m3.mid,
        };
    }
}

/// Removes frames of an earlier, longer run, which would be taken for this one's.
pub fn remove_frames_from(work: &WorkDir, first: usize) -> Result<()> {
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
    Some((json::read(files).ok()?, snapshot))
}
