//! The depth of every cell below the object's surface, with sub-cell accuracy.
//!
//! The mask of inside cells is blurred a little; the surface is where the blurred step crosses one half, to first order
//! at a distance of (f - 1/2) / |grad f| from the cell's centre. Deeper cells find the nearest such point by sweeping
//! (Danielsson 1980).

use crate::parallel;
use nalgebra::{Point3, Vector3};

use super::Grid;

/// The first-order distance is used up to this many cells from the surface.
const TRUSTED_CELLS: f64 = 1.5;

/// The surface around a mask of cells.
#[derive(Clone)]
pub struct Surface {
    /// Inside cells that touch the outside, by ascending index.
    pub cells: Vec<u32>,
    /// Per surface cell: the point on the surface nearest to its centre, world frame, scene units.
    pub points: Vec<Point3<f64>>,
    /// Per surface cell: unit normal that points outward; zero if the object is too thin to tell.
    pub normals: Vec<Vector3<f64>>,
    /// Area of each surface cell's share of the surface, scene units squared.
    pub areas: Vec<f64>,
    /// Per cell of the grid: distance of its centre to the surface, scene units; 0 outside.
    pub depth: Vec<f32>,
    /// Per cell of the grid: position in `cells` of the nearest surface cell; `u32::MAX` outside.
    pub nearest: Vec<u32>,
}

/// Stands for no surface cell.
pub const NONE: u32 = u32::MAX;

impl Surface {
    /// Computes the surface of the cells of `inside`. No cell on the grid's border may be inside.
    pub fn of(grid: &Grid, inside: &[bool]) -> Self {
        let blurred = blur(grid, inside);
        let is_surface = |i: usize| inside[i] && grid.neighbours(i).any(|n| !inside[n]);
        let cells: Vec<u32> = parallel::flat_map_range(inside.len(), |i| is_surface(i).then_some(i as u32));
        let local: Vec<(Point3<f64>, Vector3<f64>)> =
            parallel::map(&cells, |&i| local_surface(grid, &blurred, i as usize));
        let (points, normals): (Vec<_>, Vec<_>) = local.into_iter().unzip();
        let (depth, nearest) = distance_to(grid, inside, &cells, &points);
        let areas = areas(grid, &blurred, inside, &nearest, cells.len());
        Self { cells, points, normals, areas, depth, nearest }
    }
}

/// The point on the surface nearest to the centre of surface cell `i`, and the outward normal there.
fn local_surface(grid: &Grid, blurred: &[f32], i: usize) -> (Point3<f64>, Vector3<f64>) {
    let center = grid.center(grid.coords(i));
    let slope = gradient(grid, blurred, i);
    let steepness = slope.norm();
    let Some(normal) = (-slope).try_normalize(1e-6) else { return (center, Vector3::zeros()) };
    let trusted = TRUSTED_CELLS * grid.cell;
    let depth = ((f64::from(blurred[i]) - 0.5) * grid.cell / steepness).clamp(0.0, trusted);
    (center + normal * depth, normal)
}

/// Gradient of the blurred mask, per cell width, by central differences.
fn gradient(grid: &Grid, blurred: &[f32], i: usize) -> Vector3<f64> {
    Vector3::from(grid.strides().map(|stride| 0.5 * (f64::from(blurred[i + stride]) - f64::from(blurred[i - stride]))))
}

/// The mask blurred by the binomial filter [1 4 6 4 1]/16 along each axis: a standard deviation of one cell.
pub fn blur(grid: &Grid, inside: &[bool]) -> Vec<f32> {
    const TAPS: [f32; 5] = [0.0625, 0.25, 0.375, 0.25, 0.0625];
    let mut from: Vec<f32> = inside.iter().map(|&inside| f32::from(u8::from(inside))).collect();
    for stride in grid.strides() {
        let reach = 2 * stride;
        from = parallel::map_range(from.len(), |i| {
            if i < reach || i + reach >= from.len() {
                return 0.0;
            }
            TAPS.iter().enumerate().map(|(tap, weight)| weight * from[i - reach + tap * stride]).sum()
        });
    }
    from
}

/// Area by the co-area formula, the integral of |grad f| over space; each cell's share goes to the nearest surface
/// cell.
fn areas(grid: &Grid, blurred: &[f32], inside: &[bool], nearest: &[u32], surfaces: usize) -> Vec<f64> {
    let margin = grid.layer() + grid.dims[0] + 1;
    let share = grid.cell * grid.cell;
    let around = steps_around();
    let mut areas = vec![0.0; surfaces];
    for i in margin..inside.len() - margin {
        let slope = gradient(grid, blurred, i).norm();
        if slope == 0.0 {
            continue;
        }
        let owner = if inside[i] { Some(nearest[i]) } else { grid_owner(grid, inside, nearest, &around, i) };
        if let Some(owner) = owner.filter(|o| *o != NONE) {
            areas[owner as usize] += slope * share;
        }
    }
    areas
}

