//! Asks: [`rounds`] decides what to ask next, and [`follow_up`] what to ask once the object is known; [`run`] takes answers from
//! recordings ([`replay`]) and asks an [`asker`] for the rest ([`live`]), within a [`budget`] that knows what a request may [`cost`].

pub mod asker;
pub mod budget;
pub mod cost;
pub mod direct;
pub mod evidence;
pub mod follow_up;
pub mod hints;
pub(super) mod live;
pub(super) mod queries;
pub mod recognition;
pub(super) mod replay;
pub mod rounds;
pub(super) mod run;
pub mod size;
pub mod whole;
