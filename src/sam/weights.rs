//! The parameters of SAM's mask decoder.

use super::MASKS;

/// Feed-forward width of the transformer (`mlp_dim`).
pub const HIDDEN: usize = 2048;

/// `y = x weight + bias`.
pub struct Linear {
    /// `[inputs, outputs]`.
    pub weight: Vec<f32>,
    pub bias: Vec<f32>,
    pub inputs: usize,
    pub outputs: usize,
}

pub struct Norm {
    pub weight: Vec<f32>,
    pub bias: Vec<f32>,
    pub epsilon: f32,
}

pub struct Attention {
    pub query: Linear,
    pub key: Linear,
    pub value: Linear,
    pub out: Linear,
}

/// One of the two layers of the two-way transformer.
pub struct Layer {
    pub self_attention: Attention,
    pub norm1: Norm,
    pub token_to_image: Attention,
    pub norm2: Norm,
    pub hidden: [Linear; 2],
    pub norm3: Norm,
    pub image_to_token: Attention,
    pub norm4: Norm,
}

/// All parameters of the mask decoder.
pub struct Weights {
    pub layers: [Layer; 2],
    pub final_attention: Attention,
    pub final_norm: Norm,
    /// The two transposed convolutions of 2 x 2 pixels and stride 2 as products: an output pixel (dy, dx) is the group
    /// of columns `2 dy + dx`.
    pub upscaling: [Linear; 2],
    pub upscaling_norm: Norm,
    /// One per mask.
    pub hypernetworks: [[Linear; 3]; MASKS],
    pub predicted_iou: [Linear; 3],
}
