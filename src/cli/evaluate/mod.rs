//! `gprop evaluate`: reads files and scenes, computes measures and prints them.

mod grasp;
mod mass;
mod objects;
mod parts;
mod robustness;
mod segmentation;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use image::GrayImage;

use crate::error::{Context, Result, UsageError};
use crate::evaluate::EvaluateError;
use crate::evaluate::filling;
use crate::evaluate::hardness::{self, HardnessEvaluation, Measured, Reading};
use crate::evaluate::masks::{Reference, compare};
use crate::evaluate::mass as masses;
use crate::evaluate::parts::{TrueView, most_shown};
use crate::evaluate::prompts;
use crate::evaluate::scores::Scores;
use crate::evaluate::simulation::{self, SimulationError};
use crate::files;
use crate::files::npz::Npz;
use crate::files::read_scope::ReadScope;
use crate::from_splat::photo_with_foreground;
use crate::pipeline::stored::{self, StoredRun};
use crate::pipeline::{self, Stage, open_segmenter};
use crate::scene::{self, SceneError};
use crate::segment;
use crate::setup;
use crate::words::output::{counted, one_line};

use super::arguments::TrueParts;
use super::{Evaluate, Global, options_of, print};

/// The folder of a scene's true part maps, one for each view.
const TRUE_MAPS: &str = "ground_truth/part_maps";

/// `gprop evaluate`.
pub fn evaluate(global: &Global, what: &Evaluate) -> Result<()> {
    match what {
        Evaluate::Grasp { outcomes: Some(outcomes), .. } => grasp::evaluate_recorded(global, outcomes),
        Evaluate::Grasp { scenes, out, gripper, allowed, .. } => {
            grasp::evaluate(global, scenes, out.as_deref(), &allowed.allow_read, gripper)
        }
        Evaluate::Simulation { reference } => evaluate_simulation(global, reference),
        Evaluate::Segmentation { scenes, truth, labels, out, allowed } => {
            segmentation::evaluate(global, scenes, truth, *labels, out.as_deref(), &allowed.allow_read)
        }
        Evaluate::Prompts { asked } => evaluate_prompts(global, asked),
        Evaluate::Parts { asked } => parts::evaluate(global, asked),
        Evaluate::Objects { scenes, .. } => objects::evaluate(global, scenes),
        Evaluate::Robustness { scenes, few_views, out, allowed } => {
            robustness::evaluate(global, scenes, *few_views, out.as_deref(), &allowed.allow_read)
        }
        Evaluate::Masks { image, reference, setup } => evaluate_masks(global, image, reference, setup),
        Evaluate::Mass { predictions: Some(predictions), truth: Some(truth), .. } => {
            let found = masses::evaluate(masses::from_json(predictions, truth)?)?;
            print(global, &found, || mass::text(&found))
        }
        Evaluate::Mass { data_set: Some(folder), split, out, weights, .. } => {
            mass::evaluate_data_set(global, folder, split.as_deref(), out.as_deref(), weights.as_deref())
        }
        Evaluate::Mass { scenes, out, weights, beside, allowed, .. } => {
            let allow_read = &allowed.allow_read;
            let asked =
                mass::Asked { scenes, out: out.as_deref(), weights: weights.as_deref(), beside: *beside, allow_read };
            mass::evaluate(global, &asked)
        }
        Evaluate::Hardness { points, out, allowed } => {
            evaluate_hardness(global, points, out.as_deref(), &allowed.allow_read)
        }
    }
}

/// For each part that was found, by its id, the true part that it mostly shows; empty if the scene has no true part maps.
fn shown_parts(global: &Global, scene: &Path, out: Option<&Path>, allow_read: &[PathBuf]) -> Result<BTreeMap<u32, u8>> {
    if !scene.join(TRUE_MAPS).exists() {
        return Ok(BTreeMap::new());
    }
    let open = stored::open(scene, out, allow_read, Stage::Vote, global.show_progress())?;
    let (gaussians, field) = StoredRun::open(scene, out, &[Stage::Vote])?.field()?;
    let in_input_frame = open.scene.in_input_frame();
    let mapped = in_input_frame.views.iter().filter(|view| true_map(scene, view).exists());
    let views = mapped.map(|view| true_view(scene, view, &open.options.scene, false));
    let part_ids: Vec<u32> = field.part_ids().collect();
    Ok(most_shown(&gaussians, &part_ids, &views.collect::<Result<Vec<_>>>()?))
}

