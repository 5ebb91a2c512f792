//! The output of `gprop materials list`, `show` and `check`: text for people, values for `--json`.

use std::fmt::Write;

use serde::Serialize;

use super::bibliography::{RULE, Reference, Rule, split_citation};
use super::check::{Finding, Severity, check};
use super::stats::{Provenance, Shares, stats};
use super::{Labels, Law, Material, MaterialLibrary, StrengthKind};
use crate::units::{Range, ShoreHardness};
use crate::words::output::{agreeing, counted};

/// A material found by name, as `show --json` prints it: SI, ranges as `[low, high]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Card {
    pub name: String,
    pub family: String,
    pub aliases: Vec<String>,
    /// How well the requested name matches; 1 is an exact match.
    pub match_score: f64,
    pub density_kg_m3: Range,
    pub youngs_modulus_pa: Range,
    pub poisson_ratio: Range,
    pub strength_pa: Range,
    pub strength_kind: StrengthKind,
    pub friction_rubber: Range,
    pub friction_steel: Range,
    /// That of its family, on a hard surface; `null` if a user's family does not say.
    pub restitution: Option<Range>,
    pub hardness: Option<ShoreHardness>,
    pub law: Law,
    pub labels: Labels,
    /// The properties by the kind of their sources.
    pub provenance: Provenance,
    /// Each property with its sources.
    pub sources: serde_json::Map<String, serde_json::Value>,
}

/// A material in a list, as `list --json` prints it: SI, ranges as `[low, high]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Listed {
    pub name: String,
    pub family: String,
    pub density_kg_m3: Range,
    pub youngs_modulus_pa: Range,
}

/// The card of the material that `name` names or is nearest to; `None` if no name shares a word with it.
pub fn show(library: &MaterialLibrary, name: &str) -> Option<Card> {
    let (material, match_score) = library.nearest(name)?;
    let mut sources = serde_json::Map::new();
    let of_family = library.family(&material.family).map_or(&[][..], |family| &family.restitution_sources);
    for (property, citations) in material.sources.by_property().into_iter().chain([("restitution", of_family)]) {
        sources.insert(property.to_owned(), citations.iter().map(|one| cited(library, one)).collect());
    }
    Some(Card {
        name: material.name.clone(),
        family: material.family.clone(),
        aliases: material.aliases.clone(),
        match_score,
        density_kg_m3: material.density_kg_m3,
        youngs_modulus_pa: material.youngs_modulus_pa,
        poisson_ratio: material.poisson_ratio,
        strength_pa: material.strength_pa,
        strength_kind: material.strength_kind,
        friction_rubber: material.friction_rubber,
        friction_steel: material.friction_steel,
        restitution: material.restitution,
        hardness: material.hardness,
        law: material.law,
        labels: material.labels.clone(),
        provenance: Provenance::of(material),
        sources,
    })
}

fn cited(library: &MaterialLibrary, citation: &str) -> serde_json::Value {
    let (id, entry) = split_citation(citation);
    if let Some(rule) = rule_of(library, citation) {
        return serde_json::json!({ "id": citation, "title": rule.statement, "references": rule.references });
    }
    let reference = library.references().iter().find(|reference| reference.id == id);
    let title = entry.and_then(|entry| entry_title(library, id, entry));
    serde_json::json!({
        "id": id,
        "entry": title.or(entry),
        "title": reference.map(|reference| &reference.title),
        "locator": reference.map(|reference| &reference.locator),
        "licence": reference.map(|reference| &reference.licence),
    })
}

/// The rule that a citation names, if it names one.
fn rule_of<'a>(library: &'a MaterialLibrary, citation: &str) -> Option<&'a Rule> {
    match split_citation(citation) {
        (RULE, Some(id)) => library.rule(id),
        _ => None,
    }
}

fn entry_title<'a>(library: &'a MaterialLibrary, id: &str, entry: &str) -> Option<&'a str> {
    let found = library.evidence.iter().find(|evidence| evidence.source == id && evidence.entry == entry);
    found.map(|evidence| evidence.title.as_str())
}

