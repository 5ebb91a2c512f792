//! Grasp forces, grippers, places to grasp at.

mod calibration;
pub mod forces;
mod places;
pub mod scenes;
