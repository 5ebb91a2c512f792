//! The commands that need no scene.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;

use crate::evaluate::filling;
use crate::evaluate::grasp as grasp_rates;
use crate::evaluate::masks::{Reference, compare};
use crate::evaluate::prompts;
use crate::evaluate::simulation::{self, SimulationError};
use crate::exit::UsageError;
use crate::from_splat::photo_with_foreground;
use crate::grasp::CalibrationReport;
use crate::grasp::gripper::GripperProfile;
use crate::materials::{MaterialLibrary, check, cli as library, stats};
use crate::npz::Npz;
use crate::pipeline::open_segmenter;
use crate::scene;
use crate::segment::{self, Segmenter};
use crate::setup::{self, SetupError};

use crate::workdir::write_atomic;

use super::{Evaluate, Global, Grasp, Materials, print};

/// `gprop setup`.
pub fn set_up(global: &Global, options: &setup::Options) -> anyhow::Result<()> {
    setup::obtain(options, global.progress())?;
    let found = setup::doctor(options);
    print(global, &found, || found.to_string())
}

/// `gprop doctor`.
pub fn doctor(global: &Global, options: &setup::Options) -> anyhow::Result<()> {
    let found = setup::doctor(options);
    print(global, &found, || found.to_string())?;
    if found.ok { Ok(()) } else { Err(SetupError::Unfit { problems: found.problems.len() }.into()) }
}

/// `gprop grasp calibrate`.
pub fn grasp(global: &Global, what: &Grasp) -> anyhow::Result<()> {
    let Grasp::Calibrate { points, gripper, plot, profile } = what;
    let mut gripper = GripperProfile::load(gripper)?;
    let report = CalibrationReport::of_file(points, &mut gripper)?;
    if let Some(path) = plot {
        write_text(path, &report.plot())?;
    }
    if let Some(path) = profile {
        write_text(path, &toml::to_string(&gripper)?)?;
    }
    print(global, &report, || report.text())
}

fn write_text(path: &Path, text: &str) -> anyhow::Result<()> {
    let written = write_atomic(path, |out| out.write_all(text.as_bytes()));
    Ok(written.map_err(|error| UsageError(format!("cannot write {path:?}: {error}")))?)
}

/// `gprop evaluate`.
pub fn evaluate(global: &Global, what: &Evaluate) -> anyhow::Result<()> {
    match what {
        Evaluate::Grasp { outcomes, objects, gripper } => {
            evaluate_grasp(global, outcomes.as_deref(), objects.as_deref(), gripper)
        }
        Evaluate::Masks { image, reference, setup } => evaluate_masks(global, image, reference, setup),
        Evaluate::Simulation { reference } => evaluate_simulation(global, reference),
        Evaluate::Prompts { scenes, scene, segment, setup } => evaluate_prompts(global, scenes, scene, segment, setup),
    }
}

fn evaluate_grasp(
    global: &Global,
    outcomes: Option<&Path>,
    objects: Option<&Path>,
    gripper: &str,
) -> anyhow::Result<()> {
    let (recorded, predicted) = match (outcomes, objects) {
        (Some(path), _) => (grasp_rates::outcomes(path)?, false),
        (None, Some(path)) => {
            let gripper = GripperProfile::load(gripper)?;
            (grasp_rates::predict(&grasp_rates::objects(path)?, &gripper), true)
        }
        (None, None) => unreachable!("clap asks for one of the two"),
    };
    let evaluation = grasp_rates::Evaluation::of(&recorded, predicted);
    print(global, &evaluation, || evaluation.text())
}

fn evaluate_simulation(global: &Global, reference: &Path) -> anyhow::Result<()> {
    let bytes = fs::read(reference).map_err(|error| UsageError(format!("{reference:?}: {error}")))?;
    let mut npz = Npz::new(bytes).map_err(SimulationError::Npz).with_context(|| format!("{reference:?}"))?;
    if npz.has("count0") {
        let comparison = filling::compare(&mut npz).with_context(|| format!("{reference:?}"))?;
        return print(global, &comparison, || comparison.to_string());
    }
    let comparison = simulation::compare(&mut npz, global.progress()).with_context(|| format!("{reference:?}"))?;
    print(global, &comparison, || comparison.to_string())
}

fn evaluate_masks(global: &Global, image: &Path, reference: &Path, setup: &setup::Options) -> anyhow::Result<()> {
    let picture = image::open(image).map_err(|error| UsageError(format!("{image:?}: {error}")))?.into_rgb8();
    let json = fs::read_to_string(reference).map_err(|error| UsageError(format!("{reference:?}: {error}")))?;
    let reference = Reference::from_json(&json).with_context(|| format!("{reference:?}"))?;
    let models = setup::obtain(setup, global.progress())?;
    let segmenter = Segmenter::new(&models, rayon::current_num_threads())?;
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
        text + "the last two columns are largest differences over the matched pairs"
    })
}

fn evaluate_prompts(
    global: &Global,
    scenes: &[PathBuf],
    options: &scene::Options,
    segment: &segment::Options,
    setup: &setup::Options,
) -> anyhow::Result<()> {
    let segmenter = open_segmenter(setup, segment, global.progress())?;
    let mut rows = Vec::new();
    for folder in scenes {
        let scene = scene::load(folder, options)?;
        let true_view = |view: scene::View| -> anyhow::Result<prompts::TrueView> {
            let path = folder.join("ground_truth/part_maps").join(format!("{}.png", view.name));
            let parts = image::open(&path).map_err(|error| UsageError(format!("{path:?}: {error}")))?.into_luma8();
            Ok(prompts::TrueView { photo: photo_with_foreground(&scene, &view)?, name: view.name, parts })
        };
        let views: Vec<_> = scene.chosen_views(options)?.into_iter().map(true_view).collect::<anyhow::Result<_>>()?;
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
                row.scene,
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

/// `gprop materials`.
pub fn materials(global: &Global, what: &Materials) -> anyhow::Result<()> {
    match what {
        Materials::Show { name, library: options } => {
            let all = options.library()?;
            let card = library::show(&all, name).ok_or_else(|| UsageError(format!("no material is like {name:?}")))?;
            print(global, &card, || library::show_text(&all, name).unwrap_or_default())
        }
        Materials::List { family, library: options } => {
            let all = options.library()?;
            let family = family.as_deref();
            let text = library::list_text(&all, family).ok_or_else(|| unknown_family(&all, family))?;
            let names: Vec<&str> = text.lines().collect();
            print(global, &names, || text.clone())
        }
        Materials::Check { stats: with_stats, library: options } => {
            let all = options.library()?;
            let (text, fit) = library::check_text(&all, *with_stats);
            let value = serde_json::json!({ "findings": check::check(&all), "stats": stats::stats(&all) });
            print(global, &value, || text)?;
            if fit { Ok(()) } else { Err(UsageError("the library does not pass its checks".to_owned()).into()) }
        }
    }
}

fn unknown_family(library: &MaterialLibrary, family: Option<&str>) -> UsageError {
    let names: Vec<&str> = library.families().iter().map(|family| family.name.as_str()).collect();
    UsageError(format!("no family {:?}; there are {}", family.unwrap_or_default(), names.join(", ")))
}
