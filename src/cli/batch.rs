//! `gprop batch`: many scenes, or what is known of them.

use std::path::Path;

use serde::Serialize;

use crate::batch::{Batch, BatchError, Outcome, QuestionStep, Questions, Shard, Standing, State, Task};
use crate::progress::Progress;

use super::{BatchArgs, Global, options_of, print, print_text};

/// What a dry run says of a scene.
#[derive(Serialize)]
struct DryScene<'a> {
    name: &'a str,
    standing: Standing,
    bytes: u64,
    need_bytes: u64,
}

/// Does what the arguments ask for.
pub fn run(global: &Global, args: &BatchArgs) -> anyhow::Result<()> {
    let task = Task { to: args.to, from: args.from, flags: global.typed.clone(), threads: global.threads };
    let batch = Batch::new(&args.folder, args.out.as_deref(), args.batch.clone(), task)?;
    batch.warnings().iter().for_each(|warning| tracing::warn!("{warning}"));
    if args.dry_run {
        return dry_run(global, &batch);
    }
    if args.merge {
        let summary = batch.merge()?;
        print(global, &summary, || summary.table())?;
        return Ok(summary.require_all()?);
    }
    if let Some(step) = args.queries {
        let options_of = |scene: &Path| options_of(scene, &global.typed);
        return questions(global, step, &batch, &Questions::new(&batch, &args.options.query, &options_of)?);
    }
    let (total, mut ended) = (batch.scenes().count(), 0);
    let progress = global.progress();
    let summary = batch.run(&mut |outcome| {
        ended += 1;
        tell(global, progress, outcome, ended, total);
    })?;
    if !global.json && !global.quiet {
        print_text(&summary.table())?;
    }
    Ok(summary.require_all()?)
}

/// A line of JSON on stdout, or one for people on stderr.
fn tell(global: &Global, progress: Progress, outcome: &Outcome, ended: usize, total: usize) {
    if global.json {
        let line = serde_json::to_string(outcome).expect("an outcome is plain data");
        // A reader that has gone away shall not stop the batch: everything is in its file too.
        let _ = print_text(&line);
        return;
    }
    let state = if outcome.state == State::Done { "done" } else { "FAILED" };
    progress.line(&format!("{:<9} {ended}/{total} {} {:.1} s", state, outcome.scene, outcome.seconds));
}

fn dry_run(global: &Global, batch: &Batch) -> anyhow::Result<()> {
    let standing = batch.standing()?;
    let scenes: Vec<DryScene> = standing
        .iter()
        .map(|(scene, standing)| DryScene {
            name: &scene.name,
            standing: *standing,
            bytes: scene.bytes,
            need_bytes: batch.need(scene),
        })
        .collect();
    let Shard { index, of } = batch.shard();
    print(global, &serde_json::json!({ "shard": index, "of": of, "scenes": scenes }), || {
        let line = |scene: &DryScene| {
            let state = match scene.standing {
                Standing::ToDo => "to do",
                Standing::Done => "done",
                Standing::Failed => "failed",
            };
            let megabytes = |bytes: u64| bytes as f64 / 1e6;
            let DryScene { name, bytes, need_bytes, .. } = scene;
            format!(
                "{name}  {state}  {:.1} MB of files, {:.0} MB of memory\n",
                megabytes(*bytes),
                megabytes(*need_bytes)
            )
        };
        scenes.iter().map(line).collect::<String>() + &format!("{} scenes in shard {index}/{of}", scenes.len())
    })
}

fn questions(global: &Global, step: QuestionStep, batch: &Batch, questions: &Questions) -> anyhow::Result<()> {
    let failures = match step {
        QuestionStep::Submit => {
            let (sent, failures) = questions.submit()?;
            print(global, &sent, || {
                format!("{} queries sent, {} of earlier submissions waiting", sent.sent, sent.waiting)
            })?;
            failures
        }
        QuestionStep::Collect => {
            let (collected, failures) = questions.collect()?;
            print(global, &collected, || format!("{} answers recorded", collected.recorded))?;
            if failures.is_empty() {
                collected.require_all()?;
            }
            failures
        }
    };
    match failures.is_empty() {
        true => Ok(()),
        false => {
            let scenes = batch.scenes().count();
            Err(BatchError::Incomplete { scenes, failed: failures, missing: Vec::new() }.into())
        }
    }
}
