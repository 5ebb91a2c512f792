//! 3D parts: volume, thickness, mass, centre of mass, inertia.
//!
//! In order:
//! 1. [`clean`] leaves floaters out;
//! 2. the object's inside on a [`grid`]: [`front`] reads the surface off the Gaussians in every view, [`hull`] bounds it,
//!    [`carve`] takes away what the views look through, [`refine`] settles between cells; or [`fill`] does without cameras;
//! 3. [`surface`] measures how deep each cell lies; [`assign`] gives it a part, with [`seam`]s of least area;
//! 4. [`thickness`] across each part;
//! 5. [`compose`] puts material into the cells: [`cores`] in sleeves, [`wall`]s of shells, nothing far behind what was
//!    [`unseen`];
//! 6. [`bodies`] of each part, their [`moments`] and [`mass`].
//!
//! Steps 1 to 5 are in scene units and need no metric scale but for the walls of shells.

mod assign;
mod bodies;
mod carve;
mod clean;
mod compose;
mod contact;
mod cores;
mod error;
mod fill;
pub mod front;
mod grid;
mod hull;
mod inside;
mod mass;
mod moments;
mod options;
mod refine;
mod region;
mod result;
mod seam;
mod splat_cells;
mod surface;
mod thickness;
mod unseen;
mod wall;

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::progress::Progress;
use crate::query::Form;
use crate::scene::gaussians::Gaussians;
use crate::units::{Estimate, MetricScale};
use crate::vote::{FieldLabel, MaterialField};
use bodies::Bodies;
use compose::{Composed, Make};
pub use error::PartsError;
pub use grid::{Grid, Interior, OUTSIDE, VOID};
use inside::{grid_around, inside};
use mass::{Piece, Weighable};
use moments::Moments;
pub use options::{BodiesAs, Options, VolumeMethod};
pub use result::{Object, Part, PartBody, Parts};
use surface::Surface;

/// What the parts stage makes.
#[derive(Debug, Clone, PartialEq)]
pub struct PartsResult {
    /// The object's inside, for the simulation to fill. World frame, scene units.
    pub interior: Interior,
    /// By label of the field; also of labels that fill nothing.
    pub shapes: Vec<Shape>,
    /// What the user should know: counted, never fatal.
    pub warnings: Vec<String>,
    parts: Option<Parts>,
}

/// What of a part needs no metric scale: scene units, scene units cubed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shape {
    /// Its value of `part_label` in `field.ply`.
    pub id: u32,
    /// How many Gaussians carry its label.
    pub gaussians: usize,
    pub volume: Estimate,
    /// Of the surface that bears a grasp; zero where it has none.
    pub thickness: Estimate,
    /// From the nearest place on its outer surface to the object's centre of mass; `None` where it has no outer surface.
    pub surface_to_center_of_mass: Option<f64>,
}

impl PartsResult {
    /// The parts in metres and kilograms.
    ///
    /// # Errors
    /// [`PartsError::ScaleUnknown`], which says how to give the scale.
    pub fn metric(&self) -> Result<&Parts, PartsError> {
        self.parts.as_ref().ok_or(PartsError::ScaleUnknown)
    }
}

