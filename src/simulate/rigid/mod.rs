//! Parts that move as rigid bodies, coupled to the grid on which the others deform.
//!
//! 1. [`choice`]: the parts whose strain would stay invisible are rigid; those that touch move as one [`body`];
//! 2. [`coupling`]: the nodes that a body shares with deforming material move with it; what they would do otherwise is the
//!    impulse on it;
//! 3. [`contact`]: impulses at the lowest points of the body's [`face`]s keep it off the ground, with Coulomb friction;
//! 4. [`body`]: it moves on with its new momentum and angular momentum.
//!
//! A rigid body limits the time step only by its speed: an object that is rigid as a whole needs a handful of steps per
//! frame.

pub mod body;
pub mod choice;
pub mod contact;
pub mod coupling;
pub mod face;
