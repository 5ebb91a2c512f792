//! From the frames of a camera file to views: the photo on disk, its actual size, its mask.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::Places;
use super::frame::{Declared, Frame, FrameProblem};
use crate::camera::{Camera, Intrinsics};
use crate::files;
use crate::output::{agreeing, counted};
use crate::scene::photo::{self, Upright};
use crate::scene::{SceneError, View, view_names};

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
    for (index, frame) in frames.iter().enumerate() {
        match photo_of(&frame.file, places) {
            Lookup::Found { folder, file } => present.push((index, folder, file)),
            Lookup::Missing => missing.push(frame.file.as_str()),
            Lookup::Outside => {
                let beside = camera_file.parent().unwrap_or(Path::new(""));
                let leads_to = view_names::without_climbing(&beside.join(frame.file.replace('\\', "/")));
                return Err(in_frame(index, FrameProblem::OutsideScene { leads_to }));
            }
        }
    }
    if present.is_empty() {
        let (count, first) = (frames.len(), missing.first().copied().unwrap_or_default().to_owned());
        return Err(SceneError::NoPhotos { path: camera_file.to_owned(), count, first, tried: places.photos.clone() });
    }
    let files: Vec<String> = present.iter().map(|(_, _, file)| file.clone()).collect();
    let sized: Vec<Result<(View, Fit), SceneError>> = present
        .par_iter()
        .zip(view_names::of(&files))
        .map(|((index, folder, file), name)| {
            let frame = &frames[*index];
            let image = folder.join(file);
            places.check_photo(camera_file, folder, &image)?;
            let (intrinsics, fit) = fitted(&image, &frame.declared, |problem| in_frame(*index, problem))?;
            let camera = Camera { intrinsics, camera_from_world: frame.camera_from_world };
            let mask = mask_of(frame, folder, file, places.masks);
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
    let header = photo::header(image)?;
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
    /// The folder, and the path within it.
    Found {
        folder: PathBuf,
        file: String,
    },
    Missing,
    /// The name points outside of every folder.
    Outside,
}

/// Looks for the photo called `file`.
fn photo_of(file: &str, places: &Places) -> Lookup {
    /// Camera files of Blender and 3DGS omit the extension.
    const EXTENSIONS: [&str; 12] =
        ["png", "jpg", "jpeg", "JPG", "PNG", "JPEG", "webp", "tif", "tiff", "bmp", "TIF", "BMP"];
    let mut within = None;
    for folder in &places.photos {
        let Some(file) = view_names::path_within(folder, file) else { continue };
        let endings = EXTENSIONS.iter().map(|end| format!("{file}.{end}"));
        if let Some(found) =
            std::iter::once(file.clone()).chain(endings).find(|file| files::is_there(&folder.join(file)))
        {
            return Lookup::Found { folder: folder.clone(), file: found };
        }
        within = Some(file);
    }
    // An absolute path that is right on the machine where the cameras were calibrated leads out of every folder here. So
    // does `../`, unless the user says where the photos are.
    let base = file.rsplit(['/', '\\']).next().unwrap_or(file);
    let may_lie_here = Path::new(file).is_absolute() || places.photos_are_named;
    match within {
        Some(_) => Lookup::Missing,
        None if may_lie_here && base != file => photo_of(base, places),
        None => Lookup::Outside,
    }
}

/// The mask of a photo: the one that the frame names, wherever that is; else the one with the photo's name in `masks`;
/// else in a folder `masks` beside the photos' folder or in it.
fn mask_of(frame: &Frame, folder: &Path, file: &str, masks: Option<&Path>) -> Option<PathBuf> {
    if masks.is_none() {
        let named = frame.mask.as_deref().map(|mask| match view_names::path_within(folder, mask) {
            Some(within) => folder.join(within),
            None => folder.join(mask.replace('\\', "/")),
        });
        if let Some(mask) = named.filter(|path| files::is_there(path)) {
            return Some(mask);
        }
    }
    let below = file.split_once('/').map_or(file, |(_, rest)| rest);
    let stem = |file: &str| file.rsplit_once('.').map_or(file, |(stem, _)| stem).to_owned();
    let folders = match masks {
        Some(masks) => vec![masks.to_owned()],
        None => vec![folder.join("masks"), folder.parent().map(|parent| parent.join("masks")).unwrap_or_default()],
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
