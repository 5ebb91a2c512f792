//! `gprop evaluate mass`: the masses of scenes and meshes, beside what a model says without gprop, as a table.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::{one_scene_only, scores_text, shown_parts};
use crate::batch;
use crate::cli::arguments::Beside;
use crate::cli::{Global, print};
use crate::error::{Context, Result, UsageError};
use crate::evaluate::mass::{self as masses, Balance, Causes, MassEvaluation, Weighed, WeighedPart};
use crate::files::read_scope::ReadScope;
use crate::pipeline::Stage;
use crate::pipeline::stages::questions::direct_session;
use crate::pipeline::stored::{self, StoredRun};
use crate::query::{AnswerSource, DirectGuess, WholeOutcome};
use crate::scene::dataset::{self, Entry};
use crate::words::output::{counted, one_line};
use crate::words::shell;
use crate::workdir::{Artifact, WorkDirError};

/// What to evaluate.
pub struct Asked<'a> {
    pub scenes: &'a [PathBuf],
    pub out: Option<&'a Path>,
    pub weights: Option<&'a Path>,
    pub beside: Option<Beside>,
    pub allow_read: &'a [PathBuf],
}

/// Scores the masses.
pub fn evaluate(global: &Global, asked: &Asked) -> Result<()> {
    one_scene_only(asked.scenes.len(), asked.out)?;
    let weights =
        asked.weights.map(|path| masses::read_weights(path).with_context(|| format!("{path:?}"))).transpose()?;
    let weigh = |scene: &PathBuf| -> Result<Weighed> {
        let parts = StoredRun::open(scene, asked.out, &[Stage::Parts])?.path(Artifact::Parts);
        let Some(weights) = &weights else { return of_scene(global, scene, &parts, asked) };
        let name = name(scene);
        let weight = weights.get(&name).ok_or_else(|| {
            let file = asked.weights.unwrap_or(Path::new(""));
            UsageError(format!("{file:?} has no line for {name:?}; add its name and mass in kg"))
        })?;
        Ok(masses::from_weight(&name, &parts, *weight)?)
    };
    let objects: Vec<Weighed> = asked.scenes.iter().map(weigh).collect::<Result<_>>()?;
    let direct = match asked.beside {
        None => None,
        Some(Beside::Direct) => {
            let guess = |(scene, object): (&PathBuf, &Weighed)| {
                let DirectGuess { mass_kg, .. } = direct_guess(global, scene, asked)?;
                Ok(masses::guessed(object, mass_kg))
            };
            let guesses = asked.scenes.iter().zip(&objects).map(guess).collect::<Result<_>>()?;
            Some(Box::new(masses::evaluate(guesses)?))
        }
    };
    let found = MassEvaluation { direct, ..masses::evaluate(objects)? };
    print(global, &found, || text(&found))
}

