//! The pictures below a folder, by names that a person takes for the same: with another extension, in other letters (case, or
//! the other Unicode form of an accent), or in another folder.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use unicode_normalization::UnicodeNormalization;

use crate::workdir::Artifact;

/// How many folders deep pictures are looked for: cameras of a rig, left and right.
const DEEPEST: usize = 3;
/// The largest number of files that are listed, so that a listing ends whatever it is given: more than any capture has.
const MOST_FILES: usize = 300_000;

/// Endings of the pictures that can be decoded.
const DECODED: [&str; 7] = ["png", "jpg", "jpeg", "webp", "tif", "tiff", "bmp"];
/// Endings of pictures from which photos that can be decoded are usually converted.
const CONVERTED: [&str; 14] =
    ["heic", "heif", "avif", "dng", "arw", "cr2", "cr3", "nef", "raf", "orf", "rw2", "exr", "tga", "gif"];
/// Folders of truth to compare results with. Its pictures are often called like the photos.
const TRUTH: &str = "ground_truth";
/// Marks of a mask's name, after or before that of its photo.
const MASK_SUFFIXES: [&str; 4] = ["_mask", "-mask", ".mask", "_masks"];
const MASK_PREFIXES: [&str; 2] = ["mask_", "mask-"];

/// The pictures below a folder, with `/` between folders.
#[derive(Debug, Default)]
pub(super) struct Listing {
    /// Sorted.
    files: Vec<String>,
    /// Indices of the files by the [`key`] of their path, and of their name.
    by_path: HashMap<String, Vec<usize>>,
    by_name: HashMap<String, Vec<usize>>,
    /// By the name up to its first dot, if that is not the end of the name's key.
    by_beginning: HashMap<String, Vec<usize>>,
    /// By the [`key_of_masked`] photo.
    by_masked: HashMap<String, Vec<usize>>,
    /// The same of the file's name alone.
    by_masked_name: HashMap<String, Vec<usize>>,
}

impl Listing {
    /// Lists `folder` without following links to folders. Left out are hidden files and folders, folders of masks or of truth,
    /// and gprop's own results.
    pub fn of(folder: &Path) -> Self {
        let mut files = Vec::new();
        let mut open = vec![(folder.to_owned(), String::new(), 0)];
        while let Some((at, prefix, depth)) = open.pop() {
            for entry in fs::read_dir(at).into_iter().flatten().flatten() {
                let (Ok(kind), Ok(name)) = (entry.file_type(), entry.file_name().into_string()) else { continue };
                if name.starts_with('.') || files.len() >= MOST_FILES {
                    continue;
                }
                let path = format!("{prefix}{name}");
                if kind.is_dir() {
                    let is_other = name == TRUTH || is_mask_folder(&name) || is_work_folder(&entry.path());
                    if depth < DEEPEST && !is_other {
                        open.push((entry.path(), format!("{path}/"), depth + 1));
                    }
                } else if is_picture(&name) {
                    files.push(path);
                }
            }
        }
        files.sort();
        let mut listing = Self::default();
        for (index, file) in files.iter().enumerate() {
            let name = name_of(file);
            let key_of_name = key(name);
            let beginning = key_of_name.split('.').next().unwrap_or_default().to_owned();
            if beginning != key_of_name {
                listing.by_beginning.entry(beginning).or_default().push(index);
            }
            listing.by_name.entry(key_of_name).or_default().push(index);
            listing.by_path.entry(key(file)).or_default().push(index);
            listing.by_masked.entry(key_of_masked(file)).or_default().push(index);
            listing.by_masked_name.entry(key_of_masked(name)).or_default().push(index);
        }
        listing.files = files;
        listing
    }

    /// The pictures, sorted.
    pub fn files(&self) -> &[String] {
        &self.files
    }

    /// The pictures in the folder itself.
    pub fn direct(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(String::as_str).filter(|file| !file.contains('/'))
    }

    /// The pictures with this path, apart from extension, case and Unicode form.
    pub fn alike(&self, path: &str) -> Vec<&str> {
        self.at(&self.by_path, &key(path))
    }

    /// The pictures with the name at the end of this path, in whatever folder.
    pub fn with_name(&self, path: &str) -> Vec<&str> {
        self.at(&self.by_name, &key(name_of(path)))
    }

    /// The pictures whose name begins with the one at the end of this path, followed by a dot: older versions of 3DGS cut a
    /// name off at its first dot.
    pub fn beginning_with(&self, path: &str) -> Vec<&str> {
        self.at(&self.by_beginning, &key(name_of(path)))
    }

    /// The masks of the photo with this path.
    pub fn masks_of(&self, photo: &str) -> Vec<&str> {
        self.at(&self.by_masked, &key(photo))
    }

