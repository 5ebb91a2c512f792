//! The parameters of SAM's mask decoder, found in an export by their names in the public implementation.
//!
//! Exporters rename the matrices of linear layers (`onnx::MatMul_1926`) but not the biases, so a matrix is identified
//! as the factor of the product to which its bias is added.

use crate::sam::weights::{Attention, HIDDEN, Layer, Linear, Norm, Weights};
use crate::sam::{CHANNELS, INNER, MASKS, UPSCALED, UPSCALED_TWICE};

use super::super::graph::{Constants, Model};
use super::super::mismatch::Mismatch;
use crate::simd::MOST_LANES;

/// Epsilon of the transformer's layer norms, and of the upscaling's (`LayerNorm2d`).
const NORM_EPSILON: f32 = 1e-5;
const UPSCALING_EPSILON: f32 = 1e-6;

/// The names of the values in the model from which the decoder starts.
pub struct Sources {
    /// `[batch, tokens, 256]`: output tokens, then those of the prompt.
    pub tokens: String,
    /// `[batch, 4096, 256]`.
    pub image_embedding: String,
    pub positional_encoding: String,
}

/// Finds the parameters; the error names the one that is missing or has the wrong shape.
pub fn read(model: &Model, constants: &Constants) -> Result<Weights, Mismatch> {
    let reader = Reader { model, constants };
    Ok(Weights {
        layers: [reader.layer(0)?, reader.layer(1)?],
        final_attention: reader.attention("transformer.final_attn_token_to_image", INNER)?,
        final_norm: reader.norm("transformer.norm_final_attn")?,
        upscaling: [
            reader.transposed_convolution("output_upscaling.0", CHANNELS, UPSCALED)?,
            reader.transposed_convolution("output_upscaling.3", UPSCALED, UPSCALED_TWICE)?,
        ],
        upscaling_norm: reader.norm_of_channels("output_upscaling.0", UPSCALED)?,
        hypernetworks: [
            reader.hypernetwork(0)?,
            reader.hypernetwork(1)?,
            reader.hypernetwork(2)?,
            reader.hypernetwork(3)?,
        ],
        predicted_iou: reader.perceptron("iou_prediction_head", MASKS)?,
    })
}

impl Sources {
    pub fn find(model: &Model, constants: &Constants) -> Result<Self, Mismatch> {
        let reader = Reader { model, constants };
        let first = "transformer.layers.0";
        let tokens = reader.product_before(&format!("{first}.self_attn.q_proj.bias"))?.0;
        let image = reader.product_before(&format!("{first}.cross_attn_token_to_image.v_proj.bias"))?.0;
        let placed = reader.product_before(&format!("{first}.cross_attn_token_to_image.k_proj.bias"))?.0;
        let terms = model.producer(placed, "Add").unwrap_or_default();
        let positions = terms.iter().find(|term| *term != image).ok_or_else(|| Mismatch::NoSum(placed.to_owned()))?;
        Ok(Self {
            tokens: tokens.to_owned(),
            image_embedding: image.to_owned(),
            positional_encoding: positions.clone(),
        })
    }
}

struct Reader<'a> {
    model: &'a Model,
    constants: &'a Constants,
}

impl<'a> Reader<'a> {
    fn layer(&self, index: usize) -> Result<Layer, Mismatch> {
        let layer = format!("transformer.layers.{index}");
        Ok(Layer {
            self_attention: self.attention(&format!("{layer}.self_attn"), CHANNELS)?,
            norm1: self.norm(&format!("{layer}.norm1"))?,
            token_to_image: self.attention(&format!("{layer}.cross_attn_token_to_image"), INNER)?,
            norm2: self.norm(&format!("{layer}.norm2"))?,
            hidden: [
                self.projection(&format!("{layer}.mlp.lin1"), CHANNELS, HIDDEN)?,
                self.projection(&format!("{layer}.mlp.lin2"), HIDDEN, CHANNELS)?,
            ],
            norm3: self.norm(&format!("{layer}.norm3"))?,
            image_to_token: self.attention(&format!("{layer}.cross_attn_image_to_token"), INNER)?,
            norm4: self.norm(&format!("{layer}.norm4"))?,
        })
    }

    fn attention(&self, name: &str, inner: usize) -> Result<Attention, Mismatch> {
        Ok(Attention {
            query: self.projection(&format!("{name}.q_proj"), CHANNELS, inner)?,
            key: self.projection(&format!("{name}.k_proj"), CHANNELS, inner)?,
            value: self.projection(&format!("{name}.v_proj"), CHANNELS, inner)?,
            out: self.projection(&format!("{name}.out_proj"), inner, CHANNELS)?,
        })
    }

