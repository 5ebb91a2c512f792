//! `gprop query`: answers the questions of a scene or of one picture, exports them, or imports answers.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::Path;

use serde::Serialize;

use crate::error::{Result, UsageError};
use crate::pipeline::Stage;
use crate::pipeline::picture::Picture;
use crate::pipeline::stages::questions::{direct_session, session_of};
use crate::pipeline::stages::subjects::FoundSubjects;
use crate::query::batch_api;
use crate::query::exchange::{BadLine, Imported};
use crate::query::session::{Pruned, QuerySession, write_sheets};
use crate::query::{DirectGuess, QueryError, WholeOutcome};
use crate::scene::ObjectChoice;
use crate::words::output::one_line;
use crate::words::readable::significant;
use crate::words::shell;
use crate::workdir::Artifact;

use super::{Global, QueryArgs, is_picture, print, shown};
use super::{picture, scene};
use crate::words::output::counted;

/// The actions on questions other than answering them.
enum QueryAction<'a> {
    Export(&'a Path),
    Import(&'a Path),
    Prune,
    Submit,
    Collect,
}

/// A picture in the output of a dry run.
#[derive(Serialize)]
struct DryPicture {
    queries: Option<crate::query::Preview>,
}

/// Runs the command.
pub fn query(global: &Global, args: &QueryArgs) -> Result<()> {
    if is_picture(&args.scene.scene) {
        return of_picture(global, args);
    }
    if args.mask.is_some() {
        return Err(UsageError("--mask is for a single picture; a scene's masks are given with --masks".into()).into());
    }
    if args.prune && args.scene.work.options.scene.object != ObjectChoice::Auto {
        let problem =
            "--prune would delete the recordings of the other objects, which are in the same folder; leave it out";
        return Err(UsageError(problem.to_owned()).into());
    }
    if args.direct {
        return directly(global, args);
    }
    match action(args) {
        Some(action) if !args.scene.work.dry_run => {
            let mut pipeline = scene::open(global, &args.scene.scene, &args.scene.work, Stage::Consensus, true)?;
            pipeline.run()?;
            pipeline.keep_flags(Stage::Query)?;
            let open = pipeline.opened();
            let about = FoundSubjects::of(open)?;
            let session = session_of(open, &about, &open.options.query)?;
            run(global, &session, &action, &format!("gprop run {}", scene::as_typed(global, &args.scene.scene)))
        }
        _ => scene::run(global, &args.scene.scene, &args.scene.work, Stage::Query),
    }
}

/// Asks how heavy the object is, or does the action on that question.
fn directly(global: &Global, args: &QueryArgs) -> Result<()> {
    let mut pipeline = scene::open(global, &args.scene.scene, &args.scene.work, Stage::Scene, true)?;
    pipeline.run()?;
    let open = pipeline.opened();
    let session = direct_session(open)?;
    if args.scene.work.dry_run {
        let preview = session.preview(&session.queries()?);
        return print(global, &preview, || format!("questions: {preview}"));
    }
    if let Some(action) = action(args) {
        let scene = scene::as_typed(global, &args.scene.scene);
        return run(global, &session, &action, &format!("gprop query {scene} --direct"));
    }
    let guess = session.direct_guess(&|round| Ok(write_sheets(&open.work, round)?))?;
    let guess =
        guess.ok_or_else(|| UsageError("no photo shows the object, so there is nothing to judge".to_owned()))?;
    print(global, &guess, || match &guess.outcome {
        WholeOutcome::Answered(DirectGuess { object, mass_kg, .. }) => {
            let [low, mid, high] = [mass_kg.low, mass_kg.mid, mass_kg.high].map(significant);
            format!("direct guess: {mid} kg ({low} to {high} kg): {}", one_line(object))
        }
        WholeOutcome::Failed(failure) => format!("direct guess: none: {failure}"),
    })
}

fn of_picture(global: &Global, args: &QueryArgs) -> Result<()> {
    picture::check_from(&args.scene.work)?;
    let (path, out) = (&args.scene.scene, args.scene.work.out.as_deref());
    let (mask, options) = (args.mask.as_deref(), args.scene.work.options.clone());
    if args.scene.work.dry_run && !Picture::is_segmented(path, mask, out, &options)? {
        return print(global, &DryPicture { queries: None }, || "segment   to do\nquery     to do".into());
    }
    let picture = Picture::open(path, mask, out, options, global.progress())?;
    let session = picture.query_session()?;
    if args.scene.work.dry_run {
        let preview = session.preview(&session.queries()?);
        let text = format!("questions: {preview}");
        return print(global, &DryPicture { queries: Some(preview) }, || text);
    }
    match action(args) {
        Some(action) => run(global, &session, &action, &format!("gprop query {}", shell::path(path))),
        None => {
            let answers = picture.run()?;
            if !global.prints_summary() {
                return Ok(());
            }
            print(global, &answers.all, || shown(&picture.work().path(Artifact::MaterialMap)))
        }
    }
}

fn action(args: &QueryArgs) -> Option<QueryAction<'_>> {
    match (&args.export, &args.import, args.batch_api) {
        (Some(folder), ..) => Some(QueryAction::Export(folder)),
        (_, Some(folder), _) => Some(QueryAction::Import(folder)),
        (.., Some(batch_api::Step::Submit)) => Some(QueryAction::Submit),
        (.., Some(batch_api::Step::Collect)) => Some(QueryAction::Collect),
        _ => args.prune.then_some(QueryAction::Prune),
    }
}

