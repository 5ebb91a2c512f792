//! Finds the object's inside on a grid, with the method that the options select.
//!
//! [`depth_view`] derives the surface in every view from the Gaussians, [`hull`] bounds it, [`carve`] removes what the
//! views look through, and [`refine`] locates the surface between cells. Alternatively, [`fill`] works without cameras, and [`mesh`] is not
//! of Gaussians at all.

mod carve;
pub mod depth_view;
mod fill;
mod hull;
pub mod mesh;
mod refine;
pub mod silhouettes;

use image::GrayImage;
use nalgebra::Point3;

use super::grid::Grid;
use super::grid::surface::Surface;
use super::{Options, PartsError, VolumeMethod};
use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::parallel;
use crate::words::progress::Progress;
use depth_view::DepthView;
use hull::UnseenBound;
use silhouettes::{Silhouette, Silhouettes};

/// A surface counts as behind a cell only if it is farther than this many pixels behind it: the depth of a splat is off
/// by one to three pixels.
const CARVE_TOLERANCE_PIXELS: f64 = 3.0;
/// Views are rendered with at most this many pixels per cell along the side of a cube that has as many cells as the
/// grid: a pixel is then smaller than a cell, and the result improves with a finer grid as far as the photos allow.
const PIXELS_PER_CELL: f64 = 5.0;
/// Views that see a surface farther away than this many tolerances see a different one.
const REFINE_REACH: f64 = 2.0;

/// A grid around the kept Gaussians' centres and one standard deviation beyond.
pub(super) fn grid_around(gaussians: &Gaussians, kept: &[bool], cells: usize) -> Grid {
    let (mut low, mut high) = (Point3::from([f64::INFINITY; 3]), Point3::from([f64::NEG_INFINITY; 3]));
    for i in (0..gaussians.len()).filter(|&i| kept[i]) {
        let deviation = gaussians.covariance(i).diagonal().map(f64::sqrt);
        low = low.inf(&(gaussians.center(i) - deviation));
        high = high.sup(&(gaussians.center(i) + deviation));
    }
    Grid::around(low, high, cells)
}

/// The cells inside the object, and the uncertainty of the surface.
pub(super) struct Inside {
    pub cells: Vec<bool>,
    /// Possible error of the surface's position, scene units.
    pub uncertainty: f64,
    /// Depth and alpha seen by the [`carving_views`]; empty if the volume does not come from views.
    views: Vec<DepthView>,
}

impl Inside {
    /// The outlines of the object in the photos of the views. `cameras` and `coverage` are those of all views.
    pub fn silhouettes<'a>(
        &'a self,
        cameras: &'a [Camera],
        coverage: &'a [Option<GrayImage>],
        options: &Options,
    ) -> Silhouettes<'a> {
        let views = self.views.iter().zip(carving_views(cameras.len(), options));
        let known = |(depth, k): (&'a DepthView, usize)| {
            let coverage = coverage.get(k)?.as_ref()?;
            Some(Silhouette { depth, camera: &cameras[k], coverage })
        };
        Silhouettes { views: views.filter_map(known).collect() }
    }

    /// For each cell of the surface, whether a view sees it. If there are no views, all are taken as seen.
    pub fn in_view(&self, surface: &Surface) -> Vec<bool> {
        let is_seen = |n: usize| {
            let (point, normal) = (surface.points[n], surface.normals[n]);
            self.views.is_empty() || carve::is_seen(&self.views, point, normal, self.uncertainty)
        };
        parallel::map_range(surface.points.len(), is_seen)
    }
}

/// Finds the inside of the object on `grid`.
///
/// # Errors
/// If the method needs cameras and there are none, or if nothing is inside.
pub(super) fn inside(
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
            let views = depth_views(gaussians, cameras, options, progress)?;
            let pixel = pixel_size(grid, &views);
            let mut cells = vec![true; grid.len()];
            UnseenBound::of(gaussians, kept, &views, grid.middle()).clip(grid, &mut cells);
            let tolerance = CARVE_TOLERANCE_PIXELS * pixel;
            carve::carve(grid, &views, tolerance, &mut cells);
            let mut cells = without_border(grid, cells);
            let disagreement = refine::refine(grid, &views, REFINE_REACH * tolerance, &mut cells);
            (cells, pixel.hypot(disagreement), views, "the views see through every place where the splat is")
        }
    };
    let cells = without_border(grid, cells);
    if !cells.contains(&true) {
        return Err(PartsError::NothingInside { why });
    }
    Ok(Inside { cells, uncertainty, views })
}

/// Marks the grid's outermost cells as outside, so that filters and neighbour searches need no edge cases.
fn without_border(grid: &Grid, mut cells: Vec<bool>) -> Vec<bool> {
    const BORDER: usize = 2;
    parallel::for_each_mut(&mut cells, |i, inside| {
        let coords = grid.coords(i);
        *inside &= (0..3).all(|axis| (BORDER..grid.dims[axis] - BORDER).contains(&coords[axis]));
    });
    cells
}

/// The views used for carving: up to `carve_views` of all `count`, spread evenly over their order.
pub fn carving_views(count: usize, options: &Options) -> impl Iterator<Item = usize> + use<> {
    let chosen = options.carve_views.min(count);
    (0..chosen).map(move |k| k * count / chosen)
}

/// The surface as the [`carving_views`] see it.
fn depth_views(
    gaussians: &Gaussians,
    cameras: &[Camera],
    options: &Options,
    progress: Progress,
) -> Result<Vec<DepthView>, PartsError> {
    if cameras.is_empty() {
        return Err(PartsError::NoViews);
    }
    let pixels_max = (PIXELS_PER_CELL * (options.volume_cells as f64).cbrt()).round() as u32;
    let chosen = carving_views(cameras.len(), options);
    let bar = progress.bar("parts", options.carve_views.min(cameras.len()) as u64).with_message("views");
    let views = chosen.map(|k| {
        let view = DepthView::of(gaussians, &cameras[k], pixels_max);
        bar.inc(1);
        view
    });
    let views = views.collect();
    bar.finish_and_clear();
    Ok(views)
}

/// The width of a pixel at the object, scene units, median over the views: no surface is known more precisely.
fn pixel_size(grid: &Grid, views: &[DepthView]) -> f64 {
    let size = |v: &DepthView| (v.camera.center_in_world() - grid.middle()).norm() / v.camera.intrinsics.fx;
    let mut sizes: Vec<f64> = views.iter().map(size).collect();
    sizes.sort_by(f64::total_cmp);
    sizes[sizes.len() / 2]
}
