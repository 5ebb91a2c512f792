//! Checks the fillings: names, densities, and the sources of the densities.

use super::Findings;
use super::rows::CITED_TOLERANCE;
use crate::materials::MaterialLibrary;
use crate::materials::bibliography::{UNCITED, split_citation};
use crate::materials::fillings::Filling;

/// Largest high/low of a density: contents packed loosely or tightly, and machines that are mostly air.
const WIDEST: f64 = 10.0;

pub fn check(library: &MaterialLibrary, findings: &mut Findings) {
    for filling in library.fillings() {
        let subject = format!("filling:{}", filling.name);
        findings.require(!filling.name.contains(';'), &subject, "name", || {
            "its name holds a semicolon, which separates names in the prompt".to_owned()
        });
        let width = filling.density_kg_m3.high / filling.density_kg_m3.low;
        findings.require(width <= WIDEST, &subject, "width", || {
            format!("its density spans a factor of {width:.1}; at most {WIDEST} is allowed")
        });
        sources(library, filling, &subject, findings);
    }
}

fn sources(library: &MaterialLibrary, filling: &Filling, subject: &str, findings: &mut Findings) {
    let cited = filling.density_sources.iter().filter(|citation| !UNCITED.contains(&citation.as_str()));
    for citation in cited {
        let (source, entry) = split_citation(citation);
        let evidence =
            library.evidence.iter().find(|known| known.source == source && Some(known.entry.as_str()) == entry);
        let Some(theirs) = evidence.and_then(|known| known.value("density")) else {
            findings.error(subject, "source", format!("evidence.csv has no density for `{citation}`"));
            continue;
        };
        let (ours, tolerance) = (filling.density_kg_m3, CITED_TOLERANCE[0]);
        let meets = theirs.high * tolerance >= ours.low && theirs.low <= ours.high * tolerance;
        findings.require(meets, subject, "source", || {
            format!("{} to {} kg/m3 misses {citation}, {} to {}", ours.low, ours.high, theirs.low, theirs.high)
        });
    }
    let is_uncited = filling.density_sources.iter().all(|citation| UNCITED.contains(&citation.as_str()));
    findings.require(!is_uncited || !filling.basis.is_empty(), subject, "source", || {
        "its density is not cited, and `basis` does not say where it comes from".to_owned()
    });
}
