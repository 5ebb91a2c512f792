//! The scene: Gaussians, calibrated photos, metric scale. All input about the scene is read here.
//!
//! [`load`] finds the splat, the cameras and the photos in a folder:
//! 1. [`splat`] finds the file that holds the Gaussians and selects the reader of its format.
//! 2. [`cameras`] finds and reads the camera file and matches each camera with its photo; `align` converts the cameras.
//! 3. [`photos::mask_reading`] decides what the masks mean, from what the splat shows.
//! 4. [`up`] finds which way is up, and the scene is turned so that it is z.
//! 5. `object` separates the object's Gaussians from its surroundings; [outliers](object::outliers) finds those that cannot belong to
//!    any object.
//! 6. `scale` determines the length of a scene unit; a printed [`marker`](Marker) is sought only by [`Scene::scale_in_photos`].
//!
//! A scene may be a mesh instead, a single file: `of_mesh` loads it.
//!
//! [`Scene::chosen_views`] picks the views to work on; [`View::photo`] decodes one; [`dataset`] lists the scenes of a
//! data set.

pub mod cameras;
pub mod dataset;
mod error;
pub mod mesh;
pub mod object;
mod of_mesh;
mod options;
mod photos;
mod reference;
mod scale;
pub mod splat;
pub mod up;

use std::borrow::Cow;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::camera::Camera;
use crate::files;
use crate::gaussians::Gaussians;
use crate::render::render_foregrounds;
use crate::units::MetricScale;
use crate::words::output::counted;
use crate::words::progress::Progress;
use cameras::align::{Align, Conversion};
use cameras::{Registered, dataparser};
pub use object::support::{Plane, SupportSurface};

pub use crate::gaussians::bounds::Bounds;
pub(crate) use crate::gaussians::bounds::robust_bounds;
use crate::gaussians::bounds::{ellipsoid_bounds, least_box, longest_side};
pub use error::{SceneError, SplatProblem};
pub use object::ObjectSource;
pub use object::choice::{ObjectChoice, ObjectNumber};
pub use object::photo_point::PhotoPoint;
pub use of_mesh::{MeshCounts, Origin, SceneMesh};
pub use options::{DEFAULT_VIEWS, ObjectBox, Options, SCENE_KEYS};
pub use photos::flaws::Flaw;
pub use photos::mask_color::{MaskChoice, MaskColor};
pub(crate) use photos::view_names::index_of;
pub use photos::{ForegroundSource, Mask, Photo, Upright};
pub use reference::Reference;
pub use scale::marker::Marker;
pub use scale::marker::board::svg as marker_board;
pub use scale::{ScaleChoice, SizedMarker};
pub use splat::Loaded;
pub use splat::{QuaternionOrder, SPLAT_FORMATS, SplatFormat};
pub use up::choice::UpChoice;
pub use up::{Up, UpSource};

/// The largest error of a length that gives the scale, as a share of it: the scale's interval then ends at ten times the scale,
/// and beyond any bound for larger errors. A side of the object with a larger error is refused; that of a marker is cut off.
const MOST_ERROR: f64 = 0.9;

/// The contents of a scene folder.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The folder's name; of a mesh, its file's without the ending; of one of several objects, with its own name after it.
    pub name: String,
    /// The object's Gaussians; those that are set aside are marked.
    pub gaussians: Gaussians,
    /// The mesh on whose surface the Gaussians lie, if the scene is a mesh.
    pub mesh: Option<Arc<SceneMesh>>,
    /// The Gaussians that are not the object's; none if the splat shows the object alone.
    pub surroundings: Gaussians,
    /// How the two were told apart.
    pub object_source: ObjectSource,
    /// Which way is up in the input's frame. Gaussians and views are in the world's frame, where it is z.
    pub up: Up,
    /// Why that is in doubt, if it is. It is among the warnings.
    pub up_in_doubt: Option<String>,
    /// The level surface on which the object stands, in the world's frame; `None` if none was found, or a box, masks or alpha say
    /// what the object is.
    pub support: Option<SupportSurface>,
    /// The object's Gaussians in the input's frame, bit for bit as they were read; `None` if that is the world's.
    as_read: Option<Gaussians>,
    /// Every view with a camera and a photo, in the order of the camera file.
    pub views: Vec<View>,
    /// The conversion that the views' cameras went through: `--align`.
    pub conversion: Conversion,
    /// All cameras of the camera file before that, and the points that were found with them.
    pub registered: Registered,
    /// `None` if the metric scale is unknown.
    pub scale: Option<MetricScale>,
    /// Every file that was read, apart from the photos and their masks.
    pub files: Vec<PathBuf>,
    /// How many objects stand on the support, if there are several and none of them was chosen: then this is the densest cluster.
    pub unchosen: Option<usize>,
    /// Messages about what was found and chosen.
    pub notes: Vec<String>,
    /// Messages about problems that are not fatal, with counts.
    pub warnings: Vec<String>,
}

