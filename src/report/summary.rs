//! The summary on the terminal at the end of a run.

use std::fmt::Write;
use std::path::Path;

use super::Report;
use super::numbers::{interval, short, significant, thousands};
use crate::output::one_line;

/// A few lines: the parts, the object, the grasp, the path of the report.
pub fn summary(report: &Report, report_page: &Path) -> String {
    let scene = &report.scene;
    let mut text = format!(
        "{}: {} Gaussians, {} views, {} parts\n",
        one_line(&scene.name),
        thousands(scene.gaussians as u64),
        scene.views.len(),
        report.labels.len()
    );
    let name_width = report.labels.iter().map(|label| one_line(&label.material).chars().count()).max().unwrap_or(0);
    for label in &report.labels {
        let part = report.parts.as_ref().and_then(|parts| parts.parts.iter().find(|part| part.id == label.id));
        let mass = part.map_or_else(String::new, |part| match part.mass_kg {
            Some(mass) => format!("{:>7} g ({})  ", significant(mass.mid * 1e3), interval(mass, 1e3)),
            None => "no mass  ".to_owned(),
        });
        let _ = writeln!(
            text,
            "  {:>2}  {:name_width$}  {mass}{}",
            label.id,
            one_line(&label.material),
            one_line(short(&label.caption))
        );
    }
    if let Some(parts) = &report.parts {
        let mass = parts.object.mass_kg;
        let _ = writeln!(text, "mass   {} kg ({})", significant(mass.mid), interval(mass, 1.0));
    }
    if let Some(grasp) = &report.grasp {
        let part = one_line(short(&grasp.part));
        let _ = match &grasp.infeasible {
            None => writeln!(
                text,
                "grasp  {} N at the {part}: slips below {} N, is damaged above {} N",
                significant(grasp.f_star_n),
                significant(grasp.f_min_n),
                significant(grasp.f_max_n),
            ),
            Some(why) => writeln!(text, "grasp  no safe grip at the {part}: {}", one_line(&why.explanation)),
        };
    }
    if !report.warnings.is_empty() {
        let _ = writeln!(text, "{} warnings, listed in the report", report.warnings.len());
    }
    let _ = write!(text, "report {}", one_line(&report_page.to_string_lossy()));
    text
}
