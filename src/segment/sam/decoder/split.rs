//! The decoder in two parts: what no prompt changes, and the rest.

use ort::value::{DynValue, PrimitiveTensorElementType, TensorElementType};

use super::super::Embedding;
use super::super::graph::{Constant, Element, Input, Model};
use super::super::runtime::{self, Runtime};
use super::feed::{Fed, PICTURE_INPUTS, PROMPT_INPUTS, PromptShape, feed, picture_inputs, standard_inputs};
use super::four_masks::FourMasks;

/// The model in two parts.
pub struct Split {
    /// `None` where nothing is left to compute.
    pub picture_model: Option<Vec<u8>>,
    pub prompt_model: Vec<u8>,
    pub picture_values: Vec<Input>,
}

/// A model that cannot be cut: all of it runs for every prompt.
pub fn whole(model: &Model, outputs: &FourMasks) -> Split {
    let input = |(name, shape, _): Fed<'_>| Input { name: name.to_owned(), shape };
    Split {
        picture_model: None,
        prompt_model: model.with_outputs(&[&outputs.logits, &outputs.scores]),
        picture_values: picture_inputs(&Embedding::blank()).map(input).to_vec(),
    }
}

/// Cuts the model where a prompt's values meet those of the picture.
pub fn split(runtime: &Runtime, model: &Model, prompt: PromptShape, outputs: &FourMasks) -> Result<Split, String> {
    let wanted = [outputs.logits.as_str(), outputs.scores.as_str()];
    let everything: Vec<&str> = PICTURE_INPUTS.into_iter().chain(PROMPT_INPUTS).collect();
    let by_prompt = model.dependents(&PROMPT_INPUTS);
    let by_picture = model.dependents(&PICTURE_INPUTS);
    let mut not_constant = model.dependents_with_shapes(&everything);
    not_constant.extend(PICTURE_INPUTS);
    let border = model.border(&wanted, &by_prompt, &not_constant);
    let computed: Vec<&str> = border.iter().copied().filter(|name| !PICTURE_INPUTS.contains(name)).collect();

    // One run with any picture and any prompt tells the shapes, and the values that depend on nothing but shapes.
    let mut trial = runtime::session(runtime, &model.with_outputs(&computed))?;
    let (blank, points) = (Embedding::blank(), prompt.blank());
    let standard = standard_inputs(&blank, &points, prompt);
    let inputs = feed(&trial, &standard)?;
    let values = trial.run(inputs).map_err(|error| error.to_string())?;
    let (mut picture_values, mut constants) = (Vec::new(), Vec::new());
    for name in border {
        if let Some((_, shape, _)) = standard.iter().find(|fed| fed.0 == name) {
            picture_values.push(Input { name: name.to_owned(), shape: shape.clone() });
        } else if by_picture.contains(name) {
            let (shape, _) = values[name].try_extract_tensor::<f32>().map_err(|error| error.to_string())?;
            picture_values.push(Input { name: name.to_owned(), shape: shape.to_vec() });
        } else {
            constants.push(constant(name, &values[name])?);
        }
    }
    let taken = picture_values.iter().map(|value| value.name.as_str()).filter(|name| computed.contains(name));
    let taken: Vec<&str> = taken.collect();
    let prompt_inputs = points.inputs(prompt).map(|(name, shape, _)| Input { name: name.to_owned(), shape });
    let inputs: Vec<Input> = picture_values.iter().cloned().chain(prompt_inputs).collect();
    Ok(Split {
        picture_model: (!taken.is_empty()).then(|| model.with_outputs(&taken)),
        prompt_model: model.cut(&wanted, &inputs, &constants),
        picture_values,
    })
}

fn constant(name: &str, value: &DynValue) -> Result<Constant, String> {
    let (shape, element, bytes) = match value.dtype().tensor_type() {
        Some(TensorElementType::Float32) => raw(value, Element::Float32, |value: &f32| value.to_le_bytes().to_vec())?,
        Some(TensorElementType::Int32) => raw(value, Element::Int32, |value: &i32| value.to_le_bytes().to_vec())?,
        Some(TensorElementType::Int64) => raw(value, Element::Int64, |value: &i64| value.to_le_bytes().to_vec())?,
        Some(TensorElementType::Bool) => raw(value, Element::Bool, |value: &bool| vec![u8::from(*value)])?,
        other => return Err(format!("its value {name:?} is of type {other:?}")),
    };
    Ok(Constant { name: name.to_owned(), shape, element, bytes })
}

fn raw<T: PrimitiveTensorElementType>(
    value: &DynValue,
    element: Element,
    bytes: impl Fn(&T) -> Vec<u8>,
) -> Result<(Vec<i64>, Element, Vec<u8>), String> {
    let (shape, values) = value.try_extract_tensor::<T>().map_err(|error| error.to_string())?;
    Ok((shape.to_vec(), element, values.iter().flat_map(bytes).collect()))
}
