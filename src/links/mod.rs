//! A robot or a scene of a simulator (URDF, MJCF) as objects: what its links look like is weighed, link by link.
//!
//! 1. [`shape`] puts the meshes and simple shapes of each link together; [`simple`] makes triangles of the latter;
//! 2. [`glb`] writes each that is not like an earlier one as a mesh, in metres and in the link's own frame;
//! 3. the batch runs them like any other meshes;
//! 4. [`mod@weighed`] gathers what was found beside what the file claimed.
//!
//! [`asset`] writes the container again with these numbers in it; its own files are only read.

mod asset;
mod glb;
mod shape;
mod simple;
mod weighed;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::batch::{self, Batch, News, Summary, Task};
use crate::error::Result;
use crate::files::json;
use crate::files::read_scope::ReadScope;
use crate::files::write::Folder;
use crate::pipeline::work_folder;
use crate::scene;
use crate::scene::mesh::containers::{
    self, Body, Container, ContainerError, FileProblem, Geometry, MeshUse, Mobility, Place,
};
use crate::words::output::counted;
pub use asset::Written;
use shape::{LinkShape, Meshes};
pub use weighed::{Claimed, Found, Link, Links};

/// The folder of the links' meshes, in the work folder.
const FOLDER: &str = "links";
/// The file that lists the links with their masses, in the work folder.
const FILE: &str = "links.json";
/// More links that differ than any robot has: each of them is asked about.
const MOST_OBJECTS: usize = 1000;

/// A container whose links cannot be run.
#[derive(Debug, Error)]
pub enum LinksError {
    #[error(transparent)]
    Container(#[from] ContainerError),
    #[error("{path:?}, line {line}: {problem}")]
    Outside { path: PathBuf, line: usize, problem: FileProblem },
    #[error("{path:?} has no link with a shape that can be weighed{why}")]
    Nothing { path: PathBuf, why: String },
    #[error(
        "{path:?} has {found} links that differ, and gprop weighs up to {most} at once; run parts of it by themselves"
    )]
    TooMany { path: PathBuf, found: usize, most: usize },
    #[error("{path:?} has changed since it was read; run again")]
    Changed { path: PathBuf },
    #[error("{folder:?} holds the model itself, which the export would replace; choose another folder with --out")]
    OwnFolder { folder: PathBuf },
    #[error("cannot write {path:?}: {source}; make room or choose another folder with --out")]
    Write { path: PathBuf, source: std::io::Error },
}

/// The links of a container, prepared to be run.
pub struct Prepared {
    container: Container,
    scope: ReadScope,
    /// Per link of the container, the name of the mesh that shows it; `None` if it has no shape.
    object_of: Vec<Option<String>>,
    /// The work folder.
    root: PathBuf,
    /// What was left out, and why.
    pub warnings: Vec<String>,
}

impl Prepared {
    /// Reads the container at `path` and writes the meshes of its links below `out`, or into the default work folder.
    ///
    /// # Errors
    /// [`LinksError`] if the container cannot be read, none of its links has a shape, or nothing can be written. Nothing is
    /// written before everything has been read.
    pub fn of(path: &Path, out: Option<&Path>, options: &scene::Options) -> Result<Self, LinksError> {
        let scope = options.read_scope(&scene::home(path));
        let container = containers::read(path, &scope)?;
        refuse_outside(&container)?;
        let mut warnings: Vec<String> = container.problems.iter().map(|problem| problem.text.clone()).collect();
        let (object_of, objects) = objects(&container, &scope, &mut warnings);
        if objects.is_empty() {
            let why = warnings.first().map_or(String::new(), |first| format!(": {first}"));
            return Err(LinksError::Nothing { path: path.to_owned(), why });
        }
        if objects.len() > MOST_OBJECTS {
            return Err(LinksError::TooMany { path: path.to_owned(), found: objects.len(), most: MOST_OBJECTS });
        }
        let root = work_folder(path, out);
        let prepared = Self { container, scope, object_of, root, warnings };
        prepared.write(&objects)?;
        Ok(prepared)
    }

    /// Writes the meshes.
    fn write(&self, objects: &BTreeMap<String, LinkShape>) -> Result<(), LinksError> {
        let folder = self.folder();
        let failed = |path: &Path, source| LinksError::Write { path: path.to_owned(), source };
        let opened = Folder::open(&folder).map_err(|source| failed(&folder, source))?;
        for (name, shape) in objects {
            let file = PathBuf::from(format!("{name}.glb"));
            let claimed = self.claimed_mass_kg(name);
            let written = opened.write(&file, |out| glb::write(shape, claimed, out));
            written.map_err(|source| failed(&folder.join(&file), source))?;
        }
        Ok(())
    }

