//! The measures of the paper's evaluation.

pub mod segmentation;
