//! Grasp forces, grippers, places to grasp at.

mod calibration;
mod forces;
mod places;
pub mod scenes;
