//! Options of the scene.

use std::fmt;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use nalgebra::Point3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::scale::{ScaleChoice, point};
use crate::config::SceneKey;
use crate::config::as_typed::as_typed;
use crate::config::option_values::{self, Domain, OptionError, check_typed, from_to};
use crate::files::read_scope::ReadScope;
use crate::gaussians::bounds::Bounds;
use crate::scene::cameras::align::Align;
use crate::scene::object::choice::ObjectChoice;
use crate::scene::object::photo_point::PhotoPoint;
use crate::scene::photos::mask_color::MaskChoice;
use crate::scene::splat::QuaternionOrder;
use crate::scene::up::choice::UpChoice;

/// The keys that a scene may set: where its own files are, which views show it best, its frame, its object and its
/// scale. Only the user may allow files outside its folder to be read.
pub const SCENE_KEYS: &[SceneKey] = &[
    SceneKey::any("views"),
    SceneKey::any("view-list"),
    SceneKey::path("splat"),
    SceneKey::any("quaternions"),
    SceneKey::path("cameras"),
    SceneKey::path("images"),
    SceneKey::path("masks"),
    SceneKey::any("mask-color"),
    SceneKey::any("align"),
    SceneKey::any("up"),
    SceneKey::any("object"),
    SceneKey::any("object-box"),
    SceneKey::any("render-views"),
    SceneKey::with("scale", ScaleChoice::may_be_of_scene, "any other scale"),
];

/// Far more than any capture has, and few enough to be counted in memory.
const MOST_VIEWS: NonZeroUsize = NonZeroUsize::new(100_000).expect("it is not zero");
const VIEWS: Domain<NonZeroUsize> = from_to(NonZeroUsize::MIN, MOST_VIEWS);

/// Number of views used by default.
pub const DEFAULT_VIEWS: NonZeroUsize = NonZeroUsize::new(10).expect("ten is not zero");

/// Where the files of a scene are, which views to use, where the object is, and how long a scene unit is.
#[derive(Debug, Clone, PartialEq, clap::Args, Serialize, Deserialize)]
#[serde(default)]
#[command(next_help_heading = "Scene")]
pub struct Options {
    /// Number of views to use, spread over all directions, chosen from the sharp ones that show the whole object (the paper
    /// uses 10)
    #[arg(long, value_name = "N", default_value_t = DEFAULT_VIEWS, overrides_with = "view_list")]
    #[arg(value_parser = VIEWS)]
    pub views: NonZeroUsize,

    /// Use these views instead of --views: file names of the photos without extension, separated by commas
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', overrides_with = "views")]
    pub view_list: Vec<String>,

    /// Splat file: .ply, .compressed.ply, .spz, .splat, .ksplat, .sog or SOG's meta.json [default: found in the scene
    /// folder]
    #[arg(long, value_name = "FILE", value_parser = option_values::file())]
    pub splat: Option<PathBuf>,

    /// Order in which a PLY splat's rot_0 to rot_3 hold a quaternion; some programs write w last (`gprop inspect` notices)
    #[arg(long, value_enum, value_name = "ORDER", default_value_t)]
    pub quaternions: QuaternionOrder,

    /// Cameras: a transforms.json, a cameras.json of 3DGS, or a folder with a COLMAP model [default: found in the scene
    /// folder]
    #[arg(long, value_name = "PATH", value_parser = option_values::file_or_folder(), overrides_with = "render_views")]
    pub cameras: Option<PathBuf>,

    /// Folder with the photos [default: found in the scene folder]
    #[arg(long, value_name = "DIR", value_parser = option_values::folder(), overrides_with = "render_views")]
    pub images: Option<PathBuf>,

    /// Folder with a mask for each photo, named like the photo [default: those that the camera file names, else masks/
    /// or mask/]
    #[arg(long, value_name = "DIR", value_parser = option_values::folder(), overrides_with = "render_views")]
    pub masks: Option<PathBuf>,

    /// What is the object in the masks: `white`, `black`, `not-black`, or colours separated by commas, each the number of
    /// a grey (0 to 255, such as an object's id) or `#rrggbb`. `auto` compares the masks with the splat and with the middle
    /// of the photos
    #[arg(long, value_name = "COLOR", default_value_t, overrides_with = "render_views")]
    pub mask_color: MaskChoice,

    /// Folder outside the scene to which the scene's links and 3DGS's `cfg_args` may lead; may be given several times.
    /// Nothing else outside the scene is read, except what other flags name
    #[arg(long, value_name = "DIR", value_parser = option_values::folder())]
    #[serde(skip)]
    pub allow_read: Vec<PathBuf>,