/// One photo and its camera.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// From the photo's file name without extension; unique within the scene and safe as a file name.
    pub name: String,
    /// Its intrinsics fit the photo on disk, turned upright if `upright` says so.
    pub camera: Camera,
    pub image: PathBuf,
    /// Whether the photo is rotated according to its EXIF orientation.
    pub upright: Upright,
    pub mask: Option<Mask>,
}

impl Scene {
    /// Where in its file each of a mesh's Gaussians comes from; empty for a splat.
    pub fn origins(&self) -> Vec<Origin> {
        self.mesh.as_ref().map_or_else(Vec::new, |mesh| mesh.origins(&self.gaussians.surface))
    }

    /// The object's Gaussians, then those of its surroundings: all that the photos show.
    pub fn whole_cloud(&self) -> Cow<'_, Gaussians> {
        if self.surroundings.is_empty() {
            return Cow::Borrowed(&self.gaussians);
        }
        let mut cloud = self.gaussians.clone();
        cloud.append(&self.surroundings);
        Cow::Owned(cloud)
    }

    /// The object's Gaussians in the input's frame, as they were read.
    pub fn gaussians_as_read(&self) -> &Gaussians {
        self.as_read.as_ref().unwrap_or(&self.gaussians)
    }

    /// A camera in the input's frame.
    pub fn camera_in_input(&self, camera: &Camera) -> Camera {
        let camera_from_input = camera.camera_from_world * self.up.world_from_input();
        Camera { camera_from_world: camera_from_input, ..camera.clone() }
    }

    /// The same scene with the input's frame as its world's, whatever is up in it.
    pub fn in_input_frame(&self) -> Cow<'_, Self> {
        if self.up.is_z() {
            return Cow::Borrowed(self);
        }
        let mut scene = self.clone();
        let input_from_world = self.up.world_from_input().inverse();
        up::turn::gaussians(&mut scene.surroundings, &input_from_world);
        up::turn::views(&mut scene.views, &input_from_world);
        scene.gaussians.clone_from(self.gaussians_as_read());
        scene.as_read = None;
        scene.up = Up::ASSUMED;
        scene.support = scene.support.map(|support| support.turned(&input_from_world));
        Cow::Owned(scene)
    }

    /// Height of the surface on which the object stands, if it was cut out of what surrounds it.
    fn floor(&self) -> Option<f64> {
        self.support.map(|support| support.plane.offset)
    }

    /// The sides of the least box around the object, the longest first, scene units.
    pub fn least_box(&self) -> [f64; 3] {
        least_box(&self.gaussians, self.floor())
    }

    /// The longest of [`Self::least_box`].
    pub fn longest_side(&self) -> f64 {
        longest_side(&self.gaussians, self.floor())
    }

    /// The box that holds the centres of all opaque Gaussians except a few strays.
    pub fn object_bounds(&self) -> Bounds {
        robust_bounds(&self.gaussians)
    }

    /// How many views have to be rendered, since there are no photos: as many as the options say; of a mesh, as many as are
    /// used. `None` if there are photos.
    pub fn views_to_render(&self, options: &Options) -> Option<NonZeroUsize> {
        options.render_views.or_else(|| self.mesh.as_ref().map(|_| options.views))
    }

    /// The cameras of all views, in their order.
    pub fn cameras(&self) -> Vec<Camera> {
        self.views.iter().map(|view| view.camera.clone()).collect()
    }
}

