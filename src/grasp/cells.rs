//! Points in cubic cells, to find those near a position.

use std::collections::HashMap;

use nalgebra::Point3;

/// Up to this many cells are looked up even if there are fewer points: those that a radius of a cell's side reaches.
const LEAST_SCANNED: f64 = 27.0;

/// The points of a cloud, sorted into cells.
pub struct Cells<'a> {
    points: &'a [Point3<f64>],
    side: f64,
    of_cell: HashMap<[i64; 3], Vec<u32>>,
}

impl<'a> Cells<'a> {
    pub fn new(points: &'a [Point3<f64>], side: f64) -> Self {
        let mut of_cell: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        for (i, point) in points.iter().enumerate() {
            of_cell.entry(cell(point, side)).or_default().push(i as u32);
        }
        Self { points, side, of_cell }
    }

    /// The points within `radius` of a position, in an order that depends only on the points.
    pub fn near(&self, place: Point3<f64>, radius: f64) -> impl Iterator<Item = usize> {
        let reach = nalgebra::Vector3::repeat(radius);
        let (low, high) = (cell(&(place - reach), self.side), cell(&(place + reach), self.side));
        let count: f64 = (0..3).map(|a| high[a] as f64 - low[a] as f64 + 1.0).product();
        // A radius of many cells' sides reaches more cells than there are points: then all points are looked at instead.
        let (low, high, others) = if count > (self.points.len() as f64).max(LEAST_SCANNED) {
            ([0; 3], [-1; 3], 0..self.points.len())
        } else {
            (low, high, 0..0)
        };
        let cells = (low[0]..=high[0])
            .flat_map(move |x| (low[1]..=high[1]).flat_map(move |y| (low[2]..=high[2]).map(move |z| [x, y, z])));
        cells
            .filter_map(|key| self.of_cell.get(&key))
            .flatten()
            .map(|&i| i as usize)
            .chain(others)
            .filter(move |&i| (self.points[i] - place).norm_squared() <= radius * radius)
    }
}

fn cell(point: &Point3<f64>, side: f64) -> [i64; 3] {
    [point.x, point.y, point.z].map(|v| (v / side).floor() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A palm as wide as an object of a kilometre, in cells of a finger's side: trillions of them.
    #[test]
    fn a_wide_reach_takes_no_longer_than_there_are_points() {
        let points: Vec<Point3<f64>> = (0..1000).map(|i| Point3::new(f64::from(i), 0.0, 0.0)).collect();
        let cells = Cells::new(&points, 0.05);
        let near = |radius: f64| cells.near(points[500], radius).collect::<Vec<_>>();
        assert_eq!(near(400.0), (100..=900).collect::<Vec<_>>());
        assert_eq!(near(0.05), [500]);
    }
}
