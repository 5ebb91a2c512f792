//! The settings of segmentation: those of the public mask generator, with the meaning that its authors give them, those
//! of the paper's culling, and gprop's own.

use std::path::PathBuf;

use serde::Serialize;

use super::Level;
use super::formats::Format;
use crate::config::SceneKey;
use crate::config::option_values::{self, Domain, OptionError, below, from_to};

/// The keys that a scene may set: those that decide how its photos are cut into segments. Only the user decides which
/// additional formats are written and what is cached.
pub const SCENE_KEYS: &[SceneKey] = &[
    SceneKey::any("level"),
    SceneKey::any("point-prompts"),
    SceneKey::path("segments"),
    SceneKey::any("points-per-side"),
    SceneKey::any("min-predicted-iou"),
    SceneKey::any("min-stability"),
    SceneKey::any("stability-offset"),
    SceneKey::any("box-nms"),
    SceneKey::any("crop-layers"),
    SceneKey::any("crop-nms"),
    SceneKey::any("crop-overlap"),
    SceneKey::any("crop-points-downscale"),
    SceneKey::any("min-region-area"),
    SceneKey::any("crop-to-foreground"),
    SceneKey::any("crop-margin"),
    SceneKey::any("whole-object"),
    SceneKey::any("cull-iou"),
    SceneKey::any("cull-score"),
    SceneKey::any("cull-inner"),
];

/// SAM's logits lie between -40 and 40 or so: with thresholds farther apart than this, nothing is left to compare.
const LOGIT: Domain<f32> = from_to(0.0, 100.0);
/// Pixels of the largest picture that gprop decodes: 20,000 x 20,000.
const PIXELS: Domain<u32> = from_to(0, 400_000_000);
/// With a margin of ten times its longer side, the box covers the whole picture unless the object is tiny in it.
const MARGIN: Domain<f64> = from_to(0.0, 10.0);
const TO_256: Domain<u32> = from_to(1, 256);
const LAYERS: Domain<u32> = from_to(0, 4);
const SCORE: Domain<f32> = from_to(0.0, 1.0);
const SHARE: Domain<f64> = from_to(0.0, 1.0);
const OVERLAP: Domain<f64> = below(0.0, 1.0);

/// How views are segmented.
#[derive(Debug, Clone, PartialEq, Serialize, clap::Args)]
#[command(next_help_heading = "Segmentation")]
#[group(skip)]
pub struct Options {
    /// Use only one of SAM's three levels, as flat segments for --ask segments (middle in the paper) [default: all three, as
    /// nested segments; for a single picture, middle]
    #[arg(long, value_enum)]
    pub level: Option<Level>,
    /// Where SAM is prompted: adaptively on the object, or at every point of the grid. `gprop evaluate prompts` measures what
    /// adaptive prompts cost in quality
    #[arg(long, value_enum, default_value_t = PointPrompts::Adaptive)]
    pub point_prompts: PointPrompts,
    /// Take the segments of every chosen view from this folder instead of SAM: VIEW.png (grey, 0 for background) or
    /// VIEW_s.npy (ids as LangSplat writes them, -1 for background)
    #[arg(long, value_name = "DIR", value_parser = option_values::folder())]
    pub segments: Option<PathBuf>,
    /// Also write the label maps in these formats
    #[arg(long, value_name = "FORMAT,...", value_enum, value_delimiter = ',')]
    pub also: Vec<Format>,
    /// Implementation of SAM's mask decoder [default: gprop itself if it can, else ONNX Runtime]
    // Left out of the keys of stored results unless it is set.
    #[arg(long, value_enum)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decoder: Option<DecoderRuntime>,
    /// Keep the output of SAM's encoder in the cache, for runs with other settings (4 MB per picture)
    #[arg(long)]
    pub cache_embeddings: bool,
    #[command(flatten)]
    pub generator: GeneratorOptions,
    #[command(flatten)]
    pub selection: SelectionOptions,
}

/// The grid points at which SAM is prompted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum PointPrompts {
    /// At every point, as in the public generator.
    Grid,
    /// On the foreground only: every fourth row and column first, then the points between them, except those that the masks
    /// of two nearby prompts cover.
    Adaptive,
}

