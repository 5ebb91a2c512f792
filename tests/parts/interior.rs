//! The object's inside as bytes: what was written is read back, and anything else is refused.

use gprop::parts::{FILLING, Grid, Interior, OUTSIDE, VOID, parts};
use gprop::query::Form;
use gprop::units::{MetricScale, Range, ScaleSource};
use gprop::words::progress::Progress;
use nalgebra::Point3;
use proptest::prelude::*;

use super::clouds::{Cloud, cameras};

const CELLS: usize = 1000;
const PARTS: usize = 3;

fn bytes(interior: &Interior) -> Vec<u8> {
    let mut bytes = Vec::new();
    interior.write(&mut bytes).unwrap();
    bytes
}

fn read(bytes: &[u8]) -> Result<Interior, String> {
    Interior::from_bytes(bytes, CELLS, PARTS).map_err(|error| error.to_string())
}

/// Four cells: one of part 0, one of what fills part 2, one empty, one outside.
fn small() -> Interior {
    let grid = Grid { origin: Point3::new(-1.0, 0.5, 2.0), cell: 0.1, dims: [2, 1, 2] };
    Interior { grid, part: vec![0, FILLING + 2, VOID, OUTSIDE], fraction: vec![1.0, 1.0, 0.0, 0.0] }
}

/// `small` with its bytes replaced by `other` from `at` on.
fn with(at: usize, other: &[u8]) -> Vec<u8> {
    let mut bytes = bytes(&small());
    bytes[at..at + other.len()].copy_from_slice(other);
    bytes
}

#[test]
fn what_the_stage_makes_is_read_as_it_was() {
    let cloud = Cloud::sphere(Point3::origin(), 1.0, 2000, |p| u32::from(p.z > 0.0));
    let shell = Form::Shell { wall_thickness_m: Range::exactly(0.01) };
    let scale =
        MetricScale { meters_per_unit: 1.0, source: ScaleSource::Metric, provenance: String::new(), range: None };
    let options = gprop::parts::Options { volume_cells: 20_000, ..Default::default() };
    let (gaussians, field) = (cloud.gaussians(0.05), cloud.field(&[Form::Solid, shell]));
    let eyes = cameras(4.0, 20, |_| true);
    let made = parts(&gaussians, &field, &eyes, Some(&scale), &options, Progress::HIDDEN).unwrap().interior;
    let written = bytes(&made);
    let found = Interior::from_bytes(&written, options.volume_cells, field.parts.len()).unwrap();
    assert!(found == made);
    assert_eq!(bytes(&found), written);
    assert!(written.len() < 8 * made.part.len() / 2, "{} bytes of {} cells", written.len(), made.part.len());
}

#[test]
fn a_prefix_is_refused() {
    let whole = bytes(&small());
    assert_eq!(read(&whole).unwrap(), small());
    for length in 0..whole.len() {
        let problem = read(&whole[..length]).unwrap_err();
        assert!(problem.contains("cut off") || problem.contains("do not fit its length"), "{length}: {problem}");
    }
    assert!(read(&[&whole[..], &[0]].concat()).unwrap_err().contains("do not fit its length"));
}

#[test]
fn numbers_that_cannot_be_are_refused() {
    const ORIGIN: usize = 12;
    const CELL: usize = ORIGIN + 24;
    const DIMS: usize = CELL + 8;
    const RUNS: usize = DIMS + 32;
    let cases: [(usize, &[u8], &str); 11] = [
        (0, b"G", "the inside of an object"),
        (8, &9_u32.to_le_bytes(), "version is 9, not 2"),
        (ORIGIN, &f64::NAN.to_le_bytes(), "a side of"),
        (CELL, &0.0_f64.to_le_bytes(), "a side of"),
        (CELL, &1e200_f64.to_le_bytes(), "a side of"),
        (DIMS, &0_u64.to_le_bytes(), "cannot have 0 x 1 x 2"),
        (DIMS, &u64::MAX.to_le_bytes(), "a grid of about 1000 cells"),
        (DIMS, &3_u64.to_le_bytes(), "have 4 cells, not 6"),
        (RUNS, &3_u32.to_le_bytes(), "part 3, but there are only 3 parts"),
        (RUNS + 4, &1.5_f32.to_le_bytes(), "in a cell is 1.5"),
        (RUNS + 8, &u32::MAX.to_le_bytes(), "more than 4 cells"),
    ];
    for (at, other, word) in cases {
        let problem = read(&with(at, other)).unwrap_err();
        assert!(problem.contains(word), "no {word:?} in: {problem}");
    }
    assert!(read(&with(RUNS + 4, &f32::NAN.to_le_bytes())).is_err());
}

proptest! {
    #[test]
    fn no_grid_has_more_cells_than_most(sides in prop::array::uniform3(-9.0..3.0_f64), cells in 1000..3_000_000_usize) {
        let extent = sides.map(|side| 10_f64.powf(side));
        let grid = Grid::around(Point3::origin(), extent.into(), cells);
        prop_assert!(grid.len() <= Grid::most_cells(cells), "{extent:?}: {:?}", grid.dims);
    }
}
