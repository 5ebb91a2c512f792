//! From the frames of a camera file to views: the photo on disk, its actual size, its mask.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::camera::{Camera, Intrinsics};
use crate::files;
use crate::scene::cameras::Places;
use crate::scene::cameras::frame::{Declared, Frame, FrameProblem};
use crate::scene::photos::Upright;
use crate::scene::photos::view_names;
use crate::scene::{SceneError, View};
use crate::words::output::{agreeing, counted};

/// The views of a camera file, and the warnings about them for the user.
#[derive(Debug)]
pub(in crate::scene) struct Views {
    pub views: Vec<View>,
    pub warnings: Vec<String>,
}

/// Finds the photo of each frame in `places`, and its mask there or beside the photo. Frames without a photo are
/// counted.
pub(in crate::scene) fn find_photos(
    camera_file: &Path,
    frames: &[Frame],
    places: &Places,
) -> Result<Views, SceneError> {
    let in_frame = |index: usize, problem| SceneError::Frame {
        path: camera_file.to_owned(),
        frame: index,
        file: frames[index].file.clone(),
        problem,
    };
    let mut present = Vec::new();
    let mut missing = Vec::new();
    let mut named: BTreeMap<(PathBuf, String), BTreeSet<&str>> = BTreeMap::new();
    for (index, frame) in frames.iter().enumerate() {
        match photo_of(&frame.file, places) {
            Lookup::Found { folder, file, is_shortened } => {
                named.entry((folder.clone(), file.clone())).or_default().insert(&frame.file);
                present.push((index, folder, file, is_shortened));
            }
            Lookup::Missing => missing.push(frame.file.as_str()),
            Lookup::Outside { leads_to } => return Err(in_frame(index, FrameProblem::OutsideScene { leads_to })),
        }
    }
    // Of several photos that end alike, one that is here may be any of them.
    present.retain(|(index, folder, file, is_shortened)| {
        let is_known = !is_shortened || named[&(folder.clone(), file.clone())].len() == 1;
        if !is_known {
            missing.push(frames[*index].file.as_str());
        }
        is_known
    });
    if present.is_empty() {
        let (count, first) = (frames.len(), missing.first().copied().unwrap_or_default().to_owned());
        return Err(SceneError::NoPhotos { path: camera_file.to_owned(), count, first, tried: places.photos.clone() });
    }
    let files: Vec<String> = present.iter().map(|(_, _, file, _)| file.clone()).collect();
    let sized: Vec<Result<(View, Fit), SceneError>> = present
        .par_iter()
        .zip(view_names::of(&files))
        .map(|((index, folder, file, _), name)| {
            let frame = &frames[*index];
            let image = folder.join(file);
            places.check_photo(camera_file, folder, &image)?;
            let (intrinsics, fit) = fitted(&image, &frame.declared, |problem| in_frame(*index, problem))?;
            let camera = Camera { intrinsics, camera_from_world: frame.camera_from_world };
            let mask = mask_of(frame, folder, file, places);
            let named_in = frame.mask.as_ref().map(|_| camera_file);
            mask.iter().try_for_each(|mask| places.check_mask(mask, named_in))?;
            Ok((View { name, camera, image, upright: fit.upright, mask }, fit))
        })
        .collect();
    // Of several errors, that of the first frame is returned, whichever thread is fastest.
    let sized: Vec<(View, Fit)> = sized.into_iter().collect::<Result<_, _>>()?;
    let mut warnings = warnings(camera_file, frames.len(), &missing, &sized);
    if let Some(masks) = places.masks {
        warnings.extend(views_without_mask(masks, &sized)?);
    } else {
        warnings.extend(masks_that_are_missing(
            camera_file,
            present.iter().map(|(index, folder, ..)| (&frames[*index], folder.as_path())),
            places,
        ));
    }
    Ok(Views { views: sized.into_iter().map(|(view, _)| view).collect(), warnings })
}

/// How a photo was matched to its camera.
#[derive(Debug, Clone, Copy)]
struct Fit {
    upright: Upright,
    /// The declared size, if it differs from the photo's.
    resized_from: Option<(u32, u32)>,
    /// Whether the photo's EXIF orientation says that it is not stored upright.
    turned: bool,
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
    let fit = Fit { upright, resized_from, turned: header.is_turned() };
    Ok((intrinsics.resized(width, height), fit))
}

/// The result of looking up a photo's name.
enum Lookup {
    /// The folder, and the path within it; whether only the end of the frame's path led there.
    Found {
        folder: PathBuf,
        file: String,
        is_shortened: bool,
    },
    Missing,
    /// The name points outside of every folder.
    Outside {
        leads_to: PathBuf,
    },
}

