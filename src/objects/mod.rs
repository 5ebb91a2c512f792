//! The objects of a capture that shows several: a list, a photo with their numbers, a page.
//!
//! 1. [`seen`]: in how many photos each is seen, and how much of it is hidden behind others.
//! 2. [`picture`]: the photo that shows most of them, with their outlines and numbers.
//! 3. [`table`]: the objects in 3D, on what they stand on.
//! 4. [`page`]: all of these on one page, with links to the reports of the objects that were run.
//!
//! `scene` tells the objects apart; [`names`] are what the model took them for.

mod names;
mod page;
mod picture;
mod seen;
mod table;

use std::path::{Path, PathBuf};

pub use names::{NameError, Names, folders_in};
use serde::Serialize;

use crate::error::Result;
use crate::parts::Parts;
use crate::query::{Recognition, WholeAnswer};
use crate::scene::{ObjectNumber, Options, StandingObjects, Up};
use crate::units::Estimate;
use crate::words::output::{counted, one_line, thousands};
use crate::words::progress::Progress;
use crate::words::readable::interval;
use crate::workdir::{self, Artifact, WorkDir};
use table::Table;

/// The content of `objects.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Objects {
    /// The name of the capture's folder.
    pub name: String,
    /// By number.
    pub objects: Vec<Object>,
    /// Which way is up in the input's frame.
    pub up: Up,
    pub support: Support,
    /// Number of photos in which objects were looked for.
    pub photos: usize,
    /// Name of the view in `objects.jpg`.
    pub shown_in: String,
    /// Messages about what the user should check.
    pub warnings: Vec<String>,
    /// What the page shows in 3D.
    #[serde(skip)]
    table: Table,
}

/// An object that stands on the support.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Object {
    /// `object_1`.
    pub name: String,
    /// What the model took it for; `None` until it was asked.
    pub caption: Option<String>,
    /// Around its opaque Gaussians except for a few strays, in the input's frame and unit.
    #[serde(rename = "box")]
    pub bounds: Corners,
    pub gaussians: usize,
    /// Number of photos that show it.
    pub photos: usize,
    /// Share of its outline that other things hide, over these photos.
    pub hidden: f64,
    /// Its work folder, relative to that of the capture.
    pub work: PathBuf,
    /// `None` until it was weighed.
    pub mass_kg: Option<Estimate>,
    /// Why its last run failed.
    pub error: Option<String>,
}

/// A box along the axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Corners {
    pub min: [f64; 3],
    pub max: [f64; 3],
}

/// The plane on which the objects stand: the points x with normal . x = offset, in the input's frame and unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Support {
    /// A unit vector away from what lies under the plane.
    pub normal: [f64; 3],
    pub offset: f64,
}

/// Some objects of a capture could not be run.
#[derive(Debug, thiserror::Error)]
#[error(
    "{} of {count} objects failed: {}; {}the same command tries again",
    failed.len(),
    failed.join(", "),
    if failed.len() < *count { "the others are done, and " } else { "" }
)]
pub struct SomeFailed {
    pub count: usize,
    /// Their names.
    pub failed: Vec<String>,
}

/// The arguments of `gprop objects`.
#[derive(Debug, Clone, clap::Args)]
pub struct Args {
    /// Folder with a splat, cameras and photos.
    pub scene: PathBuf,
    /// Work folder [default: SCENE/gprop]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub options: Options,
}

