//! Names of views: short, unique, and safe as file names; and paths that stay within the scene.

use std::collections::{HashMap, HashSet};
use std::path::{Component, Path, PathBuf};

use crate::scene::{SceneError, View};

/// A name for each of `files`: the file name without extension, preceded by the folders above it if two files would get
/// the same name, and followed by a number if even these are the same.
pub(in crate::scene) fn of(files: &[String]) -> Vec<String> {
    let short: Vec<String> = files.iter().map(|file| safe(stem(file))).collect();
    let distinct: HashSet<String> = short.iter().map(|name| name.to_lowercase()).collect();
    let names = if distinct.len() == short.len() {
        short
    } else {
        files.iter().map(|file| safe(without_extension(file))).collect()
    };
    let mut taken = Taken::default();
    names.into_iter().map(|name| taken.numbered(name)).collect()
}

/// The index of the view with this name, or else of the only one whose photo's file has this name, without extension.
pub fn index_of(views: &[View], name: &str) -> Result<usize, SceneError> {
    let named = views.iter().position(|view| view.name == name);
    let is_its_file = |view: &View| view.image.file_stem().is_some_and(|stem| stem == name);
    let mut of_file = (0..views.len()).filter(|&index| is_its_file(&views[index]));
    let only = of_file.next().filter(|_| of_file.next().is_none());
    named.or(only).ok_or_else(|| {
        let known = views.iter().map(|view| view.name.clone()).collect();
        SceneError::UnknownView { name: name.to_owned(), known }
    })
}

/// Whether a path is absolute on any system: `/data`, `C:\data`, `\\server\data`.
pub(in crate::scene) fn is_absolute(file: &str) -> bool {
    let has_drive = matches!(file.as_bytes(), [drive, b':', b'/' | b'\\', ..] if drive.is_ascii_alphabetic());
    has_drive || file.starts_with(['/', '\\'])
}

/// The path of `file` relative to `folder`; `file` is relative to it or absolute, with the separators of any system.
/// `None` if it leads out of the folder.
pub(in crate::scene) fn path_within(folder: &Path, file: &str) -> Option<String> {
    let file = file.replace('\\', "/");
    let absolute_folder = folder.canonicalize().unwrap_or_default();
    let path = Path::new(&file);
    let relative = if is_absolute(&file) { path.strip_prefix(absolute_folder).ok()? } else { path };
    let mut parts = Vec::new();
    for component in relative.components() {
        match component {
            Component::Normal(part) => parts.push(part.to_str()?),
            Component::CurDir => {}
            Component::ParentDir => drop(parts.pop()?),
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(parts.join("/"))
}

/// The path with every `..` resolved, whether or not the path exists.
pub(in crate::scene) fn without_climbing(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for component in std::path::absolute(path).unwrap_or_else(|_| path.to_owned()).components() {
        match component {
            Component::ParentDir => drop(plain.pop()),
            other => plain.push(other),
        }
    }
    plain
}

fn without_extension(file: &str) -> &str {
    match file.rsplit_once('.') {
        Some((stem, extension)) if !stem.is_empty() && !extension.contains('/') => stem,
        _ => file,
    }
}

fn stem(file: &str) -> &str {
    without_extension(file).rsplit('/').next().unwrap_or_default()
}

/// Letters, digits, `-`, `_` and inner dots are kept; the rest becomes `_`.
fn safe(name: &str) -> String {
    /// Leaves room for the suffixes that stages append, within the 255 bytes that common file systems allow.
    const LONGEST: usize = 120;
    let keep = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let name: String = name.chars().map(keep).take(LONGEST).collect();
    match name.trim_matches('.') {
        "" => "view".to_owned(),
        trimmed => trimmed.to_owned(),
    }
}

/// The names that have been given. Case is ignored, since not every file system distinguishes it.
#[derive(Default)]
struct Taken {
    names: HashSet<String>,
    /// For each name that clashed, the number to try next: all before it are taken.
    next: HashMap<String, usize>,
    /// How many names were tried.
    tried: usize,
}

impl Taken {
    /// `name`, or `name_2`, `name_3` ... if it is taken.
    fn numbered(&mut self, name: String) -> String {
        let lower = name.to_lowercase();
        self.tried += 1;
        if self.names.insert(lower.clone()) {
            return name;
        }
        let next = self.next.entry(lower.clone()).or_insert(2);
        loop {
            let number = *next;
            *next += 1;
            self.tried += 1;
            if self.names.insert(format!("{lower}_{number}")) {
                return format!("{name}_{number}");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_clash_are_numbered_without_trying_all_numbers_again() {
        let tried = |count: usize| {
            let mut taken = Taken::default();
            // Names that are all alike, in two spellings, and names that look like theirs with a number.
            let names = (0..count).map(|n| match n % 3 {
                0 => "____".to_owned(),
                1 => "View".to_owned(),
                _ => format!("view_{}", n / 3 + 2),
            });
            let given: HashSet<String> = names.map(|name| taken.numbered(name).to_lowercase()).collect();
            assert_eq!(given.len(), count);
            taken.tried
        };
        assert!(tried(10_000) <= 12 * tried(1000));
        let same = of(&["木.png", "山.png", "images/木.png", "Images/木.png"].map(str::to_owned));
        assert_eq!(same, ["_", "__2", "images__", "Images___2"]);
    }
}
