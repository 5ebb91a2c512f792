//! Words and numbers for people: what may be shown at a terminal, numbers in readable form, short names of parts, progress.

pub mod output;
pub(crate) mod part_name;
pub mod progress;
pub(crate) mod readable;
