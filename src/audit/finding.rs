//! A finding: what is wrong, where, and what to do.

use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

/// The kinds of findings, by the names that `--ignore` takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A value or element that readers of the format would refuse
    Invalid,
    /// A mesh that is missing, lies outside of the named folders, or cannot be read
    Mesh,
    /// No mass, or a mass of zero
    MassMissing,
    /// A mass that no material or filling of that size has
    Density,
    /// A mass without an inertia
    InertiaMissing,
    /// An inertia that no mass within the shape can have
    InertiaImpossible,
    /// An inertia that was never filled in: equal round values
    InertiaPlaceholder,
    /// An inertia off the shape's own by more than a factor of 3
    InertiaOff,
    /// A centre of mass outside of the shape
    Center,
    /// No friction
    FrictionMissing,
    /// A friction that no pair of materials has
    FrictionRange,
    /// Colliders that differ from what is seen
    Collider,
    /// A size that looks like millimetres read as metres, or the like
    Units,
    /// A mesh that is open, turned inside out, or has edges of more than two triangles
    Surface,
}

/// One thing that is wrong.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    pub kind: Kind,
    /// The file in which it is written.
    #[serde(serialize_with = "as_text")]
    pub file: PathBuf,
    /// Counted from 1.
    pub line: usize,
    /// What is wrong.
    pub problem: String,
    /// What to do.
    pub remedy: String,
}

impl Finding {
    /// The problem and its remedy in one line.
    pub fn text(&self) -> String {
        format!("{}; {}", self.problem, self.remedy)
    }
}

/// Paths in JSON are text.
pub(super) fn as_text<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}
