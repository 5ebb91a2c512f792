//! The report: one line for each finding, or JSON.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::PathBuf;

use serde::Serialize;

use super::finding::as_text;
use super::judge::{Judged, JudgedBody};
use super::{AuditError, Finding};
use crate::scene::mesh::containers::{Body, Container, ContainerError};
use crate::words::output::{counted, one_line};

/// What an audit found. As JSON it has the keys that DESIGN.md lists for `audit --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// In the order of their paths.
    pub files: Vec<FileReport>,
}

/// A file that was audited.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FileReport {
    #[serde(serialize_with = "as_text")]
    pub path: PathBuf,
    /// `URDF`, `MJCF`, `USD` or `glTF`; `None` if the file cannot be read.
    pub format: Option<&'static str>,
    /// Why the file cannot be read.
    pub error: Option<String>,
    /// What is wrong and belongs to no link.
    pub problems: Vec<String>,
    pub findings: Vec<Finding>,
    pub links: Vec<LinkReport>,
    /// Meshes that were not measured, because gprop does not read their formats.
    pub unread_meshes: BTreeSet<String>,
    /// What `--fix` changed.
    pub fixed: Vec<String>,
}

/// A link of a URDF or a body of an MJCF.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LinkReport {
    pub name: String,
    /// Counted from 1.
    pub line: usize,
    /// As stated or as MuJoCo computes it; `None` if nothing says it.
    pub mass_kg: Option<f64>,
    /// Of what is seen, or of the colliders if that encloses nothing; `None` if neither does.
    pub volume_m3: Option<f64>,
    pub density_kg_m3: Option<f64>,
    /// What is wrong, each with its remedy.
    pub problems: Vec<String>,
    /// The same with kind and place.
    pub findings: Vec<Finding>,
}

fn texts(findings: &[Finding]) -> Vec<String> {
    findings.iter().map(Finding::text).collect()
}

impl FileReport {
    pub(super) fn of(path: PathBuf, container: &Container, judged: Judged, fixed: Vec<String>) -> Self {
        let links = container.bodies.iter().zip(judged.bodies).map(|(body, judged)| LinkReport::of(body, judged));
        Self {
            path,
            format: Some(container.format.name()),
            error: None,
            problems: texts(&judged.findings),
            findings: judged.findings,
            links: links.collect(),
            unread_meshes: judged.unread,
            fixed,
        }
    }

    pub(super) fn unreadable(path: PathBuf, error: &ContainerError) -> Self {
        Self {
            path,
            format: None,
            error: Some(error.to_string()),
            problems: Vec::new(),
            findings: Vec::new(),
            links: Vec::new(),
            unread_meshes: BTreeSet::new(),
            fixed: Vec::new(),
        }
    }

    fn findings(&self) -> impl Iterator<Item = (&str, &Finding)> {
        let of_links =
            self.links.iter().flat_map(|link| link.findings.iter().map(|finding| (link.name.as_str(), finding)));
        self.findings.iter().map(|finding| ("", finding)).chain(of_links)
    }
}

impl LinkReport {
    fn of(body: &Body, judged: JudgedBody) -> Self {
        let mass_kg = judged.mass.kg();
        let volume_m3 = judged.size.best().and_then(|shapes| shapes.volume_m3).map(|[_, mid, _]| mid);
        let density = mass_kg.zip(volume_m3).map(|(mass, volume)| mass / volume);
        Self {
            name: body.name.clone(),
            line: body.place.line,
            mass_kg,
            volume_m3,
            density_kg_m3: density.filter(|density| density.is_finite()),
            problems: texts(&judged.findings),
            findings: judged.findings,
        }
    }
}

impl Report {
    /// One line for each finding: file, line, link, what is wrong, what to do. Then what was fixed and what was not measured.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for file in &self.files {
            if let Some(error) = &file.error {
                let _ = writeln!(text, "{}", one_line(error));
            }
            for (link, finding) in file.findings() {
                let link = if link.is_empty() { String::new() } else { format!("{link}: ") };
                let line = format!("{}:{}: {link}{}", finding.file.display(), finding.line, finding.text());
                let _ = writeln!(text, "{}", one_line(&line));
            }
            for fixed in &file.fixed {
                let _ = writeln!(text, "{}", one_line(&format!("fixed {}: {fixed}", file.path.display())));
            }
        }
        let unread: BTreeSet<&String> = self.files.iter().flat_map(|file| &file.unread_meshes).collect();
        if !unread.is_empty() {
            let meshes = counted(unread.len(), "mesh").replace("meshs", "meshes");
            let _ = writeln!(
                text,
                "{meshes} not measured, in formats that gprop does not read (convert to GLB, OBJ, STL or PLY)"
            );
        }
        let links = self.files.iter().map(|file| file.links.len()).sum();
        let problems = self.problems();
        let _ = writeln!(
            text,
            "{} in {}: {}",
            counted(links, "link"),
            counted(self.files.len(), "file"),
            if problems == 0 { "nothing wrong".to_owned() } else { counted(problems, "problem") }
        );
        text
    }

    /// How many findings there are.
    pub fn problems(&self) -> usize {
        self.files.iter().map(|file| file.findings().count()).sum()
    }

    /// # Errors
    /// If a file cannot be read, or else if anything is wrong.
    pub fn require_sound(&self) -> Result<(), AuditError> {
        let unreadable = self.files.iter().filter(|file| file.error.is_some()).count();
        let wrong = self.files.iter().filter(|file| file.findings().next().is_some()).count();
        match () {
            () if unreadable > 0 => Err(AuditError::Unreadable { files: counted(unreadable, "file") }),
            () if wrong > 0 => {
                let problems = counted(self.problems(), "problem");
                Err(AuditError::Wrong { problems, files: counted(wrong, "file") })
            }
            () => Ok(()),
        }
    }
}
