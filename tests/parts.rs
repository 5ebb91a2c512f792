//! Volume, thickness and mass against closed forms and ground truth.

#[path = "parts/bad_input.rs"]
mod bad_input;
#[path = "parts/bodies.rs"]
mod bodies;
#[path = "parts/closed_forms.rs"]
mod closed_forms;
#[path = "parts/clouds.rs"]
pub mod clouds;
#[path = "parts/front.rs"]
mod front;
#[path = "parts/hidden.rs"]
mod hidden;
#[path = "parts/scenes.rs"]
mod scenes;
#[path = "parts/truth.rs"]
pub mod truth;
