//! The vote's own loss: the ground truth's part maps in place of SAM, an answer of its own for each part in place of the
//! model's, and the outcome rendered into held-out views.

use gprop::evaluate::segmentation::IouTally;
use gprop::materials::MaterialLibrary;
use gprop::progress::Progress;
use gprop::query::{Answer, Answers, Form, Match, Outcome, PartAnswer};
use gprop::segment::LabelMap;
use gprop::vote::raster::{RenderOptions, render_labels};
use gprop::vote::{MaterialField, Options, Rule, ViewInput, vote};

use super::scenes::{self, Measured};

/// The answer "`name` is made of the library's row number `row`".
fn answer(name: &str, row: usize) -> Answer {
    let material = &MaterialLibrary::builtin().materials()[row];
    Answer {
        caption: name.to_owned(),
        family: material.family.clone(),
        material: material.name.clone(),
        density_kg_m3: material.density_kg_m3,
        youngs_modulus_pa: material.youngs_modulus_pa,
        poisson_ratio: material.poisson_ratio,
        yield_strength_pa: material.strength_pa,
        hardness: material.hardness,
        friction_rubber: material.friction_rubber,
        form: Form::Solid,
        confidence: 1.0,
        matched: Match::Exact,
        flags: Vec::new(),
    }
}

/// The true answers to the true maps.
pub fn true_answers(measured: &Measured, maps: &[(gprop::scene::View, LabelMap)]) -> Answers {
    let mut parts = Vec::new();
    for (view, map) in maps {
        for (row, name) in measured.part_names().iter().enumerate() {
            let part = row as u16 + 1;
            if map.labels.contains(&part) {
                let outcome = Outcome::Answered(answer(name, row));
                parts.push(PartAnswer { view: view.name.clone(), part, outcome });
            }
        }
    }
    Answers { parts }
}

/// IoU over the held-out views by part name.
pub fn measure(measured: &Measured, field: &MaterialField) -> IouTally<u32> {
    let names = measured.part_names();
    let name_of = |label: u32| names.iter().position(|name| *name == field.labels[label as usize].caption);
    let labels: Vec<u32> = field.part_label.iter().map(|&label| name_of(label).unwrap() as u32).collect();
    let mut tally = IouTally::default();
    for view in &measured.held_out {
        let predicted = render_labels(&measured.scene.gaussians, &view.camera, &labels, &RenderOptions::default());
        let truth = view.parts.pixels().map(|p| (p.0[0] != 255).then_some(u32::from(p.0[0])));
        tally.add(truth.zip(predicted));
    }
    tally
}

#[test]
fn true_parts_come_back_in_views_that_did_not_vote() {
    for rule in [Rule::Frequency, Rule::Contribution] {
        for measured in scenes::all() {
            let maps = measured.true_maps();
            let answers = true_answers(&measured, &maps);
            let views: Vec<_> =
                maps.iter().map(|(view, map)| ViewInput { name: &view.name, camera: &view.camera, map }).collect();
            let options = Options { vote: rule, ..Default::default() };
            let library = MaterialLibrary::builtin();
            let start = std::time::Instant::now();
            let field = vote(&measured.scene.gaussians, &views, &answers, library, &options, Progress::Hidden).unwrap();
            let seconds = start.elapsed().as_secs_f64();
            let tally = measure(&measured, &field);
            let unseen = field.views.iter().filter(|views| **views == 0).count();
            println!(
                "{rule:?} {}: {:.4} {:?} {} labels, {unseen} unseen of {}, {seconds:.2} s {:?}",
                measured.scene.name,
                tally.mean().unwrap(),
                tally.per_label().values().map(|v| (v * 1e4).round() / 1e4).collect::<Vec<_>>(),
                field.labels.len(),
                field.views.len(),
                field.warnings
            );
        }
    }
}
