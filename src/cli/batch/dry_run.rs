//! `gprop batch --dry-run`: the scenes with their state, the memory that each needs, and what asking about it would cost.

use serde::Serialize;

use crate::batch::{Batch, Selected, Shard, Standing};
use crate::error::Result;
use crate::exit;
use crate::query::Preview;
use crate::query::ask::cost::Cost;
use crate::words::output::{counted, one_line};

use super::super::{BatchArgs, Global, LastRun, WorkArgs, options_of, print, scene};

/// What a batch would do.
#[derive(Serialize)]
struct DryBatch<'a> {
    shard: usize,
    of: usize,
    scenes: Vec<DryScene<'a>>,
    skipped: Vec<String>,
    /// Cost of asking all questions that are due and known.
    cost: Cost,
    /// How many questions there may be in all of these scenes, without those whose answers are recorded, if answers disagree and parts
    /// consist of several materials.
    at_most: usize,
    /// Number of scenes whose questions are not known, because their parts are not found yet or cannot be read.
    unknown: usize,
}

/// A scene in the output of a dry run.
#[derive(Serialize)]
struct DryScene<'a> {
    name: &'a str,
    standing: Standing,
    bytes: u64,
    need_bytes: u64,
    /// `None` if nothing would be asked, or it is not known.
    queries: Option<Preview>,
    is_known: bool,
    /// Why the questions are not known, if the scene cannot be opened.
    #[serde(skip_serializing_if = "Option::is_none")]
    problem: Option<String>,
}

/// Prints what the batch would do.
pub fn print_state(global: &Global, args: &BatchArgs, batch: &Batch) -> Result<()> {
    let Shard { index, of } = batch.shard();
    let standing = batch.standing()?;
    let bar = global.progress().bar("scenes", standing.len() as u64);
    let quiet = Global { quiet: true, ..global.clone() };
    let scenes: Vec<DryScene> = standing
        .iter()
        .map(|(scene, standing)| {
            bar.inc(1);
            let is_open = *standing == Standing::ToDo || (*standing == Standing::Failed && args.batch.retry_failed);
            let asked = if is_open { questions(&quiet, args, scene) } else { Ok(Questions::Known(None)) };
            DryScene::new(batch, scene, *standing, asked)
        })
        .collect();
    bar.finish_and_clear();
    let previews = || scenes.iter().filter_map(|scene| scene.queries.as_ref());
    let dry = DryBatch {
        shard: index,
        of,
        skipped: batch.skipped().map(|outcome| outcome.scene).collect(),
        cost: previews().fold(Cost::default(), |sum, preview| sum.plus(preview.cost)),
        at_most: previews().map(|preview| preview.at_most - preview.recorded).sum(),
        unknown: scenes.iter().filter(|scene| !scene.is_known).count(),
        scenes,
    };
    print(global, &dry, || dry.text())
}

/// The questions of a scene.
enum Questions {
    /// They are known; `None` if there are none to ask.
    Known(Option<Preview>),
    /// They are not known until its parts are found.
    Unknown,
}

fn questions(global: &Global, args: &BatchArgs, of: &Selected) -> Result<Questions> {
    if !of.work.exists() {
        return Ok(Questions::Unknown);
    }
    let options = options_of(&of.folder, &global.flags.typed)?;
    let out = of.named_work().map(Into::into);
    let work = WorkArgs { out, from: args.from, dry_run: true, last_run: LastRun { fresh: true }, options };
    let dry = scene::dry_run(global, &of.folder, &work, args.to, !args.no_simulate)?;
    Ok(if dry.lacks_parts() { Questions::Unknown } else { Questions::Known(dry.queries) })
}

impl<'a> DryScene<'a> {
    fn new(batch: &Batch, scene: &'a Selected, standing: Standing, asked: Result<Questions>) -> Self {
        let (queries, is_known, problem) = match asked {
            Ok(Questions::Known(queries)) => (queries, true, None),
            Ok(Questions::Unknown) => (None, false, None),
            Err(error) => (None, false, Some(exit::message(&error))),
        };
        let Selected { name, bytes, .. } = scene;
        Self { name, standing, bytes: *bytes, need_bytes: batch.need(scene), queries, is_known, problem }
    }

    fn text(&self) -> String {
        let Self { name, bytes, need_bytes, .. } = self;
        let state = match self.standing {
            Standing::ToDo => "to do",
            Standing::Done => "done",
            Standing::Failed => "failed",
        };
        let asked = match (&self.problem, &self.queries) {
            (Some(problem), _) => {
                format!("; cannot be opened: {}", one_line(problem.lines().next().unwrap_or_default()))
            }
            (None, Some(queries)) => format!("; {queries}"),
            (None, None) if self.is_known => String::new(),
            (None, None) => "; questions unknown".to_owned(),
        };
        let megabytes = |bytes: &u64| *bytes as f64 / 1e6;
        format!(
            "{}  {state}  {:.1} MB of files, {:.0} MB of memory{asked}\n",
            one_line(name),
            megabytes(bytes),
            megabytes(need_bytes)
        )
    }
}

impl DryBatch<'_> {
    fn text(&self) -> String {
        let Self { shard, of, scenes, skipped, cost, at_most, unknown } = self;
        let lines: String = scenes.iter().map(DryScene::text).collect();
        let skipped: String = skipped.iter().map(|name| format!("{name}  skipped\n")).collect();
        let mut text = format!("{lines}{skipped}{} in shard {shard}/{of}", counted(scenes.len(), "scene"));
        if cost.requests > 0 || *unknown == 0 {
            text += &format!("; to ask: {cost}");
        }
        if *at_most > cost.requests {
            text +=
                &format!("\nat most {} if answers disagree or name several materials", counted(*at_most, "question"));
        }
        if *unknown > 0 {
            text += &format!(
                "\nwhat would be asked about {} is unknown until the parts are found; `gprop batch` with `--to consensus` finds \
                 them and sends nothing",
                counted(*unknown, "scene")
            );
        }
        text
    }
}