/// Loads the scene in `folder`: the splat, the cameras, and the size of each photo. With [`Options::render_views`]
/// there are no views yet; they are rendered from the splat. If `folder` is a mesh file, the scene is made of it, and its
/// views are rendered too.
///
/// # Errors
/// [`SceneError`], which says what is missing or broken, where, and what to do.
pub fn load(folder: &Path, options: &Options) -> Result<Scene, SceneError> {
    load_with_progress(folder, options, Progress::HIDDEN)
}

/// As [`load`], showing the progress of what takes seconds in a large scene.
///
/// # Errors
/// As [`load`].
pub fn load_with_progress(folder: &Path, options: &Options, progress: Progress) -> Result<Scene, SceneError> {
    options.check()?;
    if mesh::is_mesh(folder) && folder.is_file() {
        return of_mesh::load(folder, options);
    }
    let options = &*options.with_object_by_number(folder)?;
    let Capture { mut found, gaussians, views, mut as_read, frame } = Capture::read(folder, options)?;
    let means = object::Means {
        object: options.object,
        object_box: options.object_box.as_ref(),
        as_read: as_read.as_ref(),
        support: frame.support_in_world.as_ref(),
    };
    let separated = object::separate(gaussians, &views, &means)?;
    found.notes.push(separated.note);
    found.warnings.extend(separated.unchosen.map(|count| {
        format!(
            "{count} objects stand on the surface that the cameras look at, and this is the densest cluster of Gaussians; `gprop \
             objects SCENE` shows them, --object N takes one"
        )
    }));
    let mut object = separated.object;
    if let Some(as_read) = &mut as_read {
        as_read.retain(&separated.kept);
    }
    // Messages name places, which users look up in the splat.
    match object::outliers::set_aside(as_read.as_mut().unwrap_or(&mut object), progress)? {
        Some(few) if few.are_few() => found.notes.push(format!("{few}; {LOOK_IF_FEW_ARE_SET_ASIDE}")),
        Some(many) => found.warnings.push(format!("{many}; {REMEDY_IF_MANY_ARE_SET_ASIDE}")),
        None => {}
    }
    if let Some(as_read) = &as_read {
        object.set_aside.clone_from(&as_read.set_aside);
    }
    let support = frame.surface_in_world.filter(|surface| {
        matches!(separated.source, ObjectSource::Standing | ObjectSource::Cluster) && up::is_level(&surface.plane)
    });
    let measured = scale::Measured {
        object: &object,
        floor: support.map(|support| support.plane.offset),
        views: &views,
        data_set: found
            .splat_units_per_camera_unit
            .and_then(|units| dataset::convention_of(folder, units * found.conversion.scaling())),
    };
    let (scale, warning) = options.scale.metric_scale(&measured)?;
    found.warnings.extend(warning);
    found.warnings.extend(frame.doubt.clone());
    let folder_name = name_of(folder);
    let name = match options.object {
        ObjectChoice::One(number) if separated.source == ObjectSource::Standing => format!("{folder_name}_{number}"),
        _ => folder_name,
    };
    Ok(Scene {
        name,
        scale,
        gaussians: object,
        mesh: None,
        surroundings: separated.surroundings,
        object_source: separated.source,
        up: frame.up,
        up_in_doubt: frame.doubt,
        support,
        as_read,
        views,
        conversion: found.conversion,
        registered: found.registered,
        files: found.files,
        unchosen: separated.unchosen,
        notes: found.notes,
        warnings: found.warnings,
    })
}

const LOOK_IF_FEW_ARE_SET_ASIDE: &str =
    "nothing needs to be done, unless `gprop inspect SCENE --html FILE` shows that a piece of the object is missing";
const REMEDY_IF_MANY_ARE_SET_ASIDE: &str =
    "if the report shows that something of the object is missing, train the splat again";

impl Options {
    /// The same with the number of the object that `--object-at` points at in the capture in `folder`.
    ///
    /// # Errors
    /// As [`StandingObjects::find`] and [`StandingObjects::at`].
    pub fn with_object_by_number(&self, folder: &Path) -> Result<Cow<'_, Self>, SceneError> {
        let Some(point) = &self.object_at else { return Ok(Cow::Borrowed(self)) };
        let number = StandingObjects::find(folder, self)?.at(point)?;
        Ok(Cow::Owned(Self { object: ObjectChoice::One(number), object_at: None, ..self.clone() }))
    }
}

