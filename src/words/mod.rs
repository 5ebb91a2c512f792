//! Words and numbers for people: what may be shown at a terminal, in pages and in tables, commands to type, numbers in
//! readable form, short names of parts, progress.

pub(crate) mod html;
pub mod output;
pub(crate) mod part_fit;
pub(crate) mod part_name;
pub mod progress;
pub(crate) mod readable;
pub(crate) mod shell;
pub(crate) mod table;
