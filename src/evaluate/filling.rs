//! Compares gprop's version of the public solver's particle filling with a run of the public solver (the peer): the
//! same cells must be filled, whatever random position a new particle has in its cell.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::simulation::{SimulationError, raise};
use crate::files::json;
use crate::files::npz::Npz;
use crate::simulate::compat::config::Filling;
use crate::simulate::compat::filling::{Blob, fill, volumes};

/// The differences.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FillComparison {
    pub cells: usize,
    /// Cells whose number of particles differs: before the filling, after filling the dense cells, after filling the
    /// inside.
    pub counts_differ: usize,
    pub dense_differ: usize,
    pub inside_differ: usize,
    pub added: usize,
    pub reference_added: i64,
    /// Largest difference of a cell's density, relative to the largest density; before and after smoothing.
    pub density_rel_max: f64,
    pub density_used_rel_max: f64,
    /// Largest difference of a particle's volume, relative to the volume.
    pub volume_rel_max: f64,
}

impl std::fmt::Display for FillComparison {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        writeln!(f, "particles added: {} (by PhysGaussian: {})", self.added, self.reference_added)?;
        let (counts, dense, inside) = (self.counts_differ, self.dense_differ, self.inside_differ);
        writeln!(
            f,
            "cells with a different number of particles, of {}: {counts} before the filling, {dense} after filling dense \
             cells, {inside} after filling the inside",
            self.cells
        )?;
        let (before, used) = (self.density_rel_max, self.density_used_rel_max);
        writeln!(
            f,
            "density, largest difference relative to the largest density: {before:.1e}, after any smoothing {used:.1e}"
        )?;
        write!(f, "volume, largest relative difference: {:.1e}", self.volume_rel_max)
    }
}

#[derive(Deserialize)]
struct Meta {
    grid_n: usize,
    grid_dx: f32,
    density_thres: f32,
    search_thres: f32,
    max_particles_per_cell: i32,
    search_exclude_dir: i32,
    ray_cast_dir: i32,
    #[serde(default)]
    boundary: Option<[f32; 6]>,
    #[serde(default)]
    smooth: bool,
}

/// The grid of the reference's volumes: the number of cells along each axis, and the grid's side.
const VOLUME_GRID: (usize, f32) = (48, 2.0);

/// Fills the reference's shell and compares the result cell by cell.
///
/// # Errors
/// If the reference cannot be read.
pub fn compare(npz: &mut Npz) -> Result<FillComparison, SimulationError> {
    let meta: Meta = json::read(npz.text("meta")?.as_bytes())?;
    let filling = Filling {
        density_threshold: meta.density_thres,
        search_threshold: meta.search_thres,
        max_partciels_per_cell: meta.max_particles_per_cell,
        search_exclude_direction: meta.search_exclude_dir,
        ray_cast_direction: meta.ray_cast_dir,
        boundary: meta.boundary,
        smooth: meta.smooth,
        ..Filling::default()
    };
    let blobs = blobs(npz)?;
    // The grid is no larger than the reference's arrays, whatever its settings say.
    let cells = meta.grid_n.checked_pow(3).unwrap_or(usize::MAX);
    length("count0", npz.i32s("count0")?.len(), cells)?;
    let filled = fill(&blobs, meta.grid_n, meta.grid_dx, &filling)?;
    let reference_count = |npz: &mut Npz, name, ours: &[i32]| -> Result<usize, SimulationError> {
        let theirs = npz.i32s(name)?;
        length(name, theirs.len(), ours.len())?;
        Ok(ours.iter().zip(theirs).filter(|(a, b)| **a != *b).count())
    };
    let difference = |npz: &mut Npz, name, ours: &[f32]| -> Result<f64, SimulationError> {
        let theirs = npz.f32s(name)?;
        length(name, theirs.len(), ours.len())?;
        let most = theirs.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
        let mut largest = 0.0;
        ours.iter().zip(theirs).for_each(|(a, b)| raise(&mut largest, f64::from((a - b).abs())));
        Ok(if largest == 0.0 { 0.0 } else { f64::from(largest as f32 / most) })
    };
    Ok(FillComparison {
        cells: filled.counts.len(),
        counts_differ: reference_count(npz, "count0", &filled.counts)?,
        dense_differ: reference_count(npz, "count_dense", &filled.counts_dense)?,
        inside_differ: reference_count(npz, "count_internal", &filled.counts_inside)?,
        added: filled.added.len(),
        reference_added: npz.i64s("n_total")?.first().copied().unwrap_or(0),
        density_rel_max: difference(npz, "density", &filled.density)?,
        density_used_rel_max: difference(npz, "density_used", &filled.density_used)?,
        volume_rel_max: largest_difference_of_volumes(npz)?,
    })
}