/// Says that things were left out because they stand too far from what the cameras look at.
fn left_aside(count: usize) -> Option<String> {
    let what = counted(count, "more thing");
    (count > 0).then(|| {
        format!(
            "{what} on the surface, far from what the cameras look at, left out; take photos that go around all of the things, or give \
             --object-box"
        )
    })
}

/// In the place of the number of an object.
const NO_OBJECT: u32 = 0;

/// The things that stand on the surface that a capture shows.
#[derive(Debug, Clone)]
pub struct StandingObjects {
    /// The folder's name.
    pub name: String,
    /// All Gaussians, in the world's frame.
    pub gaussians: Gaussians,
    /// The same in the input's frame, as they were read; `None` if that is the world's.
    as_read: Option<Gaussians>,
    /// For each Gaussian, the number of its object, from 1; 0 if it belongs to none.
    pub object_of_gaussian: Vec<u32>,
    /// Number of objects.
    pub count: usize,
    /// Every view with a camera and a photo, in the order of the camera file.
    pub views: Vec<View>,
    pub up: Up,
    /// The surface, in the input's frame.
    pub support: Plane,
    /// Messages about problems that are not fatal.
    pub warnings: Vec<String>,
}

impl StandingObjects {
    /// Finds them in the scene in `folder`.
    ///
    /// # Errors
    /// As [`load`]; also if nothing tells objects apart, because the photos have masks or no surface is found.
    pub fn find(folder: &Path, options: &Options) -> Result<Self, SceneError> {
        options.check()?;
        if mesh::is_mesh(folder) && folder.is_file() {
            return Err(SceneError::NoSupport("a mesh is one object"));
        }
        let Capture { found, gaussians, views, as_read, frame } = Capture::read(folder, options)?;
        let support = frame.support_in_world;
        let standing = object::standing(&gaussians, &views, support.as_ref())?;
        let input_from_world = frame.up.world_from_input().inverse();
        Ok(Self {
            name: name_of(folder),
            gaussians,
            as_read,
            object_of_gaussian: standing.object_of_gaussian,
            count: standing.count,
            views,
            up: frame.up,
            support: support.ok_or(SceneError::NoSupport("no surface was found"))?.turned(&input_from_world),
            warnings: found.warnings.into_iter().chain(frame.doubt).chain(left_aside(standing.aside)).collect(),
        })
    }