/// The implementation of SAM's mask decoder. Masks differ by rounding only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum DecoderRuntime {
    /// gprop itself, with a third of ONNX Runtime's work; fails if gprop does not know the network in the file, or if a
    /// trial differs from ONNX Runtime.
    Native,
    /// ONNX Runtime, from the file as it is.
    #[value(name = "onnxruntime")]
    OnnxRuntime,
}

/// SAM's automatic mask generator. Names in parentheses are those of the public `SamAutomaticMaskGenerator`; the
/// defaults are those of the paper's code, except that there are no crop layers (the paper's code uses one).
#[derive(Debug, Clone, PartialEq, Serialize, clap::Args)]
#[group(skip)]
pub struct GeneratorOptions {
    /// Point prompts along each side of the grid (points_per_side)
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = TO_256)]
    pub points_per_side: u32,
    /// Minimum IoU that SAM predicts for a mask (pred_iou_thresh)
    #[arg(long, value_name = "IOU", default_value_t = 0.7, value_parser = SCORE)]
    pub min_predicted_iou: f32,
    /// Minimum stability: IoU of the masks at a stricter and a laxer threshold (stability_score_thresh)
    #[arg(long, value_name = "RATIO", default_value_t = 0.85, value_parser = SCORE)]
    pub min_stability: f32,
    /// Distance of those two thresholds from the mask's own, in logits (stability_score_offset)
    #[arg(long, value_name = "LOGIT", default_value_t = 1.0, value_parser = LOGIT)]
    pub stability_offset: f32,
    /// If the boxes of two masks overlap by more than this IoU, keep only the better mask (box_nms_thresh)
    #[arg(long, value_name = "IOU", default_value_t = 0.7, value_parser = SCORE)]
    pub box_nms: f32,
    /// Layers of crops to segment besides the whole picture; layer i has 4^i crops (crop_n_layers; 1 in the paper's code)
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = LAYERS)]
    pub crop_layers: u32,
    /// Like --box-nms, between masks of different crops (crop_nms_thresh)
    #[arg(long, value_name = "IOU", default_value_t = 0.7, value_parser = SCORE)]
    pub crop_nms: f32,
    /// Overlap of neighbouring crops, as a fraction of the picture's shorter side (crop_overlap_ratio)
    #[arg(long, value_name = "SHARE", default_value_t = 512.0 / 1500.0, value_parser = OVERLAP)]
    pub crop_overlap: f64,
    /// Factor by which the points per side shrink with each layer of crops (crop_n_points_downscale_factor)
    #[arg(long, value_name = "FACTOR", default_value_t = 1, value_parser = TO_256)]
    pub crop_points_downscale: u32,
    /// Remove holes, islands and segments of fewer pixels (min_mask_region_area)
    #[arg(long, value_name = "PIXELS", default_value_t = 300, value_parser = PIXELS)]
    pub min_region_area: u32,
}

/// Which of SAM's masks are segments of the object.
#[derive(Debug, Clone, PartialEq, Serialize, clap::Args)]
#[group(skip)]
pub struct SelectionOptions {
    /// Segment the foreground's bounding box instead of the whole picture, to spend the grid and SAM's resolution on the object
    #[arg(long, value_name = "BOOL", default_value_t = true, action = clap::ArgAction::Set)]
    pub crop_to_foreground: bool,
    /// Margin around that box on each side, as a fraction of its longer side
    #[arg(long, value_name = "SHARE", default_value_t = 0.1, value_parser = MARGIN)]
    pub crop_margin: f64,
    /// Masks that cover at least this fraction of the foreground are the whole object: flat segments leave them out, and
    /// adaptive prompts ignore them
    #[arg(long, value_name = "SHARE", default_value_t = 0.9, value_parser = SHARE)]
    pub whole_object: f64,
    /// For flat segments: if two masks overlap by more than this IoU, keep only the one with the better score (the
    /// paper's iou_thr)
    #[arg(long, value_name = "IOU", default_value_t = 0.8, value_parser = SHARE)]
    pub cull_iou: f64,
    /// Minimum score of a flat segment, IoU times stability (score_thr); the best 3 stay if none has it
    #[arg(long, value_name = "SCORE", default_value_t = 0.7, value_parser = SHARE)]
    pub cull_score: f64,
    /// For flat segments, remove a mask that lies at least 85 % inside another and covers less than half of it, if
    /// (overlap / its area) x (overlap / the other's area) is below this value (the paper's inner_thr)
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, value_parser = SHARE)]
    pub cull_inner: f64,
}