impl Objects {
    /// Looks at the objects in the photos, writes the numbered photo into the work folder, and reads what earlier runs found out
    /// about each.
    ///
    /// # Errors
    /// If a photo cannot be read, or the work folder cannot be written.
    pub fn look(found: &StandingObjects, work: &WorkDir, progress: Progress) -> Result<Self> {
        let looks = seen::look(found, progress);
        let shown = &found.views[seen::shows_most(&looks, found.count)];
        let photo = picture::draw(found, shown)?;
        work.write_with(Artifact::ObjectsPicture, |out| out.write_all(&photo))?;
        let object = |number: ObjectNumber| {
            let seen = seen::summary(&looks, number);
            let bounds = found.bounds_in_input(number);
            let folder = workdir::object_folder(Path::new(""), &number.to_string());
            Object {
                name: number.to_string(),
                caption: caption(&work.root().join(&folder)),
                bounds: Corners { min: bounds.min.coords.into(), max: bounds.max.coords.into() },
                gaussians: found.object_of_gaussian.iter().filter(|of| **of == number.get()).count(),
                photos: seen.photos,
                hidden: seen.hidden,
                mass_kg: mass_kg(&work.root().join(&folder)),
                work: folder,
                error: None,
            }
        };
        Ok(Self {
            name: found.name.clone(),
            objects: ObjectNumber::first(found.count).map(object).collect(),
            up: found.up,
            support: Support { normal: found.support.normal.into(), offset: found.support.offset },
            photos: looks.len(),
            shown_in: shown.name.clone(),
            warnings: found.warnings.clone(),
            table: Table::new(found, shown),
        })
    }

    /// Reads again what the runs of the objects found out, in the capture's work folder `root`; `errors` are those of runs that
    /// failed, by number.
    pub fn read_results(&mut self, root: &Path, errors: &[Option<String>]) {
        for (object, error) in self.objects.iter_mut().zip(errors) {
            let folder = root.join(&object.work);
            (object.caption, object.mass_kg) = (caption(&folder), mass_kg(&folder));
            object.error.clone_from(error);
        }
    }

    /// Writes the list and its page into the work folder. The numbered photo must be there.
    ///
    /// # Errors
    /// If the work folder cannot be written.
    pub fn write(&self, work: &WorkDir) -> Result<()> {
        work.write_json(Artifact::Objects, self)?;
        let page = page::html(self, &work.read(Artifact::ObjectsPicture)?, work.root());
        work.write_with(Artifact::ObjectsPage, |out| out.write_all(page.as_bytes()))?;
        Ok(())
    }

    /// The list as text.
    pub fn text(&self) -> String {
        let mut text = format!("{}: {}\n", self.name, counted(self.objects.len(), "object"));
        for object in &self.objects {
            text += &format!(
                "{:<10} {:>9} Gaussians, {}",
                object.name,
                thousands(object.gaussians as u64),
                object.seen_in_words()
            );
            if let Some(caption) = &object.caption {
                text += &format!("; {}", one_line(caption));
            }
            if let Some(mass) = object.mass_kg {
                text += &format!("; {} kg", interval(mass, 1.0));
            }
            if let Some(error) = &object.error {
                text += &format!("; failed: {error}");
            }
            text.push('\n');
        }
        text
    }
}

impl Object {
    /// Its name, with what the model took it for: `object_2 (mug)`.
    pub fn title(&self) -> String {
        self.caption
            .as_deref()
            .map_or_else(|| self.name.clone(), |caption| format!("{} ({})", self.name, one_line(caption)))
    }

    /// In how many photos it is seen, and how much of it is hidden there.
    fn seen_in_words(&self) -> String {
        format!("in {}, {:.0} % hidden", counted(self.photos, "photo"), 100.0 * self.hidden)
    }
}

/// What the model took an object for, if it was asked.
fn caption(folder: &Path) -> Option<String> {
    let answer: WholeAnswer<Recognition> = workdir::read_json(&folder.join(Artifact::Object.path())).ok()?;
    answer.outcome.answered().map(|recognized| recognized.object.clone())
}

/// The mass that a run found, if the scale was known.
fn mass_kg(folder: &Path) -> Option<Estimate> {
    let parts: Parts = workdir::read_json(&folder.join(Artifact::Parts.path())).ok()?;
    Some(parts.object.mass_kg)
}

/// Lists the objects of a capture.
///
/// # Errors
/// As [`StandingObjects::find`] and [`Objects::look`].
pub fn command(args: &Args, work: &Path, progress: Progress) -> Result<Objects> {
    let found = StandingObjects::find(&args.scene, &args.options)?;
    found.require_any()?;
    let work = WorkDir::open(work)?;
    let objects = Objects::look(&found, &work, progress)?;
    objects.write(&work)?;
    Ok(objects)
}