    /// A linear layer on sequences: a product with `[inputs, outputs]`, then a sum.
    fn projection(&self, name: &str, inputs: usize, outputs: usize) -> Result<Linear, Mismatch> {
        let bias = format!("{name}.bias");
        let weight = self.product_before(&bias)?.1;
        Ok(Linear {
            weight: self.floats(weight, &[inputs, outputs])?,
            bias: self.parameter(&bias, &[outputs])?,
            inputs,
            outputs,
        })
    }

    fn norm(&self, name: &str) -> Result<Norm, Mismatch> {
        let values_of = |what: &str| self.parameter(&format!("{name}.{what}"), &[CHANNELS]);
        Ok(Norm { weight: values_of("weight")?, bias: values_of("bias")?, epsilon: NORM_EPSILON })
    }

    /// The norm over the channels that follows a convolution: exporters write it as elementary operations, in which the
    /// first product and the first sum with one value per channel are scale and shift.
    fn norm_of_channels(&self, convolution: &str, channels: usize) -> Result<Norm, Mismatch> {
        let weight = self.name_of(&format!("{convolution}.weight"))?;
        let operand_of = |operator: &str| {
            let mut inputs = self.model.consumers_after(weight, operator).flatten();
            let values = inputs.find_map(|input| self.constants.get(input, &[channels, 1, 1]));
            values.map(<[f32]>::to_vec).ok_or_else(|| Mismatch::NoNorm(weight.to_owned()))
        };
        Ok(Norm { weight: operand_of("Mul")?, bias: operand_of("Add")?, epsilon: UPSCALING_EPSILON })
    }

    /// `[inputs, outputs, 2, 2]` as a matrix of `[inputs, 4 outputs]`.
    fn transposed_convolution(&self, name: &str, inputs: usize, outputs: usize) -> Result<Linear, Mismatch> {
        let kernel = self.parameter(&format!("{name}.weight"), &[inputs, outputs, 2, 2])?;
        let bias = self.parameter(&format!("{name}.bias"), &[outputs])?;
        let mut weight = vec![0.0; kernel.len()];
        for (index, value) in kernel.into_iter().enumerate() {
            let (input, output, place) = (index / (4 * outputs), index / 4 % outputs, index % 4);
            weight[input * 4 * outputs + place * outputs + output] = value;
        }
        Ok(Linear { weight, bias: bias.repeat(4), inputs, outputs: 4 * outputs })
    }

    fn hypernetwork(&self, mask: usize) -> Result<[Linear; 3], Mismatch> {
        self.perceptron(&format!("output_hypernetworks_mlps.{mask}"), UPSCALED_TWICE)
    }

    fn perceptron(&self, name: &str, outputs: usize) -> Result<[Linear; 3], Mismatch> {
        let layer = |index: usize, outputs: usize| -> Result<Linear, Mismatch> {
            let rows = self.parameter(&format!("{name}.layers.{index}.weight"), &[outputs, CHANNELS])?;
            let mut bias = self.parameter(&format!("{name}.layers.{index}.bias"), &[outputs])?;
            // The number of columns is rounded up to fill whole vectors; the additional columns are zero.
            let columns = outputs.next_multiple_of(MOST_LANES);
            bias.resize(columns, 0.0);
            let mut weight = vec![0.0; CHANNELS * columns];
            for (index, value) in rows.into_iter().enumerate() {
                weight[index % CHANNELS * columns + index / CHANNELS] = value;
            }
            Ok(Linear { weight, bias, inputs: CHANNELS, outputs: columns })
        };
        Ok([layer(0, CHANNELS)?, layer(1, CHANNELS)?, layer(2, outputs)?])
    }

    /// The value that is multiplied before this bias is added, and the matrix it is multiplied with.
    fn product_before(&self, bias: &str) -> Result<(&'a str, &'a str), Mismatch> {
        let bias = self.name_of(bias)?;
        let sum = self.model.consumer(bias, "Add").ok_or_else(|| Mismatch::NotAdded(bias.to_owned()))?;
        match sum.iter().find_map(|input| self.model.producer(input, "MatMul")) {
            Some([left, right]) => Ok((left, right)),
            _ => Err(Mismatch::NoProduct(bias.to_owned())),
        }
    }

    fn parameter(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, Mismatch> {
        self.floats(self.name_of(name)?, shape)
    }

    fn floats(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, Mismatch> {
        let values = self.constants.get(name, shape).map(<[f32]>::to_vec);
        values.ok_or_else(|| Mismatch::NoConstant { name: name.to_owned(), shape: shape.to_vec() })
    }

    /// The full name of the mask decoder's parameter with this name, whatever its prefix.
    fn name_of(&self, name: &str) -> Result<&str, Mismatch> {
        let found = self.constants.name_ending_in(&format!("mask_decoder.{name}"));
        found.ok_or_else(|| Mismatch::NoParameter(name.to_owned()))
    }
}