impl Options {
    /// Checks that every number is within its domain.
    ///
    /// # Errors
    /// [`OptionError`], which names the option.
    pub fn check(&self) -> Result<(), OptionError> {
        self.generator.check()?;
        self.selection.check()
    }

    /// The level of segments that are not nested.
    pub fn flat_level(&self) -> Level {
        self.level.unwrap_or_default()
    }

    /// The options without those that change nothing about the segments, and without the path of the folder from which
    /// they are taken: its content decides.
    pub fn deciding(&self) -> Self {
        Self { also: Vec::new(), cache_embeddings: false, segments: None, ..self.clone() }
    }
}

impl GeneratorOptions {
    /// Checks that every number is within its domain.
    ///
    /// # Errors
    /// [`OptionError`], which names the option.
    pub fn check(&self) -> Result<(), OptionError> {
        TO_256.check("--points-per-side", self.points_per_side)?;
        SCORE.check("--min-predicted-iou", self.min_predicted_iou)?;
        SCORE.check("--min-stability", self.min_stability)?;
        LOGIT.check("--stability-offset", self.stability_offset)?;
        SCORE.check("--box-nms", self.box_nms)?;
        LAYERS.check("--crop-layers", self.crop_layers)?;
        SCORE.check("--crop-nms", self.crop_nms)?;
        OVERLAP.check("--crop-overlap", self.crop_overlap)?;
        TO_256.check("--crop-points-downscale", self.crop_points_downscale)?;
        PIXELS.check("--min-region-area", self.min_region_area)
    }
}

impl SelectionOptions {
    /// Checks that every number is within its domain.
    ///
    /// # Errors
    /// [`OptionError`], which names the option.
    pub fn check(&self) -> Result<(), OptionError> {
        MARGIN.check("--crop-margin", self.crop_margin)?;
        SHARE.check("--whole-object", self.whole_object)?;
        SHARE.check("--cull-iou", self.cull_iou)?;
        SHARE.check("--cull-score", self.cull_score)?;
        SHARE.check("--cull-inner", self.cull_inner)
    }
}

impl Default for Options {
    fn default() -> Self {
        option_values::defaults()
    }
}

impl Default for GeneratorOptions {
    fn default() -> Self {
        option_values::defaults()
    }
}

impl Default for SelectionOptions {
    fn default() -> Self {
        option_values::defaults()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoder(typed: &[&str]) -> Result<Option<DecoderRuntime>, clap::Error> {
        option_values::typed::<Options>(typed).map(|options| options.decoder)
    }

    #[test]
    fn the_decoder_is_gprops_choice_unless_it_is_named() {
        assert_eq!(decoder(&[]).unwrap(), None);
        assert_eq!(decoder(&["--decoder", "native"]).unwrap(), Some(DecoderRuntime::Native));
        assert_eq!(decoder(&["--decoder", "onnxruntime"]).unwrap(), Some(DecoderRuntime::OnnxRuntime));
        assert!(decoder(&["--decoder", "fast"]).unwrap_err().to_string().contains("native, onnxruntime"));
    }

    /// Results of runs without the option stay valid, and those with it are never reused for another decoder.
    #[test]
    fn a_decoder_is_part_of_the_key_only_if_it_is_named() {
        let key = |decoder| serde_json::to_value(Options { decoder, ..Options::default() }.deciding()).unwrap();
        assert_eq!(key(None).get("decoder"), None);
        assert_eq!(key(Some(DecoderRuntime::OnnxRuntime))["decoder"], "onnxruntime");
    }
}
