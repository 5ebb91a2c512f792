//! Volume, thickness and mass against closed forms and ground truth.

mod bad_input;
mod bodies;
mod closed_forms;
pub mod clouds;
mod depth_view;
mod fillings;
mod hidden;
mod interior;
mod mutants;
mod of_mesh;
mod scenes;
mod thin;
pub mod truth;