fn evaluate_hardness(global: &Global, points: &Path, out: Option<&Path>, allow_read: &[PathBuf]) -> Result<()> {
    let readings = hardness::read_points(points)?;
    let mut scenes: Vec<&Path> = readings.iter().map(|(_, reading)| reading.scene.as_path()).collect();
    scenes.sort_unstable();
    scenes.dedup();
    one_scene_only(scenes.len(), out)?;
    let mut measured = Vec::with_capacity(readings.len());
    for scene in scenes {
        let of_scene: Vec<_> = readings.iter().filter(|(_, reading)| reading.scene == scene).collect();
        measured.extend(measure(points, scene, &of_scene, out, allow_read)?);
    }
    let found = hardness::evaluate(measured)?;
    print(global, &found, || hardness_text(&found))
}

/// The field's values at the points of one scene.
fn measure(
    points: &Path,
    scene: &Path,
    readings: &[&(u64, Reading)],
    out: Option<&Path>,
    allow_read: &[PathBuf],
) -> Result<Vec<Measured>> {
    let folder = points.parent().unwrap_or(Path::new("")).join(scene);
    let stored = StoredRun::open(&folder, out, &[Stage::Vote])?;
    let options = stored.options(&folder, out.is_some(), allow_read)?.scene;
    let loaded = scene::load(&folder, &options).map_err(SceneError::without_flag)?;
    let (gaussians, field) = stored.field()?;
    let mut measured = Vec::with_capacity(readings.len());
    for view in &loaded.views {
        let here: Vec<&Reading> = readings.iter().map(|(_, reading)| reading).filter(|r| r.view == view.name).collect();
        if here.is_empty() {
            continue;
        }
        let places: Vec<(f64, f64)> = here.iter().map(|reading| (reading.x, reading.y)).collect();
        let said = hardness::field_at(&gaussians, &field, &loaded.camera_in_input(&view.camera), &places);
        let pairs = here.into_iter().zip(said);
        measured.extend(pairs.map(|(reading, predicted)| Measured { reading: reading.clone(), predicted }));
    }
    match readings.iter().find(|(_, reading)| loaded.views.iter().all(|view| view.name != reading.view)) {
        Some((line, reading)) => {
            Err(UsageError(format!("{points:?} line {line}: {folder:?} has no view {:?}", reading.view)).into())
        }
        None => Ok(measured),
    }
}

/// Refuses ground truth in a scene's folder that leads out of the folder.
fn check_truth(path: &Path, scope: &ReadScope) -> Result<(), SceneError> {
    let Some((path, _)) = scope.leads_out_below(path) else { return Ok(()) };
    Ok(scene::Reference { what: "ground truth", path: &path, named_in: None, flag: None }.check(scope)?)
}

fn one_scene_only(scenes: usize, out: Option<&Path>) -> Result<(), UsageError> {
    match out {
        Some(_) if scenes != 1 => Err(UsageError(format!(
            "--out is the work folder of one scene, not of {scenes}; leave it out, or give one scene"
        ))),
        _ => Ok(()),
    }
}

fn hardness_text(found: &HardnessEvaluation) -> String {
    let mut text = format!("{:<24} {:<12} {:>9} {:>9}  {:>12} {:>8}\n", "scene", "view", "x", "y", "predicted", "read");
    for Measured { reading, predicted } in &found.points {
        let said = match predicted {
            Ok(hardness) => format!("{:.0} {:?}", hardness.range.mid(), hardness.scale),
            Err(hardness::Missing::OffTheObject) => "off object".to_owned(),
            Err(hardness::Missing::NoHardness) => "none".to_owned(),
        };
        let (scene, view) = (reading.scene.to_string_lossy(), one_line(&reading.view));
        let scene = one_line(&scene);
        let read = format!("{:.0} {:?}", reading.hardness, reading.shore);
        text += &format!("{scene:<24} {view:<12} {:>9.1} {:>9.1}  {said:>12} {read:>8}\n", reading.x, reading.y);
    }
    text + &scores_text(&found.scores, "on the joint axis")
        + &format!("\nno hardness at {}", counted(found.missing, "point"))
}

