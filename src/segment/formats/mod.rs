//! Label maps as other programs keep them, written beside gprop's own 16-bit PNG and read in its place.

mod coco;
mod format;
mod import;
mod npy;

pub use coco::coco;
pub use format::Format;
pub use import::{ImportError, file_of_view, import_view};
