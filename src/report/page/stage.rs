//! Gaussians in 3D on a page: what every page with them embeds.

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use minijinja::Value;

pub use super::viewer::Shown;
use crate::report::Cloud;

/// The frame of the canvas, the bar above it and the line below it.
pub const STYLE: &str = include_str!("stage.css");
/// Defines `stageOf`, which the page's own script calls.
pub const SCRIPT: &str = include_str!("stage.js");
/// Of [`viewer_code`].
pub const LICENCES: &str = include_str!("splats.licences.txt");

/// The content of the element `#viewer-code`: three.js and Spark.
pub fn viewer_code() -> Value {
    Value::from_safe_string(BASE64.encode(include_bytes!("splats.js.gz")))
}

/// The content of the element `#cloud`.
pub fn packed(cloud: &Cloud) -> Value {
    Value::from_safe_string(BASE64.encode(&cloud.gzip))
}
