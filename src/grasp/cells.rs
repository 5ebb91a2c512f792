//! Points in cubic cells, to find those near a position.

use std::collections::HashMap;

use nalgebra::Point3;

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
        let cells = (low[0]..=high[0])
            .flat_map(move |x| (low[1]..=high[1]).flat_map(move |y| (low[2]..=high[2]).map(move |z| [x, y, z])));
        cells
            .filter_map(|key| self.of_cell.get(&key))
            .flatten()
            .map(|&i| i as usize)
            .filter(move |&i| (self.points[i] - place).norm_squared() <= radius * radius)
    }
}

fn cell(point: &Point3<f64>, side: f64) -> [i64; 3] {
    [point.x, point.y, point.z].map(|v| (v / side).floor() as i64)
}
