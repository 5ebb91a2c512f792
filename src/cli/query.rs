//! `gprop query`: answers the queries of a scene or of one picture, or moves them out and answers in.

use std::path::Path;

use serde::Serialize;

use crate::exit::UsageError;
use crate::pipeline::Stage;
use crate::pipeline::desk::{Desk, Pruned};
use crate::pipeline::picture::Picture;
use crate::query::QueryError;
use crate::workdir::Artifact;

use super::scene;
use super::{Global, QueryArgs, print};

/// What is to be done with the queries besides answering them.
enum Errand<'a> {
    Export(&'a Path),
    Import(&'a Path),
    Prune,
    Submit,
    Collect,
}

/// The two halves of a submission by the Batch API.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum BatchStep {
    /// Send the open queries.
    Submit,
    /// Fetch and record what has been answered.
    Collect,
}

/// What a dry run says of a picture.
#[derive(Serialize)]
struct DryPicture {
    queries: Option<crate::query::Plan>,
}

/// Does what the arguments ask for.
pub fn query(global: &Global, args: &QueryArgs) -> anyhow::Result<()> {
    if args.scene.scene.is_file() {
        return of_picture(global, args);
    }
    if args.mask.is_some() {
        return Err(UsageError("--mask is for a single picture; a scene's masks are given with --masks".into()).into());
    }
    match errand(args) {
        Some(errand) if !args.scene.work.dry_run => {
            let mut pipeline = scene::open(global, &args.scene.scene, &args.scene.work, Stage::Segment)?;
            pipeline.run()?;
            run(global, &pipeline.desk()?, &errand)
        }
        _ => scene::run(global, &args.scene.scene, &args.scene.work, Stage::Query),
    }
}

fn of_picture(global: &Global, args: &QueryArgs) -> anyhow::Result<()> {
    let (path, out) = (&args.scene.scene, args.scene.work.out.as_deref());
    let (mask, options) = (args.mask.as_deref(), args.scene.work.options.clone());
    if args.scene.work.dry_run && !Picture::is_segmented(path, mask, out, &options)? {
        return print(global, &DryPicture { queries: None }, || "segment   to do\nquery     to do".into());
    }
    let picture = Picture::open(path, mask, out, options, global.progress())?;
    let desk = picture.desk()?;
    if args.scene.work.dry_run {
        let plan = desk.plan(&desk.queries()?);
        let text = format!("queries: {plan}");
        return print(global, &DryPicture { queries: Some(plan) }, || text);
    }
    match errand(args) {
        Some(errand) => run(global, &desk, &errand),
        None => {
            let answers = picture.run()?;
            if global.quiet && !global.json {
                return Ok(());
            }
            print(global, &answers.parts, || picture.work().path(Artifact::MaterialMap).display().to_string())
        }
    }
}

fn errand(args: &QueryArgs) -> Option<Errand<'_>> {
    match (&args.export, &args.import, args.batch) {
        (Some(folder), ..) => Some(Errand::Export(folder)),
        (_, Some(folder), _) => Some(Errand::Import(folder)),
        (.., Some(BatchStep::Submit)) => Some(Errand::Submit),
        (.., Some(BatchStep::Collect)) => Some(Errand::Collect),
        _ => args.prune.then_some(Errand::Prune),
    }
}

fn run(global: &Global, desk: &Desk, errand: &Errand) -> anyhow::Result<()> {
    match errand {
        Errand::Export(folder) => {
            let queries = desk.export(folder)?;
            print(global, &serde_json::json!({ "queries": queries }), || {
                format!("{queries} queries in {}; its README.txt says how to answer them", folder.display())
            })
        }
        Errand::Import(folder) => import(global, desk, folder),
        Errand::Prune => {
            let pruned = desk.prune()?;
            let Pruned { kept, removed } = pruned;
            print(global, &pruned, || format!("{removed} recordings removed, {kept} kept"))
        }
        Errand::Submit => {
            let sent = desk.submit()?;
            print(global, &sent, || {
                format!("{} queries sent, {} of earlier submissions waiting", sent.sent, sent.waiting)
            })
        }
        Errand::Collect => {
            let collected = desk.collect()?;
            print(global, &collected, || format!("{} answers recorded", collected.recorded))?;
            Ok(collected.require_all()?)
        }
    }
}

fn import(global: &Global, desk: &Desk, folder: &Path) -> anyhow::Result<()> {
    let imported = desk.import(folder)?;
    print(global, &imported, || {
        format!("{} answers recorded, {} not answered", imported.recorded, imported.unanswered)
    })?;
    if imported.bad.is_empty() {
        return Ok(());
    }
    let lines: Vec<String> = imported.bad.iter().map(ToString::to_string).collect();
    let count = lines.len();
    Err(QueryError::Import { folder: folder.to_owned(), count, lines: lines.join("\n") }.into())
}
