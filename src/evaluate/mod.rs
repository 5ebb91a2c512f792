//! Evaluates gprop's results with the measures that papers report.

mod error;
pub mod filling;
pub mod grasp;
pub mod hardness;
pub mod label_maps;
pub mod masks;
pub mod mass;
pub mod objects;
pub mod parts;
pub mod prompts;
pub mod robustness;
pub mod scores;
pub mod segmentation;
pub mod simulation;
pub mod vocabulary;

pub use error::EvaluateError;
