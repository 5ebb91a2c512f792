//! A picture for a mesh, without seams: each triangle has half of a square tile of its own, with the pixels around it
//! that a viewer blends with. Tiles grow with their triangles in powers of two, so that rows of equal tiles fill the
//! picture. Neighbours on the picture have similar colours, because viewers blend pixels of neighbouring tiles from afar.

use nalgebra::Point3;

use super::Mesh;

/// Side of the picture of the largest mesh, pixels, and of the smallest.
const SIDE: u32 = 1024;
const LEAST_SIDE: u32 = 256;
/// Pixels along a triangle's legs.
const STEPS: [u32; 6] = [2, 4, 8, 16, 32, 64];
/// Pixels of a tile besides those along a leg: where it starts, and two so that the halves do not share any.
const EXTRA: u32 = 3;

/// Where a triangle is on the picture: its first corner in a corner of a tile, the other two along its sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tile {
    /// The tile's first pixel.
    pub origin: [u32; 2],
    /// Pixels from the first corner to each of the others.
    pub steps: u32,
    /// Whether the triangle has the tile's other half, turned by half a turn.
    pub second: bool,
}

impl Tile {
    /// The pixel that is `along` pixels from the first corner towards the second and third corners.
    pub fn pixel(&self, along: [u32; 2]) -> [u32; 2] {
        let last = self.steps + EXTRA - 1;
        [0, 1].map(|axis| self.origin[axis] + if self.second { last - along[axis] } else { along[axis] })
    }

    /// Where its corners are on a picture of this size, from 0 to 1 with v upwards.
    pub fn uv(&self, size: [u32; 2]) -> [[f64; 2]; 3] {
        [[0, 0], [self.steps, 0], [0, self.steps]].map(|along| {
            let [x, y] = self.pixel(along).map(|pixel| f64::from(pixel) + 0.5);
            [x / f64::from(size[0]), 1.0 - y / f64::from(size[1])]
        })
    }
}

/// A tile for each triangle, and the size of the picture. `colors` are the triangles', roughly; the mesh's surface is this share of the
/// largest.
pub fn layout(mesh: &Mesh, colors: &[[u8; 3]], share: f64) -> (Vec<Tile>, [u32; 2]) {
    let side = ((f64::from(SIDE) * share.sqrt()) as u32).clamp(LEAST_SIDE, SIDE);
    let longest: Vec<f64> = mesh.triangles.iter().map(|t| longest_side(mesh.corners(*t))).collect();
    let (mut fine, mut coarse) = (0.0, longest.iter().copied().fold(0.0, f64::max));
    // The finest pixels with which all tiles fit, to a thousandth.
    for _ in 0..10 {
        let middle = 0.5 * (fine + coarse);
        if height(&longest, middle, side) > side { fine = middle } else { coarse = middle }
    }
    let tiles = place(&longest, &by_color(colors), coarse, side);
    let rows = height(&longest, coarse, side);
    (tiles, [side, rows.max(1)])
}

fn longest_side([a, b, c]: [Point3<f64>; 3]) -> f64 {
    (b - a).norm().max((c - b).norm()).max((a - c).norm())
}

/// The index in [`STEPS`] of a triangle whose pixels have this size.
fn class(longest: f64, pixel: f64) -> usize {
    STEPS.iter().position(|steps| f64::from(*steps) * pixel >= longest).unwrap_or(STEPS.len() - 1)
}

fn height(longest: &[f64], pixel: f64, side: u32) -> u32 {
    let mut count = [0u32; STEPS.len()];
    longest.iter().for_each(|side| count[class(*side, pixel)] += 1);
    let rows = |(steps, count): (&u32, &u32)| {
        let tile = steps + EXTRA;
        count.div_ceil(2).div_ceil(side / tile) * tile
    };
    STEPS.iter().zip(&count).map(rows).sum()
}

/// The triangles in the order of a curve through the cube of all colours (Morton 1966).
fn by_color(colors: &[[u8; 3]]) -> Vec<usize> {
    let code = |t: &usize| {
        (0..8).fold(0u32, |code, bit| {
            (0..3).fold(code, |code, channel| code | (u32::from(colors[*t][channel]) >> bit & 1) << (3 * bit + channel))
        })
    };
    let mut order: Vec<usize> = (0..colors.len()).collect();
    order.sort_by_cached_key(|t| (code(t), *t));
    order
}

fn place(longest: &[f64], order: &[usize], pixel: f64, side: u32) -> Vec<Tile> {
    let mut tiles = vec![Tile { origin: [0; 2], steps: 0, second: false }; longest.len()];
    let mut top = 0;
    for (n, &steps) in STEPS.iter().enumerate() {
        let tile = steps + EXTRA;
        let per_row = side / tile;
        let mut placed = 0;
        for t in order.iter().copied().filter(|t| class(longest[*t], pixel) == n) {
            let square = placed / 2;
            let origin = [square % per_row * tile, top + square / per_row * tile];
            tiles[t] = Tile { origin, steps, second: placed % 2 == 1 };
            placed += 1;
        }
        top += u32::div_ceil(placed, 2).div_ceil(per_row) * tile;
    }
    tiles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_pixel_has_two_triangles() {
        let mut random = fastrand::Rng::with_seed(1);
        let longest: Vec<f64> = (0..3000).map(|_| 0.5 + 20.0 * random.f64().powi(4)).collect();
        let pixel = 0.2;
        let rows = height(&longest, pixel, SIDE);
        let mut used = vec![false; (SIDE * rows) as usize];
        for tile in place(&longest, &(0..3000).collect::<Vec<_>>(), pixel, SIDE) {
            for x in 0..=tile.steps + 1 {
                for y in 0..=tile.steps + 1 - x {
                    let [x, y] = tile.pixel([x, y]);
                    assert!(x < SIDE && y < rows, "{tile:?}");
                    assert!(!std::mem::replace(&mut used[(y * SIDE + x) as usize], true), "{tile:?}");
                }
            }
        }
    }
}
