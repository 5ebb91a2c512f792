//! Finds the photos that a camera file names.
//!
//! 1. Exactly where the file says, in any of the places.
//! 2. There under another extension, in other letters, or without the folders at the start of the path: it may be a path of
//!    another machine, or `images_2` may stand where `images` was.
//! 3. By its name alone, in the folders below those that are meant for photos; if none of the photos was found until then,
//!    also in other folders of the scene.
//! 4. In the same folders, by the name up to its first dot, which is all that older versions of 3DGS keep.
//!
//! A single candidate is taken. Several are an error that lists them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::listing::{Listing, Listings, has_ending, usual_endings};
use super::view_names;
use crate::files;
use crate::scene::SceneError;
use crate::scene::cameras::Places;
use crate::scene::cameras::frame::{Frame, FrameProblem};

/// The photo of a frame.
#[derive(Debug, Clone)]
pub(super) struct Place {
    /// Index of the frame.
    pub frame: usize,
    pub folder: PathBuf,
    /// The path within the folder.
    pub file: String,
    /// Whether it is where the camera file says, under the name that it says.
    pub is_exact: bool,
}

impl Place {
    pub fn path(&self) -> PathBuf {
        self.folder.join(&self.file)
    }
}

/// The photos that are there, in the order of the frames, and the frames for which there is none.
pub(super) struct Found {
    pub places: Vec<Place>,
    pub missing: Vec<usize>,
    /// Frames whose only candidate may just as well be the photo of another frame.
    pub shared: Vec<usize>,
}

/// Looks for the photo of every frame.
pub(super) fn look_up(
    camera_file: &Path,
    frames: &[Frame],
    places: &Places,
    listings: &mut Listings,
) -> Result<Found, SceneError> {
    let listed = places.photos.iter().filter(|folder| places.may_list(folder)).cloned().collect();
    let mut search = Search { places, listings, listed };
    let mut found: Vec<Option<Place>> = Vec::with_capacity(frames.len());
    for (frame, named) in frames.iter().enumerate() {
        let place =
            search.near_its_place(&named.file).map_err(|problem| problem.in_frame(frame, named, camera_file))?;
        found.push(place.map(|place| Place { frame, ..place }));
    }
    let none_yet = found.iter().all(Option::is_none);
    for (frame, place) in found.iter_mut().enumerate().filter(|(_, place)| place.is_none()) {
        let named = &frames[frame];
        let by_name = search.by_name(&named.file, none_yet);
        let by_name = by_name.map_err(|problem| problem.in_frame(frame, named, camera_file))?;
        *place = by_name.map(|place| Place { frame, ..place });
    }
    Ok(without_shared(frames, found))
}

/// Sets aside what was found for several names, unless it has exactly that name.
fn without_shared(frames: &[Frame], found: Vec<Option<Place>>) -> Found {
    let mut named: BTreeMap<PathBuf, BTreeSet<&str>> = BTreeMap::new();
    for place in found.iter().flatten() {
        named.entry(place.path()).or_default().insert(&frames[place.frame].file);
    }
    let missing = (0..found.len()).filter(|frame| found[*frame].is_none()).collect();
    let is_its_own = |place: &Place| place.is_exact || named[&place.path()].len() == 1;
    let (places, shared): (Vec<Place>, Vec<Place>) = found.into_iter().flatten().partition(is_its_own);
    Found { places, missing, shared: shared.into_iter().map(|place| place.frame).collect() }
}

/// Why a search ends without an answer.
enum Problem {
    /// The name leads out of every folder.
    Outside {
        leads_to: PathBuf,
    },
    Several {
        found: Vec<PathBuf>,
    },
}

impl Problem {
    fn in_frame(self, index: usize, frame: &Frame, camera_file: &Path) -> SceneError {
        let (path, file) = (camera_file.to_owned(), frame.file.clone());
        match self {
            Self::Outside { leads_to } => {
                SceneError::Frame { path, frame: index, file, problem: FrameProblem::OutsideScene { leads_to } }
            }
            Self::Several { found } => SceneError::Several { path, what: "photo", file, found, flag: "--images" },
        }
    }
}

struct Search<'a> {
    places: &'a Places<'a>,
    listings: &'a mut Listings,
    /// The places that may be listed.
    listed: Vec<PathBuf>,
}

