//! Decides what the masks of a scene mean: which of their values are the object's, and which way up they lie.
//!
//! 1. A few views are sampled: their masks, reduced, and what the splat shows from their cameras.
//! 2. The usual reading is white or, in masks that are dark or coloured, all but black. Another reading replaces it only if it
//!    fits what the splat shows and the usual one does not.
//! 3. If no reading fits the splat, the middle of the photos decides, where the object is, against their border, where it is
//!    not: the cameras may need a conversion, or the splat may be another.
//! 4. A mask without an EXIF orientation beside a photo that has one may lie like the photo as it is stored or like the photo
//!    turned upright. Its shape decides, else the splat does.
//!
//! Masks that would hide everything are an error.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use image::metadata::Orientation;
use image::{GrayImage, RgbImage};

use super::mask::{Mask, Stored};
use super::mask_color::{Color, MaskChoice, MaskColor, in_words, is_grey};
use super::mask_lying::{Fits, Lying};
use super::{ALONE_LIMIT, Upright, VIEW_LIMIT, header};
use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::numeric::evenly;
use crate::parallel;
use crate::render::{Colors, FOREGROUND_ALPHA, RenderOptions, render};
use crate::scene::error::MasksHideAll;
use crate::scene::object::cluster::looked_at;
use crate::scene::{SceneError, View};
use crate::words::output::agreeing;

/// The number of views that are sampled.
const SAMPLES: usize = 8;
/// Longest side of a reduced mask in pixels.
const SIDE: u32 = 96;
/// A mask with more colours than this is no map of objects.
const MOST_COLORS: usize = 64;
/// The number of colours that a message names.
const MOST_COLORS_NAMED: usize = 8;
/// A reading that overlaps the splat by less than this (IoU) does not fit. Masks that fit reach 0.9, those of thin objects with
/// cameras that are a little off 0.6; a wrong reading of an object that fills half of the picture stays at 0.3.
const LEAST_FIT: f64 = 0.5;
/// The gain in overlap by which an unusual reading, or an orientation, has to be better.
const LEAST_GAIN: f64 = 0.1;
/// The share of the picture that a splat of one object covers at most; a splat that covers more shows the room too.
const MOST_OF_OBJECT: f64 = 0.75;
/// The difference between the shares of the object in the middle and at the border of the photos that tells one from the other.
const LEAST_IN_MIDDLE: f64 = 0.2;
/// The middle reaches from here to here of each side, and the border is as wide as this share of it.
const MIDDLE: (f64, f64) = (0.4, 0.6);
const BORDER: f64 = 0.05;

/// What the user is told about the masks.
#[derive(Debug, Default)]
pub(in crate::scene) struct Told {
    pub notes: Vec<String>,
    pub warnings: Vec<String>,
}

/// Decides how the masks of the `views` of the scene in `folder` are read.
pub(in crate::scene) fn decide(
    folder: &Path,
    views: &mut [View],
    gaussians: &Gaussians,
    choice: &MaskChoice,
) -> Result<Told, SceneError> {
    let masked: Vec<usize> = (0..views.len()).filter(|view| views[*view].mask.is_some()).collect();
    if masked.is_empty() {
        return Ok(Told::default());
    }
    let mut samples = sampled(views, &evenly(&masked, SAMPLES).copied().collect::<Vec<_>>())?;
    if matches!(choice, MaskChoice::Auto) || samples.iter().any(Sample::is_ambiguous) {
        let splat = shown(views, &samples, gaussians);
        samples.iter_mut().zip(splat).for_each(|(sample, splat)| sample.splat = splat);
    }
    let Reading { color, why } = match choice {
        MaskChoice::Given(color) => Reading { color: color.clone(), why: "as --mask-color says".to_owned() },
        MaskChoice::Auto => reading(&samples),
    };
    let turns = Turns::of(&samples, &color);
    let mut unclear = Vec::new();
    for mask in views.iter_mut().filter_map(|view| view.mask.as_mut()) {
        mask.orientation = turns.orientation(&mask.lying);
        mask.color = color.clone();
        if mask.lying.fits == Fits::Both && turns.turned.is_none() {
            unclear.push(mask.path.clone());
        }
    }
    let short = |path: &Path| path.strip_prefix(folder).unwrap_or(path).display().to_string();
    let first = views[masked[0]].mask.as_ref().map(|mask| short(&mask.path)).unwrap_or_default();
    let mut told = Told::default();
    told.notes.push(format!("masks: {}, first `{first}`; {}, {why}", masked.len(), in_words(&color)));
    told.notes.extend(turns.note());
    told.warnings.extend(hidden(views, &masked, &samples, &color)?);
    if let Some(first) = unclear.first() {
        told.warnings.push(format!(
            "{} no EXIF orientation beside a photo that has one, and nothing tells which way up {} (first: `{}`); taken to lie \
             like the photo as gprop uses it. If that is wrong, turn the mask",
            agreeing(unclear.len(), "a mask has", "masks have"),
            agreeing(unclear.len(), "it lies", "they lie"),
            short(first),
        ));
    }
    Ok(told)
}

