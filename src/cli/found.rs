//! The result of a stage in a few lines, for people at a terminal: what was found, then the path of the file.

use std::collections::BTreeMap;
use std::fmt::Write;

use serde_json::Value;

use crate::consensus::AskAbout;
use crate::error::{Error, Result};
use crate::grasp::GraspReport;
use crate::parts::PartsError;
use crate::pipeline::stages::recognise::AnswerAboutWhole;
use crate::pipeline::stages::refine::{LookedFor, RefinedFile};
use crate::pipeline::{Pipeline, Stage, stages};
use crate::query::{Answers, Hypothesis, Outcome, Recognition};
use crate::report::{claim_line, grasp_line, mass_line, misfit_line, part_lines, provisional_line, size_line};
use crate::segment::Segmentation;
use crate::simulate::SimulationReport;
use crate::vote::MaterialField;
use crate::words::output::one_line;
use crate::words::output::{agreeing, counted, thousands};
use crate::words::part_name::part_name;
use crate::words::readable::significant;
use crate::workdir::Artifact;

use super::shown;

/// The result of `stage`, which must be done.
pub fn text(pipeline: &mut Pipeline, stage: Stage) -> Result<String> {
    let misfit = misfit_line(stages::scene::misfit(pipeline.opened())?.as_deref());
    let found = match stage {
        Stage::Scene | Stage::Report => String::new(),
        Stage::Segment => segments(pipeline.segments()?.as_ref()),
        Stage::Consensus if pipeline.opened().options.consensus.ask == AskAbout::Segments => {
            return Ok(misfit + "no parts: the model is asked about segments");
        }
        Stage::Consensus => parts_of_views(&pipeline.opened().work.read_json(Artifact::FoundParts)?),
        Stage::Recognise => recognition(pipeline.opened().get::<AnswerAboutWhole>()?.known()),
        Stage::Refine => looked_for(&pipeline.opened().get::<RefinedFile>()?.looked_for),
        Stage::Query => answers(pipeline.answers()?.as_ref()),
        Stage::Vote => materials(pipeline.field()?.as_ref()),
        Stage::Parts => {
            let parts = if_metric(pipeline.parts())?;
            let field = pipeline.field()?;
            let lines = part_lines(&field.parts, parts.as_deref()) + &parts.as_deref().map_or_else(no_scale, mass_line);
            let open = pipeline.opened();
            let longest_side = open.scene.longest_side();
            let claimed = open.scene.mesh.as_ref().and_then(|mesh| mesh.painted.mesh.claimed_mass_kg);
            let lines = lines + &parts.as_deref().map_or_else(String::new, |parts| claim_line(claimed, parts));
            lines + &size_line(stages::parts::scale(open)?.as_ref(), longest_side)
        }
        Stage::Simulate => simulation(pipeline.simulation()?.as_ref()),
        Stage::Grasp => if_metric(pipeline.grasp())?.as_deref().map_or_else(no_scale, grasp),
    };
    let artifacts: &[Artifact] = match stage {
        Stage::Segment => &[Artifact::Segments],
        Stage::Simulate => &[Artifact::Animation, Artifact::Simulation],
        other => &[other.row().result],
    };
    let mut text = misfit + &open_questions(pipeline, stage)? + &found;
    artifacts.iter().for_each(|artifact| text += &format!("{}\n", shown(&pipeline.opened().work.path(*artifact))));
    Ok(text)
}

/// What the object is taken for.
fn recognition(known: Option<&Recognition>) -> String {
    let Some(known) = known else { return "the model is not asked what the object is\n".to_owned() };
    let hypothesis = |of: &Hypothesis| format!("  {} % {}\n", (100.0 * of.probability).round(), one_line(&of.what));
    let hypotheses: String = known.hypotheses.iter().map(hypothesis).collect();
    format!("{}\n{hypotheses}", one_line(&known.object))
}

/// The things without a number that were looked for in the photos.
fn looked_for(things: &[LookedFor]) -> String {
    if things.is_empty() {
        return "nothing without a number to look for\n".to_owned();
    }
    let line = |LookedFor { what, id, .. }: &LookedFor| match id {
        Some(id) => format!("part {id}: {}\n", one_line(what)),
        None => format!("not found: {}\n", one_line(what)),
    };
    things.iter().map(line).collect()
}

/// That masses and what follows from them are provisional, if answers are missing.
fn open_questions(pipeline: &Pipeline, stage: Stage) -> Result<String> {
    if stage < Stage::Parts {
        return Ok(String::new());
    }
    Ok(provisional_line(stages::report::provisional(pipeline.opened())?.as_deref()))
}

