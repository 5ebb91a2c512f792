//! From the frames of a camera file to views: the photo on disk, its actual size, its mask.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use image::metadata::Orientation;

use super::listing::{Listings, key_of_masked};
use super::look_up::{Found, Place, look_up};
use super::mask::Mask;
use super::mask_files::{MaskFiles, named_mask};
use super::mask_lying::Lying;
use crate::camera::{Camera, Intrinsics};
use crate::parallel;
use crate::scene::cameras::Places;
use crate::scene::cameras::frame::{Declared, Frame, FrameProblem};
use crate::scene::error::Held;
use crate::scene::photos::Upright;
use crate::scene::photos::view_names;
use crate::scene::{SceneError, View};
use crate::words::output::{agreeing, counted};

/// The number of pictures or views that a message names.
const MOST_NAMED: usize = 8;

/// The views of a camera file, and the messages about them for the user.
#[derive(Debug)]
pub(in crate::scene) struct Views {
    pub views: Vec<View>,
    pub notes: Vec<String>,
    pub warnings: Vec<String>,
}

/// Finds the photo of each frame in `places`, and its mask there or beside the photo. Frames without a photo are
/// counted, and so are photos without a frame.
pub(in crate::scene) fn find_photos(
    camera_file: &Path,
    frames: &[Frame],
    places: &Places,
) -> Result<Views, SceneError> {
    let mut listings = Listings::default();
    let found = look_up(camera_file, frames, places, &mut listings)?;
    if found.places.is_empty() {
        let first = frames.first().map(|frame| frame.file.clone()).unwrap_or_default();
        let tried = places.photos.iter().filter(|folder| folder.is_dir());
        let tried = tried.map(|folder| held(folder, places, &mut listings)).collect();
        return Err(SceneError::NoPhotos { path: camera_file.to_owned(), count: frames.len(), first, tried });
    }
    let mut mask_files = MaskFiles::new(camera_file, places, &mut listings);
    let masks = found.places.iter().map(|place| {
        // A photo that must not be read is the more important finding.
        places.check_photo(camera_file, &place.folder, &place.path())?;
        mask_files.of(&frames[place.frame], place)
    });
    let masks: Vec<Option<PathBuf>> = masks.collect::<Result<_, _>>()?;
    let mask_folders = mask_files.searched();
    let files: Vec<String> = found.places.iter().map(|place| place.file.clone()).collect();
    let inputs: Vec<_> = found.places.iter().zip(masks).zip(view_names::of(&files)).collect();
    let sized: Vec<(View, Fit)> = parallel::try_map(&inputs, |((place, mask), name)| {
        view(camera_file, &frames[place.frame], place, mask.clone(), name.clone())
    })?;
    let mut warnings = left_out(camera_file, frames, &found, places, &mut listings);
    warnings.extend(about_photos(camera_file, &sized));
    if let Some(warning) = views_without_mask(&mask_folders, &sized, places, &mut listings)? {
        warnings.push(warning);
    }
    if places.masks.is_none() {
        let named = found.places.iter().map(|place| (&frames[place.frame], place.folder.as_path()));
        warnings.extend(masks_that_are_missing(camera_file, named, places));
    }
    let notes = notes(camera_file, frames, &found, places, &mut listings);
    Ok(Views { views: sized.into_iter().map(|(view, _)| view).collect(), notes, warnings })
}

/// The view of a frame whose photo and mask were found.
fn view(
    camera_file: &Path,
    frame: &Frame,
    place: &Place,
    mask: Option<PathBuf>,
    name: String,
) -> Result<(View, Fit), SceneError> {
    let image = place.path();
    let (intrinsics, fit) = fitted(&image, &frame.declared, |problem| SceneError::Frame {
        path: camera_file.to_owned(),
        frame: place.frame,
        file: frame.file.clone(),
        problem,
    })?;
    let camera = Camera { intrinsics, camera_from_world: frame.camera_from_world };
    let size = (intrinsics.width, intrinsics.height);
    let lying = |mask: PathBuf| -> Result<Mask, SceneError> {
        Ok(Mask { lying: Lying::of(fit.orientation, fit.upright, &mask, size)?, ..Mask::new(mask) })
    };
    let mask = mask.map(lying).transpose()?;
    Ok((View { name, camera, image, upright: fit.upright, mask }, fit))
}

/// How a photo was matched to its camera.
#[derive(Debug, Clone, Copy)]
struct Fit {
    upright: Upright,
    /// The declared size, if it differs from the photo's.
    resized_from: Option<(u32, u32)>,
    /// The photo's EXIF orientation.
    orientation: Orientation,
}