/// Scores the masses of the scenes in a folder: of all whose weight is in the file `weights`, or else in the data set.
pub fn evaluate_data_set(
    global: &Global,
    folder: &Path,
    split: Option<&str>,
    out: Option<&Path>,
    weights: Option<&Path>,
) -> Result<()> {
    let given = weights.map(|path| masses::read_weights(path).with_context(|| format!("{path:?}"))).transpose()?;
    let mut chosen = dataset::list(folder, None)?.scenes;
    chosen.retain(|entry| split.is_none() || entry.split.as_deref() == split);
    if let (Some(path), Some(given)) = (weights, &given) {
        tell_of_unknown(given, path, &chosen);
    }
    let weight_of = |entry: &Entry| given.as_ref().map_or(entry.mass_kg, |given| given.get(&entry.name).copied());
    let outcomes = batch::Known::read(&batch::home(folder, out))?;
    let failures = outcomes.failed();
    let (mut objects, mut missing, mut failed, mut known) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for entry in &chosen {
        let Some(weight_kg) = weight_of(entry) else { continue };
        known += 1;
        if failures.contains(entry.name.as_str()) {
            failed.push(entry.name.clone());
            continue;
        }
        let work = out.map(|out| out.join(&entry.name));
        match StoredRun::open(&entry.folder, work.as_deref(), &[Stage::Parts]) {
            Ok(stored) => objects.push(masses::from_weight(&entry.name, &stored.path(Artifact::Parts), weight_kg)?),
            Err(WorkDirError::Unfinished { .. } | WorkDirError::OfSeveral { .. }) => missing.push(entry.name.clone()),
            Err(error) => return Err(error.into()),
        }
    }
    if objects.is_empty() && failed.is_empty() {
        let of_split = split.map(|split| format!(" of the split {split:?}")).unwrap_or_default();
        let states = weights.unwrap_or(folder);
        let problem = match known {
            0 => format!(
                "{states:?} states no weight of a scene{of_split}; check --data-set and --split, or give --weights FILE with the \
                 columns name,mass_kg"
            ),
            _ => format!(
                "{states:?} states the weights of {}{of_split}, none of which has been run; run `gprop batch` first, or give \
                 its --out",
                counted(known, "scene")
            ),
        };
        return Err(UsageError(problem).into());
    }
    if objects.is_empty() {
        return Err(UsageError(failed_text(&failed)).into());
    }
    let found = MassEvaluation { missing, failed, ..masses::evaluate(objects)? };
    print(global, &found, || text(&found))
}

/// That scenes failed in the last batch; nothing if none did.
fn failed_text(failed: &[String]) -> String {
    failed.first().map_or_else(String::new, |first| {
        format!(
            "failed in the last batch, and not scored: {} (first: {}); score what was run alone since by naming its folder",
            counted(failed.len(), "scene"),
            one_line(first)
        )
    })
}

/// Warns of names in a file of weights that are no scenes: they may be misspelt.
fn tell_of_unknown(given: &BTreeMap<String, f64>, path: &Path, scenes: &[Entry]) {
    let names: BTreeSet<&str> = scenes.iter().map(|entry| entry.name.as_str()).collect();
    let unknown: Vec<&String> = given.keys().filter(|name| !names.contains(name.as_str())).collect();
    if let (Some(first), Some(scene)) = (unknown.first(), names.first()) {
        tracing::warn!(
            "{path:?} has {} that no chosen scene has (first: {first:?}; scenes are called like {scene:?})",
            counted(unknown.len(), "name")
        );
    }
}

/// The name of a scene's folder, or of a mesh without its ending.
fn name(scene: &Path) -> String {
    let name = if scene.is_file() { scene.file_stem() } else { scene.file_name() };
    name.unwrap_or(scene.as_os_str()).to_string_lossy().into_owned()
}

/// A scene whose ground truth lies in its folder.
fn of_scene(global: &Global, scene: &Path, parts: &Path, asked: &Asked) -> Result<Weighed> {
    if scene.is_file() {
        return Err(UsageError(format!("{scene:?} is a mesh; say what it weighs with --weights FILE")).into());
    }
    let truth = scene.join("ground_truth/parts.json");
    super::check_truth(&truth, &ReadScope::new(scene).and(asked.allow_read.iter().map(PathBuf::as_path)))?;
    let shown = shown_parts(global, scene, asked.out, asked.allow_read)?;
    Ok(masses::from_scene(&name(scene), parts, &truth, &shown)?)
}

/// What a model said of the mass of a scene's object without gprop.
fn direct_guess(global: &Global, scene: &Path, asked: &Asked) -> Result<DirectGuess> {
    let mut open = stored::open(scene, asked.out, asked.allow_read, Stage::Scene, global.show_progress())?;
    open.options.query.answers = AnswerSource::Replay;
    let guess = direct_session(&open)?.direct_guess(&|_| Ok(()))?;
    let remedy = || format!("ask with `gprop query {} --direct`", shell::path(scene));
    match guess.map(|guess| guess.outcome) {
        Some(WholeOutcome::Answered(guess)) => Ok(guess),
        Some(WholeOutcome::Failed(failure)) => Err(UsageError(format!("{scene:?}: {failure}; {}", remedy())).into()),
        None => Err(UsageError(format!("{scene:?}: no photo shows the object")).into()),
    }
}

