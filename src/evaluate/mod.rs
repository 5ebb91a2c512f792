//! The measures of the paper's evaluation, and how this program's parts compare with reference implementations.

pub mod masks;
pub mod segmentation;