/// How the mask of a photo without a camera is read: as usual, since one picture cannot tell white from black.
pub(super) fn alone(photo: &Path, mask: &Path, size: (u32, u32)) -> Result<Mask, SceneError> {
    let lying = Lying::of(header(photo)?.orientation(), Upright::Turned, mask, size)?;
    if lying.fits == Fits::Both {
        tracing::warn!(
            "mask {mask:?} has no EXIF orientation, but its photo has one; it is taken to lie like the photo upright"
        );
    }
    let small = reduced(&Stored::read(mask, Upright::Turned, ALONE_LIMIT)?, size);
    let color = usual(&[Sample { view: 0, lying, small, splat: None }]);
    Ok(Mask { color, orientation: lying.by_shape(), ..Mask::new(mask.to_owned()) })
}

/// The mask of a sampled view.
struct Sample {
    view: usize,
    lying: Lying,
    small: Small,
    /// Whether the splat covers each pixel of the reduced photo; empty without the splat.
    splat: Option<Vec<bool>>,
}

impl Sample {
    fn is_ambiguous(&self) -> bool {
        self.lying.fits == Fits::Both
    }

    /// Whether each pixel of the reduced photo is the object's, according to a mask turned in this way.
    fn object(&self, color: &MaskColor, orientation: Orientation) -> Vec<bool> {
        let mut small = Stored { colors: self.small.colors.clone(), is_lossy: self.small.is_lossy };
        small.turn(orientation);
        let (width, height) = self.small.size;
        let colors = nearest(&small.colors, (width, height));
        colors.pixels().map(|pixel| color.is_object(pixel.0, small.is_lossy)).collect()
    }
}

/// A mask with its pixels thinned out, and the size of the photo reduced alike.
struct Small {
    colors: RgbImage,
    is_lossy: bool,
    size: (u32, u32),
}

fn reduced(mask: &Stored, photo: (u32, u32)) -> Small {
    let small = |(width, height): (u32, u32)| {
        let factor = (f64::from(SIDE) / f64::from(width.max(height))).min(1.0);
        let side = |length: u32| ((f64::from(length) * factor).round() as u32).max(1);
        (side(width), side(height))
    };
    Small {
        colors: nearest(&mask.colors, small(mask.colors.dimensions())),
        is_lossy: mask.is_lossy,
        size: small(photo),
    }
}

/// The picture at another size, each pixel one of its own: the mean of two objects' numbers would be a third object's.
fn nearest(picture: &RgbImage, (width, height): (u32, u32)) -> RgbImage {
    if picture.dimensions() == (width, height) {
        return picture.clone();
    }
    image::imageops::resize(picture, width, height, image::imageops::FilterType::Nearest)
}

fn sampled(views: &[View], chosen: &[usize]) -> Result<Vec<Sample>, SceneError> {
    let sample = |view: &usize| {
        let View { upright, mask, camera, .. } = &views[*view];
        let mask = mask.as_ref().expect("only views with a mask are sampled");
        let size = (camera.intrinsics.width, camera.intrinsics.height);
        let small = reduced(&Stored::read(&mask.path, *upright, VIEW_LIMIT)?, size);
        Ok(Sample { view: *view, lying: mask.lying, small, splat: None })
    };
    parallel::try_map(chosen, sample)
}

