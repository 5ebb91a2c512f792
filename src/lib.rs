//! gprop gives every Gaussian of a 3D Gaussian Splatting scene a material and its physical properties, without
//! training, and uses them: mass per part, a dynamic simulation, and the force with which a gripper may hold the
//! object.
//!
//! # As a library
//! A [`Pipeline`] works on a scene folder as `gprop run` does. Asking for a result runs the stages that it needs and that
//! have not run yet:
//!
//! ```
//! # use gprop::setup;
//! # use gprop::words::progress::Progress;
//! # // Without SAM there is nothing to show.
//! # if setup::obtain(&setup::Options::default(), Progress::Hidden).is_err() {
//! #     assert!(std::env::var_os("GPROP_NO_SKIP").is_none(), "no SAM, and GPROP_NO_SKIP is set");
//! #     return Ok::<(), Box<dyn std::error::Error>>(());
//! # }
//! let work = tempfile::tempdir()?;
//! let mut options = gprop::Options::of_scene("fixtures/hammer")?;
//! // Two of its views and coarse volumes, to be quick.
//! options.scene.view_list = vec!["003".into(), "022".into()];
//! options.parts.volume_cells = 100_000;
//! let mut pipeline = gprop::Pipeline::builder("fixtures/hammer").out(&work).options(options).open()?;
//! let parts = pipeline.parts()?;
//! for part in &parts.parts {
//!     if let Some(mass) = part.mass_kg {
//!         println!("{}, {}: {:.3} kg ({:.3} to {:.3})", part.caption, part.material, mass.mid, mass.low, mass.high);
//!     }
//! }
//! assert!((0.2..2.0).contains(&parts.object.mass_kg.mid));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Nothing leaves the machine unless it is asked for. ONNX Runtime would send telemetry; gprop keeps it from the network, and
//! if the environment has `ORT_DISABLE_TELEMETRY=1` when your `main` starts other threads, it does not even try
//! ([`setup::NO_TELEMETRY`]).
//!
//! The stages can also be called one by one, on values in memory: each module below has a function for its own stage
//! ([`vote::vote`], [`parts::parts`], [`simulate::simulate`], [`grasp::grasp`]).
//!
//! # How it is built
//! Data moves to the right only; [`pipeline`] alone knows all the stages:
//!
//! ```text
//!  scene/     segment/         consensus/   query/       vote/            parts/        simulate/   grasp/
//!  PLY,       SAM's masks      the parts    LMM names    every view       volume,       MPM on the  F_min, F_max,
//!  cameras -> of each view, -> of the    -> each part's  votes on the  -> thickness, -> Gaussians-> F*, gripper
//!  images     nested           object in    material in  Gaussians that   mass          (Frames)    (GraspReport)
//!  (Scene)    (Segmentation)   3D           its best     it sees          (Parts)
//!                              (consensus:: views        (MaterialField)
//!                              Parts)       (Answers)                                       report/ export/
//! ```
//!
//! [`render`] draws Gaussians for every stage after [`scene`]; [`pictures`] holds the pictures that several stages
//! make, [`pictures::plots`] draws their plots. Imports never lead back, neither between these modules nor between files;
//! `tests/structure.rs` checks it.
//!
//! The inner loops are [`sam`], the mask decoder; [`mpm`], the simulation's solver; and [`render`]. They compute with the
//! vector registers of [`simd`].
//!
//! The method follows *GaussianProperty: Integrating Physical Properties to 3D Gaussians with LMMs* (Xu et al., 2024).

// What gprop writes goes through `files::write`; its tests write as they like.
#![cfg_attr(test, allow(clippy::disallowed_methods))]
// A module's docs list its parts in order for readers of the source, including private ones.
#![allow(rustdoc::private_intra_doc_links)]

#[cfg(not(unix))]
compile_error!("gprop runs on Linux and macOS");

pub mod batch;
pub mod camera;
mod cli;
pub mod config;
pub mod consensus;
pub mod error;
pub mod evaluate;
pub mod exit;
pub mod export;
pub mod files;
pub mod film;
pub mod from_splat;
pub mod gaussians;
pub mod grasp;
pub mod inspect;
pub mod lettering;
pub mod materials;
pub mod mpm;
pub mod numeric;
pub mod parts;
pub mod pictures;
pub mod pipeline;
pub mod query;
pub mod render;
pub mod report;
pub mod sam;
pub mod scene;
pub mod segment;
pub mod setup;
pub mod simd;
pub mod simulate;
pub mod units;
pub mod vote;
pub mod words;
pub mod workdir;

pub use cli::{command, main};
pub use error::Error;
pub use pipeline::{Builder, Options, Pipeline};
