//! nerfstudio's `transforms.json`: camera-to-world matrices in OpenGL axes, intrinsics at the top or per frame.
//!
//! Layout after the nerfstudio documentation, "Data conventions": `fl_x fl_y cx cy w h` in pixels, `k1 k2 k3 p1 p2` of
//! OpenCV's lens model, `camera_angle_x` (horizontal field of view, radians) where there is no `fl_x`.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::Matrix4;
use serde::Deserialize;

use super::error::FrameProblem;
use super::{SceneError, View, photo, view_names};
use crate::camera::{Camera, Distortion, Intrinsics, camera_from_world_of_opengl};

/// The views of a camera file, and what the user should know of them.
pub(super) struct Views {
    pub views: Vec<View>,
    pub warnings: Vec<String>,
}

#[derive(Debug, Deserialize)]
struct Transforms {
    #[serde(flatten)]
    lens: Lens,
    frames: Vec<Frame>,
}

#[derive(Debug, Deserialize)]
struct Frame {
    file_path: String,
    transform_matrix: Vec<Vec<f64>>,
    #[serde(flatten)]
    lens: Lens,
}

/// Intrinsics as far as they are given.
#[derive(Debug, Clone, Deserialize)]
struct Lens {
    camera_model: Option<String>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

/// The camera file of `folder`.
pub(super) fn find(folder: &Path) -> Result<PathBuf, SceneError> {
    let path = folder.join("transforms.json");
    if path.is_file() {
        return Ok(path);
    }
    let remedy = if folder.join("sparse").is_dir() {
        "there is a COLMAP model, which gprop cannot read yet; nerfstudio's `ns-process-data` turns it into the \
         transforms.json that gprop reads"
    } else {
        "gprop reads nerfstudio's transforms.json, which should lie beside the splat"
    };
    Err(SceneError::NoCameras { folder: folder.to_owned(), remedy })
}

/// Reads the camera file at `path`, whose photos lie below its folder.
pub(super) fn read(path: &Path) -> Result<Views, SceneError> {
    let text = fs::read(path).map_err(|reason| SceneError::Io { path: path.to_owned(), reason })?;
    let transforms: Transforms =
        serde_json::from_slice(&text).map_err(|reason| SceneError::Json { path: path.to_owned(), reason })?;
    if transforms.frames.is_empty() {
        return Err(SceneError::NoFrames { path: path.to_owned() });
    }
    let in_frame = |frame: usize, problem| {
        let file = transforms.frames[frame].file_path.clone();
        SceneError::Frame { path: path.to_owned(), frame, file, problem }
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let files = transforms.frames.iter().enumerate().map(|(index, frame)| {
        view_names::path_within(folder, &frame.file_path).ok_or_else(|| in_frame(index, FrameProblem::OutsideScene))
    });
    let files: Vec<String> = files.collect::<Result<_, _>>()?;
    let mut views = Vec::with_capacity(files.len());
    let mut resized = Vec::new();
    for (index, (file, name)) in files.iter().zip(view_names::of(&files)).enumerate() {
        let frame = &transforms.frames[index];
        let camera_from_world = pose(&frame.transform_matrix).map_err(|problem| in_frame(index, problem))?;
        let image = folder.join(file);
        let (width, height) = photo::size(&image)?;
        let lens = frame.lens.clone().or(&transforms.lens);
        let declared = lens.intrinsics(width, height).map_err(|problem| in_frame(index, problem))?;
        let intrinsics = declared.resized(width, height);
        if intrinsics != declared {
            resized.push(format!("`{name}` {} x {}, found {width} x {height}", declared.width, declared.height));
        }
        views.push(View { name, camera: Camera { intrinsics, camera_from_world }, image });
    }
    Ok(Views { views, warnings: resize_warning(&resized).into_iter().collect() })
}

fn pose(rows: &[Vec<f64>]) -> Result<nalgebra::Isometry3<f64>, FrameProblem> {
    if rows.len() != 4 || rows.iter().any(|row| row.len() != 4) {
        return Err(FrameProblem::MatrixShape);
    }
    let world_from_camera_opengl = Matrix4::from_fn(|row, column| rows[row][column]);
    camera_from_world_of_opengl(&world_from_camera_opengl).ok_or(FrameProblem::NotARotation)
}

impl Lens {
    /// This lens with what it lacks taken from `other`.
    fn or(self, other: &Self) -> Self {
        Self {
            camera_model: self.camera_model.or_else(|| other.camera_model.clone()),
            camera_angle_x: self.camera_angle_x.or(other.camera_angle_x),
            camera_angle_y: self.camera_angle_y.or(other.camera_angle_y),
            fl_x: self.fl_x.or(other.fl_x),
            fl_y: self.fl_y.or(other.fl_y),
            cx: self.cx.or(other.cx),
            cy: self.cy.or(other.cy),
            w: self.w.or(other.w),
            h: self.h.or(other.h),
            k1: self.k1.or(other.k1),
            k2: self.k2.or(other.k2),
            k3: self.k3.or(other.k3),
            k4: self.k4.or(other.k4),
            p1: self.p1.or(other.p1),
            p2: self.p2.or(other.p2),
        }
    }

    /// The intrinsics for the declared size, or for the photo's own `width` and `height` where none is declared.
    fn intrinsics(&self, width: u32, height: u32) -> Result<Intrinsics, FrameProblem> {
        self.check_model()?;
        let (w, h) = (self.w.unwrap_or(width.into()), self.h.unwrap_or(height.into()));
        let (w, h) = (positive("w", w.round())?, positive("h", h.round())?);
        let focal = |angle: f64, side: f64| 0.5 * side / (0.5 * angle).tan();
        let fx = self.fl_x.or(self.camera_angle_x.map(|angle| focal(angle, w)));
        let fx = positive("fl_x", fx.ok_or(FrameProblem::NoFocalLength)?)?;
        let fy = self.fl_y.or(self.camera_angle_y.filter(|_| self.fl_x.is_none()).map(|angle| focal(angle, h)));
        Ok(Intrinsics {
            width: w as u32,
            height: h as u32,
            fx,
            fy: positive("fl_y", fy.unwrap_or(fx))?,
            cx: self.cx.unwrap_or(0.5 * w),
            cy: self.cy.unwrap_or(0.5 * h),
            distortion: self.distortion(),
        })
    }

    fn check_model(&self) -> Result<(), FrameProblem> {
        const KNOWN: [&str; 5] = ["PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"];
        match &self.camera_model {
            Some(model) if !KNOWN.contains(&model.as_str()) => Err(FrameProblem::CameraModel { model: model.clone() }),
            _ if self.k4.is_some_and(|k4| k4 != 0.0) => {
                Err(FrameProblem::CameraModel { model: "with k4 other than 0".to_owned() })
            }
            _ => Ok(()),
        }
    }

    fn distortion(&self) -> Distortion {
        let value = |k: Option<f64>| k.unwrap_or(0.0);
        Distortion::opencv(value(self.k1), value(self.k2), value(self.p1), value(self.p2), value(self.k3))
    }
}

fn positive(name: &'static str, value: f64) -> Result<f64, FrameProblem> {
    match value.is_finite() && value > 0.0 {
        true => Ok(value),
        false => Err(FrameProblem::Number { name, value, positive: true }),
    }
}

/// One line for all photos whose size is not the declared one.
fn resize_warning(resized: &[String]) -> Option<String> {
    let first = resized.first()?;
    let count = resized.len();
    Some(format!(
        "{count} photos are not of the size that transforms.json declares (first: {first}); their intrinsics were rescaled"
    ))
}
