//! The evaluation of masses as a table.

use super::scores_text;
use crate::evaluate::mass::{Balance, Causes, MassEvaluation, Weighed, WeighedPart};
use crate::output::{counted, one_line};

/// The table of masses, the causes of the errors, the scores.
pub fn text(found: &MassEvaluation) -> String {
    let mut text =
        format!("{:<24} {:>10} {:>10} {:>10} {:>10}  covered\n", "object", "low kg", "mid kg", "high kg", "true kg");
    for object in &found.objects {
        let (range, holds) = (object.predicted, if object.covered { "yes" } else { "no" });
        text += &format!(
            "{:<24} {:>10.4} {:>10.4} {:>10.4} {:>10.4}  {holds}\n",
            one_line(&object.id),
            range.low,
            range.mid,
            range.high,
            object.truth
        );
        object.parts.iter().for_each(|part| text += &part_line(part));
    }
    text += &causes_text(&found.objects);
    text += &scores_text(&found.scores, "kg");
    let (coverage, width) = (100.0 * found.coverage, found.median_width);
    text += &format!("\ninterval contains the truth: {coverage:.0} %, median width (high / low) {width:.2}");
    match found.missing.first() {
        Some(first) => {
            text + &format!("\nwithout a mass: {} (first: {})", counted(found.missing.len(), "scene"), one_line(first))
        }
        None => text,
    }
}

/// The causes of the errors, object by object; nothing if no ground truth is detailed enough.
fn causes_text(objects: &[Weighed]) -> String {
    let with_causes = || objects.iter().filter_map(|object| Some((object, object.causes?)));
    if with_causes().next().is_none() {
        return String::new();
    }
    let mut text = format!(
        "\n{:<24} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}  {:>7} {:>7}\n",
        "error in g from", "volume", "wall", "density", "filling", "missing", "in all", "centre", "inertia"
    );
    for (object, causes) in with_causes() {
        let Causes { volume_kg, wall_kg, density_kg, filling_kg, missing_kg } = causes;
        let all = object.predicted.mid - object.truth;
        let name = cut(&object.id, 24);
        text += &format!("{name:<24}");
        for kg in [volume_kg, wall_kg, density_kg, filling_kg, missing_kg, all] {
            text += &format!(" {:>8.1}", 1e3 * kg);
        }
        if let Some(Balance { center_error, inertia_error }) = object.balance {
            text += &format!("  {:>6.1}% {:>6.1}%", 100.0 * center_error, 100.0 * inertia_error);
        }
        text.push('\n');
        for part in object.true_parts.iter().filter(|_| object.true_parts.len() > 1) {
            let name = cut(&part.name, 22);
            let [found, truth] = [part.found_kg, part.true_kg].map(|kg| 1e3 * kg);
            text += &format!("  {name:<22} {found:>8.1} g found, {truth:.1} g true\n");
        }
    }
    text + "\n"
}

fn part_line(part: &WeighedPart) -> String {
    let truth = part.true_mass_kg.map_or_else(|| "-".to_owned(), |mass| format!("{mass:.4}"));
    let name = cut(&part.name, 22);
    let columns = match part.mass_kg {
        Some(mass) => [mass.low, mass.mid, mass.high].map(|kg| format!("{kg:.4}")),
        None => ["none", "none", "none"].map(str::to_owned),
    };
    let [low, mid, high] = columns;
    format!("  {name:<22} {low:>10} {mid:>10} {high:>10} {truth:>10}\n")
}

/// A name on one line, cut to the width of its column.
fn cut(name: &str, width: usize) -> String {
    one_line(name).chars().take(width).collect()
}
