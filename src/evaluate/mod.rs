//! Measuring what gprop makes, with the measures that the field reports.

pub mod filling;
pub mod grasp;
pub mod masks;
pub mod prompts;
pub mod segmentation;
pub mod simulation;