    /// As [`Self::find`] if there are several. The splat is not read if masks or a box say what the object is.
    ///
    /// # Errors
    /// As [`load`].
    pub fn find_several(folder: &Path, options: &Options) -> Result<Option<Self>, SceneError> {
        let is_chosen = options.object_at.is_some() || options.object_box.is_some();
        if !folder.is_dir() || is_chosen || options.render_views.is_some() {
            return Ok(None);
        }
        let mut found = Found::default();
        found.splat(folder, options)?;
        let views = found.views(folder, options)?;
        let has_masks = views.is_empty() || views.iter().any(|view| view.mask.is_some());
        if has_masks || object::own_foreground(&views)? != ForegroundSource::Whole {
            return Ok(None);
        }
        match Self::find(folder, options) {
            Ok(several) if several.count > 1 => Ok(Some(several)),
            Ok(_) | Err(SceneError::NoSupport(_)) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// # Errors
    /// If there are no objects.
    pub fn require_any(&self) -> Result<(), SceneError> {
        match self.count {
            0 => Err(SceneError::NoSupport("nothing stands on the surface that the cameras look at")),
            _ => Ok(()),
        }
    }

    /// For each pixel, row by row, the number of the object that it [shows](render_foregrounds).
    pub fn shown(&self, camera: &Camera) -> Vec<Option<u32>> {
        render_foregrounds(&self.gaussians, camera, &self.object_of_gaussian)
    }

    /// The object that a pixel of a photo shows.
    ///
    /// # Errors
    /// If there is no such view, or the pixel is outside of it or shows no object.
    pub fn at(&self, point: &PhotoPoint) -> Result<ObjectNumber, SceneError> {
        let view = &self.views[index_of(&self.views, &point.view)?];
        let (size, [x, y]) = (view.camera.intrinsics, point.pixel);
        let labels = self.shown(&view.camera);
        let label_at = |x: u32, y: u32| labels[y as usize * size.width as usize + x as usize];
        let shown = (x < size.width && y < size.height).then(|| label_at(x, y)).flatten();
        ObjectNumber::first(self.count).find(|number| shown == Some(number.get())).ok_or_else(|| {
            let middle = |number: ObjectNumber| {
                let mine = (0..size.height).flat_map(|y| (0..size.width).map(move |x| [x, y]));
                let mine: Vec<_> = mine.filter(|[x, y]| label_at(*x, *y) == Some(number.get())).collect();
                let [x, y] = *mine.get(mine.len() / 2)?;
                Some(format!("{number} (such as at {x},{y})"))
            };
            SceneError::NoObjectAt {
                given: point.clone(),
                size: [size.width, size.height],
                shown: ObjectNumber::first(self.count).filter_map(middle).collect(),
            }
        })
    }

    /// The Gaussians of an object, in the world's frame.
    pub fn gaussians_of(&self, object: ObjectNumber) -> Gaussians {
        self.kept(self.gaussians.clone(), object)
    }

    /// The box that holds the ellipsoids of an object's opaque Gaussians except a few strays, in the input's frame.
    pub fn bounds_in_input(&self, object: ObjectNumber) -> Bounds {
        ellipsoid_bounds(&self.kept(self.as_read.as_ref().unwrap_or(&self.gaussians).clone(), object))
    }

    /// The Gaussians of no object, in the world's frame.
    pub fn surroundings(&self) -> Gaussians {
        self.of_number(self.gaussians.clone(), NO_OBJECT)
    }

    /// The same in the input's frame, as they were read.
    pub fn surroundings_as_read(&self) -> Gaussians {
        self.of_number(self.as_read.as_ref().unwrap_or(&self.gaussians).clone(), NO_OBJECT)
    }

    fn kept(&self, gaussians: Gaussians, object: ObjectNumber) -> Gaussians {
        self.of_number(gaussians, object.get())
    }

    fn of_number(&self, mut gaussians: Gaussians, number: u32) -> Gaussians {
        let kept: Vec<bool> = self.object_of_gaussian.iter().map(|of| *of == number).collect();
        gaussians.retain(&kept);
        gaussians
    }
}

/// The folder of a scene: of a mesh file, the one that holds it.
pub fn home(scene: &Path) -> PathBuf {
    if scene.is_dir() { scene.to_owned() } else { scene.parent().unwrap_or(scene).to_owned() }
}

/// Refuses what is not a folder.
fn check_is_folder(path: &Path) -> Result<(), SceneError> {
    match (path.is_dir(), path.exists()) {
        (true, _) => Ok(()),
        (false, true) if mesh::containers::is_robot(path) => Err(SceneError::IsRobot { path: path.to_owned() }),
        (false, true) => Err(SceneError::NotAFolder { path: path.to_owned() }),
        (false, false) => Err(SceneError::NoFolder { path: path.to_owned() }),
    }
}

/// All that a folder shows, turned into the world's frame, before the object is separated from its surroundings.
struct Capture {
    found: Found,
    gaussians: Gaussians,
    views: Vec<View>,
    /// The Gaussians in the input's frame, if that is another.
    as_read: Option<Gaussians>,
    frame: Frame,
}

impl Capture {
    fn read(folder: &Path, options: &Options) -> Result<Self, SceneError> {
        check_is_folder(folder)?;
        let mut found = Found::default();
        let splat_path = found.splat(folder, options)?;
        let mut views = match options.render_views {
            Some(_) => {
                // The file relates the splat to cameras that are not read.
                let align = match options.align {
                    Align::By(conversion) => Some(conversion),
                    Align::Gsplat(_) => None,
                };
                if found.dataparser(folder, None).is_some() || align.is_none() {
                    found.splat_units_per_camera_unit = None;
                }
                found.conversion = align.unwrap_or_default();
                Vec::new()
            }
            None => found.views(folder, options)?,
        };
        let splat = found.read_splat(&splat_path, options)?;
        let mut gaussians = splat.gaussians;
        found.masks(folder, &mut views, &gaussians, options)?;
        let frame = found.frame(&gaussians, &views, &options.up)?;
        let as_read = up::turn::upright(&frame.up, &mut gaussians, &mut views);
        found.notes.extend(frame.up.note());
        Ok(Self { found, gaussians, views, as_read, frame })
    }
}

/// The results collected while loading.
struct Found {
    files: Vec<PathBuf>,
    notes: Vec<String>,
    warnings: Vec<String>,
    /// Splat units per unit of the cameras in their file, without the scale of `--align`: nerfstudio trains in units of
    /// its own. `None` if unknown.
    splat_units_per_camera_unit: Option<f64>,
    conversion: Conversion,
    registered: Registered,
    /// Whether z is up in the splat's frame, as the camera file says.
    z_is_up: bool,
}

/// The world's frame, and what gives it.
struct Frame {
    up: Up,
    doubt: Option<String>,
    support_in_world: Option<Plane>,
    surface_in_world: Option<SupportSurface>,
}

impl Default for Found {
    fn default() -> Self {
        Self {
            files: Vec::new(),
            notes: Vec::new(),
            warnings: Vec::new(),
            splat_units_per_camera_unit: Some(1.0),
            conversion: Conversion::default(),
            registered: Registered::default(),
            z_is_up: false,
        }
    }
}

impl Found {
    fn splat(&mut self, folder: &Path, options: &Options) -> Result<PathBuf, SceneError> {
        let splat::find::Found { path, others, reason } = match &options.splat {
            Some(path) => splat::find::Found { path: path.clone(), others: Vec::new(), reason: None },
            None => {
                let found =
                    splat::find::find(folder).map_err(|error| dataset::instead_of_scene(folder).unwrap_or(error))?;
                let flag = Some(("--splat", found.path.as_path()));
                let splat = Reference { what: "splat", path: &found.path, named_in: None, flag };
                splat.check(&options.read_scope(folder))?;
                found
            }
        };
        let choice = Choice { path: &path, reason: reason.as_deref(), others: &others };
        self.notes.push(choice.note("splat", folder, "--splat"));
        self.files.push(path.clone());
        Ok(path)
    }

    fn read_splat(&mut self, path: &Path, options: &Options) -> Result<Loaded, SceneError> {
        let mut splat = splat::read(path, options.quaternions)?;
        let prefixed = |text: String| format!("`{}`: {text}", path.display());
        self.notes.extend(std::mem::take(&mut splat.notes).into_iter().map(prefixed));
        self.warnings.extend(std::mem::take(&mut splat.warnings).into_iter().map(prefixed));
        self.files.append(&mut splat.files);
        Ok(splat)
    }

    fn views(&mut self, folder: &Path, options: &Options) -> Result<Vec<View>, SceneError> {
        let scope = options.read_scope(folder);
        let chosen = cameras::choose(folder, options.cameras.as_deref(), &scope)?;
        let choice = chosen.source;
        if options.cameras.is_none() {
            choice.check(folder, &scope)?;
        }
        let said = Choice { path: &choice.path, reason: chosen.reason.as_deref(), others: &chosen.others };
        self.notes.push(said.note("cameras", folder, "--cameras"));
        let (mut capture, files) = cameras::read(&choice)?;
        self.notes.append(&mut capture.notes);
        self.files.extend(files);
        let moved = self.follow_dataparser(folder, options, &choice, &mut capture)?;
        let named = options.cameras.as_deref();
        let registered = Registered::of(&capture, &choice, &options.read_scope(folder).and(named));
        self.registered = if moved { registered.without_points() } else { registered };
        self.conversion = self.registered.conversion(&options.align)?;
        self.z_is_up = !moved && self.conversion.is_none() && (capture.z_is_up || dataset::is_of_abo(folder));
        let places = cameras::Places::of(folder, &choice, options);
        let found = photos::find::find_photos(&choice.path, &capture.frames, &places)?;
        self.warnings.extend(found.warnings);
        self.notes.extend(found.notes);
        let mut views = found.views;
        if !self.conversion.is_none() {
            self.notes.push(format!("cameras converted by --align {}", options.align));
            for view in &mut views {
                view.camera.camera_from_world = self.conversion.apply(&view.camera.camera_from_world);
            }
        }
        if matches!(options.align, Align::Gsplat(_)) {
            self.files.extend(self.registered.points().map(Path::to_owned));
        }
        Ok(views)
    }

    /// Finds which way is up, and the support.
    fn frame(&mut self, gaussians: &Gaussians, views: &[View], choice: &UpChoice) -> Result<Frame, SceneError> {
        let cameras = up::cameras::up(views);
        let may_have_support = !views.is_empty() && object::own_foreground(views)? == ForegroundSource::Whole;
        let focus =
            may_have_support.then(|| object::support::Focus::of(gaussians, &object::support::poses(views))).flatten();
        let support = focus.as_ref().and_then(|focus| focus.support(cameras.as_ref()));
        let surface = focus.zip(support).and_then(|(focus, support)| focus.support_surface(support));
        let evidence = up::Evidence { choice, z_by_convention: self.z_is_up, cameras, support: support.as_ref() };
        let up = up::find(&evidence);
        self.warnings.extend(up::upside_down(&up, cameras.as_ref()));
        Ok(Frame {
            up,
            doubt: up::doubt(&up, cameras.as_ref()),
            support_in_world: support.map(|support| support.turned(&up.world_from_input())),
            surface_in_world: surface.map(|surface| surface.turned(&up.world_from_input())),
        })
    }

    /// Decides how the masks are read.
    fn masks(
        &mut self,
        folder: &Path,
        views: &mut [View],
        gaussians: &Gaussians,
        options: &Options,
    ) -> Result<(), SceneError> {
        let told = photos::mask_reading::decide(folder, views, gaussians, &options.mask_color)?;
        self.notes.extend(told.notes);
        self.warnings.extend(told.warnings);
        Ok(())
    }

    /// Applies a `dataparser_transforms.json` beside the splat or the cameras, which belongs to both; false if there is none.
    fn follow_dataparser(
        &mut self,
        folder: &Path,
        options: &Options,
        choice: &cameras::CameraSource,
        capture: &mut cameras::Capture,
    ) -> Result<bool, SceneError> {
        let Some(path) = self.dataparser(folder, Some(&choice.path)) else { return Ok(false) };
        // The user allows the files beside those that a flag names.
        let named = [options.splat.as_deref(), options.cameras.as_ref().map(|_| choice.path.as_path())];
        let scope = options.read_scope(folder).and(named.into_iter().flatten().filter_map(Path::parent));
        Reference { what: "camera file", path: &path, named_in: None, flag: None }.check(&scope)?;
        let splat_from_input = dataparser::read(&path)?;
        self.splat_units_per_camera_unit = Some(splat_from_input.scaling() / capture.applied.scale);
        dataparser::follow(capture, &splat_from_input);
        self.notes.push(format!("cameras brought into the splat's frame by `{}`", path.display()));
        self.files.push(path);
        Ok(true)
    }

    /// The `dataparser_transforms.json` beside the splat, the camera file or in the scene's folder.
    fn dataparser(&self, folder: &Path, cameras: Option<&Path>) -> Option<PathBuf> {
        let beside = self.files[0].parent().into_iter().chain(cameras.and_then(Path::parent)).chain([folder]);
        beside.map(|folder| folder.join(dataparser::FILE)).find(|path| files::is_there(path))
    }
}

/// A file that was chosen, and those that might have been.
struct Choice<'a> {
    path: &'a Path,
    /// Why this one, if it is one of several alike.
    reason: Option<&'a str>,
    others: &'a [PathBuf],
}

impl Choice<'_> {
    /// The note that names the file, and `flag`, by which the user can choose another one.
    fn note(&self, what: &str, folder: &Path, flag: &str) -> String {
        const MOST_NAMED: usize = 4;
        let short = |path: &Path| format!("`{}`", path.strip_prefix(folder).unwrap_or(path).display());
        let mut note = format!("{what}: {}", short(self.path));
        if let Some(reason) = self.reason {
            note.push_str(&format!(", {reason}"));
        }
        if !self.others.is_empty() {
            let mut others: Vec<String> = self.others.iter().take(MOST_NAMED).map(|path| short(path)).collect();
            if self.others.len() > MOST_NAMED {
                others.push(format!("{} more", self.others.len() - MOST_NAMED));
            }
            note.push_str(&format!(" (also there: {}; {flag} chooses)", others.join(", ")));
        }
        note
    }
}

/// The folder's own name, even if it was given as `.`.
fn name_of(folder: &Path) -> String {
    let absolute = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    absolute.file_name().map_or_else(|| "scene".to_owned(), |name| name.to_string_lossy().into_owned())
}