/// A result that does not exist if the metric scale is unknown.
fn if_metric<T>(found: Result<T, Error>) -> Result<Option<T>, Error> {
    match found {
        Err(error) if matches!(error.downcast_ref(), Some(PartsError::ScaleUnknown)) => Ok(None),
        found => found.map(Some),
    }
}

fn no_scale() -> String {
    "no masses or forces: the metric scale is unknown (see --scale and --known-mass)\n".to_owned()
}

fn segments(found: &Segmentation) -> String {
    let counts: Vec<usize> = found.views.iter().map(|view| view.segments.len()).collect();
    let each = match (counts.iter().min(), counts.iter().max()) {
        (Some(least), Some(most)) if least < most => format!(", {least} to {most} in each"),
        _ => String::new(),
    };
    format!("{} in {}{each}\n", counted(counts.iter().sum(), "segment"), counted(counts.len(), "view"))
}

/// `file` is `consensus.json`.
fn parts_of_views(file: &Value) -> String {
    let all = file["parts"].as_array().map_or(&[][..], Vec::as_slice);
    let pieces = all.iter().filter(|part| !part["piece_of"].is_null()).count();
    let parts = all.len() - pieces;
    let with_pieces = match pieces {
        0 => String::new(),
        _ => format!(
            "; {} of {} may be of another material and {} asked about as well: {} to ask about in all",
            counted(pieces, "smaller region"),
            agreeing(parts, "it", "them"),
            agreeing(pieces, "is", "are"),
            counted(all.len(), "region"),
        ),
    };
    format!("{}{with_pieces}\n", counted(parts, "part"))
}

fn answers(found: &Answers) -> String {
    let mut by_material: BTreeMap<&str, usize> = BTreeMap::new();
    let mut failed = 0;
    for answer in &found.all {
        match &answer.outcome {
            Outcome::Answered(answer) => *by_material.entry(&answer.material).or_default() += 1,
            Outcome::Failed(_) => failed += 1,
        }
    }
    let mut text = counted(found.all.len() - failed, "answer");
    if failed > 0 {
        text += &format!(", {} without one", counted(failed, "question"));
    }
    text.push('\n');
    let mut materials: Vec<_> = by_material.into_iter().collect();
    materials.sort_by_key(|(_, answers)| std::cmp::Reverse(*answers));
    for (material, answers) in materials {
        let _ = writeln!(text, "  {answers:>3}  {}", one_line(material));
    }
    text
}

fn materials(field: &MaterialField) -> String {
    let mut text = String::new();
    for part in &field.parts {
        let gaussians = field.part_ids().filter(|id| *id == part.id).count();
        let name = part_name(&part.caption, &part.material);
        let (material, name) = (one_line(&part.material), one_line(&name));
        let _ = writeln!(text, "  {:>2}  {material}  {} Gaussians: {name}", part.id, thousands(gaussians as u64));
    }
    text
}

fn simulation(report: &SimulationReport) -> String {
    let seconds = report.frames.last().map_or(0.0, |frame| frame.t_s);
    let particles = thousands(report.particles as u64);
    format!("{particles} particles, {} s in {}\n", significant(seconds), counted(report.frames.len(), "frame"))
}

fn grasp(report: &GraspReport) -> String {
    let mut text = grasp_line(report);
    if report.candidates.len() > 1 {
        text += "places, best first:\n";
    }
    for place in report.candidates.iter().skip_while(|_| report.candidates.len() < 2) {
        let unsafe_because =
            place.infeasible_because.map_or_else(String::new, |reason| format!("; not safe: {}", reason.in_words()));
        let _ = writeln!(
            text,
            "  {} N at the {}, {} mm wide, {} mm from the centre of mass{unsafe_because}",
            significant(place.force_n),
            one_line(&part_name(&place.part, &place.material)),
            significant(place.width_m * 1e3),
            significant(place.lever_m * 1e3),
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn pieces_are_counted_apart_from_parts() {
        let (part, piece) = (json!({ "piece_of": null }), json!({ "piece_of": 1 }));
        let text = |parts: &[&Value]| parts_of_views(&json!({ "parts": parts }));
        assert_eq!(text(&[&part, &part]), "2 parts\n");
        assert_eq!(
            text(&[&part, &part, &piece, &piece]),
            "2 parts; 2 smaller regions of them may be of another material and are asked about as well: 4 regions to ask about \
             in all\n"
        );
        assert_eq!(
            text(&[&part, &piece, &piece]),
            "1 part; 2 smaller regions of it may be of another material and are asked about as well: 3 regions to ask about in \
             all\n"
        );
    }
}
