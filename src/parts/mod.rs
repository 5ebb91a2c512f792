//! 3D parts: volume, thickness, mass, centre of mass, inertia.
//!
//! In order:
//! 1. [`clean`] leaves floaters out;
//! 2. the object's inside on a [`grid`]: [`front`] reads the surface off the Gaussians in every view, [`hull`] bounds it,
//!    [`carve`] takes away what the views look through; or [`fill`] does without cameras;
//! 3. [`surface`] measures how deep each cell lies; [`assign`] gives it a part, with [`seam`]s of least area;
//! 4. [`thickness`] across each part;
//! 5. [`compose`] puts material into the cells: [`cores`] in sleeves, [`wall`]s of shells, nothing far behind what was
//!    [`unseen`];
//! 6. [`moments`] and [`mass`].
//!
//! Steps 1 to 5 are in scene units and need no metric scale but for the walls of shells.

pub mod assign;
pub mod carve;
pub mod clean;
pub mod compose;
mod contact;
mod cores;
mod error;
pub mod fill;
pub mod front;
pub mod grid;
pub mod hull;
mod mass;
pub mod moments;
mod options;
pub mod seam;
mod splat_cells;
pub mod surface;
pub mod thickness;
pub mod unseen;
pub mod wall;

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::progress::Progress;
use crate::query::Form;
use crate::scene::gaussians::Gaussians;
use crate::units::{Estimate, MetricScale};
use crate::vote::{FieldLabel, MaterialField};
use compose::{Composed, Make};
pub use error::PartsError;
use front::DepthView;
pub use grid::{Grid, Interior, OUTSIDE, VOID};
use hull::UnseenBound;
use mass::Body;
use moments::Moments;
pub use options::{Options, VolumeMethod};
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
    let thickness = thickness::thickness(&cells, makes.len());
    let (composed, cells) = compose::compose(cells, &makes, &thickness, inside.uncertainty);

    let mut shapes = shapes(field, &composed, &makes, &thickness);
    let moments = Moments::of(&composed.interior, makes.len());
    let scaled = moments.iter().zip(&shapes).map(|(m, s)| m.map(|m| m.with_volume(s.volume.mid)));
    let moments: Vec<Option<Moments>> = scaled.collect();
    if let Some(center) = mass::center_of_mass(&bodies(&shapes, &field.labels, &moments)) {
        set_distances(&mut shapes, &cells, center);
    }
    let warnings = warnings(field, &kept, &shapes, &composed, scale.is_none());
    let parts = meters_per_unit.map(|scale| {
        let (object, parts) = mass::weigh(&bodies(&shapes, &field.labels, &moments), scale);
        Parts { object, parts, warnings: warnings.clone() }
    });
    Ok(PartsResult { interior: composed.interior, shapes, warnings, parts })
}

