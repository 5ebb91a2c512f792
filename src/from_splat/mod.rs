//! Data derived from the object itself: the foreground of photos without alpha or masks, from the splat, and whole views if
//! there are no photos, from the splat or the mesh.

mod foreground;
mod mesh;
mod orbit;

pub use foreground::{foreground, photo_with_foreground};
pub use orbit::{orbit, render_views};
