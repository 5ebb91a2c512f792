//! Volume, thickness and mass against closed forms and ground truth.

#[path = "parts/scenes.rs"]
mod scenes;
#[path = "parts/truth.rs"]
mod truth;
