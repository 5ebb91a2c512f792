//! Narrows the choice of materials to those that an evaluation tells apart.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::config::option_values::missing;
use crate::files;
use crate::materials::{Material, MaterialLibrary, fold};

/// Which materials a model may choose among.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LabelSet {
    /// Those that map to a label of ABO's evaluation.
    Abo,
    /// Those that map to a label of MVImgNet's evaluation.
    Mvimgnet,
    /// Those that a text file names, one per line: a material, a family, or a label of the evaluations. Blank lines and
    /// lines that begin with `#` are skipped.
    File(PathBuf),
}

/// A file of labels that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LabelsError {
    #[error("cannot read the labels in {path:?}: {source}; --labels takes abo, mvimgnet or a text file")]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error("{path:?} line {line}: {label:?} is not a material, family or label of an evaluation{hint}")]
    Unknown { path: PathBuf, line: usize, label: String, hint: String },
    #[error("{path:?} names no label; write one per line")]
    Empty { path: PathBuf },
}

impl LabelSet {
    /// True if `text` names the labels of an evaluation; otherwise it is taken for the path of a file.
    pub fn is_name(text: &str) -> bool {
        matches!(text, "abo" | "mvimgnet")
    }

    /// Parses the value of `--labels`.
    ///
    /// # Errors
    /// If it is neither a set of labels nor an existing file.
    pub fn parse(text: &str) -> Result<Self, String> {
        match text {
            "abo" => Ok(Self::Abo),
            "mvimgnet" => Ok(Self::Mvimgnet),
            path => match missing(Path::new(path), "file", |path| !path.is_dir()) {
                None => Ok(Self::File(path.into())),
                Some(problem) => Err(format!("{problem}; give abo, mvimgnet or a text file")),
            },
        }
    }

    /// The materials of `library` that a model may choose among.
    pub fn restrict(&self, library: &MaterialLibrary) -> Result<MaterialLibrary, LabelsError> {
        match self {
            Self::Abo => Ok(library.restricted_to(|material| material.labels.abo.exact)),
            Self::Mvimgnet => Ok(library.restricted_to(|material| material.labels.mvimgnet.exact)),
            Self::File(path) => {
                let text = files::read_to_string(path)
                    .map_err(|source| LabelsError::Unreadable { path: path.clone(), source })?;
                let meanings = (1..)
                    .zip(text.lines().map(str::trim))
                    .filter(|(_, label)| !label.is_empty() && !label.starts_with('#'))
                    .map(|(line, label)| {
                        Meaning::of(label, library).ok_or_else(|| LabelsError::Unknown {
                            path: path.clone(),
                            line,
                            label: label.into(),
                            hint: hint(label, library),
                        })
                    })
                    .collect::<Result<Vec<_>, _>>()?;
                if meanings.is_empty() {
                    return Err(LabelsError::Empty { path: path.clone() });
                }
                Ok(library.restricted_to(|material| meanings.iter().any(|meaning| meaning.includes(material))))
            }
        }
    }
}

/// The meaning of a line of a label file.
enum Meaning<'a> {
    Family(&'a str),
    Material(&'a str),
    /// As [`fold`] returns it.
    Label(String),
}

impl<'a> Meaning<'a> {
    fn of(label: &str, library: &'a MaterialLibrary) -> Option<Self> {
        if let Some(family) = library.family(label) {
            return Some(Self::Family(&family.name));
        }
        if let Some(material) = library.get(label) {
            return Some(Self::Material(&material.name));
        }
        let meaning = Self::Label(fold(label));
        library.materials().iter().any(|material| meaning.includes(material)).then_some(meaning)
    }

    fn includes(&self, material: &Material) -> bool {
        match self {
            Self::Family(family) => material.family == *family,
            Self::Material(name) => material.name == *name,
            Self::Label(label) => [&material.labels.abo, &material.labels.mvimgnet]
                .iter()
                .any(|known| known.exact && fold(&known.name) == *label),
        }
    }
}

fn hint(label: &str, library: &MaterialLibrary) -> String {
    library
        .nearest(label)
        .map_or(String::new(), |(material, _)| format!("; the nearest material is {:?}", material.name))
}
