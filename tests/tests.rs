//! One binary; a module per concern. A new test goes where its concern lives.

// Fixtures and helpers shared by the modules.
mod support;

// Whether photos, cameras and Gaussians agree, and what would make them.
mod inspect;
// Reading what lies on disk: PLY, cameras, photos, and everything that can be wrong with them.
mod scene;
// Finding, fetching and checking ONNX Runtime and SAM.
mod setup;
// SAM's masks against the reference generator; label maps.
mod segment;
// The material library.
mod materials;
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
// Scores of masses and hardness against numbers worked out elsewhere.
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
// The two files of options: what each may set, which of them wins.
mod configuration;
// Full disks, files that go, clocks that go back, scenes that mean harm.
mod faults;
// What the fuzz targets found, and what they start from.
mod fuzz;
// The report: its page in a browser, its JSON against the published schema.
mod report;
// Every command in the README and in docs/.
mod docs;
// What a new law, format, export or gripper needs, where the compiler does not ask for it.
mod extending;
// Names, numbers and paths on the command line; a terminal that cannot be written to.
mod usage;
// The crate as others call it: results, errors, shared work folders.
mod library;
// The source's own layout: no import circles, one style of module files.
mod structure;
// The whole program: runs, reruns, kills, bad input, exit codes.
mod run;