fn scores_text(scores: &Scores, unit: &str) -> String {
    let pra = scores.pra.map_or_else(|| "-".to_owned(), |pra| format!("{pra:.3}"));
    format!(
        "ADE {:.3} {unit}  ALDE {:.3}  APE {:.3}  MnRE {:.3}  PRA {pra}  of {}",
        scores.ade, scores.alde, scores.ape, scores.mnre, scores.count
    )
}

fn evaluate_simulation(global: &Global, reference: &Path) -> Result<()> {
    let bytes = files::read(reference).map_err(|error| UsageError(format!("{reference:?}: {error}")))?;
    let mut npz = Npz::new(bytes).map_err(SimulationError::Npz).with_context(|| format!("{reference:?}"))?;
    if npz.has("count0") {
        let comparison = filling::compare(&mut npz).with_context(|| format!("{reference:?}"))?;
        return print(global, &comparison, || comparison.to_string());
    }
    let comparison = simulation::compare(&mut npz, global.progress()).with_context(|| format!("{reference:?}"))?;
    print(global, &comparison, || comparison.to_string())
}

fn evaluate_prompts(global: &Global, asked: &TrueParts) -> Result<()> {
    refuse_segments(asked)?;
    let mut rows = Vec::new();
    for folder in &asked.scenes {
        let pipeline::Options { scene: options, segment, setup, .. } = &options_of(folder, &global.flags.typed)?;
        // Embeddings that the first of the two ways left in the cache would make the other look faster.
        let segment = &segment::Options { cache_embeddings: false, ..segment.clone() };
        let segmenter = open_segmenter(setup, segment, global.progress())?;
        let scene = scene::load(folder, options)?;
        let true_view = |view: scene::View| -> Result<prompts::TruePhoto> {
            let parts = true_parts(folder, &view, options)?;
            Ok(prompts::TruePhoto { photo: photo_with_foreground(&scene, &view)?, name: view.name, parts })
        };
        let views: Vec<_> = scene.chosen_views(options)?.into_iter().map(true_view).collect::<Result<_>>()?;
        rows.push(prompts::compare(&segmenter, &scene.name, &views, segment)?);
        global.progress().line(&format!("{} done", scene.name));
    }
    print(global, &rows, || {
        let mut text = format!(
            "{:<12} {:>5} {:>13} {:>17} {:>9} {:>13} {:>8} {:>12}\n",
            "scene",
            "views",
            "grid: prompts",
            "adaptive: prompts",
            "grid: IoU",
            "adaptive: IoU",
            "grid: s",
            "adaptive: s"
        );
        let iou = |outcome: &prompts::Outcome| outcome.mean_iou.map_or("-".to_owned(), |iou| format!("{iou:.4}"));
        for row in &rows {
            text += &format!(
                "{:<12} {:>5} {:>13} {:>17} {:>9} {:>13} {:>8.1} {:>12.1}\n",
                one_line(&row.scene),
                row.views,
                row.grid.prompts,
                row.adaptive.prompts,
                iou(&row.grid),
                iou(&row.adaptive),
                row.grid.seconds,
                row.adaptive.seconds
            );
        }
        text
    })
}

/// Refuses segments from a folder where SAM's segments are measured.
fn refuse_segments(asked: &TrueParts) -> Result<(), UsageError> {
    match asked.segment.segments {
        Some(_) => {
            Err(UsageError("--segments: this command measures the segments that SAM finds; leave it out".to_owned()))
        }
        None => Ok(()),
    }
}

/// The true part map of a view.
fn true_parts(folder: &Path, view: &scene::View, options: &scene::Options) -> Result<GrayImage> {
    let path = true_map(folder, view);
    check_truth(&path, &options.read_scope(folder))?;
    let parts = part_map(&path)?;
    let picture = (view.camera.intrinsics.width, view.camera.intrinsics.height);
    if parts.dimensions() != picture {
        let map = parts.dimensions();
        return Err(EvaluateError::MapSize { path, map, view: view.name.clone(), picture }.into());
    }
    Ok(parts)
}