/// Looks for the photo called `file`.
fn photo_of(file: &str, places: &Places) -> Lookup {
    /// Camera files of Blender and 3DGS omit the extension.
    const EXTENSIONS: [&str; 12] =
        ["png", "jpg", "jpeg", "JPG", "PNG", "JPEG", "webp", "tif", "tiff", "bmp", "TIF", "BMP"];
    let find = |file: &str| {
        places.photos.iter().find_map(|folder| {
            let file = view_names::path_within(folder, file)?;
            let endings = EXTENSIONS.iter().map(|end| format!("{file}.{end}"));
            let found = std::iter::once(file.clone()).chain(endings).find(|file| files::is_there(&folder.join(file)));
            found.map(|file| (folder.clone(), file))
        })
    };
    if let Some((folder, file)) = find(file) {
        return Lookup::Found { folder, file, is_shortened: false };
    }
    // If the user names the photos' folder, the folders in a frame's path need not exist there.
    if !places.photos_are_named {
        let is_within = |file: &str| places.photos.iter().any(|folder| view_names::path_within(folder, file).is_some());
        if is_within(file) {
            return Lookup::Missing;
        }
        // An absolute path that is right on the machine where the cameras were calibrated leads out of every folder here.
        if !view_names::is_absolute(file) {
            // From the folder of the camera file, a name may climb and still lead to one of the folders.
            let leads_to = places.beside_camera_file(file);
            let climbed = leads_to.to_string_lossy().into_owned();
            return match find(&climbed) {
                Some((folder, file)) => Lookup::Found { folder, file, is_shortened: false },
                None if is_within(&climbed) => Lookup::Missing,
                None => Lookup::Outside { leads_to },
            };
        }
    }
    let mut ends = std::iter::successors(Some(file), |file| file.split_once(['/', '\\']).map(|(_, end)| end));
    let found = ends.find_map(|end| find(end).filter(|_| !end.is_empty()));
    found.map_or(Lookup::Missing, |(folder, file)| Lookup::Found { folder, file, is_shortened: true })
}

/// The mask that a frame names, wherever that is, if it exists. `folder` is that of the photo.
fn named_mask(frame: &Frame, folder: &Path, places: &Places) -> Option<PathBuf> {
    let mask = frame.mask.as_deref()?;
    let candidates = match view_names::path_within(folder, mask) {
        Some(within) => vec![folder.join(within)],
        // A path that climbs does so from the folder of the camera file or from that of the photo.
        None => vec![places.beside_camera_file(mask), folder.join(mask.replace('\\', "/"))],
    };
    candidates.into_iter().find(|path| files::is_there(path))
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

/// The mask of a photo: the one that the frame names; else the one with the photo's name in `--masks`; else in a folder
/// `masks` in the photos' folder, or beside it if that is in the scene.
fn mask_of(frame: &Frame, folder: &Path, file: &str, places: &Places) -> Option<PathBuf> {
    let masks = places.masks;
    if masks.is_none()
        && let Some(mask) = named_mask(frame, folder, places)
    {
        return Some(mask);
    }
    let below = file.split_once('/').map_or(file, |(_, rest)| rest);
    let stem = |file: &str| file.rsplit_once('.').map_or(file, |(stem, _)| stem).to_owned();
    let folders = match masks {
        Some(masks) => vec![masks.to_owned()],
        None => {
            let beside = folder.parent().filter(|parent| places.scope.leads_out(parent).is_none());
            [Some(folder), beside].into_iter().flatten().map(|folder| folder.join("masks")).collect()
        }
    };
    // COLMAP appends .png to the photo's whole name.
    let names = [file, below].into_iter().flat_map(|file| {
        let stem = stem(file);
        [format!("{stem}.png"), format!("{file}.png"), format!("{stem}.jpg"), file.to_owned()]
    });
    let names: Vec<String> = names.collect();
    folders.iter().flat_map(|folder| names.iter().map(move |name| folder.join(name))).find(|path| files::is_there(path))
}

/// A warning that lists the views without a mask in the folder that the user named.
fn views_without_mask(masks: &Path, sized: &[(View, Fit)]) -> Result<Option<String>, SceneError> {
    let without: Vec<&str> =
        sized.iter().map(|(view, _)| view).filter(|view| view.mask.is_none()).map(|view| view.name.as_str()).collect();
    let (count, views) = (without.len(), sized.len());
    if count == views {
        let first = without.first().copied().unwrap_or_default().to_owned();
        return Err(SceneError::NoMasks { folder: masks.to_owned(), first, views });
    }
    Ok((count > 0).then(|| {
        let folder = masks.display();
        format!(
            "--masks `{folder}` has no mask for {count} of {views} views: {}; the foreground there is taken from \
             alpha, else from the Gaussians",
            without.join(", ")
        )
    }))
}

fn warnings(camera_file: &Path, frames: usize, missing: &[&str], sized: &[(View, Fit)]) -> Vec<String> {
    let mut warnings = Vec::new();
    let file = camera_file.display();
    if let Some(first) = missing.first() {
        let count = missing.len();
        warnings.push(format!(
            "{count} of the {} that `{file}` names {} missing (first: `{first}`); {} left out",
            counted(frames, "photo"),
            agreeing(count, "is", "are"),
            agreeing(count, "it is", "they are"),
        ));
    }
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
    let turned: Vec<_> = sized.iter().filter(|(_, fit)| fit.turned).collect();
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
