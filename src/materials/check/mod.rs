//! The checks that keep the library plausible: of each row, of its physics, and of the library as a whole.
//!
//! [`check`] runs them in this order: [`rows`] (ranges, family bounds, friction, hardness, sources, with [`rules`] for
//! those that are rules for a class), [`physics`] (moduli, strength, wave speeds, hardness against stiffness, law
//! parameters), [`structure`] (foams, composites and fabrics against their constituents), [`fillings`] (names,
//! densities, sources), [`whole`] (duplicates, copied rows, class defaults, labels), [`mod@reference`]
//! (against textbook values from which no row was made).
//!
//! A finding that needs no correction is listed in `deviations.csv` with its reason; a deviation that matches no
//! finding is itself a finding, so that the list stays current, unless a user's tables may have replaced what it is about.

mod fillings;
mod physics;
mod reference;
mod rows;
mod rules;
mod structure;
mod whole;

use serde::Serialize;

use super::MaterialLibrary;

pub use physics::{gent_modulus_pa, qi_modulus_pa};

/// The result of a check.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// The name of a material, the id of a rule, `family:NAME`, `filling:NAME`, or `library`.
    pub subject: String,
    /// The check's name, as `deviations.csv` spells it.
    pub check: &'static str,
    pub severity: Severity,
    pub message: String,
    /// The reason why it needs no correction, if `deviations.csv` has one.
    pub excuse: Option<String>,
}

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// The library must not be released with it.
    Error,
    /// Should be looked at.
    Warning,
}

impl Finding {
    /// True if it fails the check: an error without an excuse.
    pub fn fails(&self) -> bool {
        self.severity == Severity::Error && self.excuse.is_none()
    }
}

/// Runs every check. The library can be released if no finding [fails](Finding::fails).
pub fn check(library: &MaterialLibrary) -> Vec<Finding> {
    let mut findings = Findings::default();
    rows::check(library, &mut findings);
    physics::check(library, &mut findings);
    structure::check(library, &mut findings);
    fillings::check(library, &mut findings);
    whole::check(library, &mut findings);
    reference::check(library, &mut findings);
    excuse(library, findings.0)
}

/// The findings that the checks collect.
#[derive(Default)]
struct Findings(Vec<Finding>);

impl Findings {
    fn error(&mut self, subject: &str, check: &'static str, message: String) {
        self.push(subject, check, Severity::Error, message);
    }

    fn warn(&mut self, subject: &str, check: &'static str, message: String) {
        self.push(subject, check, Severity::Warning, message);
    }

    /// Adds an error unless `holds`.
    fn require(&mut self, holds: bool, subject: &str, check: &'static str, message: impl FnOnce() -> String) {
        if !holds {
            self.error(subject, check, message());
        }
    }

    fn push(&mut self, subject: &str, check: &'static str, severity: Severity, message: String) {
        self.0.push(Finding { subject: subject.to_owned(), check, severity, message, excuse: None });
    }
}

fn excuse(library: &MaterialLibrary, mut findings: Vec<Finding>) -> Vec<Finding> {
    for deviation in &library.deviations {
        let mut stale = true;
        for finding in &mut findings {
            if finding.subject == deviation.subject && finding.check == deviation.check {
                finding.excuse = Some(deviation.reason.clone());
                stale = false;
            }
        }
        if (stale && !deviation.is_inherited) || deviation.reason.is_empty() {
            findings.push(Finding {
                subject: deviation.subject.clone(),
                check: "stale_deviation",
                severity: Severity::Error,
                message: format!(
                    "deviations.csv excuses `{}`, but that check finds nothing here, or the reason is missing",
                    deviation.check
                ),
                excuse: None,
            });
        }
    }
    findings
}
