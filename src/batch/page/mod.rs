//! `index.html`: all scenes of a batch on one page that opens from disk and can be sorted and searched; each scene has
//! a small picture and a link to its report. Scene names and error texts are escaped by the template engine.

mod distribution;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Component, Path};

use image::{ImageFormat, ImageReader, Limits};
use minijinja::{Value, context};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};

use crate::files;
use crate::parallel;
use crate::pictures::thumbnail;
use crate::report::ESTIMATED;
use crate::report::style;
use crate::units::Estimate;
use crate::words::html::jpeg_url;
use crate::words::output::thousands;
use crate::words::readable::{figures, significant};
use crate::workdir::Artifact;

use super::{BatchError, Outcome, State, Summary, memory};
use distribution::{Fences, histogram};

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

/// The columns of the histograms' quantities.
const MASS_COLUMN: usize = 4;
const WIDTH_COLUMN: usize = 5;

/// What of a scene deserves a look, as words on its row and as the buttons that show such rows alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Mark {
    Failed,
    NoResult,
    Heavy,
    Light,
    Wide,
    Warnings,
}

impl Mark {
    const ALL: [Self; 6] = [Self::Failed, Self::NoResult, Self::Heavy, Self::Light, Self::Wide, Self::Warnings];

    fn text(self) -> &'static str {
        match self {
            Self::Failed => "failed",
            Self::NoResult => "no result",
            Self::Heavy => "unusually heavy",
            Self::Light => "unusually light",
            Self::Wide => "unusually wide interval",
            Self::Warnings => "with warnings",
        }
    }

    /// True for a number that is far from those of the other scenes.
    fn is_outlier(self) -> bool {
        matches!(self, Self::Heavy | Self::Light | Self::Wide)
    }
}

/// Where masses and the widths of their intervals are far from those of the other scenes.
struct Usual {
    mass: Option<Fences>,
    width: Option<Fences>,
}

impl Usual {
    fn marks(&self, outcome: &Outcome) -> Vec<Mark> {
        let mut marks = Vec::new();
        match outcome.state {
            State::Failed => marks.push(Mark::Failed),
            State::Skipped => marks.push(Mark::NoResult),
            State::Done => {}
        }
        if let Some((mass, fences)) = outcome.results.mass_kg.zip(self.mass) {
            marks.extend((mass.mid > fences.high).then_some(Mark::Heavy));
            marks.extend((mass.mid < fences.low).then_some(Mark::Light));
        }
        let width = outcome.results.mass_kg.and_then(width);
        marks.extend(width.zip(self.width).filter(|(width, fences)| *width > fences.high).map(|_| Mark::Wide));
        marks.extend((outcome.warnings > 0).then_some(Mark::Warnings));
        marks
    }
}

/// How many times its lower end the upper end of an interval is.
fn width(estimate: Estimate) -> Option<f64> {
    (estimate.low > 0.0).then(|| estimate.high / estimate.low)
}

fn page(summary: &Summary, title: &str, home: &Path) -> String {
    let masses = || summary.outcomes.iter().filter_map(|outcome| outcome.results.mass_kg);
    let mids: Vec<f64> = masses().map(|mass| mass.mid).filter(|mass| *mass > 0.0).collect();
    let widths: Vec<f64> = masses().filter_map(width).collect();
    let usual = Usual { mass: Fences::of(&mids), width: Fences::of(&widths) };
    let row_of = |outcome: &Outcome| row(outcome, &usual.marks(outcome), home);
    let known = summary.outcomes.iter().map(|outcome| &outcome.scene).zip(parallel::map(&summary.outcomes, row_of));
    let no_result = [Mark::NoResult.text()];
    let unknown =
        summary.missing.iter().map(|name| (name, context! { name, state => "unknown", rank => 1, marks => no_result }));
    let rows: BTreeMap<&String, Value> = known.chain(unknown).collect();
    let plots = [
        histogram("Masses", MASS_COLUMN, "kg", &mids),
        histogram("Intervals of the masses: upper end / lower end", WIDTH_COLUMN, "times", &widths),
    ];
    let data = context! {
        title,
        tiles => tiles(summary),
        plots => plots.into_iter().flatten().collect::<Vec<_>>(),
        marks => counted_marks(summary, &usual),
        asked => summary.asked.requests > 0,
        rows => rows.into_values().collect::<Vec<_>>(),
        style => Value::from_safe_string(include_str!("page.css").to_owned()),
        script => Value::from_safe_string(include_str!("page.js").to_owned()),
    };
    style::engine().render_str(include_str!("page.html.j2"), data).expect("the template is a constant")
}

/// The marks that any scene has, each with the number of scenes.
fn counted_marks(summary: &Summary, usual: &Usual) -> Vec<Value> {
    let mut counts: BTreeMap<Mark, usize> = BTreeMap::from([(Mark::NoResult, summary.missing.len())]);
    for mark in summary.outcomes.iter().flat_map(|outcome| usual.marks(outcome)) {
        *counts.entry(mark).or_default() += 1;
    }
    let button = |mark: Mark| {
        let count = counts.get(&mark).copied().filter(|count| *count > 0)?;
        Some(context! { text => mark.text(), count })
    };
    Mark::ALL.into_iter().filter_map(button).collect()
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
    if summary.asked.requests > 0 {
        tiles.push(tile("requests", thousands(summary.asked.requests as u64)));
        tiles.push(tile("cost", summary.asked.usd.map_or_else(|| "unknown".to_owned(), |usd| format!("{usd:.2} USD"))));
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
fn row(outcome: &Outcome, marks: &[Mark], home: &Path) -> Value {
    let (state, rank) = match (outcome.state, outcome.warnings) {
        (State::Failed, _) => ("failed", 0),
        (State::Skipped, _) => ("skipped", 1),
        (State::Done, 1..) => ("warnings", 2),
        (State::Done, 0) => ("done", 3),
    };
    let report = outcome.work.join(Artifact::ReportHtml.path());
    let results = &outcome.results;
    let outliers = marks.iter().filter(|mark| mark.is_outlier()).map(|mark| mark.text());
    let width = results.mass_kg.and_then(width);
    let named = &results.materials[..results.materials.len().min(MATERIALS)];
    context! {
        name => &outcome.scene,
        state,
        rank,
        warnings => outcome.warnings,
        marks => marks.iter().map(|mark| mark.text()).collect::<Vec<_>>(),
        outliers => outliers.collect::<Vec<_>>(),
        error => outcome.error.as_deref().map(error),
        picture => (outcome.state != State::Skipped)
            .then(|| picture(&outcome.work.join(Artifact::Thumbnail.path())))
            .flatten(),
        link => (outcome.state == State::Done && report.is_file()).then(|| link(home, &report)).flatten(),
        materials => named.join("; "),
        more_materials => results.materials.len() - named.len(),
        mass => results.mass_kg.map(|mass| cell(mass, 1.0, results.estimated_scale)),
        width => width.map(|width| context! { value => width, text => significant(width) }),
        volume => results.volume_m3.map(|volume| cell(volume, 1e6, results.estimated_scale)),
        parts => results.parts,
        gaussians => results.gaussians,
        views => results.views,
        seconds => outcome.seconds,
        usd => outcome.asked.usd,
        requests => outcome.asked.requests,
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
    Some(Value::from_safe_string(jpeg_url(&jpeg)))
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