/// The part numbers in a grey PNG of 8 or 16 bits.
fn part_map(path: &Path) -> Result<GrayImage, UsageError> {
    let wrong = |problem: String| UsageError(format!("{path:?}: {problem}"));
    let bytes = files::read(path).map_err(|error| wrong(error.to_string()))?;
    let map = segment::LabelMap::from_png(&bytes).map_err(|error| wrong(error.to_string()))?;
    let parts: Result<Vec<u8>, _> = map.labels.into_iter().map(u8::try_from).collect();
    let parts =
        parts.map_err(|_| wrong("it has a value above 255; part numbers are 0 to 254, 255 is no part".into()))?;
    Ok(GrayImage::from_raw(map.width, map.height, parts).expect("a map has a label for each pixel"))
}

/// A view with its true part map; `segmented` says whether the parts were found with the help of this view.
fn true_view(folder: &Path, view: &scene::View, options: &scene::Options, segmented: bool) -> Result<TrueView> {
    let parts = true_parts(folder, view, options)?;
    Ok(TrueView { name: view.name.clone(), camera: view.camera.clone(), parts, segmented })
}

fn true_map(folder: &Path, view: &scene::View) -> PathBuf {
    folder.join(TRUE_MAPS).join(format!("{}.png", view.name))
}

/// A picture in a file whose first bytes tell the format.
fn read_picture(path: &Path) -> image::ImageResult<image::DynamicImage> {
    image::ImageReader::new(files::picture(path)?).with_guessed_format()?.decode()
}

fn evaluate_masks(global: &Global, image: &Path, reference: &Path, setup: &setup::Options) -> Result<()> {
    let picture = read_picture(image).map_err(|error| UsageError(format!("{image:?}: {error}")))?.into_rgb8();
    let json = files::read_to_string(reference).map_err(|error| UsageError(format!("{reference:?}: {error}")))?;
    let reference = Reference::from_json(&json).with_context(|| format!("{reference:?}"))?;
    let segmenter = open_segmenter(setup, &segment::Options::default(), global.progress())?;
    let lists = compare(segmenter.sam(), &picture, &reference, &())?;
    print(global, &lists, || {
        let mut text = format!(
            "{:<7} {:>6} {:>10} {:>10} {:>10} {:>10} {:>14} {:>14}\n",
            "level", "count", "reference", "unmatched", "mean IoU", "least IoU", "predicted IoU", "stability"
        );
        for (list, c) in &lists {
            text += &format!(
                "{list:<7} {:>6} {:>10} {:>10} {:>10.4} {:>10.4} {:>14.1e} {:>14.1e}\n",
                c.count,
                c.reference_count,
                c.unmatched,
                c.matched_mean_iou,
                c.matched_min_iou,
                c.predicted_iou_max_difference,
                c.stability_max_difference
            );
        }
        text + "the last two columns are the largest differences over the matched pairs"
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_map_is_read_as_numbers_or_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("000.png");
        let labels = |labels: [u16; 3]| segment::LabelMap { width: 3, height: 1, labels: labels.to_vec() };
        std::fs::write(&path, labels([0, 254, 255]).to_png().unwrap()).unwrap();
        assert_eq!(part_map(&path).unwrap().as_raw(), &[0, 254, 255], "16 bits");
        GrayImage::from_raw(3, 1, vec![0, 7, 255]).unwrap().save(&path).unwrap();
        assert_eq!(part_map(&path).unwrap().as_raw(), &[0, 7, 255], "8 bits");
        let refused = |words: &str| {
            let error = part_map(&path).unwrap_err().to_string();
            assert!(error.contains("000.png") && error.contains(words), "{error}");
        };
        std::fs::write(&path, labels([0, 1, 256]).to_png().unwrap()).unwrap();
        refused("above 255");
        image::RgbImage::from_pixel(3, 1, image::Rgb([1, 1, 1])).save(&path).unwrap();
        refused("grey PNG");
        std::fs::write(&path, "no picture").unwrap();
        refused("not a readable PNG");
    }
}
