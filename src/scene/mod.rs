//! The scene: Gaussians, calibrated photos, metric scale. Everything read from outside enters here.

pub mod gaussians;

use std::path::PathBuf;

use crate::camera::Camera;
use crate::units::MetricScale;
use gaussians::Gaussians;

/// What a scene folder holds.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The folder's name.
    pub name: String,
    pub gaussians: Gaussians,
    /// Every view with a camera and a photo, in the order of the camera file.
    pub views: Vec<View>,
    /// `None` where nobody says how long a scene unit is.
    pub scale: Option<MetricScale>,
    /// What the user should know: counted, never fatal.
    pub warnings: Vec<String>,
}

/// One photo and its camera.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// The photo's file name without extension; unique within the scene and safe as a file name.
    pub name: String,
    pub camera: Camera,
    pub image: PathBuf,
}

/// A decoded photo at its camera's size.
#[derive(Debug, Clone)]
pub struct Photo {
    /// The picture composited over white where it has alpha.
    pub rgb: image::RgbImage,
    /// 255 where the object is; all 255 where the picture has no alpha.
    pub foreground: image::GrayImage,
}