/// The table of masses, the causes of the errors, the errors of centre and inertia, the scores.
pub fn text(found: &MassEvaluation) -> String {
    let mut text =
        format!("{:<24} {:>10} {:>10} {:>10} {:>10}  covered\n", "object", "low kg", "mid kg", "high kg", "true kg");
    for object in &found.objects {
        let (range, holds) = (object.predicted, if object.covered { "yes" } else { "no" });
        text += &format!(
            "{:<24} {:>10.4} {:>10.4} {:>10.4} {:>10.4}  {holds}\n",
            one_line(&object.id),
            range.low,
            range.mid,
            range.high,
            object.truth
        );
        object.parts.iter().for_each(|part| text += &part_line(part));
    }
    text += &details_text(&found.objects);
    match &found.direct {
        None => text += &all_scores_text(found),
        Some(direct) => {
            text += &beside_text(&found.objects, &direct.objects);
            text += &format!("gprop\n{}\nthe direct guess\n{}", all_scores_text(found), all_scores_text(direct));
        }
    }
    if let Some(first) = found.missing.first() {
        text += &format!("\nwithout a mass: {} (first: {})", counted(found.missing.len(), "scene"), one_line(first));
    }
    if !found.failed.is_empty() {
        text += &format!("\n{}", failed_text(&found.failed));
    }
    text
}

fn all_scores_text(found: &MassEvaluation) -> String {
    let scores = scores_text(&found.scores, "kg");
    let coverage = 100.0 * found.coverage;
    let width = found.median_width.map_or_else(|| "unknown".to_owned(), |width| format!("{width:.2}"));
    format!("{scores}\ninterval contains the truth: {coverage:.0} %, median width (high / low) {width}")
}

/// The direct guesses, object by object, each with its error and that of gprop in the logarithm.
fn beside_text(objects: &[Weighed], guesses: &[Weighed]) -> String {
    let mut text = format!(
        "\n{:<24} {:>10} {:>10} {:>10}  covered  {:>9} {:>9}\n",
        "the direct guess", "low kg", "mid kg", "high kg", "its error", "gprop's"
    );
    for (object, guess) in objects.iter().zip(guesses) {
        let (range, holds) = (guess.predicted, if guess.covered { "yes" } else { "no" });
        let [own, gprop] = [guess, object].map(|of| (of.predicted.mid / of.truth).ln());
        let name = cut(&guess.id, 24);
        text += &format!(
            "{name:<24} {:>10.4} {:>10.4} {:>10.4}  {holds:<7}  {own:>+9.3} {gprop:>+9.3}\n",
            range.low, range.mid, range.high
        );
    }
    text + "\n"
}

/// All that the ground truth of a scene tells beyond its mass; nothing if no object comes from such a scene.
fn details_text(objects: &[Weighed]) -> String {
    let text = causes_text(objects) + &balance_text(objects) + &without_causes_text(objects);
    if text.is_empty() { text } else { text + "\n" }
}

/// The causes of the errors, object by object; nothing if no ground truth is detailed enough.
fn causes_text(objects: &[Weighed]) -> String {
    let with_causes = || objects.iter().filter_map(|object| Some((object, object.causes?)));
    if with_causes().next().is_none() {
        return String::new();
    }
    let mut text = format!(
        "\n{:<24} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}\n",
        "error in g from", "volume", "wall", "density", "filling", "missing", "in all"
    );
    for (object, causes) in with_causes() {
        let Causes { volume_kg, wall_kg, density_kg, filling_kg, missing_kg } = causes;
        let all = object.predicted.mid - object.truth;
        let name = cut(&object.id, 24);
        text += &format!("{name:<24}");
        for kg in [volume_kg, wall_kg, density_kg, filling_kg, missing_kg, all] {
            text += &format!(" {:>8.1}", 1e3 * kg);
        }
        text.push('\n');
        for part in object.true_parts.iter().filter(|_| object.true_parts.len() > 1) {
            let name = cut(&part.name, 22);
            let [found, truth] = [part.found_kg, part.true_kg].map(|kg| 1e3 * kg);
            text += &format!("  {name:<22} {found:>8.1} g found, {truth:.1} g true\n");
        }
    }
    text
}

