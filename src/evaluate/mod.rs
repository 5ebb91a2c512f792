//! Measuring what gprop makes, with the measures that the field reports.

mod error;
pub mod hardness;
pub mod masks;
pub mod mass;
pub mod scores;
pub mod segmentation;

pub use error::EvaluateError;