impl Search<'_> {
    /// The photo called `file` at its place or, under nearly the same name, near it.
    fn near_its_place(&mut self, file: &str) -> Result<Option<Place>, Problem> {
        if let Some(place) = self.exact(file, true) {
            return Ok(Some(place));
        }
        let is_within =
            |file: &str| self.places.photos.iter().any(|folder| view_names::path_within(folder, file).is_some());
        // If the user names the photos' folder, the folders in a frame's path need not exist there. An absolute path that is
        // right on the machine where the cameras were calibrated leads out of every folder here.
        if self.places.photos_are_named || view_names::is_absolute(file) || is_within(file) {
            return self.alike(file);
        }
        // From the folder of the camera file, a name may climb and still lead to one of the folders.
        let leads_to = self.places.beside_camera_file(file);
        let climbed = leads_to.to_string_lossy().into_owned();
        if !is_within(&climbed) {
            return Err(Problem::Outside { leads_to });
        }
        match self.exact(&climbed, true) {
            Some(place) => Ok(Some(place)),
            None => self.alike(&climbed),
        }
    }

    /// The photo with exactly this path in one of the places. One that is to be refused, because its folder lies outside of
    /// what may be read, is found without its extension too.
    fn exact(&self, file: &str, is_exact: bool) -> Option<Place> {
        self.places.photos.iter().find_map(|folder| {
            let file = view_names::path_within(folder, file).filter(|file| !file.is_empty())?;
            let endings = usual_endings().map(|ending| format!("{file}.{ending}"));
            let endings = endings.take(if self.listed.contains(folder) { 0 } else { usize::MAX });
            let names = std::iter::once(file.clone()).chain(endings);
            let there = names.into_iter().find(|name| files::is_there(&folder.join(name)))?;
            Some(Place { frame: 0, folder: folder.clone(), file: there, is_exact })
        })
    }

    /// The photo whose path ends as `file` does, the longest end first, apart from extension, case and Unicode form.
    fn alike(&mut self, file: &str) -> Result<Option<Place>, Problem> {
        let mut end = file;
        loop {
            if end.len() < file.len()
                && let Some(place) = self.exact(end, false)
            {
                return Ok(Some(place));
            }
            if let Some(place) = self.only_one(false, |listing, folder| {
                view_names::path_within(folder, end).map_or(Vec::new(), |within| listing.alike(&within))
            })? {
                let within = view_names::path_within(&place.folder, end);
                // Camera files of Blender and 3DGS leave the extension out.
                let only_lacks_extension = place.file.rsplit_once('.').map(|(stem, _)| stem) == within.as_deref();
                let is_exact = end.len() == file.len() && only_lacks_extension;
                return Ok(Some(Place { is_exact, ..place }));
            }
            match end.split_once(['/', '\\']) {
                Some((_, rest)) if !rest.is_empty() => end = rest,
                _ => return Ok(None),
            }
        }
    }

    /// The photo with the name at the end of `file`, in any folder below those for photos or, if `everywhere`, below any
    /// place.
    fn by_name(&mut self, file: &str, everywhere: bool) -> Result<Option<Place>, Problem> {
        let file = file.replace('\\', "/");
        // Of two folders of a rig, one does not stand in for the other.
        if !everywhere && !self.names_no_folder_of_its_own(&file) {
            return Ok(None);
        }
        let found = self.only_one(!everywhere, |listing, _| listing.with_name(&file))?;
        if found.is_some() || has_ending(&file) {
            return Ok(found);
        }
        self.only_one(!everywhere, |listing, _| listing.beginning_with(&file))
    }

    /// Whether the folders in a path only lead to one of the places for photos.
    fn names_no_folder_of_its_own(&self, file: &str) -> bool {
        let Some((folder, _)) = file.rsplit_once('/') else { return true };
        let leads_to = |place: &PathBuf| Some(place.join(view_names::path_within(place, folder)?));
        self.places.photos.iter().filter_map(leads_to).any(|folder| self.places.photos.contains(&folder))
    }

    /// What `candidates` returns for the first place for which that is anything, if it is a single picture.
    fn only_one(
        &mut self,
        only_for_photos: bool,
        candidates: impl for<'l> Fn(&'l Listing, &Path) -> Vec<&'l str>,
    ) -> Result<Option<Place>, Problem> {
        for folder in &self.listed {
            if only_for_photos && !self.places.is_for_photos(folder) {
                continue;
            }
            match candidates(self.listings.of(folder), folder)[..] {
                [] => {}
                [file] => {
                    let place = Place { frame: 0, folder: folder.clone(), file: file.to_owned(), is_exact: false };
                    return Ok(Some(place));
                }
                ref several => {
                    return Err(Problem::Several { found: several.iter().map(|file| folder.join(file)).collect() });
                }
            }
        }
        Ok(None)
    }
}