/// The errors of centre of mass and inertia, object by object; nothing if no ground truth gives these.
fn balance_text(objects: &[Weighed]) -> String {
    let mut lines = objects.iter().filter_map(|object| {
        let Balance { center_error, inertia_error } = object.balance?;
        let name = cut(&object.id, 24);
        Some(format!("{name:<24} {:>7.1}% {:>7.1}%\n", 100.0 * center_error, 100.0 * inertia_error))
    });
    match lines.next() {
        Some(first) => {
            format!("\n{:<24} {:>8} {:>8}\n{first}", "error of", "centre", "inertia") + &lines.collect::<String>()
        }
        None => String::new(),
    }
}

/// The number of scenes without causes, and why they have none; nothing if there is no such scene.
fn without_causes_text(objects: &[Weighed]) -> String {
    // Only the objects of scenes have parts.
    let mut without = objects.iter().filter(|object| !object.parts.is_empty() && object.causes.is_none());
    let Some(first) = without.next() else { return String::new() };
    format!(
        "\nwithout causes: {} (first: {}); causes need the volume and mass of every part in ground_truth/parts.json, and \
         either the box of every part, or maps in ground_truth/part_maps that show every part that was found, and the `id` of \
         each part on them\n",
        counted(1 + without.count(), "scene"),
        one_line(&first.id)
    )
}

fn part_line(part: &WeighedPart) -> String {
    let truth = part.true_mass_kg.map_or_else(|| "-".to_owned(), |mass| format!("{mass:.4}"));
    let name = cut(&part.name, 22);
    let columns = match part.mass_kg {
        Some(mass) => [mass.low, mass.mid, mass.high].map(|kg| format!("{kg:.4}")),
        None => ["none", "none", "none"].map(str::to_owned),
    };
    let [low, mid, high] = columns;
    format!("  {name:<22} {low:>10} {mid:>10} {high:>10} {truth:>10}\n")
}

/// A name on one line, cut to the width of its column.
fn cut(name: &str, width: usize) -> String {
    one_line(name).chars().take(width).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Estimate;

    fn weighed(id: &str, causes: Option<Causes>, balance: Option<Balance>) -> Weighed {
        let part = WeighedPart {
            name: "body".to_owned(),
            volume_m3: None,
            mass_kg: None,
            true_volume_m3: None,
            true_mass_kg: None,
        };
        let predicted = Estimate::new(0.9, 1.0, 1.1);
        let (true_parts, parts) = (Vec::new(), vec![part]);
        Weighed { id: id.to_owned(), predicted, truth: 1.0, covered: true, causes, true_parts, balance, parts }
    }

    #[test]
    fn centre_and_inertia_are_shown_without_causes_too() {
        let balance = Some(Balance { center_error: 0.012, inertia_error: 0.34 });
        let objects = [weighed("mug", Some(Causes::default()), balance), weighed("lamp", None, balance)];
        let text = details_text(&objects);
        let off = |name: &str| text.lines().any(|line| line.starts_with(name) && line.ends_with("    1.2%    34.0%"));
        assert!(off("mug") && off("lamp"), "{text}");
        assert!(text.contains("without causes: 1 scene (first: lamp)"), "{text}");
        let of_masses = Weighed { parts: Vec::new(), ..weighed("B07A", None, None) };
        assert_eq!(details_text(&[of_masses]), "", "only its mass is known");
    }
}
