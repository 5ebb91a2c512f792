//! One binary; a module per concern. A new test goes where its concern lives.

#![allow(clippy::disallowed_methods, reason = "tests write as they like")]

// Fixtures and helpers shared by the modules.
mod support;

// Agreement of photos, cameras and Gaussians, and the conversions that bring it about.
mod inspect;
// The search for a similarity between cameras and splat.
mod similarity;
// Reading a scene: PLY, cameras, photos, and everything that can be wrong with them.
mod scene;
// Finding, fetching and checking ONNX Runtime and SAM.
mod setup;
// What loaded libraries may not do: connect, resolve names, write.
#[cfg(target_os = "linux")]
mod libraries;
// Processors older than this one, emulated.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
mod processors;
// SAM's masks against the reference generator; label maps.
mod segment;
// The material library.
mod materials;
// Tools for agents: the protocol, its client, answers, hostile input.
mod mcp;
// What URDF and MJCF claim, checked without a model.
mod audit;
// Links of URDF and MJCF as objects, and the files back with what was found.
mod links;
// Sheets, prompts, answers, recordings, servers.
mod query;
// Rasteriser, depth maps, spherical harmonics.
mod render;
// The parts on which views agree.
mod consensus;
// Depth test, ballots, tally.
mod vote;
// Volume, thickness, mass against closed forms and ground truth.
mod parts;
// Scores of masses and hardness against numbers computed independently.
mod evaluate;
// The Material Point Method against closed forms.
mod simulate;
// Grasp forces, grippers, places to grasp at.
mod grasp;
// Rates of gripping policies.
mod evaluate_grasp;
// Exports, loaded by MuJoCo, usd-core, NumPy, splat-transform.
mod export;
// Many scenes: choice, shards, budgets, kills, one submission for all.
mod batch;
// The two configuration files: what each may set, and which takes precedence.
mod configuration;
// The options of the last run, with which later commands go on.
mod last_run;
// Full disks, files that disappear, clocks that are set back, hostile scenes.
mod faults;
// The corpus of the fuzz targets: their starting files and their findings.
mod fuzz;
// The report: its page in a browser, its JSON against the published schema.
mod report;
// Every command in the README and in docs/.
mod docs;
// What every command prints with --json, against the published schemas.
mod commands;
// Steps for a new law, format, export or gripper that the compiler does not enforce.
mod extending;
// Names, numbers and paths on the command line; a terminal that cannot be written to.
mod usage;
// The crate as a library: results, errors, shared work folders.
mod library;
// The layout of the source: which way imports go.
mod structure;
// The whole program: runs, reruns, kills, bad input, exit codes.
mod run;
