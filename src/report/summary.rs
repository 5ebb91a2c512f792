//! The summary on the terminal at the end of a run.

use std::fmt::Write;
use std::path::Path;

use super::Report;
use crate::grasp::{ForceRule, GraspReport, Limit};
use crate::parts::Parts;
use crate::units::{Estimate, MetricScale, ScaleSource};
use crate::vote::FieldPart;
use crate::words::output::{counted, one_line};
use crate::words::part_name::part_name;
use crate::words::readable::{Figures, figures, interval, mass, significant};

/// A few lines: the parts, the object, the grasp, the path of the report.
pub fn summary(report: &Report, report_page: &Path) -> String {
    let scene = &report.scene;
    let mut text = format!(
        "{}: {}, {}, {}\n",
        one_line(&scene.name),
        counted(scene.gaussians, "Gaussian"),
        counted(scene.views.len(), "view"),
        counted(report.labels.len(), "part"),
    );
    text += &misfit_line(scene.misfit.as_deref());
    text += &provisional_line(report.provisional.as_deref());
    text += &part_lines(&report.labels, report.parts.as_ref());
    if let Some(parts) = &report.parts {
        text += &mass_line(parts);
        text += &claim_line(scene.claimed_mass_kg, parts);
        text += &size_line(scene.scale.as_ref(), scene.longest_side);
    }
    if let Some(grasp) = &report.grasp {
        text += &grasp_line(grasp);
    }
    match report.warnings.len() {
        0 => {}
        1 => text += "1 thing to check, at the top of the report\n",
        several => text += &format!("{several} things to check, at the top of the report\n"),
    }
    let _ = write!(text, "report {}", one_line(&report_page.to_string_lossy()));
    text
}

/// That photos and splat disagree, if they do.
pub fn misfit_line(misfit: Option<&str>) -> String {
    misfit.map_or_else(String::new, |misfit| format!("NOT ALIGNED  {}\n", one_line(misfit)))
}

/// That questions are open, if some are.
pub fn provisional_line(provisional: Option<&str>) -> String {
    provisional.map_or_else(String::new, |open| format!("PROVISIONAL  {open}\n"))
}

/// A line for each part: its number, material, mass and name.
pub fn part_lines(labels: &[FieldPart], parts: Option<&Parts>) -> String {
    let mut text = String::new();
    let fillings = parts.into_iter().flat_map(|parts| &parts.fillings);
    let names = labels.iter().map(|label| &label.material).chain(fillings.map(|filling| &filling.filling));
    let name_width = names.map(|name| one_line(name).chars().count()).max().unwrap_or(0);
    for label in labels {
        let part = parts.and_then(|parts| parts.part(label.id));
        let shown = part.map_or_else(String::new, |part| match part.mass_kg {
            Some(kg) => {
                let Figures { mid, interval } = mass(kg);
                format!("{mid:>9} ({interval})  ")
            }
            None => "no mass  ".to_owned(),
        });
        let _ = writeln!(
            text,
            "  {:>2}  {:name_width$}  {shown}{}{}",
            label.id,
            one_line(&label.material),
            one_line(&part_name(&label.caption, &label.material)),
            label.corrected.as_ref().map_or_else(String::new, |of| format!(" ({})", one_line(&of.to_string())))
        );
    }
    for filling in parts.into_iter().flat_map(|parts| &parts.fillings) {
        let Figures { mid, interval } = mass(filling.mass_kg);
        let _ = writeln!(
            text,
            "      {:name_width$}  {mid:>9} ({interval})  unseen, in part {}",
            one_line(&filling.filling),
            filling.inside_of
        );
    }
    text
}

/// The mass of the object.
pub fn mass_line(parts: &Parts) -> String {
    let mass = figures(parts.object.mass_kg, 1.0);
    let estimated = if parts.estimated_scale.is_some() { ESTIMATED } else { "" };
    format!("mass   {} kg ({}){estimated}\n", mass.mid, mass.interval)
}

/// What the file said of the mass, beside what was found; nothing if it said nothing.
pub fn claim_line(claimed_kg: Option<f64>, parts: &Parts) -> String {
    claimed_kg.map_or_else(String::new, |claimed| format!("claim  {}\n", claim(claimed, parts.object.mass_kg)))
}

/// A claim beside what was found: "said 0.05 kg; gprop 0.55 to 0.78 kg".
pub(super) fn claim(claimed_kg: f64, found: Estimate) -> String {
    format!("said {} kg; gprop {} kg", significant(claimed_kg), interval(found, 1.0))
}

/// How long the object is if only its known mass gives the scale, so that a mass in the wrong unit is noticed; else
/// nothing. `longest_side` is in scene units.
pub fn size_line(scale: Option<&MetricScale>, longest_side: f64) -> String {
    let of_mass = scale.filter(|scale| scale.source == ScaleSource::KnownMass);
    let Some((scale, range)) = of_mass.and_then(|scale| Some((scale, scale.range?))) else { return String::new() };
    let side = figures(Estimate::new(range.low, scale.meters_per_unit, range.high), longest_side);
    format!("size   the known mass implies that the longest side is {} m ({})\n", side.mid, side.interval)
}

/// The mark after a number that is no better than a model's estimate of the object's length.
pub const ESTIMATED: &str = ", estimated scale";

/// The force at the best place, or why no grip there is safe.
pub fn grasp_line(grasp: &GraspReport) -> String {
    let name = part_name(&grasp.part, &grasp.material);
    let part = one_line(&name);
    let estimated = if grasp.estimated_scale { ESTIMATED } else { "" };
    match &grasp.infeasible {
        None if grasp.candidates.is_empty() => format!(
            "grasp  no place was found where the fingers fit; the {part} slips below {} N and is damaged above {} N{estimated}\n",
            significant(grasp.f_min_n),
            significant(grasp.f_max_n),
        ),
        None => format!(
            "grasp  {} N at the {part}: {}{}{estimated}\n",
            significant(grasp.force_n),
            bounds_in_words(grasp),
            cut_short(grasp) + &papers_force(grasp),
        ),
        Some(why) => format!("grasp  no safe grip at the {part}: {}{estimated}\n", one_line(&why.explanation)),
    }
}

/// What lower and higher forces do: "slips below 2 N, damaged above 400 N".
pub(super) fn bounds_in_words(grasp: &GraspReport) -> String {
    let [slip, hold, damage] = [grasp.f_min_n, grasp.f_hold_n, grasp.f_max_n].map(significant);
    let turns = if hold == slip { String::new() } else { format!("may turn below {hold} N, ") };
    format!("slips below {slip} N, {turns}damaged above {damage} N")
}

/// Why the force is less than the safety factor asks for, if it is.
fn cut_short(grasp: &GraspReport) -> String {
    let times = grasp.force_n / grasp.f_hold_n;
    let why = match grasp.force_limited_by {
        Limit::Yield | Limit::Bending => "more would come too near to damage",
        Limit::Gripper if times < grasp.safety_factor => "the gripper cannot press harder",
        Limit::Gripper | Limit::Safety | Limit::Slip => return String::new(),
    };
    match grasp.force_rule {
        ForceRule::Safety => format!("; only {} times what holds it, as {why}", significant(times)),
        ForceRule::Paper => String::new(),
    }
}

/// The paper's F* beside the force to press with, if that is another.
fn papers_force(grasp: &GraspReport) -> String {
    match grasp.force_rule {
        ForceRule::Safety => format!("; the paper's F* is {} N", significant(grasp.f_star_n)),
        ForceRule::Paper => String::new(),
    }
}