/// The card as text: the description, the numbers in everyday units, their sources.
pub fn show_text(library: &MaterialLibrary, name: &str) -> Option<String> {
    let (material, score) = library.nearest(name)?;
    let mut text = String::new();
    let mut line = |label: &str, value: String| {
        let _ = writeln!(text, "  {label:<18} {value}");
    };
    line("family", material.family.clone());
    if !material.aliases.is_empty() {
        line("also called", material.aliases.join(", "));
    }
    if score < 1.0 {
        line("match", format!("nearest name to {name:?}, score {score:.2}"));
    }
    line("density", span(material.density_kg_m3, "kg/m3"));
    line("Young's modulus", stress(material.youngs_modulus_pa));
    line("Poisson's ratio", span(material.poisson_ratio, ""));
    line("strength", format!("{} ({})", stress(material.strength_pa), material.strength_kind));
    line("friction on rubber", span(material.friction_rubber, ""));
    line("friction on steel", span(material.friction_steel, ""));
    if let Some(restitution) = material.restitution {
        line("restitution", format!("{} (of its family)", span(restitution, "")));
    }
    line(
        "hardness",
        material.hardness.map_or("none".to_owned(), |one| span(one.range, &format!("Shore {:?}", one.scale))),
    );
    line("simulated as", law_text(&material.law));
    line("labels", labels_text(&material.labels));
    Some(format!("{}\n{text}{}", material.name, sources_text(library, material)))
}

/// The materials of one family or of all; `None` if there is no such family.
pub fn list(library: &MaterialLibrary, family: Option<&str>) -> Option<Vec<Listed>> {
    let family = match family {
        Some(name) => Some(library.family(name)?),
        None => None,
    };
    let chosen = |material: &&Material| family.is_none_or(|family| family.name == material.family);
    let listed = |material: &Material| Listed {
        name: material.name.clone(),
        family: material.family.clone(),
        density_kg_m3: material.density_kg_m3,
        youngs_modulus_pa: material.youngs_modulus_pa,
    };
    Some(library.materials().iter().filter(chosen).map(listed).collect())
}

/// The materials of a list as a table.
pub fn list_text(listed: &[Listed]) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "{:<38} {:<20} {:>14} {:>16}", "name", "family", "density kg/m3", "Young's modulus");
    for Listed { name, family, density_kg_m3, youngs_modulus_pa } in listed {
        let (density, youngs) = (span(*density_kg_m3, ""), stress(*youngs_modulus_pa));
        let _ = writeln!(text, "{name:<38} {family:<20} {density:>14} {youngs:>16}");
    }
    text
}

/// The output of `check`, and true if the library can be released.
pub fn check_text(library: &MaterialLibrary, with_stats: bool) -> (String, bool) {
    let findings = check(library);
    let mut text = String::new();
    for finding in findings.iter().filter(|finding| finding.excuse.is_none()) {
        let _ = writeln!(text, "{}", finding_text(finding));
    }
    let errors = findings.iter().filter(|finding| finding.fails()).count();
    let warnings = findings.iter().filter(|one| one.severity == Severity::Warning && one.excuse.is_none()).count();
    let excused = findings.iter().filter(|finding| finding.excuse.is_some()).count();
    let families = library.families().len();
    if with_stats {
        text.push_str(&stats_text(&stats(library)));
    }
    let _ = writeln!(
        text,
        "{} of {families} {}: {}, {}, {} with a reason",
        counted(library.materials().len(), "material"),
        agreeing(families, "family", "families"),
        counted(errors, "error"),
        counted(warnings, "warning"),
        counted(excused, "deviation"),
    );
    (text, errors == 0)
}

fn finding_text(finding: &Finding) -> String {
    let severity = match finding.severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
    };
    format!("{severity}: {}: {} ({})", finding.subject, finding.message, finding.check)
}

