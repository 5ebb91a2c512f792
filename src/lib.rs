//! gprop gives every Gaussian of a 3D Gaussian Splatting scene a material and its physical properties, without
//! training, and uses them: mass per part, a dynamic simulation, and the force with which a gripper may hold the
//! object.
//!
//! # As a library
//! A [`Pipeline`] works on a scene folder as `gprop run` does. Asking for a result runs the stages that it needs and that
//! have not run yet:
//!
//! ```
//! # fn copy(from: &std::path::Path, to: &std::path::Path) -> std::io::Result<()> {
//! #     std::fs::create_dir_all(to)?;
//! #     for entry in std::fs::read_dir(from)?.flatten() {
//! #         let (from, to) = (entry.path(), to.join(entry.file_name()));
//! #         if from.is_dir() { copy(&from, &to)? } else { std::fs::copy(&from, &to).map(drop)? }
//! #     }
//! #     Ok(())
//! # }
//! # // The hammer, with two of its views and coarse volumes, to be quick.
//! # let home = tempfile::tempdir().unwrap();
//! # copy("fixtures/hammer".as_ref(), &home.path().join("my_scene")).unwrap();
//! # std::env::set_current_dir(&home).unwrap();
//! # let quick = "scale = \"metric\"\nview-list = \"003,022\"\nvolume-cells = 100000";
//! # std::fs::write("my_scene/gprop.toml", quick).unwrap();
//! # // Without SAM there is nothing to show.
//! # if gprop::Pipeline::open("my_scene")?.segments().is_err() {
//! #     assert!(std::env::var_os("GPROP_NO_SKIP").is_none(), "no SAM, and GPROP_NO_SKIP is set");
//! #     return Ok(());
//! # }
//! let mut pipeline = gprop::Pipeline::open("my_scene")?;
//! for part in &pipeline.parts()?.parts {
//!     println!("{} of {}: {:?} kg", part.caption, part.material, part.mass_kg);
//! }
//! # assert!((0.2..2.0).contains(&pipeline.parts()?.object.mass_kg.mid));
//! # Ok::<(), gprop::Error>(())
//! ```
//!
//! Results can be held together, and for longer than the pipeline: each is an [`Arc`](std::sync::Arc).
//!
//! Nothing leaves the machine unless it is asked for. ONNX Runtime would send telemetry; gprop keeps it from the network, and
//! if the environment has `ORT_DISABLE_TELEMETRY=1` when your `main` starts other threads, it does not even try
//! ([`setup::NO_TELEMETRY`]).
//!
//! [`Pipeline::builder`] sets the work folder and the [`Options`], passes [progress](Event) to a function of yours, and
//! takes a [token](CancelToken) that cancels the run. [`results`] describes what the stages find, [`options`] what can be
//! set for each. An [`Error`] has a [kind](ErrorKind). Everything else that is public serves the program and its tests,
//! and may change in any version.
//!
//! # How it is built
//! Data moves to the right only; [`pipeline`] alone knows all the stages:
//!
//! ```text
//!  scene/        segment/       consensus/   query/            vote/            parts/       simulate/   grasp/
//!  splat or      SAM's masks    the parts    a model says      every view       volume,      MPM on the  F_min, F_max,
//!  mesh, photos, of each view,  of the       what the object   votes on the     thickness,   Gaussians   F*, gripper
//!  cameras,   -> nested      -> object    -> and its parts  -> Gaussians that -> mass,     -> (frames) -> (GraspReport)
//!  scale, up,    (Segmentation) in 3D        are made of       it sees          the belief
//!  objects                      (consensus:: (Answers)         (MaterialField)  (Parts)
//!  (Scene)                       Parts)                                                     report/ export/
//! ```
//!
//! Between the question what the object is and those about its parts, [`refine`] looks in the photos for what that answer
//! names and no part shows.
//!
//! A mesh becomes flat Gaussians and drawn views in [`scene`], and a capture of several objects one scene for each, so
//! that the stages after it do not differ.
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

#[doc(hidden)]
pub mod audit;
#[doc(hidden)]
pub mod batch;
#[doc(hidden)]
pub mod camera;
mod cli;
#[doc(hidden)]
pub mod config;
#[doc(hidden)]
pub mod consensus;
#[doc(hidden)]
pub mod error;
#[doc(hidden)]
pub mod evaluate;
#[doc(hidden)]
pub mod exit;
#[doc(hidden)]
pub mod export;
#[doc(hidden)]
pub mod files;
#[doc(hidden)]
pub mod film;
#[doc(hidden)]
pub mod from_splat;
#[doc(hidden)]
pub mod gaussians;
#[doc(hidden)]
pub mod grasp;
#[doc(hidden)]
pub mod inspect;
#[doc(hidden)]
pub mod lettering;
#[doc(hidden)]
pub mod links;
#[doc(hidden)]
pub mod local_server;
#[doc(hidden)]
pub mod materials;
mod mcp;
#[doc(hidden)]
pub mod mpm;
#[doc(hidden)]
pub mod numeric;
#[doc(hidden)]
pub mod objects;
pub mod options;
mod parallel;
#[doc(hidden)]
pub mod parts;
#[doc(hidden)]
pub mod pictures;
#[doc(hidden)]
pub mod pipeline;
#[doc(hidden)]
pub mod query;
#[doc(hidden)]
pub mod refine;
pub mod render;
#[doc(hidden)]
pub mod report;
pub mod results;
#[doc(hidden)]
pub mod sam;
#[doc(hidden)]
pub mod scene;
#[doc(hidden)]
pub mod segment;
#[doc(hidden)]
pub mod setup;
#[doc(hidden)]
pub mod simd;
#[doc(hidden)]
pub mod simulate;
#[doc(hidden)]
pub mod units;
#[doc(hidden)]
pub mod vote;
#[doc(hidden)]
pub mod words;
#[doc(hidden)]
pub mod workdir;

#[doc(hidden)]
pub use cli::{command, main};
pub use error::{Error, ErrorKind};
pub use pipeline::{Builder, Options, Pipeline, Plan, Preset, Stage};
pub use words::progress::{CancelToken, Event, ShowProgress, StageNumber};
