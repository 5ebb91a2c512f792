//! `gprop batch`: runs many scenes, or lists their state.

mod display;
mod dry_run;

use std::path::Path;

use crate::batch::{Batch, BatchError, BatchQuestions, Summary, Task};
use crate::error::{Result, UsageError};
use crate::pipeline::{self, Stage};
use crate::query::session::price;
use crate::query::{self, AnswerSource, batch_api, client};
use crate::words::progress;

use super::{BatchArgs, Global, options_of, print, print_text, scene, shown};
use crate::words::output::{agreeing, counted};
pub use display::Display;

/// Runs the command.
pub fn run(global: &Global, args: &BatchArgs) -> Result<()> {
    let (mut flags, max_usd) = (global.flags.typed.clone(), args.options.query.max_usd);
    if args.no_simulate {
        scene::check_without_simulation(args.to)?;
        flags.push("--no-simulate".into());
    }
    check_from(args)?;
    let task = Task { to: args.to, from: args.from, flags, max_usd, threads: global.threads };
    let batch = Batch::new(&args.folder, args.out.as_deref(), args.batch.clone(), task)?;
    batch.warnings().iter().for_each(|warning| tracing::warn!("{warning}"));
    if args.dry_run {
        return dry_run::print_state(global, args, &batch);
    }
    if args.merge {
        let summary = batch.merge()?;
        print(global, &summary, || with_page(&summary, &batch))?;
        return Ok(summary.require_all()?);
    }
    if let Some(step) = args.queries {
        let options_of = |scene: &Path| options_of(scene, &global.flags.typed);
        return questions(global, step, &batch, &BatchQuestions::new(&batch, &args.options, &options_of)?);
    }
    announce(&args.options, batch.scenes().count())?;
    let mut display = Display::new(global);
    let summary = batch.run(&mut |news| display.take(&news))?;
    drop(display);
    if !global.json && !global.quiet {
        // Of several shards, the page is written by --merge.
        print_text(&if batch.shard().of == 1 { with_page(&summary, &batch) } else { summary.table() })?;
    }
    Ok(summary.require_all()?)
}

/// The table of all scenes, then the path of their page.
fn with_page(summary: &Summary, batch: &Batch) -> String {
    format!("{}\n{}", summary.table(), shown(&batch.page()))
}

/// Tells the user which server may be asked about the scenes' pictures. The number of pictures is known only when a
/// scene is segmented; the scene's own process reports it.
pub fn announce(options: &pipeline::Options, scenes: usize) -> Result<()> {
    let query = &options.query;
    let destination = client::destination(query)?.filter(|_| query.answers.may_ask());
    let Some(destination) = destination.filter(|_| options.setup.network().is_ok()) else { return Ok(()) };
    let budget = match query.max_usd {
        Some(_) if is_free(query)? => "nothing is charged, so --max-usd counts nothing".to_owned(),
        Some(max_usd) => format!("at most {max_usd} USD, as set by --max-usd"),
        None => "no limit set by --max-usd".to_owned(),
    };
    let scenes = format!("{}{}", agreeing(scenes, "", "up to "), counted(scenes, "scene"));
    let which = match query.answers {
        AnswerSource::Live => format!("the pictures of {scenes}, even if their answers are recorded"),
        AnswerSource::Record | AnswerSource::Replay | AnswerSource::Partial => {
            format!("those pictures of {scenes} that have no recorded answer")
        }
    };
    progress::notice(&format!("asking {destination} about {which} ({budget})"));
    Ok(())
}

/// Whether the model's price is known to be nothing.
fn is_free(query: &query::Options) -> Result<bool> {
    Ok(price(query)?.is_some_and(|price| price.input_usd_per_mtok == 0.0 && price.output_usd_per_mtok == 0.0))
}

/// Refuses a `--from` that would be ignored or that every scene would refuse.
fn check_from(args: &BatchArgs) -> Result<(), UsageError> {
    let problem = match (args.queries, args.from) {
        (None, from) => return scene::check_from(from, args.to),
        (Some(batch_api::Step::Submit), Some(from)) if from > Stage::Segment => {
            format!("--queries submit can redo only scene and segment; leave out --from {}", from.name())
        }
        (Some(batch_api::Step::Collect), Some(from)) => {
            format!("--queries collect runs no stage; leave out --from {}", from.name())
        }
        (Some(_), _) => return Ok(()),
    };
    Err(UsageError(problem))
}

fn questions(global: &Global, step: batch_api::Step, batch: &Batch, questions: &BatchQuestions) -> Result<()> {
    let failures = match step {
        batch_api::Step::Submit => {
            let (sent, failures) = questions.submit()?;
            print(global, &sent, || sent.to_string())?;
            failures
        }
        batch_api::Step::Collect => {
            let (collected, failures) = questions.collect()?;
            print(global, &collected, || format!("{} recorded", counted(collected.recorded, "answer")))?;
            if failures.is_empty() {
                collected.require_all()?;
            }
            failures
        }
    };
    if failures.is_empty() {
        return Ok(());
    }
    let scenes = batch.scenes().count();
    Err(BatchError::Incomplete { scenes, failed: failures, missing: Vec::new(), lacks_answers: false }.into())
}
