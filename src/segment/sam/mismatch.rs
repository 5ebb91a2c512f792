//! Differences between a model and SAM's, or reasons why ONNX Runtime cannot run it.

/// The reason why a file's network cannot be used as one of SAM's.
#[derive(Debug, thiserror::Error)]
pub enum Mismatch {
    #[error("it is not an ONNX model, or it is cut off")]
    NotOnnx,
    #[error("its graph cannot be reduced to other outputs")]
    Uncut,
    /// An error from ONNX Runtime while it loads or runs the network.
    #[error("{0}")]
    Runtime(#[from] ort::Error),

    /// `kind` is "input" or "output"; `tensor` its type and shape.
    #[error("its {kind} {name:?} is {tensor}")]
    Tensor { kind: &'static str, name: String, tensor: String },
    #[error("it has the inputs {} instead of a single picture", inputs.join(", "))]
    Inputs { inputs: Vec<String> },
    #[error("it gave {given} instead of {expected:?}")]
    Embedding { given: String, expected: [i64; 4] },

    #[error("it has no {kind} {name:?}, only {}", found.join(", "))]
    Missing { kind: &'static str, name: &'static str, found: Vec<String> },
    #[error("it has an additional input {0:?}")]
    Besides(String),
    #[error("its input {name:?} is {shape:?}, not [prompts, points, 2] with {most} points at most")]
    PromptShape { name: &'static str, shape: Vec<Option<i64>>, most: usize },
    #[error(
        "output {name:?} has shape {found:?}, and no value it is made from is [{batch},4,{side},{side}]; export the \
         decoder with multimask output"
    )]
    OneMask { name: &'static str, found: Vec<i64>, batch: i64, side: i64 },

    #[error("it has no parameter {0:?}")]
    NoParameter(String),
    #[error("{name:?} is not a float constant of shape {shape:?}")]
    NoConstant { name: String, shape: Vec<usize> },
    #[error("{0:?} is not added to anything")]
    NotAdded(String),
    #[error("{0:?} is not added to a product")]
    NoProduct(String),
    #[error("{0:?} is not a sum")]
    NoSum(String),
    #[error("there is no layer norm after {0:?}")]
    NoNorm(String),

    #[error("its tokens hold {0} numbers in all, which does not fit SAM's prompts")]
    Tokens(usize),
    #[error("{0:?} is smaller than a picture's embedding")]
    SmallValue(String),
    /// Logits in units of the largest one, and predicted IoU.
    #[error("on a trial, its logits are off by {logits:e} and its predicted IoU by {predicted_iou:e}")]
    Trial { logits: f32, predicted_iou: f32 },
    #[error("the picture was prepared by another decoder")]
    OtherDecoder,
}