fn bodies<'a>(shapes: &'a [Shape], labels: &'a [FieldLabel], moments: &[Option<Moments>]) -> Vec<Body<'a>> {
    let all = shapes.iter().zip(labels).zip(moments);
    all.filter(|((shape, _), _)| shape.gaussians > 0)
        .map(|((shape, label), moments)| Body { shape, label, moments: *moments })
        .collect()
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

/// A grid around the kept Gaussians' centres and a deviation beyond.
fn grid_around(gaussians: &Gaussians, kept: &[bool], cells: usize) -> Grid {
    let (mut low, mut high) = (Point3::from([f64::INFINITY; 3]), Point3::from([f64::NEG_INFINITY; 3]));
    for i in (0..gaussians.len()).filter(|&i| kept[i]) {
        let deviation = gaussians.covariance(i).diagonal().map(f64::sqrt);
        low = low.inf(&(gaussians.center(i) - deviation));
        high = high.sup(&(gaussians.center(i) + deviation));
    }
    Grid::around(low, high, cells)
}

/// The cells inside the object, and how well that is known.
struct Inside {
    cells: Vec<bool>,
    /// How far the surface may be off, scene units.
    uncertainty: f64,
    /// What the views see; none where the volume does not come from views.
    views: Vec<DepthView>,
}

impl Inside {
    /// Whether a view sees each cell of the surface. Where there are no views, all are taken as seen.
    fn in_view(&self, surface: &Surface) -> Vec<bool> {
        let see = |(point, normal): (&Point3<f64>, &Vector3<f64>)| {
            self.views.is_empty() || carve::is_seen(&self.views, *point, *normal, self.uncertainty)
        };
        surface.points.par_iter().zip(&surface.normals).map(see).collect()
    }
}

fn inside(
    gaussians: &Gaussians,
    kept: &[bool],
    grid: &Grid,
    cameras: &[Camera],
    options: &Options,
    progress: Progress,
) -> Result<Inside, PartsError> {
    let (cells, uncertainty, views, why) = match options.volume {
        VolumeMethod::Fill => {
            let cells = fill::fill(gaussians, kept, grid, options.fill_density);
            (cells, grid.cell, Vec::new(), "no cell is dense enough to be the object's skin")
        }
        VolumeMethod::Hybrid | VolumeMethod::Carve | VolumeMethod::Shell => {
            let views = depth_views(gaussians, cameras, options.carve_views, progress)?;
            let pixel = pixel_size(grid, &views);
            let mut cells = vec![true; grid.len()];
            UnseenBound::of(gaussians, kept, cameras, grid.middle()).clip(grid, &mut cells);
            carve::carve(grid, &views, pixel, &mut cells);
            (cells, pixel, views, "the views see through every place where the splat is")
        }
    };
    let cells = without_border(grid, cells);
    if !cells.contains(&true) {
        return Err(PartsError::NothingInside { why });
    }
    Ok(Inside { cells, uncertainty, views })
}

/// The grid's outermost cells are outside, so that filters and neighbours need no edge cases.
fn without_border(grid: &Grid, mut cells: Vec<bool>) -> Vec<bool> {
    const BORDER: usize = 2;
    cells.par_iter_mut().enumerate().for_each(|(i, inside)| {
        let coords = grid.coords(i);
        *inside &= (0..3).all(|axis| (BORDER..grid.dims[axis] - BORDER).contains(&coords[axis]));
    });
    cells
}

/// The surface seen from up to `count` of the cameras, spread evenly over their order.
fn depth_views(
    gaussians: &Gaussians,
    cameras: &[Camera],
    count: usize,
    progress: Progress,
) -> Result<Vec<DepthView>, PartsError> {
    if cameras.is_empty() {
        return Err(PartsError::NoViews);
    }
    let count = count.min(cameras.len());
    let bar = progress.bar("parts", count as u64);
    let views = (0..count).map(|k| {
        let view = DepthView::of(gaussians, &cameras[k * cameras.len() / count]);
        bar.inc(1);
        view
    });
    let views = views.collect();
    bar.finish_and_clear();
    Ok(views)
}

/// The width of a pixel at the object, scene units, median over the views: no surface is known better.
fn pixel_size(grid: &Grid, views: &[DepthView]) -> f64 {
    let size = |v: &DepthView| (v.camera.center_in_world() - grid.middle()).norm() / v.camera.intrinsics.fx;
    let mut sizes: Vec<f64> = views.iter().map(size).collect();
    sizes.sort_by(f64::total_cmp);
    sizes[sizes.len() / 2]
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

/// Sets how near each part's seen surface comes to the object's centre of mass.
fn set_distances(shapes: &mut [Shape], cells: &assign::Labelled, center: Point3<f64>) {
    for s in (0..cells.surface.cells.len()).filter(|&s| cells.seen[s]) {
        let distance = (cells.surface.points[s] - center).norm();
        let nearest = &mut shapes[cells.label[cells.surface.cells[s] as usize] as usize].surface_to_center_of_mass;
        *nearest = Some(nearest.map_or(distance, |d| d.min(distance)));
    }
}

fn warnings(
    field: &MaterialField,
    kept: &[bool],
    shapes: &[Shape],
    composed: &Composed,
    scale_unknown: bool,
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

/// The object and its parts, in metres and kilograms. Written as `parts.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parts {
    pub object: Object,
    /// By id.
    pub parts: Vec<Part>,
    pub warnings: Vec<String>,
}

/// The whole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Object {
    pub volume_m3: Estimate,
    pub mass_kg: Estimate,
    /// World frame, metres.
    pub center_of_mass_m: [f64; 3],
    /// About the centre of mass, world axes.
    pub inertia_kg_m2: [[f64; 3]; 3],
}

/// One part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Its value of `part_label` in `field.ply`.
    pub id: u32,
    pub caption: String,
    pub material: String,
    pub family: String,
    /// How many Gaussians carry its label.
    pub gaussians: usize,
    pub volume_m3: Estimate,
    /// Of the surface that bears a grasp: wall to wall for a solid, the wall for a shell.
    pub thickness_m: Estimate,
    pub density_kg_m3: Estimate,
    pub mass_kg: Estimate,
    pub center_of_mass_m: [f64; 3],
    pub inertia_kg_m2: [[f64; 3]; 3],
    /// From the nearest place on its outer surface to the object's centre of mass; `None` where it has no outer surface.
    pub surface_to_center_of_mass_m: Option<f64>,
}