/// For each sample, where the splat shows the object; `None` if the splat does not tell it from the room.
fn shown(views: &[View], samples: &[Sample], gaussians: &Gaussians) -> Vec<Option<Vec<bool>>> {
    let all = covered(views, samples, gaussians);
    let share = |covered: &[bool]| covered.iter().filter(|covered| **covered).count() as f64 / covered.len() as f64;
    let mean = all.iter().map(|covered| share(covered)).sum::<f64>() / all.len() as f64;
    if mean <= MOST_OF_OBJECT {
        return all.into_iter().map(Some).collect();
    }
    let Some(kept) = looked_at(gaussians, views) else { return vec![None; samples.len()] };
    let mut object = gaussians.clone();
    object.retain(&kept);
    covered(views, samples, &object).into_iter().map(Some).collect()
}

fn covered(views: &[View], samples: &[Sample], gaussians: &Gaussians) -> Vec<Vec<bool>> {
    let black = vec![[0.0; 3]; gaussians.len()];
    let options = RenderOptions { colors: Colors::Fixed(&black), ..RenderOptions::default() };
    let of_sample = |sample: &Sample| {
        let camera = &views[sample.view].camera;
        let (width, height) = sample.small.size;
        let small = Camera { intrinsics: camera.intrinsics.resized(width, height), ..camera.clone() };
        render(gaussians, &small, &options).alpha.iter().map(|alpha| *alpha >= FOREGROUND_ALPHA).collect()
    };
    samples.iter().map(of_sample).collect()
}

/// A reading of the masks, and what speaks for it, as the end of a sentence.
struct Reading {
    color: MaskColor,
    why: String,
}

/// How the masks are to be read.
fn reading(samples: &[Sample]) -> Reading {
    let usual = usual(samples);
    by_splat(samples, &usual).unwrap_or_else(|| by_middle(samples, usual))
}

/// The reading that fits the splat; `None` if none does.
fn by_splat(samples: &[Sample], usual: &MaskColor) -> Option<Reading> {
    let fit = |color: &MaskColor| overlap(samples.iter(), |sample| sample.object(color, sample.lying.by_shape()));
    let usually = fit(usual);
    let (color, fits) = best(usual, colors_in(samples, inside_splat(samples)), fit);
    if fits < LEAST_FIT {
        return None;
    }
    let why = if color == *usual {
        format!("which fits the splat ({:.0} % overlap)", 100.0 * usually)
    } else {
        format!(
            "since they fit the splat better so: read as {} they overlap it by {:.0} %, as {} by {:.0} %; --mask-color overrides this",
            in_words(&color),
            100.0 * fits,
            in_words(usual),
            100.0 * usually,
        )
    };
    Some(Reading { color, why })
}

/// The reading by which the object is in the middle of the photos and not at their border; the usual one if none is.
fn by_middle(samples: &[Sample], usual: MaskColor) -> Reading {
    let (color, share) = best(&usual, colors_in(samples, not_at_border(samples)), |color| in_middle(samples, color));
    let why = if share < LEAST_IN_MIDDLE {
        return Reading {
            color: usual,
            why: "as usual; neither the splat nor the middle of the photos tells (--mask-color overrides this)"
                .to_owned(),
        };
    } else if color == usual {
        "which is in the middle of the photos"
    } else {
        "since that is in the middle of the photos and not at their border; --mask-color overrides this"
    };
    Reading { color, why: why.to_owned() }
}

/// The reading with the largest fit, and its fit. One that is less usual has to be better by [`LEAST_GAIN`] than all that are
/// more usual.
fn best(usual: &MaskColor, rare: Option<MaskColor>, fit: impl Fn(&MaskColor) -> f64) -> (MaskColor, f64) {
    let only_black = MaskColor::Colors(vec![[0; 3]]);
    let others = [MaskColor::White, MaskColor::Black, MaskColor::NotBlack, only_black].into_iter().chain(rare);
    let mut best = (usual.clone(), fit(usual));
    for color in others {
        let of_color = fit(&color);
        if of_color > best.1 + LEAST_GAIN {
            best = (color, of_color);
        }
    }
    best
}

