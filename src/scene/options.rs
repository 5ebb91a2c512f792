//! What the user may choose about a scene.

use std::fmt;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::str::FromStr;

use nalgebra::Point3;
use serde::{Serialize, Serializer};

use super::align::Conversion;
use super::bounds::Bounds;
use super::choose::DEFAULT_VIEWS;
use super::scale::{ScaleChoice, point};

/// Where the parts of a scene lie, which views to use, where the object is, and how long a scene unit is.
#[derive(Debug, Clone, PartialEq, clap::Args, Serialize)]
#[command(next_help_heading = "Scene")]
pub struct Options {
    /// How many views to use, chosen spread over all directions among the sharp ones that show the whole object (the paper's
    /// ablation levels off near 10)
    #[arg(long, value_name = "N", default_value_t = DEFAULT_VIEWS, overrides_with = "view_list")]
    pub views: NonZeroUsize,

    /// Use just these views instead of --views: the photos' file names without extension, separated by commas
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', overrides_with = "views")]
    pub view_list: Vec<String>,

    /// The splat, where it is not found by itself: .ply, .compressed.ply, .spz or .splat
    #[arg(long, value_name = "FILE")]
    pub splat: Option<PathBuf>,

    /// The cameras, where they are not found by themselves or others are wanted: a transforms.json, a cameras.json of 3DGS, or
    /// a folder with a COLMAP model
    #[arg(long, value_name = "PATH")]
    pub cameras: Option<PathBuf>,

    /// The folder with the photos, where it is not found by itself
    #[arg(long, value_name = "DIR")]
    pub images: Option<PathBuf>,

    /// A folder with a mask for each photo (white on the object), named as the photo
    #[arg(long, value_name = "DIR")]
    pub masks: Option<PathBuf>,

    /// What brings the cameras into the splat's frame, as `gprop inspect` suggests it: names joined with `+`
    #[arg(long, value_name = "NAME[+NAME...]", default_value_t)]
    pub align: Conversion,

    /// Where the object is: two corners of a box in scene units. Where photos have neither alpha nor masks and no box is
    /// given, the densest cluster of Gaussians that the cameras look at is the object
    #[arg(long, value_name = "X,Y,Z:X,Y,Z", allow_hyphen_values = true)]
    pub object_box: Option<ObjectBox>,

    /// Render this many views from the splat itself instead of using photos
    #[arg(long, value_name = "N", conflicts_with_all = ["cameras", "images", "masks"])]
    pub render_views: Option<NonZeroUsize>,

    /// How long a scene unit is: `metric` (metres), a factor in metres per scene unit, `known-length:X,Y,Z:X,Y,Z=M` (two points
    /// of the scene and their distance in metres), `bbox:AXIS=M` (a side of the object's box), `cameras:A,B=M` (the
    /// distance of two views' cameras), or `auto`: what the data set states, and unknown where it states nothing
    #[arg(long, value_name = "auto|metric|F|...", default_value_t)]
    pub scale: ScaleChoice,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            views: DEFAULT_VIEWS,
            view_list: Vec::new(),
            splat: None,
            cameras: None,
            images: None,
            masks: None,
            align: Conversion::default(),
            object_box: None,
            render_views: None,
            scale: ScaleChoice::default(),
        }
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

/// Written as it is typed.
impl Serialize for ObjectBox {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
