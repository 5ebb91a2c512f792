//! Hand-labelled maps in a folder: one PNG per view, with the view's name, and one file that explains their values.
//!
//! That file is `labels.json`, an object of names by pixel value (`{"0": "oak, white", "1": "fabric"}`), or EISeg's
//! `autosave_label.txt`, with one line per label: its number, its name and optionally a colour. A value without a name
//! is background. Of EISeg's pictures only the grey ones (`VIEW.png`) are read; the coloured ones (`VIEW_pseudo.png`,
//! `VIEW_cutout.png`) are ignored.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::EvaluateError;
use crate::files;
use crate::files::json;
use crate::segment::LabelMap;

const NAMES_JSON: &str = "labels.json";
const NAMES_EISEG: &str = "autosave_label.txt";
/// Name endings of the pictures that EISeg writes beside its label maps.
const OTHER_PICTURES: [&str; 2] = ["_pseudo", "_cutout"];

/// A folder of hand-labelled maps.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelMaps {
    /// Names by pixel value.
    pub names: BTreeMap<u16, String>,
    /// The maps by view name, sorted.
    paths: BTreeMap<String, PathBuf>,
}

impl LabelMaps {
    /// Lists the maps of a folder and reads the meaning of their values.
    pub fn open(folder: &Path) -> Result<Self, EvaluateError> {
        let entries = fs::read_dir(folder).map_err(|source| read_error(folder, source))?;
        let mut paths = BTreeMap::new();
        for entry in entries {
            let path = entry.map_err(|source| read_error(folder, source))?.path();
            let is_png = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
            let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            if is_png && !OTHER_PICTURES.iter().any(|end| stem.ends_with(end)) {
                paths.insert(stem, path);
            }
        }
        if paths.is_empty() {
            return Err(EvaluateError::NoMaps { path: folder.to_owned() });
        }
        Ok(Self { names: names(folder)?, paths })
    }

    /// Names of the views that have a map, sorted.
    pub fn views(&self) -> impl Iterator<Item = &str> {
        self.paths.keys().map(String::as_str)
    }

    /// The map of a view, whose picture has `size` pixels; `None` if the view has no map.
    pub fn of(&self, view: &str, size: (u32, u32)) -> Result<Option<LabelMap>, EvaluateError> {
        let Some(path) = self.paths.get(view) else { return Ok(None) };
        let bytes = files::read(path).map_err(|source| read_error(path, source))?;
        let map = LabelMap::from_png(&bytes)
            .map_err(|source| EvaluateError::Map { path: path.clone(), source: Box::new(source) })?;
        if (map.width, map.height) != size {
            let map = (map.width, map.height);
            return Err(EvaluateError::MapSize { path: path.clone(), map, view: view.to_owned(), picture: size });
        }
        Ok(Some(map))
    }
}

fn names(folder: &Path) -> Result<BTreeMap<u16, String>, EvaluateError> {
    let (json, eiseg) = (folder.join(NAMES_JSON), folder.join(NAMES_EISEG));
    if !json.exists() && eiseg.exists() {
        let text = files::read_to_string(&eiseg).map_err(|source| read_error(&eiseg, source))?;
        return eiseg_names(&eiseg, &text);
    }
    let text = files::read_to_string(&json).map_err(|source| EvaluateError::Read {
        path: json.clone(),
        source,
        remedy: ": it names the values of the maps, as {\"1\": \"wood\"}; EISeg's autosave_label.txt works too",
    })?;
    let expected = "an object of names by pixel value, such as {\"1\": \"wood\"}";
    json::read(text.as_bytes()).map_err(|source| EvaluateError::Json { path: json, expected, source })
}

fn eiseg_names(path: &Path, text: &str) -> Result<BTreeMap<u16, String>, EvaluateError> {
    let mut names = BTreeMap::new();
    for (line, text) in (1..).zip(text.lines()).filter(|(_, text)| !text.trim().is_empty()) {
        let words: Vec<&str> = text.split_whitespace().collect();
        let colored = words.len() >= 5 && words[words.len() - 3..].iter().all(|word| word.parse::<u8>().is_ok());
        let name = words[1..words.len() - if colored { 3 } else { 0 }].join(" ");
        let number = words[0].parse().ok().filter(|_| !name.is_empty()).ok_or_else(|| EvaluateError::Row {
            path: path.to_owned(),
            line,
            message: format!("{text:?} is not a number, a name and a colour"),
        })?;
        names.insert(number, name);
    }
    Ok(names)
}

fn read_error(path: &Path, source: std::io::Error) -> EvaluateError {
    EvaluateError::Read { path: path.to_owned(), source, remedy: "" }
}
