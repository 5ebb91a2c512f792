//! The commands that work on a scene.

use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use crate::exit::UsageError;
use crate::pipeline::{Pipeline, Plan, Stage};
use crate::query::QueryError;
use crate::report;
use crate::workdir::Artifact;

use super::{Global, QueryArgs, SceneArgs, print};

/// What a dry run says of a stage.
#[derive(Serialize)]
struct DryStage {
    name: Stage,
    reusable: bool,
}

/// Runs the stages up to `to` and prints what the last one made.
pub fn run(global: &Global, args: &SceneArgs, to: Stage) -> anyhow::Result<()> {
    let mut pipeline = open(global, args, to)?;
    if args.work.dry_run {
        return dry_run(global, &pipeline, to);
    }
    pipeline.run()?;
    if global.quiet && !global.json {
        return Ok(());
    }
    if to == Stage::Report {
        let report = pipeline.report()?;
        return print(global, &report, || report::summary(&report, &pipeline.work().path(Artifact::ReportHtml)));
    }
    let artifact = result_of(to);
    let path = pipeline.work().path(artifact);
    let value: Value = if global.json { json_of(&pipeline, artifact)? } else { Value::Null };
    print(global, &value, || path.display().to_string())
}

/// Answers the queries, or moves them out or their answers in.
pub fn query(global: &Global, args: &QueryArgs) -> anyhow::Result<()> {
    let (Some(folder), scene) = (args.export.as_deref().or(args.import.as_deref()), &args.scene) else {
        return run(global, &args.scene, Stage::Query);
    };
    let mut pipeline = open(global, scene, Stage::Segment)?;
    pipeline.run()?;
    if args.export.is_some() {
        export(global, &pipeline, folder)
    } else {
        import(global, &pipeline, folder, scene.work.options.query.lmm_model.as_deref())
    }
}

fn export(global: &Global, pipeline: &Pipeline, folder: &Path) -> anyhow::Result<()> {
    let queries = pipeline.export_queries(folder)?;
    print(global, &serde_json::json!({ "queries": queries }), || {
        format!("{queries} queries in {}; its README.txt says how to answer them", folder.display())
    })
}

fn import(global: &Global, pipeline: &Pipeline, folder: &Path, model: Option<&str>) -> anyhow::Result<()> {
    let imported = pipeline.import_answers(folder, model)?;
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

fn open(global: &Global, args: &SceneArgs, to: Stage) -> anyhow::Result<Pipeline> {
    if args.work.from.is_some_and(|from| from > to) {
        return Err(UsageError(format!("--from {:?} comes after the last stage, {to:?}", args.work.from)).into());
    }
    let plan = Plan { to, from: args.work.from };
    Pipeline::open(&args.scene, args.work.out.as_deref(), args.work.options.clone(), plan, global.progress())
}

fn dry_run(global: &Global, pipeline: &Pipeline, to: Stage) -> anyhow::Result<()> {
    let reusable = pipeline.reusable()?;
    let stages: Vec<DryStage> = Stage::ALL
        .into_iter()
        .filter(|stage| *stage <= to)
        .map(|name| DryStage { name, reusable: reusable.contains(&name) })
        .collect();
    // What is asked can be told only once the parts are known.
    let asked = to >= Stage::Query && reusable.contains(&Stage::Segment) && !reusable.contains(&Stage::Query);
    let queries = if asked { Some(pipeline.query_plan()?) } else { None };
    print(global, &serde_json::json!({ "stages": stages, "queries": queries }), || {
        let mut text = String::new();
        for stage in &stages {
            let state = if stage.reusable { "as it is" } else { "to do" };
            text += &format!("{:<9} {state}\n", format!("{:?}", stage.name).to_lowercase());
        }
        if let Some(plan) = &queries {
            text += &format!("queries: {} parts, {} recorded; to ask: {}\n", plan.parts, plan.recorded, plan.cost);
        }
        text
    })
}

/// The file that holds what a stage made.
fn result_of(stage: Stage) -> Artifact<'static> {
    match stage {
        Stage::Scene => Artifact::Views,
        Stage::Segment => Artifact::Segments,
        Stage::Query => Artifact::Answers,
        Stage::Vote => Artifact::Field,
        Stage::Parts => Artifact::Parts,
        Stage::Simulate => Artifact::Simulation,
        Stage::Grasp => Artifact::Grasp,
        Stage::Report => Artifact::ReportHtml,
    }
}

/// An artifact as one JSON value; of the field, the labels that its numbers stand for.
fn json_of(pipeline: &Pipeline, artifact: Artifact) -> anyhow::Result<Value> {
    Ok(match artifact {
        Artifact::Answers => serde_json::to_value(&pipeline.answers()?.parts)?,
        Artifact::Field => pipeline.work().read_json(Artifact::Labels)?,
        other => pipeline.work().read_json(other)?,
    })
}
