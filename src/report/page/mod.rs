//! `report.html`: one file that opens from disk, with inlined pictures and viewer, in light and dark.
//!
//! This module turns numbers into the texts and positions that the template shows, [`viewer`] into the data for the
//! script. The template, the style and the script define the page; `splats.js.gz` is three.js and Spark
//! (`scripts/build-viewer`), which the page of a capture with several objects shares through [`stage`]. Captions and names
//! from outside are escaped by the template engine, in HTML and in the script's JSON.

mod object;
pub mod stage;
mod viewer;
mod views;

use std::collections::BTreeMap;

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use minijinja::value::Serde;
use minijinja::{Value, context};

use crate::grasp::candidates::Candidate;
use crate::grasp::{ForceRule, GraspReport, Limit, Reason};
use crate::materials::stats::Provenance;
use crate::materials::{Material, MaterialLibrary, SPELLINGS};
use crate::parts::Part;
use crate::pictures::palette;
use crate::query::{Answers, Form};
use crate::simulate::{RigidReport, SimulationReport, animation, plot, script};
use crate::units::Estimate;
use crate::vote::{Contents, FieldPart, correction};
use crate::words::part_name::part_name;

use super::force_scale::force_scale;
use super::style;
use super::summary::bounds_in_words;
use super::tables;
use super::weighing::sentences;
use super::{Cloud, Motion, Pictures, Report};
use crate::words::output::{counted, thousands};
use crate::words::readable::{self, figures, interval, significant};

/// The page's own scripts, in the order in which they build on each other.
const SCRIPTS: [&str; 8] = [
    stage::SCRIPT,
    include_str!("motion.js"),
    include_str!("ground.js"),
    include_str!("timeline.js"),
    include_str!("page.js"),
    include_str!("compare.js"),
    include_str!("../../materials/nearest.js"),
    include_str!("correct.js"),
];

/// The file that corrections are saved in, and what they may name.
#[derive(Debug, Clone)]
pub struct CorrectionsFile<'a> {
    pub name: String,
    /// The place of the file in words, such as `in the scene's folder`.
    pub place: String,
    /// The library of the run.
    pub library: &'a MaterialLibrary,
}

/// The page of a report. `motion` is that of the cloud in the simulation.
pub fn page(
    report: &Report,
    answers: &Answers,
    pictures: &Pictures,
    cloud: &Cloud,
    motion: Option<&Motion>,
    corrections: &CorrectionsFile<'_>,
) -> String {
    let data = context! {
        report => Serde(report),
        counts => counts(report),
        scale => scale(report),
        tiles => tiles(report),
        provisional => &report.provisional,
        viewer => Serde(viewer::viewer(report, cloud, motion)),
        cloud => stage::packed(cloud),
        motion => motion.map(|motion| Value::from_safe_string(BASE64.encode(&motion.gzip))),
        cloud_note => cloud_note(cloud),
        motion_note => motion.map(motion_note),
        parts => report.labels.iter().map(|label| part_row(label, report)).collect::<Vec<_>>(),
        library => library(corrections.library),
        corrections => context! { name => &corrections.name, place => &corrections.place },
        is_metric => report.parts.is_some(),
        weighing => report.parts.as_ref().map(|parts| sentences(parts, report.scene.claimed_mass_kg)),
        object => report.parts.as_ref().and_then(|parts| object::object(parts, pictures)),
        grasp => report.grasp.as_ref().map(|report| grasp(report, pictures)),
        simulation => report.simulation.as_ref().map(|run| simulation(run, pictures)),
        views => views::views(pictures, answers),
        csv => csv(report, answers, pictures),
        disagreements => views::disagreements(report, pictures, answers),
        answers => views::sentence(&report.answers),
        style => Value::from_safe_string([stage::STYLE, include_str!("page.css")].concat()),
        script => Value::from_safe_string(SCRIPTS.concat()),
        viewer_code => stage::viewer_code(),
        licences => stage::LICENCES,
    };
    style::engine().render_str(include_str!("page.html.j2"), data).expect("the template is a constant")
}

fn cloud_note(cloud: &Cloud) -> String {
    let (shown, all) = (thousands(cloud.count as u64), thousands(cloud.of as u64));
    if cloud.count == cloud.of {
        format!("All {all} visible Gaussians are shown.")
    } else {
        format!("{shown} of {all} visible Gaussians are shown, evenly thinned and enlarged, to keep this file small.")
    }
}

/// The names and quantities that a correction may have, as the page compares them.
fn library(library: &MaterialLibrary) -> Value {
    let material = |row: &Material| context! { name => &row.name, family => &row.family, aliases => &row.aliases };
    context! {
        materials => library.materials().iter().map(material).collect::<Vec<_>>(),
        fillings => Serde(library.fillings().iter().map(|row| &row.name).collect::<Vec<_>>()),
        spellings => BTreeMap::from(SPELLINGS),
        quantities => Serde(correction::QUANTITIES),
        none => correction::NONE,
        empty => correction::EMPTY,
    }
}