/// `next` is the command that uses imported answers.
fn run(global: &Global, session: &QuerySession, action: &QueryAction, next: &str) -> Result<()> {
    match action {
        QueryAction::Export(folder) => {
            let queries = session.export(folder)?;
            print(global, &serde_json::json!({ "queries": queries }), || match queries {
                0 => format!(
                    "all questions are answered, so there is none in {}; to change an answer, edit it in an earlier export \
                     and import that again, with the same name after \"model\"",
                    shown(folder)
                ),
                _ => {
                    format!("{} in {}; its README.txt says how to answer", counted(queries, "question"), shown(folder))
                }
            })
        }
        QueryAction::Import(folder) => import(global, session, folder, next),
        QueryAction::Prune => {
            let pruned = session.prune()?;
            let Pruned { kept, removed } = pruned;
            print(global, &pruned, || format!("{} removed, {kept} kept", counted(removed, "recording")))
        }
        QueryAction::Submit => {
            let sent = session.submit()?;
            print(global, &sent, || sent.to_string())
        }
        QueryAction::Collect => {
            let collected = session.collect()?;
            print(global, &collected, || format!("{} recorded", counted(collected.recorded, "answer")))?;
            Ok(collected.require_all()?)
        }
    }
}

/// Most problems of imported lines that a message lists.
const MOST_PROBLEMS: usize = 20;

fn import(global: &Global, session: &QuerySession, folder: &Path, next: &str) -> Result<()> {
    let imported = session.import(folder)?;
    let Imported { recorded, by_hand, unanswered, bad } = &imported;
    print(global, &imported, || {
        let next = match (*recorded, *unanswered) {
            (0, _) => String::new(),
            (_, 0) => format!("; continue with `{next}`, and the same --out if you gave one"),
            // A model that is asked answers again what another model answered, but not what a person did.
            _ if by_hand == recorded => format!(
                "; answer the rest and import again, then continue with `{next}`, and the same --out if you gave one; or let a model answer \
                 the rest: `{next} --lmm-url URL --lmm-model NAME`"
            ),
            _ => format!(
                "; answer the rest and import again, then continue with `{next}`, and the same --out if you gave one"
            ),
        };
        format!("{} recorded, {} not answered{next}", counted(*recorded, "answer"), counted(*unanswered, "question"))
    })?;
    if bad.is_empty() {
        return Ok(());
    }
    // A problem that several answers have is told once.
    let mut others: HashMap<&str, usize> = HashMap::new();
    let mut problems: Vec<&BadLine> = Vec::new();
    for line in bad {
        match others.entry(&line.problem) {
            Entry::Occupied(mut others) => *others.get_mut() += 1,
            Entry::Vacant(first) => {
                first.insert(0);
                problems.push(line);
            }
        }
    }
    let line = |first: &&BadLine| {
        let others = match others[first.problem.as_str()] {
            0 => String::new(),
            others => format!(" (and {})", counted(others, "other line")),
        };
        format!("{}{others}", one_line(&first.to_string()))
    };
    let mut lines: Vec<String> = problems.iter().take(MOST_PROBLEMS).map(line).collect();
    if problems.len() > MOST_PROBLEMS {
        lines.push(format!("and {} in other lines", counted(problems.len() - MOST_PROBLEMS, "other problem")));
    }
    let lines = lines.join("\n");
    Err(QueryError::Import { folder: folder.to_owned(), count: bad.len(), recorded: *recorded, lines }.into())
}
