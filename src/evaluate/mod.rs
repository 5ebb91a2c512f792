//! How good results are, against ground truth or a reference.

pub mod masks;