/// A note about what is left out while the object moves; empty if nothing is.
fn motion_note(motion: &Motion) -> String {
    let mut notes = Vec::new();
    let (shown, all) = (motion.tracks.shown.len(), motion.tracks.of);
    if shown < all {
        notes.push(format!(
            "While the object moves, {} of the {} Gaussians that move on their own are shown, enlarged, to keep this file \
             small.",
            thousands(shown as u64),
            thousands(all as u64)
        ));
    }
    let (frames, of_frames) = (motion.times_s.len(), motion.of_frames);
    if frames < of_frames {
        notes.push(format!("The animation uses {frames} of the {of_frames} frames and interpolates between them."));
    }
    notes.join(" ")
}

/// The tables to download, as data URIs.
fn csv(report: &Report, answers: &Answers, pictures: &Pictures) -> Value {
    let uri = |csv: String| data_uri("text/csv", csv.as_bytes());
    context! {
        parts => uri(tables::parts(report)),
        properties => uri(tables::properties(report)),
        grasp => report.grasp.as_ref().map(|grasp| uri(tables::places(&grasp.candidates))),
        simulation => uri(tables::simulation(report)),
        answers => uri(tables::answers(answers, pictures)),
    }
}

fn data_uri(mime: &str, bytes: &[u8]) -> Value {
    Value::from_safe_string(format!("data:{mime};base64,{}", BASE64.encode(bytes)))
}

/// How much was read and found.
fn counts(report: &Report) -> String {
    let counts = [
        counted(report.scene.gaussians, "Gaussian"),
        counted(report.scene.views.len(), "view"),
        counted(report.labels.len(), "part"),
    ];
    counts.join(" · ")
}

fn scale(report: &Report) -> String {
    match &report.scene.scale {
        None => "metric scale unknown".to_owned(),
        Some(scale) => {
            format!("1 scene unit = {} m: {}", significant(scale.meters_per_unit), scale.provenance)
        }
    }
}

fn tiles(report: &Report) -> Vec<Value> {
    let mut tiles = Vec::new();
    let is_estimated = report.parts.as_ref().is_some_and(|parts| parts.estimated_scale.is_some());
    let doubts = [(report.provisional.is_some(), "provisional"), (is_estimated, "estimated scale")];
    let doubts: Vec<&str> = doubts.into_iter().filter_map(|(is_so, words)| is_so.then_some(words)).collect();
    let named =
        |name: &str| if doubts.is_empty() { name.to_owned() } else { format!("{name} ({})", doubts.join(", ")) };
    if let Some(parts) = &report.parts {
        let measured = |name, unit, estimate, factor| {
            let shown = figures(estimate, factor);
            tile(&named(name), format!("{} {unit}", shown.mid), format!("{} {unit}", shown.interval))
        };
        tiles.push(measured("mass", "kg", parts.object.mass_kg, 1.0));
        tiles.push(measured("volume", "cm³", parts.object.volume_m3, 1e6));
    }
    if let Some(grasp) = &report.grasp {
        tiles.push(match &grasp.infeasible {
            None if grasp.candidates.is_empty() => {
                tile(&named("grip"), "no place".to_owned(), "no place was found where the fingers fit".to_owned())
            }
            None => tile(&named("grip with"), format!("{} N", significant(grasp.force_n)), bounds_in_words(grasp)),
            Some(why) => tile(&named("grip"), "not safe".to_owned(), why.explanation.clone()),
        });
    }
    tiles.extend(report.simulation.as_ref().and_then(softened_tile));
    let seen = 100.0 * report.scene.seen_gaussians as f64 / report.scene.gaussians.max(1) as f64;
    tiles.push(tile(
        "Gaussians seen",
        format!("{seen:.0} %"),
        "the rest are assigned to their neighbours' parts".to_owned(),
    ));
    tiles
}

/// The parts that were softened in the simulation, and by how much; `None` if everything has its true stiffness.
fn softened_tile(simulation: &SimulationReport) -> Option<Value> {
    let softened = softened(simulation);
    let most = softened.values().copied().reduce(f64::max)?;
    let each: Vec<String> =
        softened.iter().map(|(material, times)| format!("{material} {}-fold", significant(*times))).collect();
    let note =
        format!("only in the simulation, so the simulated object bends more than the real one: {}", each.join("; "));
    Some(tile("softened", format!("{}-fold", significant(most)), note))
}

