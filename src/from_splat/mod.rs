//! Data derived from the splat itself: the foreground of photos without alpha or masks, and whole views if there are no
//! photos.

mod foreground;
mod orbit;

pub use foreground::{foreground, photo_with_foreground};
pub use orbit::{orbit, render_views};
