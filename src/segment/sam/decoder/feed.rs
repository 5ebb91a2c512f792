//! The inputs of the standard export and the tensors fed to them.

use std::sync::LazyLock;

use ort::session::Session;
use ort::value::TensorRef;

use super::super::graph::Model;
use super::super::mismatch::Mismatch;
use super::super::{EMBEDDING, Embedding, LOGITS_SIDE, MODEL_SIDE};

pub const PROMPT_INPUTS: [&str; 2] = ["point_coords", "point_labels"];
pub const PICTURE_INPUTS: [&str; 4] = ["image_embeddings", "mask_input", "has_mask_input", "orig_im_size"];
pub const OUTPUTS: [&str; 2] = ["low_res_masks", "iou_predictions"];
/// Made when it is needed: as a constant, its zeros would be a quarter of a megabyte of the program.
static NO_MASK: LazyLock<Vec<f32>> = LazyLock::new(|| vec![0.0; LOGITS_SIDE * LOGITS_SIDE]);

/// Maximum number of points in a run: more than any export is made for. It limits the memory that a damaged export can
/// request.
const MOST_POINTS: usize = 1 << 16;

/// A named float tensor to feed to the model.
pub type Fed<'a> = (&'a str, Vec<i64>, &'a [f32]);

/// The shape of a run: `point_coords` is `[batch, points, 2]`.
#[derive(Debug, Clone, Copy)]
pub struct PromptShape {
    pub batch: usize,
    points: usize,
}

/// The points and labels of a run.
pub struct Prompt {
    points: Vec<f32>,
    labels: Vec<f32>,
}

impl PromptShape {
    pub fn of(model: &Model) -> Result<Self, Mismatch> {
        // Without a box, the export expects a padding point after the prompt, if it takes more than one point.
        let unknown = || vec![None; 3];
        let shape = model.input_shape(PROMPT_INPUTS[0]).unwrap_or_else(unknown);
        let side = |dimension: Option<i64>, otherwise: usize| match dimension {
            Some(fixed) => usize::try_from(fixed).ok().filter(|&fixed| fixed > 0),
            None => Some(otherwise),
        };
        match shape.as_slice() {
            &[batch, points, Some(2) | None] => side(batch, 1).zip(side(points, 2)),
            _ => None,
        }
        .filter(|(batch, points)| batch.checked_mul(*points).is_some_and(|count| count <= MOST_POINTS))
        .map(|(batch, points)| Self { batch, points })
        .ok_or(Mismatch::PromptShape { name: PROMPT_INPUTS[0], shape, most: MOST_POINTS })
    }

    /// A run with these prompts of one point each; the rest of the batch repeats the last.
    pub fn fill(self, points: &[[f32; 2]]) -> Prompt {
        let mut prompt = Prompt {
            points: vec![0.0; self.batch * self.points * 2],
            // Label -1 marks padding.
            labels: vec![-1.0; self.batch * self.points],
        };
        let last = points.last().copied().unwrap_or([MODEL_SIDE as f32 / 2.0; 2]);
        for index in 0..self.batch {
            let point = points.get(index).copied().unwrap_or(last);
            prompt.points[index * self.points * 2..][..2].copy_from_slice(&point);
            prompt.labels[index * self.points] = 1.0;
        }
        prompt
    }

    pub fn blank(self) -> Prompt {
        self.fill(&[])
    }
}

impl Prompt {
    pub fn inputs(&self, shape: PromptShape) -> [Fed<'_>; 2] {
        let (batch, points) = (shape.batch as i64, shape.points as i64);
        [
            (PROMPT_INPUTS[0], vec![batch, points, 2], self.points.as_slice()),
            (PROMPT_INPUTS[1], vec![batch, points], self.labels.as_slice()),
        ]
    }
}

/// All inputs of the standard export.
pub fn standard_inputs<'a>(embedding: &'a Embedding, prompt: &'a Prompt, shape: PromptShape) -> Vec<Fed<'a>> {
    picture_inputs(embedding).into_iter().chain(prompt.inputs(shape)).collect()
}

/// The inputs that depend only on the picture: its embedding, no initial mask, and the model's own frame as the
/// picture's size.
pub fn picture_inputs(embedding: &Embedding) -> [Fed<'_>; 4] {
    let side = LOGITS_SIDE as i64;
    [
        (PICTURE_INPUTS[0], EMBEDDING.to_vec(), embedding.0.as_slice()),
        (PICTURE_INPUTS[1], vec![1, 1, side, side], NO_MASK.as_slice()),
        (PICTURE_INPUTS[2], vec![1], &[0.0]),
        (PICTURE_INPUTS[3], vec![2], &[MODEL_SIDE as f32; 2]),
    ]
}

/// Selects from all inputs those that the session has.
pub fn feed<'a>(session: &Session, all: &'a [Fed<'a>]) -> Result<Vec<(String, TensorRef<'a, f32>)>, Mismatch> {
    let find = |name: &str| {
        let known = all.iter().find(|fed| fed.0 == name);
        let (_, shape, values) = known.ok_or_else(|| Mismatch::Besides(name.to_owned()))?;
        Ok((name.to_owned(), TensorRef::from_array_view((shape.as_slice(), *values))?))
    };
    session.inputs().iter().map(|input| find(input.name())).collect()
}

/// Checks that the model has the names of the standard export.
pub fn check_names(model: &Model) -> Result<(), Mismatch> {
    let missing = |kind, name, found: Vec<&str>| Mismatch::Missing {
        kind,
        name,
        found: found.into_iter().map(str::to_owned).collect(),
    };
    let (inputs, outputs) = (model.input_names(), model.output_names());
    for name in PICTURE_INPUTS.into_iter().chain(PROMPT_INPUTS) {
        if !inputs.contains(&name) {
            return Err(missing("input", name, inputs));
        }
    }
    for name in OUTPUTS {
        if !outputs.contains(&name) {
            return Err(missing("output", name, outputs));
        }
    }
    Ok(())
}