/// The reading that most programs would mean: white, or all but black if nothing is white.
fn usual(samples: &[Sample]) -> MaskColor {
    let pixels = || samples.iter().flat_map(|s| s.small.colors.pixels().map(|pixel| (pixel.0, s.small.is_lossy)));
    let is_grey = pixels().all(|(color, is_lossy)| is_grey(color, is_lossy));
    let has_white = pixels().any(|(color, is_lossy)| MaskColor::White.is_object(color, is_lossy));
    if is_grey && has_white { MaskColor::White } else { MaskColor::NotBlack }
}

/// The intersection over union of the object in the masks and in the splat, over all samples; 0 without the splat.
fn overlap<'a>(samples: impl Iterator<Item = &'a Sample>, object: impl Fn(&Sample) -> Vec<bool>) -> f64 {
    let (mut both, mut either) = (0_usize, 0_usize);
    for sample in samples {
        let Some(splat) = &sample.splat else { continue };
        for (mask, splat) in object(sample).into_iter().zip(splat) {
            both += usize::from(mask && *splat);
            either += usize::from(mask || *splat);
        }
    }
    if either == 0 { 0.0 } else { both as f64 / either as f64 }
}

/// How often a colour is counted and how often it occurs.
type Counts = BTreeMap<Color, (usize, usize)>;

/// The colours of which more than half of the pixels are counted, and not all colours; `None` if the masks are no maps of
/// objects, with exact colours.
fn colors_in(samples: &[Sample], counts: Counts) -> Option<MaskColor> {
    let is_map = samples.iter().all(|sample| !sample.small.is_lossy) && counts.len() <= MOST_COLORS;
    let colors: Vec<Color> =
        counts.iter().filter(|(_, (counted, all))| 2 * counted > *all).map(|(color, _)| *color).collect();
    (is_map && !colors.is_empty() && colors.len() < counts.len()).then_some(MaskColor::Colors(colors))
}

/// Per colour, how many of its pixels the splat covers.
fn inside_splat(samples: &[Sample]) -> Counts {
    let mut counts = Counts::new();
    for sample in samples {
        let Some(splat) = &sample.splat else { continue };
        let mut small = Stored { colors: sample.small.colors.clone(), is_lossy: sample.small.is_lossy };
        small.turn(sample.lying.by_shape());
        for (pixel, covered) in nearest(&small.colors, sample.small.size).pixels().zip(splat) {
            let count = counts.entry(pixel.0).or_default();
            *count = (count.0 + usize::from(*covered), count.1 + 1);
        }
    }
    counts
}

/// Counts every colour fully but the one that is most frequent at the border.
fn not_at_border(samples: &[Sample]) -> Counts {
    let mut at_border = Counts::new();
    for sample in samples {
        let (width, height) = sample.small.colors.dimensions();
        for (x, y, pixel) in sample.small.colors.enumerate_pixels() {
            let count = at_border.entry(pixel.0).or_default();
            count.0 += usize::from(is_border(x, width) || is_border(y, height));
        }
    }
    let background = at_border.iter().max_by_key(|(_, (count, _))| *count).map(|(color, _)| *color);
    at_border.keys().map(|color| (*color, (usize::from(Some(*color) != background), 1))).collect()
}

/// The share of the object in the middle of the photos less its share at their border, over all samples.
fn in_middle(samples: &[Sample], color: &MaskColor) -> f64 {
    let (mut middle, mut border) = ((0_usize, 0_usize), (0_usize, 0_usize));
    for Small { colors, is_lossy, .. } in samples.iter().map(|sample| &sample.small) {
        let (width, height) = colors.dimensions();
        for (x, y, pixel) in colors.enumerate_pixels() {
            let is_object = usize::from(color.is_object(pixel.0, *is_lossy));
            if is_middle(x, width) && is_middle(y, height) {
                middle = (middle.0 + is_object, middle.1 + 1);
            } else if is_border(x, width) || is_border(y, height) {
                border = (border.0 + is_object, border.1 + 1);
            }
        }
    }
    let share = |(object, all): (usize, usize)| object as f64 / all.max(1) as f64;
    share(middle) - share(border)
}