/// The share of each property that is cited, in percent.
fn stats_text(shares: &[Shares]) -> String {
    let mut text = String::from("cited, %                  n");
    for (property, _) in shares.first().map(|one| one.cited.as_slice()).unwrap_or_default() {
        let _ = write!(text, " {property:>15}");
    }
    text.push('\n');
    let mut line = |of: &str, materials: usize, shares: &[(&'static str, f64)]| {
        let _ = write!(text, "{of:<22} {materials:>4}");
        for (_, share) in shares {
            let _ = write!(text, " {:>15.0}", 100.0 * share);
        }
        text.push('\n');
    };
    for one in shares {
        line(&one.of, one.materials, &one.cited);
    }
    if let Some(all) = shares.last() {
        line("of these by a rule", all.materials, &all.by_rule);
    }
    text.push_str("The rest is engineering judgement or, in tables of your own, numbers without a source.\n");
    text
}

fn span(range: Range, unit: &str) -> String {
    let space = if unit.is_empty() { "" } else { " " };
    if range.low == range.high {
        return format!("{}{space}{unit}", range.low);
    }
    format!("{} to {}{space}{unit}", range.low, range.high)
}

/// A stress in the unit that suits its upper end best.
fn stress(range: Range) -> String {
    let (unit, size) = match range.high {
        high if high >= 1e9 => ("GPa", 1e9),
        high if high >= 1e6 => ("MPa", 1e6),
        high if high >= 1e3 => ("kPa", 1e3),
        _ => ("Pa", 1.0),
    };
    let rounded = |value: f64| (value / size * 1e4).round() / 1e4;
    span(Range::new(rounded(range.low), rounded(range.high)), unit)
}

/// The law's name, then its parameters.
fn law_text(law: &Law) -> String {
    let written = serde_json::to_value(law).unwrap_or_default();
    let parts = written.as_object().into_iter().flatten().map(|(name, value)| match value.as_f64() {
        Some(number) => format!("{name} {}", plain(number)),
        None => value.as_str().unwrap_or_default().to_owned(),
    });
    parts.collect::<Vec<_>>().join(", ")
}

/// A number in usual notation: with powers of ten from ten thousand on.
fn plain(value: f64) -> String {
    if value.abs() >= 1e4 { format!("{value:e}") } else { value.to_string() }
}

fn labels_text(labels: &Labels) -> String {
    let exactly = |exact| if exact { "" } else { " (nearest)" };
    format!(
        "abo: {}{}, mvimgnet: {}{}",
        labels.abo.name,
        exactly(labels.abo.exact),
        labels.mvimgnet.name,
        exactly(labels.mvimgnet.exact)
    )
}

fn sources_text(library: &MaterialLibrary, material: &Material) -> String {
    let mut text = format!("sources\n  {}\n", Provenance::of(material));
    let mut named: Vec<&str> = Vec::new();
    let mut rules: Vec<&Rule> = Vec::new();
    for (property, citations) in material.sources.by_property() {
        if citations.is_empty() {
            continue;
        }
        let mut ids: Vec<&str> = Vec::new();
        for citation in citations {
            let rule = rule_of(library, citation);
            let id = if rule.is_some() { citation } else { split_citation(citation).0 };
            if !ids.contains(&id) {
                ids.push(id);
            }
            if let Some(rule) = rule {
                named.extend(rule.references.iter().map(String::as_str));
                if !rules.contains(&rule) {
                    rules.push(rule);
                }
            }
        }
        let _ = writeln!(text, "  {property:<18} {}", ids.join(", "));
        named.extend(ids);
    }
    for rule in rules {
        let _ = writeln!(text, "  [{RULE}:{}] {} ({})", rule.id, rule.statement, rule.references.join(", "));
    }
    for reference in library.references().iter().filter(|reference| named.contains(&reference.id.as_str())) {
        let Reference { id, title, publisher, year, locator, licence } = reference;
        let said = [title, publisher, year, locator, licence].into_iter().filter(|part| !part.is_empty());
        let _ = writeln!(text, "  [{id}] {}", said.map(String::as_str).collect::<Vec<_>>().join("; "));
    }
    text
}