/// Measures the parts of the object that `gaussians` draw, as `field` labels them. `cameras` are those of all views, not
/// only of those that were segmented. Without `scale` there are shapes but no masses, and shells count as solid since
/// their walls are known in metres only.
///
/// # Errors
/// An option outside its domain; a cloud that is empty, not finite or not the field's; no cameras to carve with; nothing
/// inside.
pub fn parts(
    gaussians: &Gaussians,
    field: &MaterialField,
    cameras: &[Camera],
    scale: Option<&MetricScale>,
    options: &Options,
    progress: Progress,
) -> Result<PartsResult, PartsError> {
    options.check()?;
    check(gaussians, field)?;
    let meters_per_unit = scale.map(|s| s.meters_per_unit);
    let makes: Vec<Make> = field.labels.iter().map(|l| make(l, meters_per_unit, options)).collect();
    let kept = clean::without_floaters(gaussians, options.min_body_share);
    let grid = grid_around(gaussians, &kept, options.volume_cells);

    let inside = inside(gaussians, &kept, &grid, cameras, options, progress)?;
    let surface = Surface::of(&grid, &inside.cells);
    let in_view = inside.in_view(&surface);
    let cells = assign::assign(gaussians, &kept, &field.part_label, makes.len(), grid, surface, &in_view);
    let chords = thickness::chords(&cells);
    let thickness = thickness::thickness(&chords, makes.len());
    let (composed, cells) = compose::compose(cells, &makes, &chords, inside.uncertainty);

    let mut shapes = shapes(field, &composed, &makes, &thickness);
    let interior = &composed.interior;
    let bodies = Bodies::of(interior, makes.len());
    let mut pieces = pieces(interior, &bodies, &shapes, gaussians, &field.part_label);
    if let Some(center) = mass::center_of_mass(&weighables(&shapes, &field.labels, &pieces)) {
        set_distances(&mut shapes, &mut pieces, &bodies, &cells, center);
    }
    let warnings = warnings(field, &kept, &shapes, &composed, scale.is_none(), options.min_part_share);
    let parts = meters_per_unit.map(|scale| {
        let (object, parts) = mass::weigh(&weighables(&shapes, &field.labels, &pieces), scale, options.bodies);
        Parts { object, parts, warnings: warnings.clone() }
    });
    Ok(PartsResult { interior: composed.interior, shapes, warnings, parts })
}

fn weighables<'a>(shapes: &'a [Shape], labels: &'a [FieldLabel], pieces: &'a [Vec<Piece>]) -> Vec<Weighable<'a>> {
    let all = shapes.iter().zip(labels).zip(pieces);
    all.filter(|((shape, _), _)| shape.gaussians > 0)
        .map(|((shape, label), pieces)| Weighable { shape, label, pieces })
        .collect()
}

/// Per label its bodies, which together have its volume.
fn pieces(
    interior: &Interior,
    bodies: &Bodies,
    shapes: &[Shape],
    gaussians: &Gaussians,
    part_label: &[u32],
) -> Vec<Vec<Piece>> {
    let moments = Moments::of(interior, &bodies.of_cell, bodies.label.len());
    let counts = bodies.gaussians(gaussians, part_label, &interior.grid);
    let mut filled = vec![0.0; shapes.len()];
    for (label, moments) in bodies.label.iter().zip(&moments) {
        filled[*label as usize] += moments.map_or(0.0, |m| m.volume);
    }
    let mut pieces: Vec<Vec<Piece>> = shapes.iter().map(|_| Vec::new()).collect();
    for ((label, moments), gaussians) in bodies.label.iter().zip(moments).zip(counts) {
        let label = *label as usize;
        if let Some(moments) = moments {
            let volume = shapes[label].volume.mid * moments.volume / filled[label];
            let moments = moments.with_volume(volume);
            pieces[label].push(Piece { moments, gaussians, surface_to_center_of_mass: None });
        }
    }
    pieces
}

fn check(gaussians: &Gaussians, field: &MaterialField) -> Result<(), PartsError> {
    if gaussians.is_empty() {
        return Err(PartsError::NoGaussians);
    }
    if field.part_label.len() != gaussians.len() {
        return Err(PartsError::FieldSize { field: field.part_label.len(), gaussians: gaussians.len() });
    }
    let labels = field.labels.len();
    if let Some(gaussian) = field.part_label.iter().position(|&l| l as usize >= labels) {
        return Err(PartsError::Label { gaussian, label: field.part_label[gaussian], labels });
    }
    let is_finite = |i: usize| {
        gaussians.positions[i].iter().all(|v| v.is_finite()) && gaussians.scale(i).iter().all(|s| s.is_finite())
    };
    match (0..gaussians.len()).find(|&i| !is_finite(i)) {
        Some(gaussian) => Err(PartsError::NotFinite { gaussian }),
        None => Ok(()),
    }
}

