//! Imports masks from other programs: a label PNG or an `_s.npy` for each view, in one folder.

use std::path::{Path, PathBuf};

use image::GrayImage;

use super::super::paint::segment_list;
use super::super::{LabelMap, LabelMapError, Level, ViewSegments};
use crate::files;

/// The reason why masks cannot be used. Each message is complete.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    #[error(
        "--segments {folder:?} has neither {view}.png nor {view}_s.npy; every chosen view needs one (--view-list names views)"
    )]
    Missing { folder: PathBuf, view: String },
    #[error("cannot read {path:?}: {source}")]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{path:?}: {problem}")]
    Map { path: PathBuf, problem: LabelMapError },
    #[error(
        "{path:?} is {} x {} pixels, its photo {} x {}; make the map of the whole photo, at its size or scaled down",
        found.0, found.1, expected.0, expected.1
    )]
    Size { path: PathBuf, expected: (u32, u32), found: (u32, u32) },
}

/// The file in `folder` that holds a view's masks; the PNG if there are both.
pub fn file_of_view(folder: &Path, view: &str) -> Result<PathBuf, ImportError> {
    let files = [format!("{view}.png"), format!("{view}_s.npy")].map(|name| folder.join(name));
    let found = files.into_iter().find(|path| files::is_there(path));
    found.ok_or_else(|| ImportError::Missing { folder: folder.to_owned(), view: view.to_owned() })
}

/// Reads a view's segments from `folder`, for a photo of `size`; a map of the photo scaled down is enlarged. From an array
/// with LangSplat's levels, `level` is taken. The quality of such masks is unknown, so their scores are 1.
pub fn import_view(folder: &Path, view: &str, size: (u32, u32), level: Level) -> Result<ViewSegments, ImportError> {
    let path = file_of_view(folder, view)?;
    let bytes = files::read(&path).map_err(|source| ImportError::Read { path: path.clone(), source })?;
    let is_png = path.extension().is_some_and(|extension| extension == "png");
    let map = if is_png {
        LabelMap::from_png(&bytes).and_then(|map| map.renumbered())
    } else {
        LabelMap::from_npy(&bytes, level)
    };
    let map = map.map_err(|problem| ImportError::Map { path: path.clone(), problem })?;
    let found = (map.width, map.height);
    let map = if found == size {
        map
    } else if is_scaled_down(found, size) {
        map.resized(size.0, size.1)
    } else {
        return Err(ImportError::Size { path, expected: size, found });
    };
    let count = map.labels.iter().copied().max().unwrap_or(0);
    let segments = segment_list(&map, &vec![(1.0, 1.0); usize::from(count)], level);
    Ok(ViewSegments { view: view.to_owned(), map, segments })
}

/// The segments without what lies outside of the foreground; those of which nothing is left are left out.
///
/// # Errors
/// [`LabelMapError`] if the map has more segments than its labels can name.
pub fn within(imported: &ViewSegments, foreground: &GrayImage, level: Level) -> Result<ViewSegments, LabelMapError> {
    let mut map = imported.map.clone();
    for (label, inside) in map.labels.iter_mut().zip(foreground.as_raw()) {
        *label = if *inside > 0 { *label } else { 0 };
    }
    let map = map.renumbered()?;
    let count = map.labels.iter().copied().max().unwrap_or(0);
    let segments = segment_list(&map, &vec![(1.0, 1.0); usize::from(count)], level);
    Ok(ViewSegments { view: imported.view.clone(), map, segments })
}

/// True if a picture of size `found` can be the whole of one of size `photo` scaled down, with sides rounded up or down:
/// LangSplat's `preprocess.py` segments photos that are higher than 1080 pixels at that height.
fn is_scaled_down(found: (u32, u32), photo: (u32, u32)) -> bool {
    /// At this scale, a pixel of the map would stand for 64 of the photo.
    const MOST: u32 = 8;
    let is_smaller = |found: u32, photo: u32| found <= photo && photo.div_ceil(MOST) <= found;
    let [w, h, width, height] = [found.0, found.1, photo.0, photo.1].map(i64::from);
    // If each side is off by less than a pixel, the two scales differ by less than 1/width + 1/height.
    is_smaller(found.0, photo.0) && is_smaller(found.1, photo.1) && (w * height - h * width).abs() < width + height
}

#[cfg(test)]
mod tests {
    use super::*;

    fn imported(map: &LabelMap, photo: (u32, u32)) -> Result<ViewSegments, ImportError> {
        let folder = tempfile::tempdir().unwrap();
        let mut bytes = Vec::new();
        map.write_npy(Some(4), &mut bytes).unwrap();
        std::fs::write(folder.path().join("a_s.npy"), bytes).unwrap();
        import_view(folder.path(), "a", photo, Level::Middle)
    }

    /// The left half is segment 1, but for a corner.
    fn halves(width: u32, height: u32) -> LabelMap {
        let label = |i: u32| u16::from(i > 0 && i % width < width / 2);
        LabelMap { width, height, labels: (0..width * height).map(label).collect() }
    }

    #[test]
    fn a_map_of_the_photo_scaled_down_is_enlarged() {
        // int(1333 / (1500 / 1080)) = 959, as LangSplat rounds, here at a tenth.
        let view = imported(&halves(96, 108), (133, 150)).unwrap();
        assert_eq!((view.map.width, view.map.height, view.segments.len()), (133, 150, 1));
        assert_eq!([view.map.at(0, 149), view.map.at(65, 0), view.map.at(67, 75), view.map.at(0, 0)], [1, 1, 0, 0]);
    }

    #[test]
    fn a_map_that_is_cropped_turned_or_larger_is_refused() {
        for (map, photo) in
            [((96, 96), (133, 150)), ((108, 96), (133, 150)), ((134, 151), (133, 150)), ((8, 9), (133, 150))]
        {
            let error = imported(&halves(map.0, map.1), photo).unwrap_err().to_string();
            assert!(error.contains("its photo 133 x 150; make the map of the whole photo"), "{error}");
        }
    }
}