/// For each material, the factor by which it was softened in the simulation; the largest one if its parts differ.
fn softened(simulation: &SimulationReport) -> BTreeMap<&str, f64> {
    let mut times: BTreeMap<&str, f64> = BTreeMap::new();
    for row in &simulation.softened {
        let most = times.entry(&row.material).or_insert(1.0 / row.factor);
        *most = most.max(1.0 / row.factor);
    }
    times
}

fn tile(name: &str, value: String, note: String) -> Value {
    context! { name, value, note }
}

fn part_row(label: &FieldPart, report: &Report) -> Value {
    let times = |factor: f64| move |estimate: Estimate| Value::from(Serde(figures(estimate, factor)));
    let part = report.parts.as_ref().and_then(|parts| parts.part(label.id));
    let part = part.as_ref();
    let measured =
        |value: fn(&Part) -> Option<Estimate>, shown: &dyn Fn(Estimate) -> Value| match (part, part.and_then(value)) {
            (_, Some(estimate)) => shown(estimate),
            (Some(part), None) => {
                let why = part.no_volume.map(|why| why.to_string()).unwrap_or_default();
                context! { mid => "none", interval => why }
            }
            (None, None) => context! { mid => "unknown", interval => "" },
        };
    context! {
        id => label.id,
        color => css(palette::part(label.id)),
        caption => &label.caption,
        name => part_name(&label.caption, &label.material),
        mass => part.map_or_else(String::new, |part| match part.mass_kg {
            Some(kg) => readable::mass(kg).mid,
            None => "no mass".to_owned(),
        }),
        material => &label.material,
        family => &label.family,
        corrected => label.corrected.as_ref().map(ToString::to_string),
        answered => answered(label),
        settings => label.corrected.iter().flat_map(|corrected| corrected.to.settings()).collect::<BTreeMap<_, _>>(),
        gaussians => report.gaussians_of(label),
        form => tables::form(label.form),
        numbers => vec![
            measured(|part| part.volume_m3, &times(1e6)),
            measured(|part| part.thickness_m, &times(1e3)),
            times(1.0)(label.density_kg_m3),
            measured(|part| part.mass_kg, &|kg| Value::from(Serde(readable::mass(kg)))),
        ],
        properties => vec![
            interval(label.youngs_modulus_pa, 1e-9),
            interval(label.poisson_ratio, 1.0),
            interval(label.yield_strength_pa, 1e-6),
            interval(label.friction_rubber, 1.0),
        ],
        provenance => MaterialLibrary::builtin().get(&label.material).map(|row| Provenance::of(row).to_string()),
        hardness => label.hardness.map(|hardness| {
            format!("{} Shore {}", interval(hardness.range.into(), 1.0), tables::shore(hardness.scale))
        }),
    }
}

/// What the answers say of a part's form, whatever is corrected: what the page needs to know to judge a correction.
fn answered(label: &FieldPart) -> Value {
    let (form, filling) = match (&label.corrected, &label.inside) {
        (Some(corrected), _) => (corrected.answered.form, corrected.answered.filling.as_deref()),
        (None, Some(Contents::Filled(filled))) => (label.form, Some(&*filled.filling)),
        (None, _) => (label.form, None),
    };
    let form = if matches!(form, Form::Shell { .. }) { "shell" } else { "whole" };
    context! { form, filling => filling.filter(|filling| *filling != "empty") }
}

