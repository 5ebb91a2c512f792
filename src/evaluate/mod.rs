//! Measuring what gprop makes, with the measures that the field reports.

pub mod masks;
pub mod prompts;
pub mod segmentation;