    /// The mass on which all links that an object shows agree, of those that state one.
    fn claimed_mass_kg(&self, object: &str) -> Option<f64> {
        let shown = self.container.bodies.iter().zip(&self.object_of).filter(|(_, of)| of.as_deref() == Some(object));
        let mut masses = shown.filter_map(|(body, _)| body.inertial.as_ref()?.mass_kg);
        let first = masses.next().filter(|mass| mass.is_finite() && *mass > 0.0)?;
        masses.all(|mass| mass == first).then_some(first)
    }

    /// The folder of the meshes, each of which is a scene of its own.
    pub fn folder(&self) -> PathBuf {
        self.root.join(FOLDER)
    }

    /// Number of meshes.
    pub fn object_count(&self) -> usize {
        self.works().count()
    }

    /// The name of each mesh, with its work folder.
    pub fn works(&self) -> impl Iterator<Item = (&str, PathBuf)> {
        let names: BTreeSet<&str> = self.object_of.iter().flatten().map(String::as_str).collect();
        names.into_iter().map(|name| (name, work_folder(&self.folder().join(format!("{name}.glb")), None)))
    }

    /// Runs the meshes; `tell` is called with each outcome, and with how all stand.
    ///
    /// # Errors
    /// As for [`Batch::run`].
    pub fn run(&self, task: Task, tell: &mut dyn FnMut(News)) -> Result<Summary> {
        Batch::new(&self.folder(), None, batch::Options::default(), task)?.run(tell)
    }

    /// Gathers what was found of each link, and writes it.
    ///
    /// # Errors
    /// [`LinksError::Write`].
    pub fn gather(&self) -> Result<Links, LinksError> {
        let links = Links::gather(&self.container, &self.object_of, &self.folder());
        let failed = |source| LinksError::Write { path: self.root.join(FILE), source };
        let folder = Folder::open(&self.root).map_err(failed)?;
        let text = json::pretty(&links).expect("links are plain data");
        folder.write(Path::new(FILE), |out| out.write_all(text.as_bytes())).map_err(failed)?;
        Ok(links)
    }

    /// Writes the container with what was found into `out`; see [`asset`].
    ///
    /// # Errors
    /// As for [`asset::write`].
    pub fn export(&self, links: &Links, out: &Path) -> Result<Written, LinksError> {
        asset::write(&self.container, links, out, &self.scope)
    }
}

/// Refuses a container that names a file outside of the folders that may be read, whatever else it names.
fn refuse_outside(container: &Container) -> Result<(), LinksError> {
    for shape in container.bodies.iter().flat_map(|body| &body.shapes) {
        if let Geometry::Mesh(MeshUse { file: Err(problem @ FileProblem::Outside { .. }), .. }) = &shape.geometry {
            let Place { source, line, .. } = shape.place;
            return Err(LinksError::Outside {
                path: container.sources[source].clone(),
                line,
                problem: problem.clone(),
            });
        }
    }
    Ok(())
}

/// Per link, the name of its object; and the objects, each of which shows all links that look alike.
fn objects(
    container: &Container,
    scope: &ReadScope,
    warnings: &mut Vec<String>,
) -> (Vec<Option<String>>, BTreeMap<String, LinkShape>) {
    let mut meshes = Meshes::new(scope);
    let mut object_of = Vec::with_capacity(container.bodies.len());
    let (mut known, mut objects): (BTreeMap<String, Option<String>>, _) = (BTreeMap::new(), BTreeMap::new());
    let mut taken = BTreeSet::new();
    for (number, body) in container.bodies.iter().enumerate() {
        if is_world(body) {
            object_of.push(None);
            continue;
        }
        let look = shape::look(body);
        let object = known.entry(look).or_insert_with(|| {
            let shape = shape::of_link(body, &mut meshes, warnings)?;
            let name = file_name(&body.name, number, &mut taken);
            objects.insert(name.clone(), shape);
            Some(name)
        });
        object_of.push(object.clone());
    }
    (object_of, objects)
}

/// True for the surroundings of an MJCF, such as its floor.
fn is_world(body: &Body) -> bool {
    body.parent.is_none() && body.mobility == Mobility::Static && body.name == "world"
}

/// A name for the files of a link: that of the link without what file systems or the shell may stumble over, and no name twice.
fn file_name(link: &str, number: usize, taken: &mut BTreeSet<String>) -> String {
    const LONGEST: usize = 64;
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let plain: String = link.chars().map(|c| if is_plain(c) { c } else { '_' }).take(LONGEST).collect();
    let is_reserved = plain.is_empty() || plain.eq_ignore_ascii_case(crate::workdir::DEFAULT_NAME);
    let plain = if is_reserved { format!("link_{number}") } else { plain };
    let others = (number..).map(|number| format!("{plain}_{number}"));
    // File systems may not tell capitals apart.
    let free = std::iter::once(plain.clone()).chain(others).find(|name| taken.insert(name.to_lowercase()));
    free.expect("there are more numbers than names")
}

impl std::fmt::Display for Prepared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let links = self.object_of.iter().flatten().count();
        write!(f, "{} with a shape, of which {} differ", counted(links, "link"), self.object_count())
    }
}
