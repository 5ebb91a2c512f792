//! A 3DGS output folder: `cameras.json` and `cfg_args`.
//!
//! `cameras.json` is a list of `{id, img_name, width, height, position, rotation, fx, fy}`: the camera's centre and its
//! camera-to-world rotation in OpenCV axes; the principal point is the picture's middle. `cfg_args` is the text of a
//! Python object; only two of its strings are extracted, nothing is evaluated.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3};
use serde::Deserialize;

use super::frame::{Declared, Focal, Frame, FrameProblem, positive};
use super::transforms::Problem;
use super::{Capture, bytes_of};
use crate::camera::{Distortion, rotation_of};
use crate::files::json;
use crate::scene::SceneError;

#[derive(Deserialize)]
struct Entry {
    img_name: String,
    width: u32,
    height: u32,
    position: [f64; 3],
    rotation: [[f64; 3]; 3],
    fx: f64,
    fy: f64,
}

/// Reads the `cameras.json` at `path`.
pub(super) fn read(path: &Path) -> Result<Capture, SceneError> {
    parse(&bytes_of(path)?).map_err(|problem| problem.in_file(path))
}

/// Reads a `cameras.json` from memory.
///
/// # Errors
/// [`Problem`] if it is not JSON, has no frames, or a frame is invalid.
pub fn parse(bytes: &[u8]) -> Result<Capture, Problem> {
    let entries: Vec<Entry> = json::parse(bytes).map_err(Problem::Json)?;
    if entries.is_empty() {
        return Err(Problem::NoFrames);
    }
    let frames = entries.into_iter().enumerate().map(|(index, entry)| {
        let file = entry.img_name.clone();
        frame(entry).map_err(|problem| Problem::Frame { frame: index, file, problem })
    });
    Ok(Capture { frames: frames.collect::<Result<_, _>>()?, ..Capture::default() })
}

fn frame(entry: Entry) -> Result<Frame, FrameProblem> {
    let rotation = Matrix3::from_fn(|row, column| entry.rotation[row][column]);
    let rotation = rotation_of(&rotation).ok_or(FrameProblem::NotARotation)?;
    if entry.position.iter().any(|value| !value.is_finite()) {
        return Err(FrameProblem::NotARotation);
    }
    let world_from_camera = Isometry3::from_parts(entry.position.into(), rotation);
    Ok(Frame {
        file: entry.img_name,
        mask: None,
        declared: Declared {
            size: Some((entry.width, entry.height)),
            fx: Focal::Pixels(positive("fx", entry.fx)?),
            fy: Some(Focal::Pixels(positive("fy", entry.fy)?)),
            cx: None,
            cy: None,
            distortion: Distortion::None,
        },
        camera_from_world: world_from_camera.inverse(),
    })
}

/// The data that the splat was trained on, according to `cfg_args`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrainingArguments {
    /// The folder with photos and cameras, as a path on the machine that trained the splat.
    pub source_path: Option<String>,
    /// The folder of the photos within it.
    pub images: Option<String>,
}

impl TrainingArguments {
    /// Extracts the strings from the text of a `cfg_args`.
    pub fn parse(text: &str) -> Self {
        Self { source_path: string_after(text, "source_path="), images: string_after(text, "images=") }
    }
}

/// The quoted string that follows `key` at the start of a word; Python's escapes of quotes and backslashes are undone.
fn string_after(text: &str, key: &str) -> Option<String> {
    let starts_word = |at: &usize| !text[..*at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
    let (at, _) = text.match_indices(key).find(|(at, _)| starts_word(at))?;
    let mut characters = text[at + key.len()..].chars();
    let quote = characters.next().filter(|c| *c == '\'' || *c == '"')?;
    let mut value = String::new();
    loop {
        match characters.next()? {
            c if c == quote => return Some(value),
            '\\' => value.push(characters.next()?),
            c => value.push(c),
        }
    }
}
