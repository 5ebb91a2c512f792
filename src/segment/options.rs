//! The settings of segmentation: those of the public mask generator under its authors' meaning, those of the paper's
//! culling, and gprop's own.

use std::path::PathBuf;

use serde::Serialize;

use super::Level;
use super::formats::Format;

/// How views are segmented.
#[derive(Debug, Clone, PartialEq, Serialize, clap::Args)]
#[command(next_help_heading = "Segmentation")]
#[group(skip)]
pub struct Options {
    /// Which of SAM's three nested masks of a prompt are the parts (the paper's choice, with SAM ViT-H: middle). With the
    /// fetched MobileSAM, middle often joins parts of different materials that small keeps apart
    #[arg(long, value_enum, default_value_t = Level::Middle)]
    pub level: Level,
    /// Where SAM is asked: on the object and there only as densely as need be, or at every point of the grid. What the first
    /// costs in quality, if anything, `gprop evaluate prompts` measures
    #[arg(long, value_enum, default_value_t = Prompts::Adaptive)]
    pub prompts: Prompts,
    /// Take the parts from this folder instead of SAM: VIEW.png (a grey label map, 0 background) or VIEW_s.npy (int32 ids, -1
    /// background) for every chosen view
    #[arg(long, value_name = "DIR")]
    pub segments: Option<PathBuf>,
    /// Also write the label maps in these forms
    #[arg(long, value_name = "FORM,...", value_enum, value_delimiter = ',')]
    pub also: Vec<Format>,
    /// Keep what SAM's encoder makes of a picture in the cache, for runs with other settings
    #[arg(long)]
    pub cache_embeddings: bool,
    #[command(flatten)]
    pub generator: GeneratorOptions,
    #[command(flatten)]
    pub parts: PartOptions,
}

/// Which points of the grid SAM is asked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Prompts {
    /// All of them, as the public generator does.
    Grid,
    /// Those on the foreground: every other row and column first, then what no mask of a neighbouring prompt covers.
    Adaptive,
}

/// SAM's automatic mask generator. Names in parentheses are those of the public `SamAutomaticMaskGenerator`; the
/// defaults are the paper's code's.
#[derive(Debug, Clone, PartialEq, Serialize, clap::Args)]
#[group(skip)]
pub struct GeneratorOptions {
    /// Point prompts along each side of the grid (points_per_side)
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..=256))]
    pub points_per_side: u32,
    /// Least quality that SAM itself predicts of a mask (pred_iou_thresh)
    #[arg(long, value_name = "IOU", default_value_t = 0.7)]
    pub min_predicted_iou: f32,
    /// Least ratio of a mask's areas at a stricter and a laxer threshold (stability_score_thresh)
    #[arg(long, value_name = "RATIO", default_value_t = 0.85)]
    pub min_stability: f32,
    /// Distance of those two thresholds from the mask's, in logits (stability_score_offset)
    #[arg(long, value_name = "LOGIT", default_value_t = 1.0)]
    pub stability_offset: f32,
    /// Of two masks whose boxes overlap by more than this IoU the better stays (box_nms_thresh)
    #[arg(long, value_name = "IOU", default_value_t = 0.7)]
    pub box_nms: f32,
    /// Layers of crops that are segmented besides the whole picture; layer i has 4^i (crop_n_layers)
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=4))]
    pub crop_layers: u32,
    /// As --box-nms, between crops (crop_nms_thresh)
    #[arg(long, value_name = "IOU", default_value_t = 0.7)]
    pub crop_nms: f32,
    /// Overlap of neighbouring crops as a share of the picture's shorter side (crop_overlap_ratio)
    #[arg(long, value_name = "SHARE", default_value_t = 512.0 / 1500.0)]
    pub crop_overlap: f64,
    /// By how much each layer of crops has fewer points a side (crop_n_points_downscale_factor)
    #[arg(long, value_name = "FACTOR", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub crop_points_downscale: u32,
    /// Holes, islands and parts of fewer pixels are removed (min_mask_region_area)
    #[arg(long, value_name = "PIXELS", default_value_t = 300)]
    pub min_region_area: u32,
}

/// From SAM's masks to the parts of an object.
#[derive(Debug, Clone, PartialEq, Serialize, clap::Args)]
#[group(skip)]
pub struct PartOptions {
    /// Segment the foreground's bounding box instead of the whole picture, so that the grid and SAM's resolution serve the object
    #[arg(long, value_name = "BOOL", default_value_t = true, action = clap::ArgAction::Set)]
    pub crop_to_foreground: bool,
    /// What that box has around it on each side, as a share of its longer side
    #[arg(long, value_name = "SHARE", default_value_t = 0.1)]
    pub crop_margin: f64,
    /// A mask that covers this share of the foreground is the whole object and no part of it
    #[arg(long, value_name = "SHARE", default_value_t = 0.9)]
    pub whole_object: f64,
    /// Of two masks that overlap by more than this IoU the one with the better score stays (the paper's iou_thr)
    #[arg(long, value_name = "IOU", default_value_t = 0.8)]
    pub cull_iou: f64,
    /// Least predicted IoU times stability of a part (the paper's score_thr)
    #[arg(long, value_name = "SCORE", default_value_t = 0.7)]
    pub cull_score: f64,
    /// A mask inside one at least twice its size goes where 1 - overlap/area x overlap/other area exceeds one minus this
    /// (the paper's inner_thr)
    #[arg(long, value_name = "SHARE", default_value_t = 0.5)]
    pub cull_inner: f64,
}

impl Options {
    /// The options without those that change nothing about the parts.
    pub fn deciding(&self) -> Self {
        Self { also: Vec::new(), cache_embeddings: false, ..self.clone() }
    }
}

/// What the command line gives where it says nothing: the defaults stand in one place.
#[derive(clap::Parser)]
struct NothingSaid {
    #[command(flatten)]
    options: Options,
}

impl Default for Options {
    fn default() -> Self {
        <NothingSaid as clap::Parser>::parse_from(["gprop"]).options
    }
}

impl Default for GeneratorOptions {
    fn default() -> Self {
        Options::default().generator
    }
}

impl Default for PartOptions {
    fn default() -> Self {
        Options::default().parts
    }
}