/// The intrinsics for the photo's actual size.
fn fitted(
    image: &Path,
    declared: &Declared,
    in_frame: impl Fn(FrameProblem) -> SceneError,
) -> Result<(Intrinsics, Fit), SceneError> {
    let header = crate::scene::photos::header(image)?;
    let upright = header.upright_for(declared.size);
    let (width, height) = header.size(upright);
    let intrinsics = declared.intrinsics((width, height)).map_err(&in_frame)?;
    let fits = (intrinsics.width, intrinsics.height) == (width, height);
    let resized_from = (!fits).then_some((intrinsics.width, intrinsics.height));
    let fit = Fit { upright, resized_from, orientation: header.orientation() };
    Ok((intrinsics.resized(width, height), fit))
}

/// A warning about masks that frames name but that do not exist.
fn masks_that_are_missing<'a>(
    camera_file: &Path,
    frames: impl Iterator<Item = (&'a Frame, &'a Path)>,
    places: &Places,
) -> Option<String> {
    let named = frames.filter_map(|(frame, folder)| Some((frame.mask.as_deref()?, named_mask(frame, folder, places))));
    let missing: Vec<&str> = named.filter(|(_, found)| found.is_none()).map(|(mask, _)| mask).collect();
    let first = missing.first()?;
    Some(format!(
        "{} that `{}` names {} missing (first: `{first}`); the foreground there is taken from `masks/`, else from alpha, \
         else from the Gaussians",
        counted(missing.len(), "mask"),
        camera_file.display(),
        agreeing(missing.len(), "is", "are"),
    ))
}

/// A warning that lists the views without a mask, if there is a folder of masks; an error if none of the views has one.
fn views_without_mask(
    folders: &[PathBuf],
    sized: &[(View, Fit)],
    places: &Places,
    listings: &mut Listings,
) -> Result<Option<String>, SceneError> {
    let without: Vec<&str> =
        sized.iter().map(|(view, _)| view).filter(|view| view.mask.is_none()).map(|view| view.name.as_str()).collect();
    let (count, views) = (without.len(), sized.len());
    let tried: Vec<Held> = folders.iter().map(|folder| held(folder, places, listings)).collect();
    let has_masks = places.masks.is_some() || tried.iter().any(|held| held.count > 0);
    if count == 0 || !has_masks {
        return Ok(None);
    }
    if count == views {
        let first = without.first().copied().unwrap_or_default().to_owned();
        return Err(SceneError::NoMasks { tried, first, views });
    }
    let flag = if places.masks.is_some() { "--masks " } else { "" };
    let folders: Vec<String> = folders.iter().map(|folder| format!("`{}`", places.short(folder))).collect();
    Ok(Some(format!(
        "{flag}{} {} no mask for {count} of {views} views: {}; the foreground there is taken from alpha, else from the Gaussians",
        folders.join(" and "),
        agreeing(folders.len(), "has", "have"),
        some_of(without.into_iter()),
    )))
}

/// The pictures in a folder, as far as it may be listed: all below one that is for photos, else those in the folder itself.
fn held(folder: &Path, places: &Places, listings: &mut Listings) -> Held {
    if !places.may_list(folder) {
        return Held { folder: folder.to_owned(), pictures: Vec::new(), count: 0, may_be_listed: false };
    }
    let listing = listings.of(folder);
    let pictures: Vec<&str> = if places.is_for_photos(folder) {
        listing.files().iter().map(String::as_str).collect()
    } else {
        listing.direct().collect()
    };
    let named = pictures.iter().take(MOST_NAMED / 2).map(|name| (*name).to_owned());
    Held { folder: folder.to_owned(), pictures: named.collect(), count: pictures.len(), may_be_listed: true }
}

/// Up to [`MOST_NAMED`] names, and how many more there are.
fn some_of<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> String {
    let more = names.len().saturating_sub(MOST_NAMED);
    let named = names.take(MOST_NAMED).collect::<Vec<_>>().join(", ");
    if more > 0 { format!("{named} and {more} more") } else { named }
}

/// What was chosen: the folders of the photos, other names than those in the camera file, photos without a camera.
fn notes(camera_file: &Path, frames: &[Frame], found: &Found, places: &Places, listings: &mut Listings) -> Vec<String> {
    let mut folders: BTreeMap<PathBuf, BTreeSet<PathBuf>> = BTreeMap::new();
    for path in found.places.iter().map(Place::path) {
        folders.entry(path.parent().unwrap_or(Path::new("")).to_owned()).or_default().insert(path);
    }
    let (named, more) = (folders.iter().take(MOST_NAMED), folders.len().saturating_sub(MOST_NAMED));
    let mut counts: Vec<String> =
        named.map(|(folder, photos)| format!("{} in `{}`", photos.len(), places.short(folder))).collect();
    if more > 0 {
        counts.push(format!("others in {}", counted(more, "folder")));
    }
    let mut notes = vec![format!("photos: {}", counts.join(", "))];
    let renamed: Vec<&Place> = found.places.iter().filter(|place| !place.is_exact).collect();
    if let Some(first) = renamed.first() {
        notes.push(format!(
            "{} under another name or in another folder than `{}` says (first: `{}` is `{}`)",
            agreeing_count(renamed.len(), "photo was found", "photos were found"),
            places.short(camera_file),
            frames[first.frame].file,
            places.short(&first.path()),
        ));
    }
    notes.extend(without_camera(camera_file, &folders, places, listings));
    notes
}

