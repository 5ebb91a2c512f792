//! The tables of the page as CSV: SI units and all digits, one row per line, for spreadsheets and scripts.

use std::fmt::Display;

use super::{Pictures, Report};
use crate::grasp::candidates::Candidate;
use crate::query::{Answers, Form, Outcome};
use crate::units::{Estimate, ShoreScale};
use crate::vote::FieldPart;
use crate::words::part_name::part_name;
use crate::words::table;

/// A column: its heading, and the cell of each row.
struct Column<'a, T> {
    heading: String,
    cell: Box<dyn Fn(&T) -> String + 'a>,
}

/// The columns of a table of `T`.
struct Columns<'a, T>(Vec<Column<'a, T>>);

impl<'a, T> Columns<'a, T> {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn number<N: Display>(self, heading: impl Into<String>, value: impl Fn(&T) -> Option<N> + 'a) -> Self {
        self.push(heading, move |row| value(row).map_or_else(String::new, |number| number.to_string()))
    }

    fn text(self, heading: &str, value: impl Fn(&T) -> String + 'a) -> Self {
        self.push(heading, move |row| table::text_cell(&value(row)))
    }

    /// Three columns: low, mid, high.
    fn estimate(self, heading: &str, value: impl Fn(&T) -> Option<Estimate> + Copy + 'a) -> Self {
        self.number(format!("{heading}_low"), move |row| value(row).map(|estimate| estimate.low))
            .number(format!("{heading}_mid"), move |row| value(row).map(|estimate| estimate.mid))
            .number(format!("{heading}_high"), move |row| value(row).map(|estimate| estimate.high))
    }

    fn push(mut self, heading: impl Into<String>, cell: impl Fn(&T) -> String + 'a) -> Self {
        self.0.push(Column { heading: heading.into(), cell: Box::new(cell) });
        self
    }

    fn csv<'r>(&self, rows: impl IntoIterator<Item = &'r T>) -> String
    where
        T: 'r,
    {
        let headings = table::row(self.0.iter().map(|column| column.heading.clone()));
        let rows = rows.into_iter().map(|row| table::row(self.0.iter().map(|column| (column.cell)(row))));
        headings + &rows.collect::<String>()
    }
}

/// The parts with their size and mass.
pub(super) fn parts(report: &Report) -> String {
    let measured = |part: &FieldPart| report.parts.as_ref().and_then(|all| all.part(part.id));
    named()
        .text("family", |part| part.family.clone())
        .text("form", |part| form(part.form).to_owned())
        .number("gaussians", |part| report.gaussians_of(part))
        .estimate("volume_m3", |part| measured(part)?.volume_m3)
        .estimate("thickness_m", |part| measured(part)?.thickness_m)
        .estimate("density_kg_m3", |part| Some(part.density_kg_m3))
        .estimate("mass_kg", |part| measured(part)?.mass_kg)
        .csv(&report.labels)
}

/// The properties of each part's material.
pub(super) fn properties(report: &Report) -> String {
    named()
        .estimate("youngs_modulus_pa", |part| Some(part.youngs_modulus_pa))
        .estimate("poisson_ratio", |part| Some(part.poisson_ratio))
        .estimate("strength_pa", |part| Some(part.yield_strength_pa))
        .estimate("friction_rubber", |part| Some(part.friction_rubber))
        .text("hardness_scale", |part| {
            part.hardness.map_or_else(String::new, |hardness| shore(hardness.scale).to_owned())
        })
        .estimate("hardness", |part| part.hardness.map(|hardness| hardness.range.into()))
        .csv(&report.labels)
}

