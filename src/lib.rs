//! gprop gives every Gaussian of a 3D Gaussian Splatting scene a material and its physical properties, without
//! training, and uses them: mass per part, a dynamic simulation, and the force with which a gripper may hold the object.
//!
//! Data moves to the right only; [`pipeline`] alone knows all the stages:
//!
//! ```text
//!  scene/        segment/        query/          vote/           parts/        simulate/      grasp/
//!  PLY, cameras, SAM parts in    LMM names each  depth-tested    3D parts:     MPM on the     F_min, F_max,
//!  images     -> each view    -> part's       -> projection,  -> volume,    -> Gaussians   -> F*, gripper
//!  (Scene)       (Segmentation)  material        frequency       thickness,    (Frames)       (GraspReport)
//!                                (Answers)       (MaterialField) mass (Parts)
//!                                                                                     report/ export/
//! ```
//!
//! [`render`] draws Gaussians for every stage after [`scene`]; [`pictures`] holds the pictures that several stages make,
//! [`simd`] the vector registers that SAM's decoder and the simulation compute with.
//! Imports never lead back, neither between these modules nor between files; `tests/structure.rs` checks it.
//!
//! The method follows *GaussianProperty: Integrating Physical Properties to 3D Gaussians with LMMs* (Xu et al., 2024).

// A module's docs list its parts in order for whoever reads the source, private ones too.
#![allow(rustdoc::private_intra_doc_links)]

pub mod batch;
pub mod camera;
pub mod cli;
pub mod config;
pub mod error;
pub mod evaluate;
pub mod exit;
pub mod export;
pub mod files;
pub mod from_splat;
pub mod grasp;
pub mod inspect;
pub mod materials;
pub mod npz;
pub mod numeric;
pub mod output;
pub mod parts;
pub mod pictures;
pub mod pipeline;
pub mod progress;
pub mod query;
pub mod read_scope;
pub mod render;
pub mod report;
pub mod scene;
pub mod segment;
pub mod setup;
pub mod simd;
pub mod simulate;
pub mod units;
pub mod values;
pub mod vote;
pub mod workdir;