/// A colour in CSS notation.
pub fn css(color: [f32; 3]) -> String {
    let [r, g, b] = color.map(|channel| (255.0 * channel).round() as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn grasp(grasp: &GraspReport, pictures: &Pictures) -> Value {
    let force = significant(grasp.force_n);
    let sentence = match &grasp.infeasible {
        None if grasp.candidates.is_empty() => {
            "no place was found where the fingers fit; the warnings say why. The forces below are those for this part."
                .to_owned()
        }
        None => format!(
            "press with {force} N per finger (gripper {:?}, command {}). This holds the object without damaging the part.{}",
            grasp.gripper,
            significant(grasp.force_command),
            reason_of_force(grasp),
        ),
        Some(why) => format!("{why}."),
    };
    context! {
        is_safe => grasp.infeasible.is_none() && !grasp.candidates.is_empty(),
        part => part_name(&grasp.part, &grasp.material),
        sentence,
        scale => force_scale(grasp),
        force,
        star => significant(grasp.f_star_n),
        hold => (grasp.f_hold_n > grasp.f_min_n).then(|| significant(grasp.f_hold_n)),
        f_min => significant(grasp.f_min_n),
        f_max => significant(grasp.f_max_n),
        picture => pictures.grasp.as_ref().map(|png| data_uri("image/png", png)),
        places => grasp.candidates.iter().enumerate().map(place_row).collect::<Vec<_>>(),
    }
}

/// How the force to press with follows from the least one that holds.
fn reason_of_force(grasp: &GraspReport) -> String {
    let factor = significant(grasp.safety_factor);
    match (grasp.force_rule, grasp.force_limited_by) {
        (ForceRule::Paper, _) => " It is the paper's F*.".to_owned(),
        (ForceRule::Safety, Limit::Safety) => {
            format!(
                " It is {factor} times the least force that holds the object; the paper's F* is {} N.",
                significant(grasp.f_star_n)
            )
        }
        (ForceRule::Safety, limit) => {
            let bound = if limit == Limit::Gripper { "the gripper's range" } else { "what damages it" };
            format!(
                " It would be {factor} times the least force that holds the object, {} N, but for {bound}; the paper's F* is {} N.",
                significant(grasp.f_hold_n),
                significant(grasp.f_star_n)
            )
        }
    }
}

/// A place to grasp at: forces in N, lengths in mm.
fn place_row((rank, place): (usize, &Candidate)) -> Value {
    context! {
        color => css(palette::place(rank)),
        rank => rank + 1,
        part => part_name(&place.part, &place.material),
        caption => &place.part,
        part_id => place.part_id,
        numbers => vec![
            significant(place.width_m * 1e3),
            format!("{:.0}", 100.0 * place.touched_share),
            significant(place.force_n),
            significant(place.f_min_n),
            significant(place.f_hold_n),
            significant(place.f_max_n),
            significant(place.f_star_n),
        ],
        unsafe => place.infeasible_because.map(Reason::in_words),
    }
}

fn simulation(simulation: &SimulationReport, pictures: &Pictures) -> Value {
    let duration = simulation.frames.last().map_or(0.0, |frame| frame.t_s);
    let softened: Vec<_> = softened(simulation)
        .into_iter()
        .map(|(material, times)| context! { material, factor => significant(times) })
        .collect();
    let is_whole =
        simulation.filled.len() == simulation.rigid.len() && simulation.rigid.iter().all(|part| part.body == 0);
    let moves = match (is_whole, simulation.rigid.len()) {
        (true, _) => " The object moves as one rigid body.".to_owned(),
        (false, 0) => String::new(),
        (false, 1) => " One part moves as a rigid body.".to_owned(),
        (false, parts) => format!(" {parts} parts move as rigid bodies."),
    };
    context! {
        sentence => format!(
            "{} particles, {} steps of up to {} µs, {} s simulated.{moves}",
            thousands(simulation.particles as u64), thousands(simulation.substeps),
            significant(simulation.dt_s * 1e6), significant(duration),
        ),
        caption => format!("{}, {}", script::caption(&simulation.scenario), animation::pace(duration)),
        animation => data_uri("image/gif", &pictures.animation),
        plot => plot::height_and_energy(simulation),
        rigid => simulation.rigid.iter().map(rigid_row).collect::<Vec<_>>(),
        softened,
    }
}

/// A rigid part: how hard it hit the ground, and what it can bear.
fn rigid_row(part: &RigidReport) -> Value {
    let verdict = match (part.dents, part.peak_pressure_pa > 0.0) {
        (true, _) => "the part would dent or break",
        (false, true) => "no damage",
        (false, false) => "never touches the ground",
    };
    context! {
        part => part_name(&part.part, &part.material),
        caption => &part.part,
        material => &part.material,
        pressure => significant(part.peak_pressure_pa / 1e6),
        strength => significant(part.strength_pa / 1e6),
        verdict,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_says_what_was_softened_and_by_how_much() {
        let run = |softened: serde_json::Value| -> SimulationReport {
            serde_json::from_value(serde_json::json!({
                "scenario": "drop", "particles": 1, "fill_particles": 0, "substeps": 1, "dt_s": 1e-5, "mass_kg": 1.0, "filled": [],
                "time_step": { "cfl": 0.4, "stiffest_material": "hickory", "wave_speed_m_s": 170.0 },
                "gravity_m_s2": 9.8, "grid_spacing_m": 0.01, "meters_per_unit": 1.0, "scale_assumed": false,
                "rigid": [], "softened": softened, "poisson_capped": [], "ground_z_m": 0.0, "frames": [],
                "warnings": [],
            }))
            .unwrap()
        };
        let rows = serde_json::json!([
            { "material": "hickory", "factor": 0.00125 },
            { "material": "steel", "factor": 0.001 },
            { "material": "steel", "factor": 0.0001 },
        ]);
        let tile = softened_tile(&run(rows)).unwrap();
        assert_eq!(tile.get_attr("value").unwrap().to_string(), "10,000-fold");
        let note = tile.get_attr("note").unwrap().to_string();
        assert!(note.contains("hickory 800-fold; steel 10,000-fold"), "{note}");
        assert!(softened_tile(&run(serde_json::json!([]))).is_none());
    }
}