fn is_middle(at: u32, side: u32) -> bool {
    let place = (f64::from(at) + 0.5) / f64::from(side);
    (MIDDLE.0..=MIDDLE.1).contains(&place)
}

fn is_border(at: u32, side: u32) -> bool {
    let width = (f64::from(side) * BORDER).ceil() as u32;
    at < width || at >= side.saturating_sub(width)
}

/// Fails if the masks hide all of every view; warns if they hide all of those views that have one.
fn hidden(
    views: &[View],
    masked: &[usize],
    samples: &[Sample],
    color: &MaskColor,
) -> Result<Option<String>, SceneError> {
    let shows = |small: &Small| small.colors.pixels().any(|pixel| color.is_object(pixel.0, small.is_lossy));
    if samples.iter().any(|sample| shows(&sample.small)) {
        return Ok(None);
    }
    let is_empty = |mask: Option<GrayImage>| mask.is_none_or(|mask| !has_object(&mask));
    let all_empty = parallel::try_map(masked, |view| views[*view].coverage().map(is_empty))?;
    if all_empty.contains(&false) {
        return Ok(None);
    }
    let colors: BTreeSet<Color> =
        samples.iter().flat_map(|sample| sample.small.colors.pixels().map(|pixel| pixel.0)).collect();
    let nothing = MasksHideAll {
        first: views[masked[0]].mask.as_ref().map(|mask| mask.path.clone()).unwrap_or_default(),
        count: masked.len(),
        color: color.to_string(),
        colors: MaskColor::Colors(colors.into_iter().take(MOST_COLORS_NAMED).collect()).to_string(),
    };
    if masked.len() == views.len() {
        Err(SceneError::MasksHideAll(Box::new(nothing)))
    } else {
        Ok(Some(nothing.to_string()))
    }
}

fn has_object(mask: &GrayImage) -> bool {
    mask.as_raw().iter().any(|value| *value >= 128)
}

/// How masks lie whose shape does not tell.
#[derive(Debug, Default)]
struct Turns {
    /// `None` if there are none, or nothing tells.
    turned: Option<bool>,
    /// The overlap with the splat as they are, and turned.
    overlaps: Option<(f64, f64)>,
}

impl Turns {
    /// Decided by those of the same set whose shape tells, else by the splat.
    fn of(samples: &[Sample], color: &MaskColor) -> Self {
        if !samples.iter().any(Sample::is_ambiguous) {
            return Self::default();
        }
        if samples.iter().any(|sample| sample.lying.fits == Fits::Turned) {
            return Self { turned: Some(true), overlaps: None };
        }
        let ambiguous = || samples.iter().filter(|sample| sample.is_ambiguous());
        let as_is = overlap(ambiguous(), |sample| sample.object(color, Orientation::NoTransforms));
        let turned = overlap(ambiguous(), |sample| sample.object(color, sample.lying.turn));
        let tells = as_is.max(turned) >= LEAST_FIT && (as_is - turned).abs() >= LEAST_GAIN;
        Self { turned: tells.then_some(turned > as_is), overlaps: tells.then_some((as_is, turned)) }
    }

    fn orientation(&self, lying: &Lying) -> Orientation {
        match lying.fits {
            Fits::Both if self.turned == Some(true) => lying.turn,
            _ => lying.by_shape(),
        }
    }

    fn note(&self) -> Option<String> {
        let (as_is, turned) = self.overlaps.filter(|(as_is, turned)| turned > as_is)?;
        Some(format!(
            "masks are turned by the EXIF orientation of their photos, which they do not have themselves: they then overlap the \
             splat by {:.0} % instead of {:.0} %",
            100.0 * turned,
            100.0 * as_is
        ))
    }
}
