//! Grasp forces, grippers, places to grasp at.

#[path = "grasp/calibration.rs"]
mod calibration;
#[path = "grasp/forces.rs"]
mod forces;
#[path = "grasp/places.rs"]
mod places;
#[path = "grasp/scenes.rs"]
pub mod scenes;