    /// Conversion of the cameras to the splat's frame, as `gprop inspect` suggests it: names joined with `+`, or `gsplat` for
    /// the frame that gsplat's trainer computes from a COLMAP model (normalize_world_space)
    #[arg(long, value_name = "NAME[+NAME...]", default_value_t)]
    pub align: Align,

    /// Which way is up in the splat's frame: an axis, a direction, or found (the surface under the objects, else the cameras)
    #[arg(long, value_name = "auto|-y|...|X,Y,Z", default_value_t, allow_hyphen_values = true)]
    pub up: UpChoice,

    /// Object to take of those on a table, by its number in `gprop objects` or by what the model took it for; `gprop run` also
    /// takes `all`
    ///
    /// Of what the model took it for, a word is enough that no other object has: `mug`. The results of object_2 go to
    /// WORK/objects/object_2. With `auto`, the only one is taken; if there are several, `gprop run` and `report` take
    /// all, and other commands want a number
    #[arg(long, value_name = "auto|all|N|NAME", default_value_t, overrides_with_all = ["object_at", "object_box"])]
    pub object: ObjectChoice,

    /// Object to take of those on a table, by a pixel that shows it: a photo's file name without extension, and the pixel from
    /// the left and from the top
    #[arg(long, value_name = "VIEW:X,Y", overrides_with_all = ["object", "object_box"])]
    pub object_at: Option<PhotoPoint>,

    /// Box around the object: two corners in the splat's frame and unit
    #[arg(long, value_name = "X,Y,Z:X,Y,Z", allow_hyphen_values = true, overrides_with_all = ["object", "object_at"])]
    pub object_box: Option<ObjectBox>,

    /// Render this many views from the splat itself instead of using photos
    #[arg(long, value_name = "N", overrides_with_all = ["cameras", "images", "masks", "mask_color"])]
    #[arg(value_parser = VIEWS)]
    pub render_views: Option<NonZeroUsize>,

    /// Length of a scene unit: `metric` (one metre), a factor in metres per scene unit, `known-length:X,Y,Z:X,Y,Z=M` (two
    /// points of the scene and their distance in metres), `bbox:AXIS=M` (a side of the object's box, z is up), `cameras:A,B=M`
    /// (the distance between two views' cameras), `apriltag:FAMILY,ID=M` or `aruco:DICT,ID=M` (the side of a printed
    /// marker that photos show, see `gprop scale board`), `estimate` (the model says how long it is), or `auto` (as the data set
    /// states it, else from --known-mass, else unknown). Lengths may end in mm, cm or m
    #[arg(long, value_name = "auto|metric|F|...", default_value_t)]
    pub scale: ScaleChoice,
}

impl Options {
    /// Checks that every number is within its domain.
    ///
    /// # Errors
    /// [`OptionError`], which names the option.
    pub fn check(&self) -> Result<(), OptionError> {
        VIEWS.check("--views", self.views)?;
        VIEWS.check("--render-views", self.render_views)?;
        self.object_at.as_ref().map_or(Ok(()), PhotoPoint::check)?;
        check_typed("--object-box", self.object_box.as_ref())?;
        check_typed("--scale", &self.scale)
    }

    /// The files that may be read for the scene in `folder` without being named by their own flag.
    pub fn read_scope(&self, folder: &Path) -> ReadScope {
        ReadScope::new(folder).and(self.allow_read.iter().map(PathBuf::as_path))
    }
}

impl Default for Options {
    fn default() -> Self {
        option_values::defaults()
    }
}

/// `--object-box`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectBox(pub Bounds);

impl FromStr for ObjectBox {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let corners = text.split_once(':').and_then(|(a, b)| Some((point(a)?, point(b)?)));
        let (a, b) = corners.ok_or("not two corners X,Y,Z:X,Y,Z in scene units")?;
        let (a, b) = (Point3::from(a), Point3::from(b));
        Ok(Self(Bounds { min: a.inf(&b), max: a.sup(&b) }))
    }
}

impl fmt::Display for ObjectBox {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Bounds { min, max } = self.0;
        write!(f, "{},{},{}:{},{},{}", min.x, min.y, min.z, max.x, max.y, max.z)
    }
}

/// Serialized in the form that users type.
impl Serialize for ObjectBox {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for ObjectBox {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        as_typed(deserializer)
    }
}