/// The blur reaches two cells, a central difference one more.
const REACH: isize = 3;

/// The surface cell to which an outside cell near the surface belongs: that of the nearest inside cell. `around` are the
/// [`steps_around`] it.
fn grid_owner(grid: &Grid, inside: &[bool], nearest: &[u32], around: &[[isize; 3]], i: usize) -> Option<u32> {
    let coords = grid.coords(i);
    let beside = |step: &[isize; 3]| {
        let at: [usize; 3] = std::array::from_fn(|axis| coords[axis].wrapping_add_signed(step[axis]));
        (0..3).all(|axis| at[axis] < grid.dims[axis]).then(|| grid.index(at))
    };
    around.iter().filter_map(beside).find(|n| inside[*n]).map(|n| nearest[n])
}

/// The steps to all cells within [`REACH`] along each axis, the shortest first.
fn steps_around() -> Vec<[isize; 3]> {
    let along = || -REACH..=REACH;
    let planes = along().flat_map(|z| along().map(move |y| (y, z)));
    let mut steps: Vec<[isize; 3]> = planes.flat_map(|(y, z)| along().map(move |x| [x, y, z])).collect();
    steps.sort_by_key(|step| step.iter().map(|way| way * way).sum::<isize>());
    steps
}

/// Per cell of `mask`, its distance to the nearest of `points`, and the index of that point. `seeds[k]` is the cell
/// that `points[k]` belongs to. Forward and backward sweeps pass the nearest point on from cell to cell until nothing
/// changes. A sweep leaves out cells of which no neighbour has changed since the last sweep in its direction.
pub fn distance_to(grid: &Grid, mask: &[bool], seeds: &[u32], points: &[Point3<f64>]) -> (Vec<f32>, Vec<u32>) {
    let mut nearest = vec![NONE; mask.len()];
    let mut distance2 = vec![f64::INFINITY; mask.len()];
    for (k, &seed) in seeds.iter().enumerate() {
        let d2 = (grid.center(grid.coords(seed as usize)) - points[k]).norm_squared();
        if d2 < distance2[seed as usize] {
            distance2[seed as usize] = d2;
            nearest[seed as usize] = k as u32;
        }
    }
    let cells: Vec<u32> = (0..mask.len() as u32).filter(|&i| mask[i as usize]).collect();
    let back = half_neighbourhood(grid);
    // Per cell: whether the next forward and the next backward sweep have to look at it.
    let mut is_due = vec![[true; 2]; mask.len()];
    let mut relax = |i: usize, [direction, other]: [usize; 2], step: isize| {
        if !std::mem::take(&mut is_due[i][direction]) {
            return false;
        }
        let mut changed = false;
        let center = grid.center(grid.coords(i));
        for offset in &back {
            let Some(beside) = i.checked_add_signed(step * offset) else { continue };
            let Some(&candidate) = nearest.get(beside) else { continue };
            if candidate == NONE || candidate == nearest[i] {
                continue;
            }
            let d2 = (center - points[candidate as usize]).norm_squared();
            if d2 < distance2[i] {
                (distance2[i], nearest[i], changed) = (d2, candidate, true);
            }
        }
        if changed {
            for offset in &back {
                for (step, direction) in [(-step, direction), (step, other)] {
                    if let Some(due) = i.checked_add_signed(step * offset).and_then(|beside| is_due.get_mut(beside)) {
                        due[direction] = true;
                    }
                }
            }
        }
        changed
    };
    loop {
        let mut changed = false;
        for &i in &cells {
            changed |= relax(i as usize, [0, 1], -1);
        }
        for &i in cells.iter().rev() {
            changed |= relax(i as usize, [1, 0], 1);
        }
        if !changed {
            break;
        }
    }
    let depth = distance2.iter().map(|d2| if d2.is_finite() { d2.sqrt() as f32 } else { 0.0 }).collect();
    (depth, nearest)
}

/// Offsets of the 13 neighbours of a cell that come before it, as positive numbers to be subtracted.
fn half_neighbourhood(grid: &Grid) -> Vec<isize> {
    let [sx, sy, sz] = grid.strides().map(|s| s as isize);
    let all = (0..27).map(|n| (n % 3 - 1) * sx + (n / 3 % 3 - 1) * sy + (n / 9 - 1) * sz);
    all.filter(|offset| *offset > 0).collect()
}
