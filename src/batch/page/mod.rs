//! `index.html`: all scenes of a batch on one page that opens from disk and can be sorted and searched; each scene has
//! a small picture and a link to its report. Scene names and error texts are escaped by the template engine.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Component, Path};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use image::{ImageFormat, ImageReader, Limits};
use minijinja::{Value, context};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use rayon::prelude::*;

use crate::files;
use crate::pictures::thumbnail;
use crate::report::ESTIMATED;
use crate::report::style;
use crate::units::Estimate;
use crate::words::readable::figures;
use crate::workdir::Artifact;

use super::{BatchError, Outcome, State, Summary, memory};

/// Name of the page.
pub const FILE: &str = "index.html";
/// Largest size in bytes of a small picture that gprop wrote: that of its pixels before compression.
const MOST_PICTURE_BYTES: u64 = 3 * 2 * thumbnail::SIDE as u64 * thumbnail::SIDE as u64;
/// Number of materials that a row names.
const MATERIALS: usize = 3;
/// Most characters of an error on the page; `summary.json` has the whole text.
const MOST_OF_AN_ERROR: usize = 1000;
/// Characters that are escaped in a link.
const ESCAPED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');

/// Writes the page of a batch into `home`, beside its other files; `title` describes the batch.
pub fn write(summary: &Summary, title: &str, home: &Path) -> Result<(), BatchError> {
    let (path, page) = (home.join(FILE), page(summary, title, home));
    files::write::file(&path, |out| out.write_all(page.as_bytes())).map_err(|source| BatchError::Io { path, source })
}

fn page(summary: &Summary, title: &str, home: &Path) -> String {
    let known = summary.outcomes.par_iter().map(|outcome| (&outcome.scene, row(outcome, home)));
    let unknown = summary.missing.par_iter().map(|name| (name, context! { name, state => "unknown", rank => 1 }));
    let rows: BTreeMap<&String, Value> = known.chain(unknown).collect();
    let data = context! {
        title,
        tiles => tiles(summary),
        rows => rows.into_values().collect::<Vec<_>>(),
        style => Value::from_safe_string(include_str!("page.css").to_owned()),
        script => Value::from_safe_string(include_str!("page.js").to_owned()),
    };
    style::engine().render_str(include_str!("page.html.j2"), data).expect("the template is a constant")
}

fn tiles(summary: &Summary) -> Vec<Value> {
    let tile = |name: &str, value: String| context! { name, value };
    let mut tiles = vec![tile("scenes", summary.scenes.to_string()), tile("done", summary.done.to_string())];
    tiles.push(tile("failed", summary.failed.to_string()));
    if summary.skipped > 0 {
        tiles.push(tile("skipped", summary.skipped.to_string()));
    }
    if !summary.missing.is_empty() {
        tiles.push(tile("no result", summary.missing.len().to_string()));
    }
    tiles.push(tile("total time", duration(summary.seconds)));
    tiles.push(tile("peak memory", format!("{:.2} GB", summary.peak_memory_bytes as f64 / memory::GIGABYTE)));
    tiles
}

fn duration(seconds: f64) -> String {
    match seconds {
        ..120.0 => format!("{seconds:.0} s"),
        ..7200.0 => format!("{:.0} min", seconds / 60.0),
        _ => format!("{:.1} h", seconds / 3600.0),
    }
}

/// The row of a scene; `rank` sorts states by how urgently they need attention.
fn row(outcome: &Outcome, home: &Path) -> Value {
    let (state, rank) = match (outcome.state, outcome.warnings) {
        (State::Failed, _) => ("failed", 0),
        (State::Skipped, _) => ("skipped", 1),
        (State::Done, 1..) => ("warnings", 2),
        (State::Done, 0) => ("done", 3),
    };
    let report = outcome.work.join(Artifact::ReportHtml.path());
    let results = &outcome.results;
    let named = &results.materials[..results.materials.len().min(MATERIALS)];
    context! {
        name => &outcome.scene,
        state,
        rank,
        warnings => outcome.warnings,
        error => outcome.error.as_deref().map(error),
        picture => (outcome.state != State::Skipped)
            .then(|| picture(&outcome.work.join(Artifact::Thumbnail.path())))
            .flatten(),
        link => (outcome.state == State::Done && report.is_file()).then(|| link(home, &report)).flatten(),
        materials => named.join("; "),
        more_materials => results.materials.len() - named.len(),
        mass => results.mass_kg.map(|mass| cell(mass, 1.0, results.estimated_scale)),
        volume => results.volume_m3.map(|volume| cell(volume, 1e6, results.estimated_scale)),
        parts => results.parts,
        gaussians => results.gaussians,
        views => results.views,
        seconds => outcome.seconds,
    }
}

