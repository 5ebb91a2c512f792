//! `gprop run` and `gprop export` of a robot or a scene of a simulator: its links, one after the other.

use crate::batch::{Summary, Task};
use crate::error::{Result, UsageError};
use crate::export::File;
use crate::links::Prepared;
use crate::pipeline::{Options, Stage};

use super::arguments::{ForPython, RunArgs};
use super::{ExportArgs, Global, batch, print, print_works, scene};

/// Runs the links of a URDF or MJCF, and prints their masses beside those that the file claims.
pub fn run(global: &Global, args: &RunArgs) -> Result<()> {
    let work = &args.scene.work;
    if args.for_python == Some(ForPython::One) {
        let problem = format!("{:?} may have several links; run each with gprop.run_all", args.scene.scene);
        return Err(UsageError(problem).into());
    }
    scene::check_from(work.from, args.to)?;
    if work.dry_run {
        return Err(UsageError(
            "--dry-run is for single objects; `gprop batch FOLDER/links --dry-run` lists links".into(),
        )
        .into());
    }
    let mut flags = global.flags.typed.clone();
    if args.no_simulate {
        scene::check_without_simulation(args.to)?;
        flags.push("--no-simulate".into());
    }
    let prepared = Prepared::of(&args.scene.scene, work.out.as_deref(), &work.options.scene)?;
    let max_usd = work.options.query.max_usd;
    let task = Task { to: args.to, from: work.from, flags, max_usd, threads: global.threads };
    let summary = run_links(global, &prepared, &work.options, task)?;
    let links = prepared.gather()?;
    if args.for_python.is_some() {
        print_works(prepared.works())?;
    } else if global.prints_summary() {
        print(global, &links, || links.table())?;
    }
    Ok(summary.require_all()?)
}

/// Writes a URDF or MJCF as it is, with what was found of its links filled in, after running the stages up to the parts.
pub fn export(global: &Global, args: &ExportArgs) -> Result<()> {
    if !args.format.is_empty() {
        let problem = "--format is for single objects; a URDF or MJCF is written as it is, with masses filled in. Export a link \
                       by itself from the folder links/ of the work folder";
        return Err(UsageError(problem.to_owned()).into());
    }
    let prepared = Prepared::of(args.scene(), args.work.as_deref(), &args.options.scene)?;
    let (flags, max_usd) = (global.flags.typed.clone(), args.options.query.max_usd);
    let task = Task { to: Stage::Parts, from: None, flags, max_usd, threads: global.threads };
    run_links(global, &prepared, &args.options, task)?.require_all()?;
    let written = prepared.export(&prepared.gather()?, args.out())?;
    written.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
    let files: Vec<_> = written.files.into_iter().map(File::of).collect();
    scene::print_written(global, &files, &[])
}

fn run_links(global: &Global, prepared: &Prepared, options: &Options, task: Task) -> Result<Summary> {
    prepared.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
    tracing::info!("{prepared}");
    batch::announce(options, prepared.object_count())?;
    // The outcomes are for people; what is printed as JSON is the result.
    let for_people = Global { json: false, ..global.clone() };
    let mut display = batch::Display::new(&for_people);
    prepared.run(task, &mut |news| display.take(&news))
}