/// A note about the photos in the same folders that the camera file does not name. Masks of those that it names do not count.
fn without_camera(
    camera_file: &Path,
    folders: &BTreeMap<PathBuf, BTreeSet<PathBuf>>,
    places: &Places,
    listings: &mut Listings,
) -> Option<String> {
    let mut without: Vec<PathBuf> = Vec::new();
    let mut all = 0;
    for (folder, photos) in folders.iter().filter(|(folder, _)| places.may_list(folder)) {
        let masked: BTreeSet<String> =
            photos.iter().filter_map(|photo| Some(key_of_masked(photo.file_name()?.to_str()?))).collect();
        let others = listings.of(folder).direct().filter(|name| !photos.contains(&folder.join(name)));
        let others: Vec<PathBuf> =
            others.filter(|name| !masked.contains(&key_of_masked(name))).map(|name| folder.join(name)).collect();
        all += photos.len() + others.len();
        without.extend(others);
    }
    let first = without.first()?;
    Some(format!(
        "{} of the {} there {} no camera in `{}` and {} left out (first: `{}`)",
        without.len(),
        counted(all, "photo"),
        agreeing(without.len(), "has", "have"),
        places.short(camera_file),
        agreeing(without.len(), "is", "are"),
        places.short(first),
    ))
}

fn agreeing_count(count: usize, one: &'static str, more: &'static str) -> String {
    format!("{count} {}", agreeing(count, one, more))
}

/// Warnings about the frames that become no views.
fn left_out(
    camera_file: &Path,
    frames: &[Frame],
    found: &Found,
    places: &Places,
    listings: &mut Listings,
) -> Vec<String> {
    let mut warnings = Vec::new();
    let (file, all) = (camera_file.display(), counted(frames.len(), "photo"));
    if let Some(first) = found.missing.first() {
        let count = found.missing.len();
        let near = found.places.first().map(Place::path).unwrap_or_default();
        let near = near.parent().map(Path::to_owned).unwrap_or_default();
        let there = held(&near, places, listings);
        let there = match there.count {
            0 => String::new(),
            count => format!(
                "; `{}` has {}: {} ...",
                places.short(&near),
                counted(count, "picture"),
                there.pictures.join(" ")
            ),
        };
        warnings.push(format!(
            "{count} of the {all} that `{file}` names {} missing (first: `{}`{there}); {} left out",
            agreeing(count, "is", "are"),
            frames[*first].file,
            agreeing(count, "it is", "they are"),
        ));
    }
    if let Some(first) = found.shared.first() {
        let count = found.shared.len();
        warnings.push(format!(
            "{count} of the {all} that `{file}` names {} left out, because the only picture that may be {} may just as well be \
             that of another camera (first: `{}`)",
            agreeing(count, "is", "are"),
            agreeing(count, "it", "one of them"),
            frames[*first].file,
        ));
    }
    warnings
}

/// Warnings about photos of another size than declared, and about those that are not stored upright.
fn about_photos(camera_file: &Path, sized: &[(View, Fit)]) -> Vec<String> {
    let mut warnings = Vec::new();
    let file = camera_file.display();
    let resized: Vec<_> = sized.iter().filter_map(|(view, fit)| fit.resized_from.map(|size| (view, size))).collect();
    if let Some((view, (width, height))) = resized.first() {
        let Intrinsics { width: true_width, height: true_height, .. } = view.camera.intrinsics;
        warnings.push(format!(
            "{} {} not have the size that `{file}` declares (first: `{}` {width} x {height}, found {true_width} x \
             {true_height}); the intrinsics were rescaled",
            counted(resized.len(), "photo"),
            agreeing(resized.len(), "does", "do"),
            view.name
        ));
    }
    let turned: Vec<_> = sized.iter().filter(|(_, fit)| fit.orientation != Orientation::NoTransforms).collect();
    if let Some((view, _)) = turned.first() {
        let done = match turned.iter().filter(|(view, _)| view.upright == Upright::Turned).count() {
            0 => "not turned, because the cameras were calibrated on photos as they are stored".to_owned(),
            all if all == turned.len() => "turned upright".to_owned(),
            some => {
                format!(
                    "turned upright: {some}; the cameras of the others were calibrated on photos as they are stored"
                )
            }
        };
        warnings.push(format!(
            "{} {} according to the EXIF orientation (first: `{}`); {done}",
            counted(turned.len(), "photo"),
            agreeing(turned.len(), "is not stored upright", "are not stored upright"),
            view.name
        ));
    }
    warnings
}
