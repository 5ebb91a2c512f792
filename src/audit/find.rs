//! The containers in what the user named.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::AuditError;
use crate::files::read_scope::ReadScope;

/// The most files and folders below a named folder: more than any collection of models has.
const MOST_ENTRIES: usize = 2_000_000;

/// A file or folder that the user named.
#[derive(Debug)]
pub struct Named {
    path: PathBuf,
    /// The folder itself, or the one that holds the file: meshes may be read from it.
    pub folder: PathBuf,
    is_folder: bool,
}

impl Named {
    /// # Errors
    /// If there is nothing.
    pub fn of(path: &Path) -> Result<Self, AuditError> {
        let found = fs::metadata(path).map_err(|_| AuditError::NotThere { path: path.to_owned() })?;
        let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let folder = if found.is_dir() { path } else { parent };
        Ok(Self { path: path.to_owned(), folder: folder.to_owned(), is_folder: found.is_dir() })
    }
}

/// A file to audit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    pub path: PathBuf,
    /// The named folder that it was found in, or that holds it.
    pub below: PathBuf,
    /// Whether the user named the file itself.
    pub is_named: bool,
}

/// The named files, and those in the named folders whose names end as those of containers do; each once, in the order of their
/// paths. Links to folders are not followed, and links to files only within the folders that the user named.
///
/// # Errors
/// If a folder cannot be listed or has too many entries.
pub fn find(named: &[Named], scope: &ReadScope) -> Result<Vec<Found>, AuditError> {
    let mut found = BTreeMap::new();
    for named in named {
        if named.is_folder {
            for path in below(&named.path)? {
                if scope.leads_out(&path).is_none() {
                    let one = Found { path: path.clone(), below: named.path.clone(), is_named: false };
                    found.entry(path).or_insert(one);
                }
            }
        } else {
            let one = Found { path: named.path.clone(), below: named.folder.clone(), is_named: true };
            found.insert(named.path.clone(), one);
        }
    }
    Ok(found.into_values().collect())
}

/// The error if nothing of what was named is a container.
pub fn nothing(named: &[Named]) -> AuditError {
    let paths: Vec<String> = named.iter().map(|named| format!("{:?}", named.path)).collect();
    AuditError::NoContainers { paths: paths.join(", ") }
}

/// The files below a folder that may be containers, by the endings of their names.
fn below(folder: &Path) -> Result<Vec<PathBuf>, AuditError> {
    const ENDINGS: [&str; 5] = ["urdf", "xml", "glb", "gltf", "usda"];
    let mut open = vec![folder.to_owned()];
    let mut found = Vec::new();
    let mut entries = 0;
    while let Some(at) = open.pop() {
        let unlisted = |source| AuditError::Unlisted { path: at.clone(), source };
        for entry in fs::read_dir(&at).map_err(unlisted)? {
            let entry = entry.map_err(unlisted)?;
            entries += 1;
            if entries > MOST_ENTRIES {
                return Err(AuditError::TooMany { path: folder.to_owned(), most: MOST_ENTRIES });
            }
            let path = entry.path();
            let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
            if entry.file_type().map_err(unlisted)?.is_dir() {
                open.push(path);
            } else if ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str())) && path.is_file() {
                found.push(path);
            }
        }
    }
    Ok(found)
}