fn cell(estimate: Estimate, factor: f64, estimated_scale: bool) -> Value {
    let shown = figures(estimate, factor);
    let mark = if estimated_scale { ESTIMATED } else { "" };
    context! { value => estimate.mid, mid => shown.mid, interval => format!("{}{mark}", shown.interval) }
}

/// The first line of an error, and the other lines up to the maximum length.
fn error(text: &str) -> Value {
    let mut shown: String = text.chars().take(MOST_OF_AN_ERROR).collect();
    if shown.len() < text.len() {
        shown.push_str(" … (the full text is in summary.json)");
    }
    let (first, rest) = shown.split_once('\n').unwrap_or((&shown, ""));
    context! { first, rest }
}

/// A scene's small picture as a data URI. `None` if it is not one that gprop wrote, because no picture is better than a
/// broken one.
fn picture(path: &Path) -> Option<Value> {
    if fs::metadata(path).ok()?.len() > MOST_PICTURE_BYTES {
        return None;
    }
    let jpeg = files::read(path).ok()?;
    let mut reader = ImageReader::with_format(files::picture_of(&jpeg), ImageFormat::Jpeg);
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(2 * thumbnail::SIDE), Some(thumbnail::SIDE));
    reader.limits(limits);
    reader.decode().ok()?;
    Some(Value::from_safe_string(format!("data:image/jpeg;base64,{}", BASE64.encode(jpeg))))
}

/// The relative URL from a page in `folder` to `file`; `None` if there is no such URL because the file is on another
/// drive.
fn link(folder: &Path, file: &Path) -> Option<Value> {
    let (folder, file) = (std::path::absolute(folder).ok()?, std::path::absolute(file).ok()?);
    let way = pathdiff::diff_paths(file, folder)?;
    let step = |step: Component| match step {
        Component::ParentDir => "..".to_owned(),
        step => utf8_percent_encode(&step.as_os_str().to_string_lossy(), ESCAPED).to_string(),
    };
    Some(Value::from_safe_string(way.components().map(step).collect::<Vec<_>>().join("/")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_leads_from_the_batch_to_the_scene_whatever_it_is_called() {
        let way = |folder: &str, file: &str| link(Path::new(folder), Path::new(file)).unwrap().to_string();
        assert_eq!(way("/r/batch", "/r/7/a b/report.html"), "../7/a%20b/report.html");
        assert_eq!(way("r/batch", "r/x\"><script>&#?%/report.html"), "../x%22%3E%3Cscript%3E%26%23%3F%25/report.html");
        assert_eq!(way("/r/batch", "/r/batch/javascript:x/report.html"), "javascript%3Ax/report.html");
    }

    #[test]
    fn a_picture_is_gprops_or_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("thumbnail.jpg");
        assert!(picture(&path).is_none(), "missing");
        let write = |width: u32, height: u32| image::RgbImage::new(width, height).save(&path).unwrap();
        write(2 * thumbnail::SIDE, thumbnail::SIDE);
        assert!(picture(&path).unwrap().to_string().starts_with("data:image/jpeg;base64,/9j/"));
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() / 4]).unwrap();
        assert!(picture(&path).is_none(), "cut short");
        write(4 * thumbnail::SIDE, thumbnail::SIDE);
        assert!(picture(&path).is_none(), "larger than any");
        fs::write(&path, vec![0; 1 << 20]).unwrap();
        assert!(picture(&path).is_none(), "a megabyte");
    }

    #[test]
    fn a_long_error_is_cut() {
        let cut = error(&"é\n".repeat(MOST_OF_AN_ERROR));
        assert_eq!(cut.get_attr("first").unwrap().as_str(), Some("é"));
        let rest = cut.get_attr("rest").unwrap().to_string();
        assert!(
            rest.ends_with("(the full text is in summary.json)") && rest.chars().count() < MOST_OF_AN_ERROR + 40,
            "{rest}"
        );
        assert_eq!(error("short").get_attr("rest").unwrap().as_str(), Some(""));
    }
}
