//! Names of views: short, unique, and safe as file names; and paths that stay within the scene.

use std::collections::HashSet;
use std::path::{Component, Path, PathBuf};

/// A name for each of `files`: the file name without extension; with the folders above it in front where two files would
/// get the same; with a number behind where even these agree.
pub(super) fn of(files: &[&str]) -> Vec<String> {
    let short: Vec<String> = files.iter().map(|file| safe(stem(file))).collect();
    let distinct: HashSet<String> = short.iter().map(|name| name.to_lowercase()).collect();
    let names = match distinct.len() == short.len() {
        true => short,
        false => files.iter().map(|file| safe(without_extension(file))).collect(),
    };
    let mut taken = HashSet::new();
    names.into_iter().map(|name| numbered(name, &mut taken)).collect()
}

/// `relative` below `folder`; `None` where it leads out of it.
pub(super) fn path_within(folder: &Path, relative: &str) -> Option<PathBuf> {
    let mut path = PathBuf::new();
    for component in Path::new(relative).components() {
        match component {
            Component::Normal(part) => path.push(part),
            Component::CurDir => {}
            Component::ParentDir => {
                if !path.pop() {
                    return None;
                }
            }
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(folder.join(path))
}

fn without_extension(file: &str) -> &str {
    let file = file.trim_start_matches("./");
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
    /// Leaves room for what stages append within the 255 bytes of common file systems.
    const LONGEST: usize = 120;
    let keep = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let name: String = name.chars().map(keep).take(LONGEST).collect();
    match name.trim_matches('.') {
        "" => "view".to_owned(),
        trimmed => trimmed.to_owned(),
    }
}

/// `name`, or `name_2`, `name_3` ... where it is taken; case does not tell names apart on every file system.
fn numbered(name: String, taken: &mut HashSet<String>) -> String {
    let candidates = std::iter::once(name.clone()).chain((2..).map(|n| format!("{name}_{n}")));
    let free = candidates.into_iter().find(|candidate| !taken.contains(&candidate.to_lowercase()));
    let free = free.expect("there is always a next number");
    taken.insert(free.to_lowercase());
    free
}