/// The reference's Gaussians.
fn blobs(npz: &mut Npz) -> Result<Vec<Blob>, SimulationError> {
    let (positions, opacity, covariance) = (npz.f32s("pos")?, npz.f32s("opacity")?, npz.f32s("cov6")?);
    let blobs = positions.chunks_exact(3).zip(covariance.as_chunks::<6>().0).zip(&opacity);
    let blob = |((p, &covariance), &opacity): ((&[f32], &[f32; 6]), &f32)| Blob {
        position: Vector3::from_column_slice(p),
        opacity,
        covariance,
    };
    Ok(blobs.map(blob).collect())
}

/// Of the volumes of the reference's filled particles, relative.
fn largest_difference_of_volumes(npz: &mut Npz) -> Result<f64, SimulationError> {
    let places: Vec<Vector3<f32>> = npz.f32s("out_pos")?.chunks_exact(3).map(Vector3::from_column_slice).collect();
    let (cells, side) = VOLUME_GRID;
    let mut largest = 0.0_f64;
    for (name, uniform) in [("vol_g48", false), ("vol_g48_uniform", true)] {
        let theirs = npz.f32s(name)?;
        length(name, theirs.len(), places.len())?;
        for (a, b) in volumes(&places, cells, side / cells as f32, uniform).iter().zip(theirs) {
            raise(&mut largest, if *a == b { 0.0 } else { f64::from((a / b - 1.0).abs()) });
        }
    }
    Ok(largest)
}

fn length(array: &'static str, found: usize, expected: usize) -> Result<(), SimulationError> {
    if found == expected { Ok(()) } else { Err(SimulationError::Length { array, found, expected }) }
}

#[cfg(test)]
mod tests {
    use std::io::{Cursor, Write};

    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    use super::*;
    use crate::files::npy::write_npy;

    /// A reference without particles: its arrays have 2 x 2 x 2 cells, its settings say `side` cells each way.
    fn reference(side: usize, density: [f32; 8]) -> Npz {
        let meta = serde_json::json!({
            "grid_n": side, "grid_dx": 1.0, "density_thres": 1.0, "search_thres": 1.0, "max_particles_per_cell": 1,
            "search_exclude_dir": 5, "ray_cast_dir": 4,
        });
        let meta = meta.to_string();
        let header = format!("{{'descr': '|S{}', 'fortran_order': False, 'shape': (), }}\n", meta.len());
        let mut text = b"\x93NUMPY\x01\x00".to_vec();
        text.extend((header.len() as u16).to_le_bytes());
        text.extend(header.bytes().chain(meta.bytes()));
        let floats = |values: &[f32]| {
            let mut bytes = Vec::new();
            write_npy(&mut bytes, &[values.len() as u64], values.iter().copied()).unwrap();
            bytes
        };
        let (mut counts, mut total) = (Vec::new(), Vec::new());
        write_npy(&mut counts, &[8], [0_i32; 8]).unwrap();
        write_npy(&mut total, &[1], [0_i64]).unwrap();
        let mut arrays = vec![("meta", text), ("n_total", total), ("density", floats(&density))];
        arrays.push(("density_used", floats(&[0.0; 8])));
        arrays.extend(["count0", "count_dense", "count_internal"].map(|name| (name, counts.clone())));
        let empty = ["pos", "opacity", "cov6", "out_pos", "vol_g48", "vol_g48_uniform"];
        arrays.extend(empty.map(|name| (name, floats(&[]))));
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in arrays {
            zip.start_file(format!("{name}.npy"), SimpleFileOptions::default()).unwrap();
            zip.write_all(&bytes).unwrap();
        }
        Npz::new(zip.finish().unwrap().into_inner()).unwrap()
    }

    #[test]
    fn what_is_not_a_number_differs_and_nothing_does_not() {
        let compared = |density| compare(&mut reference(2, density)).unwrap();
        let same = compared([0.0; 8]);
        assert_eq!((same.cells, same.density_rel_max, same.volume_rel_max), (8, 0.0, 0.0));
        let mut broken = [0.0; 8];
        (broken[0], broken[1]) = (1.0, f32::NAN);
        assert!(compared(broken).density_rel_max.is_nan());
    }

    #[test]
    fn a_grid_that_the_arrays_do_not_have_asks_for_no_memory() {
        for side in [3, 100_000, usize::MAX] {
            let refused = compare(&mut reference(side, [0.0; 8]));
            assert!(matches!(refused, Err(SimulationError::Length { array: "count0", .. })), "{side}: {refused:?}");
        }
    }
}
