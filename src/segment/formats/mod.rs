//! Label maps in the formats of other programs, written in addition to gprop's own 16-bit PNG and read in place of it.

mod coco;
mod format;
mod import;
mod npy;

pub use coco::coco;
pub use format::Format;
pub use import::{ImportError, file_of_view, import_view, within};
