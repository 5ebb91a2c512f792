//! Every segment of every view with its sheet and its questions: what can be replayed, asked or exported.

use rayon::prelude::*;

use super::cost::{Cost, Price};
use super::error::QueryError;
use super::options::{Context, Options};
use super::prompt::Prompts;
use super::question::{About, Question, Questions};
use super::recorded::{Asked, Mask};
use super::sha256::Sha256Hex;
use super::sheet::Drawer;
use crate::materials::MaterialLibrary;
use crate::scene::Photo;
use crate::segment::LabelMap;

/// One view with its segments or parts.
#[derive(Debug, Clone, Copy)]
pub struct ViewInput<'a> {
    /// Unique among the views.
    pub name: &'a str,
    pub photo: &'a Photo,
    /// As large as the photo.
    pub map: &'a LabelMap,
    /// The ids in the map to ask about.
    pub ids: &'a [u16],
}

/// A segment and the picture that is sent for it.
#[derive(Debug, Clone, PartialEq)]
pub struct SegmentQuery {
    pub view: String,
    pub segment: u16,
    pub photo_sha256: Sha256Hex,
    pub mask: Mask,
    /// Hash of the sheet's pixels before JPEG.
    pub sheet_sha256: Sha256Hex,
    /// Width and height of the sheet.
    pub sheet_size: (u32, u32),
    /// The sheet as JPEG.
    pub jpeg: Vec<u8>,
}

/// Everything that may be asked about a scene.
#[derive(Debug)]
pub struct Queries<'a> {
    /// By view in the order of the views, then by segment id.
    pub segments: Vec<SegmentQuery>,
    pub questions: Questions,
    pub library: &'a MaterialLibrary,
    pub prompts: &'a Prompts,
    pub options: &'a Options,
}

impl SegmentQuery {
    /// The identity of `question` when asked about this segment.
    pub fn asked(&self, question: &Question) -> Asked {
        Asked {
            view: self.view.clone(),
            photo_sha256: self.photo_sha256.clone(),
            mask: self.mask.clone(),
            prompt_sha256: question.prompt_sha256.clone(),
            schema_sha256: question.schema.sha256().clone(),
            sheet_sha256: self.sheet_sha256.clone(),
        }
    }
}

impl<'a> Queries<'a> {
    /// Draws the sheet of every segment and writes the questions.
    pub fn prepare(
        views: &[ViewInput],
        library: &'a MaterialLibrary,
        prompts: &'a Prompts,
        options: &'a Options,
        about: About,
    ) -> Result<Self, QueryError> {
        let questions = Questions::new(prompts, library, (options.guidance, options.context), about)?;
        let mut segments = Vec::new();
        for view in views {
            segments.extend(segments_of(view, options.context, options.sheet_size)?);
        }
        Ok(Self { segments, questions, library, prompts, options })
    }

    /// The most that asking about `segments` may cost: every question of the longest chain, each answered at the first
    /// try.
    pub fn cost<'p>(&self, segments: impl Iterator<Item = &'p SegmentQuery>, price: Option<&Price>) -> Cost {
        let chain = self.questions.longest_chain();
        segments.flat_map(|segment| chain.iter().map(move |question| (segment, *question))).fold(
            Cost::default(),
            |cost, (segment, question)| {
                let tokens = self.options.lmm_max_tokens;
                cost.plus(Cost::of_request(&[&question.prompt], segment.sheet_size, tokens, price))
            },
        )
    }
}

fn segments_of(view: &ViewInput, context: Context, sheet_size: u32) -> Result<Vec<SegmentQuery>, QueryError> {
    let (map, photo) = (view.map, view.photo);
    if (map.width, map.height) != photo.rgb.dimensions() {
        return Err(QueryError::SizeMismatch {
            view: view.name.into(),
            map: (map.width, map.height),
            photo: photo.rgb.dimensions(),
        });
    }
    let photo_sha256 = Sha256Hex::of_picture(photo.rgb.dimensions(), photo.rgb.as_raw());
    let drawer = Drawer::new(photo, map, context, sheet_size);
    let mut ids = view.ids.to_vec();
    ids.sort_unstable();
    ids.into_par_iter()
        .map(|segment| {
            let sheet =
                drawer.sheet(segment).ok_or_else(|| QueryError::EmptySegment { view: view.name.into(), segment })?;
            Ok(SegmentQuery {
                view: view.name.into(),
                segment,
                photo_sha256: photo_sha256.clone(),
                mask: Mask::of_segment(map, segment),
                sheet_sha256: sheet.pixels_sha256(),
                sheet_size: sheet.picture.dimensions(),
                jpeg: sheet.jpeg(),
            })
        })
        .collect()
}
