//! Finds the mask of a photo, in this order:
//! 1. the one that the photo's frame names, unless `--masks` names a folder;
//! 2. the one with the photo's name in `--masks`, else in a folder `masks` or `mask` in the photos' folder, or beside it if that
//!    is in the scene;
//! 3. the same under a name that a person would take for that of the photo's mask;
//! 4. beside the photo, under its name with a mark: `000_mask.png`, `000.jpg.png`.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::listing::{Listings, is_mask_folder, key, key_of_masked, name_of};
use super::look_up::Place;
use super::view_names;
use crate::files;
use crate::scene::SceneError;
use crate::scene::cameras::Places;
use crate::scene::cameras::frame::Frame;
use crate::scene::splat::find::names_in;

/// The search for the masks of one scene.
pub(super) struct MaskFiles<'a> {
    camera_file: &'a Path,
    places: &'a Places<'a>,
    listings: &'a mut Listings,
    /// The folders of masks, by the folder of the photo.
    folders: HashMap<PathBuf, Vec<PathBuf>>,
}

impl<'a> MaskFiles<'a> {
    pub fn new(camera_file: &'a Path, places: &'a Places<'a>, listings: &'a mut Listings) -> Self {
        Self { camera_file, places, listings, folders: HashMap::new() }
    }

    /// The mask of a frame's photo.
    pub fn of(&mut self, frame: &Frame, place: &Place) -> Result<Option<PathBuf>, SceneError> {
        if self.places.masks.is_none()
            && let Some(mask) = named_mask(frame, &place.folder, self.places)
        {
            self.places.check_mask(&mask, Some(self.camera_file))?;
            return Ok(Some(mask));
        }
        let folders = self.folders_for(place);
        let exact = exact_names(&place.file);
        let exact = folders.iter().flat_map(|folder| exact.iter().map(|name| folder.join(name)));
        let mask = match exact.into_iter().find(|path| files::is_there(path)) {
            Some(mask) => Some(mask),
            None => match self.alike(&folders, &place.file)? {
                Some(mask) => Some(mask),
                None if self.places.masks.is_none() => self.beside(place)?,
                None => None,
            },
        };
        mask.iter().try_for_each(|mask| self.places.check_mask(mask, None))?;
        Ok(mask)
    }

    /// The folders in which masks were looked for, that are there.
    pub fn searched(&self) -> Vec<PathBuf> {
        let mut folders: Vec<PathBuf> = self.folders.values().flatten().cloned().collect();
        folders.sort();
        folders.dedup();
        folders
    }

    fn folders_for(&mut self, place: &Place) -> Vec<PathBuf> {
        let places = self.places;
        let photos = place.folder.as_path();
        let photo = place.path();
        let nearest = photo.parent().unwrap_or(photos);
        let of_masks = |folder: &Path| -> Vec<PathBuf> {
            let known = ["masks", "mask"].map(|name| folder.join(name)).into_iter().filter(|path| path.is_dir());
            let mut found: Vec<PathBuf> = known.collect();
            if places.may_list(folder) {
                let named = names_in(folder).into_iter().filter(|name| is_mask_folder(name));
                found.extend(named.map(|name| folder.join(name)).filter(|path| path.is_dir()));
            }
            found
        };
        let found = || -> Vec<PathBuf> {
            if let Some(masks) = places.masks {
                return vec![masks.to_owned()];
            }
            // The parent of a relative path of one name is the current folder.
            let parent =
                photos.parent().map(|parent| if parent.as_os_str().is_empty() { Path::new(".") } else { parent });
            let beside = parent.filter(|parent| places.scope.leads_out(parent).is_none());
            let mut folders: Vec<PathBuf> = Vec::new();
            for folder in [Some(photos), beside, Some(nearest)].into_iter().flatten().flat_map(of_masks) {
                if !folders.contains(&folder) {
                    folders.push(folder);
                }
            }
            folders
        };
        self.folders.entry(nearest.to_owned()).or_insert_with(found).clone()
    }

    /// The mask whose path ends as the photo's does, the longest end first; else the one with its name in any folder.
    fn alike(&mut self, folders: &[PathBuf], photo: &str) -> Result<Option<PathBuf>, SceneError> {
        for folder in folders.iter().filter(|folder| self.places.may_list(folder)) {
            let listing = self.listings.of(folder);
            let ends = std::iter::successors(Some(photo), |end| end.split_once('/').map(|(_, rest)| rest));
            let by_path = ends.map(|end| listing.masks_of(end)).find(|found| !found.is_empty());
            let found = by_path.unwrap_or_else(|| listing.masks_with_name(photo));
            let found: Vec<PathBuf> = found.into_iter().map(|file| folder.join(file)).collect();
            if let Some(mask) = self.only_one(found, photo)? {
                return Ok(Some(mask));
            }
        }
        Ok(None)
    }

    /// The mask in the photo's own folder.
    fn beside(&mut self, place: &Place) -> Result<Option<PathBuf>, SceneError> {
        let photo = place.path();
        let folder = photo.parent().unwrap_or(&place.folder);
        if !self.places.may_list(folder) {
            return Ok(None);
        }
        let name = name_of(&place.file);
        let marked = |file: &&str| !file.contains('/') && key_of_masked(file) == key(name) && key(file) != key(name);
        let found = self.listings.of(folder).masks_of(name).into_iter().filter(marked);
        let found: Vec<PathBuf> = found.map(|file| folder.join(file)).collect();
        self.only_one(found, &place.file)
    }

    fn only_one(&self, mut found: Vec<PathBuf>, photo: &str) -> Result<Option<PathBuf>, SceneError> {
        if found.len() > 1 {
            let (path, file) = (self.camera_file.to_owned(), photo.to_owned());
            return Err(SceneError::Several { path, what: "photo", file, found, flag: "--masks" });
        }
        Ok(found.pop())
    }
}

/// The names that most programs give to a mask, best first; COLMAP appends .png to the photo's whole name. The folder at the
/// start of the photo's path may be left out.
fn exact_names(photo: &str) -> Vec<String> {
    let below = photo.split_once('/').map_or(photo, |(_, rest)| rest);
    let names = [photo, below].into_iter().flat_map(|file| {
        let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
        [format!("{stem}.png"), format!("{file}.png"), format!("{stem}.jpg"), file.to_owned()]
    });
    names.collect()
}

/// The mask that a frame names, wherever that is, if it exists. `folder` is that of the photo.
pub(super) fn named_mask(frame: &Frame, folder: &Path, places: &Places) -> Option<PathBuf> {
    let mask = frame.mask.as_deref()?;
    let candidates = match view_names::path_within(folder, mask) {
        Some(within) => vec![folder.join(within)],
        // A path that climbs does so from the folder of the camera file or from that of the photo.
        None => vec![places.beside_camera_file(mask), folder.join(mask.replace('\\', "/"))],
    };
    candidates.into_iter().find(|path| files::is_there(path))
}