/// How a label's volume is to be filled.
fn make(label: &FieldLabel, meters_per_unit: Option<f64>, options: &Options) -> Make {
    let wall_m = match (options.volume, label.form) {
        (VolumeMethod::Fill | VolumeMethod::Carve, _) | (VolumeMethod::Hybrid, Form::Solid) => None,
        (VolumeMethod::Shell, Form::Solid) => Some(Estimate::exactly(options.wall_m)),
        (_, Form::Shell { wall_thickness_m }) => Some(Estimate::from(wall_thickness_m)),
    };
    match (wall_m, meters_per_unit) {
        (Some(wall), Some(scale)) => Make::Wall(wall.scaled(1.0 / scale)),
        _ => Make::Solid,
    }
}

fn shapes(field: &MaterialField, composed: &Composed, makes: &[Make], thickness: &[Option<Estimate>]) -> Vec<Shape> {
    let mut gaussians = vec![0; makes.len()];
    field.part_label.iter().for_each(|&l| gaussians[l as usize] += 1);
    let shape = |l: usize| Shape {
        id: l as u32,
        gaussians: gaussians[l],
        volume: composed.volumes[l],
        thickness: match makes[l] {
            Make::Wall(wall) => wall,
            Make::Solid => thickness[l].unwrap_or(Estimate::exactly(0.0)),
        },
        surface_to_center_of_mass: None,
    };
    (0..makes.len()).map(shape).collect()
}

/// Sets how near each part's and each body's seen surface comes to the object's centre of mass.
fn set_distances(
    shapes: &mut [Shape],
    pieces: &mut [Vec<Piece>],
    bodies: &Bodies,
    cells: &assign::Labelled,
    center: Point3<f64>,
) {
    let places = bodies.places(shapes.len());
    let lower = |known: &mut Option<f64>, distance: f64| *known = Some(known.map_or(distance, |d| d.min(distance)));
    for s in (0..cells.surface.cells.len()).filter(|&s| cells.seen[s]) {
        let (cell, distance) = (cells.surface.cells[s] as usize, (cells.surface.points[s] - center).norm());
        lower(&mut shapes[cells.label[cell] as usize].surface_to_center_of_mass, distance);
        if let Some((label, place)) = places.get(bodies.of_cell[cell] as usize) {
            lower(&mut pieces[*label][*place].surface_to_center_of_mass, distance);
        }
    }
}

fn warnings(
    field: &MaterialField,
    kept: &[bool],
    shapes: &[Shape],
    composed: &Composed,
    scale_unknown: bool,
    min_part_share: f64,
) -> Vec<String> {
    let caption = |l: u32| &field.labels[l as usize].caption;
    let mut warnings = Vec::new();
    let floaters = kept.iter().filter(|kept| !**kept).count();
    if floaters > 0 {
        warnings.push(format!("{floaters} of {} Gaussians float off the object and count for no volume", kept.len()));
    }
    for shape in shapes.iter().filter(|s| s.gaussians > 0 && s.volume.mid <= 0.0) {
        let (name, count) = (caption(shape.id), shape.gaussians);
        warnings.push(format!("part {name:?} ({count} Gaussians) owns no place on the surface: no volume, no mass"));
    }
    let whole: f64 = shapes.iter().map(|shape| shape.volume.mid).sum();
    let is_speck = |shape: &&Shape| shape.volume.mid > 0.0 && shape.volume.mid < min_part_share * whole;
    for shape in shapes.iter().filter(is_speck) {
        let (name, percent) = (caption(shape.id), 100.0 * shape.volume.mid / whole);
        warnings
            .push(format!("part {name:?} is {percent:.3} % of the object: a real detail, or a wrong answer's speck"));
    }
    for (shell, core) in composed.cores.iter().enumerate() {
        if let Some(core) = core {
            let (shell, core) = (caption(shell as u32), caption(*core));
            warnings.push(format!("{core:?} is taken to go on inside {shell:?}, unseen"));
        }
    }
    for (peg, through) in &composed.passages {
        warnings.push(format!("{:?} is taken to go through {:?}, unseen", caption(*peg), caption(*through)));
    }
    let shells = field.labels.iter().any(|l| matches!(l.form, Form::Shell { .. }));
    if scale_unknown && shells {
        warnings.push("walls are known in metres only: without a scale, shells count as solid".to_owned());
    }
    warnings
}