/// The places to grasp at, best first.
pub(super) fn places(places: &[Candidate]) -> String {
    let contact = |columns: Columns<'static, Candidate>, finger: usize| {
        ["x", "y", "z"].into_iter().enumerate().fold(columns, |columns, (axis, name)| {
            columns.number(format!("contact{}_{name}_m", finger + 1), move |place| Some(place.contacts_m[finger][axis]))
        })
    };
    let columns = Columns::new()
        .number("part", |place: &Candidate| Some(place.part_id))
        .text("name", |place| part_name(&place.part, &place.material))
        .number("width_m", |place| Some(place.width_m))
        .estimate("thickness_m", |place| Some(place.thickness_m))
        .number("touched_share", |place| Some(place.touched_share))
        .number("bend_rad", |place| Some(place.bend_rad))
        .number("lever_m", |place| Some(place.lever_m))
        .number("offset_m", |place| Some(place.offset_m))
        .number("force_n", |place| Some(place.force_n))
        .number("f_hold_n", |place| Some(place.f_hold_n))
        .number("f_min_n", |place| Some(place.f_min_n))
        .number("f_star_n", |place| Some(place.f_star_n))
        .number("f_max_n", |place| Some(place.f_max_n))
        .number("torque_margin_n_m", |place| Some(place.torque_margin_n_m))
        .number("feasible", |place| Some(place.feasible));
    contact(contact(columns, 0), 1).csv(places)
}

/// The object's motion, frame by frame.
pub(super) fn simulation(report: &Report) -> String {
    let frames = report.simulation.iter().flat_map(|simulation| &simulation.frames);
    Columns::new()
        .number("t_s", |frame: &crate::simulate::checkpoint::FrameSummary| Some(frame.t_s))
        .number("center_of_mass_x_m", |frame| Some(frame.center_of_mass_m[0]))
        .number("center_of_mass_y_m", |frame| Some(frame.center_of_mass_m[1]))
        .number("center_of_mass_z_m", |frame| Some(frame.center_of_mass_m[2]))
        .number("kinetic_energy_j", |frame| Some(frame.kinetic_energy_j))
        .number("elastic_energy_j", |frame| Some(frame.elastic_energy_j))
        .csv(frames)
}

/// Every answer. `segment` is the number in `answers.jsonl` and in the names of the sheets, `part` that of the other tables.
pub(super) fn answers(answers: &Answers, pictures: &Pictures) -> String {
    let said = |outcome: &Outcome, part: fn(&crate::query::Answer) -> String| match outcome {
        Outcome::Answered(answer) => part(answer),
        Outcome::Failed(_) => String::new(),
    };
    Columns::new()
        .text("view", |row: &crate::query::SubjectAnswer| row.view.clone())
        .number("segment", |row| Some(row.subject.number()))
        .number("part", |row| pictures.part_of(&row.view, row.subject.number()))
        .text("caption", move |row| said(&row.outcome, |answer| answer.caption.clone()))
        .text("material", move |row| said(&row.outcome, |answer| answer.material.clone()))
        .number("confidence", |row| match &row.outcome {
            Outcome::Answered(answer) => Some(answer.confidence),
            Outcome::Failed(_) => None,
        })
        .text("failure", |row| match &row.outcome {
            Outcome::Answered(_) => String::new(),
            Outcome::Failed(failure) => failure.to_string(),
        })
        .csv(&answers.all)
}

/// The columns that say which part a row is about.
fn named<'a>() -> Columns<'a, FieldPart> {
    Columns::new()
        .number("part", |part: &FieldPart| Some(part.id))
        .text("name", |part| part_name(&part.caption, &part.material))
        .text("caption", |part| part.caption.clone())
        .text("material", |part| part.material.clone())
}

/// A form in one word.
pub(super) fn form(form: Form) -> &'static str {
    match form {
        Form::Shell { .. } => "shell",
        Form::Solid => "solid",
        Form::Mixed => "mixed",
    }
}

/// The letter of a Shore scale.
pub(super) fn shore(scale: ShoreScale) -> &'static str {
    match scale {
        ShoreScale::A => "A",
        ShoreScale::D => "D",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_caption_is_one_cell_and_no_formula() {
        let columns = Columns::new()
            .text("caption", |text: &&str| (*text).to_owned())
            .estimate("mass_kg", |text| (text.len() > 3).then_some(Estimate::new(0.1, 0.2, 0.3)));
        let csv = columns.csv(&["=1+1", "a \"b\", c", "lid"]);
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(
            lines,
            [
                "caption,mass_kg_low,mass_kg_mid,mass_kg_high",
                "\"'=1+1\",0.1,0.2,0.3",
                "\"a \"\"b\"\", c\",0.1,0.2,0.3",
                "\"lid\",,,"
            ]
        );
    }
}
