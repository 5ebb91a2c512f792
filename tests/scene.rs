//! Reading what lies on disk, and everything that can be wrong with it.

// Loading a whole scene folder: what is found, what is missing, which views are chosen.
mod folder;