    /// The masks of the photo with the name at the end of this path, in whatever folder.
    pub fn masks_with_name(&self, photo: &str) -> Vec<&str> {
        self.at(&self.by_masked_name, &key(name_of(photo)))
    }

    fn at(&self, map: &HashMap<String, Vec<usize>>, key: &str) -> Vec<&str> {
        map.get(key).into_iter().flatten().map(|index| self.files[*index].as_str()).collect()
    }
}

/// What two paths have in common if a person takes them for the same picture.
pub(super) fn key(path: &str) -> String {
    without_ending(path).nfc().collect::<String>().to_lowercase()
}

/// The [`key`] of the photo to which a mask with this path belongs: `000.png`, `000.jpg.png`, `000_mask.png` and
/// `mask_000.png` are masks of `000.jpg`.
pub(super) fn key_of_masked(path: &str) -> String {
    let key = key(path);
    let (folder, name) = key.rsplit_once('/').map_or(("", &*key), |(folder, name)| (folder, name));
    let name = MASK_SUFFIXES.iter().find_map(|mark| name.strip_suffix(mark)).unwrap_or(name);
    let name = MASK_PREFIXES.iter().find_map(|mark| name.strip_prefix(mark)).unwrap_or(name);
    let name = without_ending(name);
    if folder.is_empty() { name.to_owned() } else { format!("{folder}/{name}") }
}

/// Whether a folder's name says that it holds masks.
pub(super) fn is_mask_folder(name: &str) -> bool {
    ["mask", "masks"].iter().any(|known| name.eq_ignore_ascii_case(known))
}

/// Whether the name's ending is that of a picture, decodable or not.
pub(super) fn has_ending(path: &str) -> bool {
    without_ending(path) != path
}

/// The endings of photos whose names come without one, in every case in which they are usual.
pub(super) fn usual_endings() -> impl Iterator<Item = String> {
    DECODED.into_iter().flat_map(|ending| [ending.to_owned(), ending.to_uppercase()])
}

fn is_picture(name: &str) -> bool {
    ending(name).is_some_and(|ending| DECODED.iter().any(|known| ending.eq_ignore_ascii_case(known)))
}

fn without_ending(path: &str) -> &str {
    let known = |ending: &&str| DECODED.iter().chain(&CONVERTED).any(|known| ending.eq_ignore_ascii_case(known));
    ending(path).filter(known).map_or(path, |ending| &path[..path.len() - ending.len() - 1])
}

/// What follows the last dot of a name.
fn ending(path: &str) -> Option<&str> {
    name_of(path).rsplit_once('.').filter(|(stem, _)| !stem.is_empty()).map(|(_, ending)| ending)
}

pub(super) fn name_of(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or_default()
}

fn is_work_folder(path: &Path) -> bool {
    // A capture that shows several objects has its runs in folders below.
    [Artifact::Run, Artifact::Objects].iter().any(|of_runs| path.join(of_runs.path()).is_file())
}

/// Listings, each made once.
#[derive(Debug, Default)]
pub(super) struct Listings(HashMap<PathBuf, Listing>);

impl Listings {
    /// The pictures below `folder`.
    pub fn of(&mut self, folder: &Path) -> &Listing {
        self.0.entry(folder.to_owned()).or_insert_with(|| Listing::of(folder))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_a_person_takes_for_the_same() {
        for (one, other) in
            [("000.jpg", "000.PNG"), ("A b.JPEG", "a B.tif"), ("caf\u{e9}.jpg", "cafe\u{301}.png"), ("x.heic", "x.jpg")]
        {
            assert_eq!(key(one), key(other), "{one} {other}");
        }
        for (one, other) in [("000.jpg", "0000.jpg"), ("a/000.jpg", "b/000.jpg"), ("000.v2.png", "000.v3.png")] {
            assert_ne!(key(one), key(other), "{one} {other}");
        }
    }

    #[test]
    fn pictures_of_the_truth_are_no_photos() {
        let folder = tempfile::tempdir().unwrap();
        for file in ["images/000.png", "ground_truth/part_maps/000.png"] {
            fs::create_dir_all(folder.path().join(file).parent().unwrap()).unwrap();
            fs::write(folder.path().join(file), "").unwrap();
        }
        assert_eq!(Listing::of(folder.path()).files(), ["images/000.png"]);
    }

    #[test]
    fn masks_belong_to_photos() {
        for mask in
            ["000.png", "000.PNG", "000.jpg.png", "000_mask.png", "000.mask.png", "mask_000.jpg", "000.jpg_mask.png"]
        {
            assert_eq!(key_of_masked(mask), key("000.jpg"), "{mask}");
        }
        assert_eq!(key_of_masked("cam0/000_mask.png"), key("cam0/000.jpg"));
        assert_ne!(key_of_masked("000_depth.png"), key("000.jpg"));
    }
}
