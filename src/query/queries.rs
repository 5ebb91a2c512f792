//! Every part of every view with its sheet and its questions: what may be replayed, asked or exported.

use rayon::prelude::*;

use super::cost::{Cost, Price};
use super::error::QueryError;
use super::options::{Context, Options};
use super::prompt::Prompts;
use super::question::{Question, Questions};
use super::recorded::{Asked, Mask};
use super::sha256::Sha256Hex;
use super::sheet::Drawer;
use crate::materials::MaterialLibrary;
use crate::scene::Photo;
use crate::segment::ViewSegments;

/// One view with its parts.
#[derive(Debug, Clone, Copy)]
pub struct ViewInput<'a> {
    /// Unique among the views.
    pub name: &'a str,
    pub photo: &'a Photo,
    /// Of the photo's size.
    pub segments: &'a ViewSegments,
}

/// A part and the picture that is sent for it.
#[derive(Debug, Clone, PartialEq)]
pub struct PartQuery {
    pub view: String,
    pub part: u16,
    pub photo_sha256: Sha256Hex,
    pub mask: Mask,
    /// Of the sheet's pixels before JPEG.
    pub sheet_sha256: Sha256Hex,
    /// Width and height of the sheet.
    pub sheet_size: (u32, u32),
    /// The sheet as JPEG.
    pub jpeg: Vec<u8>,
}

/// All that may be asked of a scene.
#[derive(Debug)]
pub struct Queries<'a> {
    /// By view in the order of the views, then by part id.
    pub parts: Vec<PartQuery>,
    pub questions: Questions,
    pub library: &'a MaterialLibrary,
    pub prompts: &'a Prompts,
    pub options: &'a Options,
}

impl PartQuery {
    /// What identifies `question` asked about this part.
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
    /// Draws the sheet of every part and writes the questions.
    pub fn prepare(
        views: &[ViewInput],
        library: &'a MaterialLibrary,
        prompts: &'a Prompts,
        options: &'a Options,
    ) -> Result<Self, QueryError> {
        let questions = Questions::new(prompts, library, options.guidance, options.context)?;
        let mut parts = Vec::new();
        for view in views {
            parts.extend(parts_of(view, options.context, options.sheet_size)?);
        }
        Ok(Self { parts, questions, library, prompts, options })
    }

    /// The most that asking `parts` may take: every question of the longest chain, each answered at once.
    pub fn cost<'p>(&self, parts: impl Iterator<Item = &'p PartQuery>, price: Option<&Price>) -> Cost {
        let chain = self.questions.longest_chain();
        parts.flat_map(|part| chain.iter().map(move |question| (part, *question))).fold(
            Cost::default(),
            |cost, (part, question)| {
                let tokens = self.options.lmm_max_tokens;
                cost.plus(Cost::of_request(&[&question.prompt], part.sheet_size, tokens, price))
            },
        )
    }
}

fn parts_of(view: &ViewInput, context: Context, sheet_size: u32) -> Result<Vec<PartQuery>, QueryError> {
    let (map, photo) = (&view.segments.map, view.photo);
    if (map.width, map.height) != photo.rgb.dimensions() {
        return Err(QueryError::SizeMismatch {
            view: view.name.into(),
            map: (map.width, map.height),
            photo: photo.rgb.dimensions(),
        });
    }
    let photo_sha256 = Sha256Hex::of_picture(photo.rgb.dimensions(), photo.rgb.as_raw());
    let drawer = Drawer::new(photo, map, context, sheet_size);
    let mut ids: Vec<u16> = view.segments.parts.iter().map(|part| part.id).collect();
    ids.sort_unstable();
    ids.into_par_iter()
        .map(|part| {
            let sheet = drawer.sheet(part).ok_or_else(|| QueryError::EmptyPart { view: view.name.into(), part })?;
            Ok(PartQuery {
                view: view.name.into(),
                part,
                photo_sha256: photo_sha256.clone(),
                mask: Mask::of_part(map, part),
                sheet_sha256: sheet.pixels_sha256(),
                sheet_size: sheet.picture.dimensions(),
                jpeg: sheet.jpeg(),
            })
        })
        .collect()
}
