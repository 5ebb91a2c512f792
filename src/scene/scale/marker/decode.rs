//! Reads the cells of a square.

use nalgebra::{Matrix3, Point2, Vector3};

use super::edges::Lens;
use super::families::Family;
use super::plane::Plane;
use super::quads::Quad;

/// Each cell is read at nine places, this far from its centre along each side, in cells.
const SPREAD: f64 = 0.2;
/// Share of the border's cells that must be black, and of the cells around the marker that must be white. A shadow or a
/// finger on the margin spoils some of them.
const LEAST_SOUND: f64 = 0.8;
/// The same before the corners are located exactly.
const LEAST_SOUND_AT_FIRST: f64 = 0.6;
/// The least difference of white and black, as a share of full light: three values of 255 in the dark half of a photo.
const LEAST_CONTRAST: f64 = 0.01;
/// A blur takes from each cell what it gives to its neighbours; this share of the difference to their mean is given back,
/// twice what AprilTag's detector gives by default.
const SHARPENING: f64 = 0.5;

/// A marker that was read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Read {
    pub id: usize,
    /// Cells that differ from the marker's code.
    pub errors: u32,
    /// Index of the quadrilateral's corner that is the marker's upper left one.
    pub upper_left: usize,
}

/// The light in the cells of a square and in the ring of cells around it.
struct Cells {
    /// Per side, with the ring.
    count: usize,
    light: Vec<f64>,
}

/// The marker of `family` whose corners are those of `quad`, in pixels of a pinhole camera.
pub(super) fn read(plane: &Plane, lens: &Lens, quad: &Quad, family: &Family, codes: &[u64]) -> Option<Read> {
    let cells = Cells::of(plane, lens, quad, family.cells())?;
    let whites = cells.whites(family.inner)?;
    let mut best: Option<Read> = None;
    for upper_left in 0..4 {
        let code = code(&whites, family.inner, upper_left);
        for (id, known) in codes.iter().enumerate() {
            let errors = (code ^ known).count_ones();
            if errors <= family.correctable && best.is_none_or(|best| errors < best.errors) {
                best = Some(Read { id, errors, upper_left });
            }
        }
    }
    best
}

/// Whether `quad` has a dark border and light around it, so that a closer look is worthwhile.
pub(super) fn has_border(plane: &Plane, lens: &Lens, quad: &Quad, cells: usize) -> bool {
    Cells::of(plane, lens, quad, cells).is_some_and(|cells| cells.threshold(LEAST_SOUND_AT_FIRST).is_some())
}

/// The cells as a number, if the corner `upper_left` is the marker's upper left one.
fn code(whites: &[bool], inner: usize, upper_left: usize) -> u64 {
    let last = inner - 1;
    let mut code = 0;
    for row in 0..inner {
        for column in 0..inner {
            let (x, y) = match upper_left {
                0 => (column, row),
                1 => (last - row, column),
                2 => (last - column, last - row),
                _ => (row, last - column),
            };
            code = code << 1 | u64::from(whites[y * inner + x]);
        }
    }
    code
}

impl Cells {
    fn of(plane: &Plane, lens: &Lens, quad: &Quad, cells: usize) -> Option<Self> {
        let to_quad = quad_from_square(quad);
        let count = cells + 2;
        let place = |n: usize, offset: f64| (n as f64 - 0.5 + offset) / cells as f64;
        let mut light = Vec::with_capacity(count * count);
        for row in 0..count {
            for column in 0..count {
                let mut sum = 0.0;
                for (x, y) in (0..9).map(|n| (f64::from(n % 3 - 1) * SPREAD, f64::from(n / 3 - 1) * SPREAD)) {
                    let at = to_quad * Vector3::new(place(column, x), place(row, y), 1.0);
                    sum += plane.light(lens.pixel(Point2::from_homogeneous(at)?)?)?;
                }
                light.push(sum / 9.0);
            }
        }
        Some(Self { count, light })
    }

    fn at(&self, row: usize, column: usize) -> f64 {
        self.light[row * self.count + column]
    }

    /// Halfway between black and white as a plane over the cells, since the light may fall off across the marker: from the
    /// border and the ring around it. `None` unless the share `sound` of both is on its side of the plane.
    fn threshold(&self, sound: f64) -> Option<Vector3<f64>> {
        let (ring, border) = (self.frame(0), self.frame(1));
        let (white, black) = (self.plane(&ring)?, self.plane(&border)?);
        let middle = 0.5 * (white + black);
        let level_at = |plane: &Vector3<f64>, (row, column): (usize, usize)| {
            plane.dot(&Vector3::new(row as f64, column as f64, 1.0))
        };
        let center = (self.count / 2, self.count / 2);
        let share = |frame: &[(usize, usize)], is_white: bool| {
            let sound =
                frame.iter().filter(|cell| (self.at(cell.0, cell.1) > level_at(&middle, **cell)) == is_white).count();
            sound as f64 / frame.len() as f64
        };
        let has_contrast = level_at(&white, center) - level_at(&black, center) >= LEAST_CONTRAST;
        (has_contrast && share(&ring, true) >= sound && share(&border, false) >= sound).then_some(middle)
    }

    /// The cells at this distance from the outermost.
    fn frame(&self, inset: usize) -> Vec<(usize, usize)> {
        let (first, last) = (inset, self.count - 1 - inset);
        let all = (first..=last).flat_map(|row| (first..=last).map(move |column| (row, column)));
        all.filter(|(row, column)| [first, last].contains(row) || [first, last].contains(column)).collect()
    }

    /// The light of these cells as a linear function of row and column (least squares).
    fn plane(&self, cells: &[(usize, usize)]) -> Option<Vector3<f64>> {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (row, column) in cells {
            let place = Vector3::new(*row as f64, *column as f64, 1.0);
            normal += place * place.transpose();
            right += place * self.at(*row, *column);
        }
        Some(normal.try_inverse()? * right)
    }

    /// For each cell inside the border, row by row, whether it is white.
    fn whites(&self, inner: usize) -> Option<Vec<bool>> {
        let threshold = self.threshold(LEAST_SOUND)?;
        let mut whites = Vec::with_capacity(inner * inner);
        for row in 2..inner + 2 {
            for column in 2..inner + 2 {
                let around = [(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)];
                let mean = 0.25 * around.iter().map(|(row, column)| self.at(*row, *column)).sum::<f64>();
                let light = self.at(row, column);
                let sharpened = light + SHARPENING * (light - mean);
                whites.push(sharpened > threshold.dot(&Vector3::new(row as f64, column as f64, 1.0)));
            }
        }
        Some(whites)
    }
}

/// The projective map from the unit square, x to the right and y down, to a quadrilateral (Heckbert, *Fundamentals of
/// Texture Mapping and Image Warping*, 1989).
pub(super) fn quad_from_square(quad: &Quad) -> Matrix3<f64> {
    let [a, b, c, d] = quad;
    let (right, down, sum) = (b - c, d - c, a - b + (c - d));
    let denominator = right.perp(&down);
    let (g, h) = (sum.perp(&down) / denominator, right.perp(&sum) / denominator);
    Matrix3::new(
        b.x - a.x + g * b.x,
        d.x - a.x + h * d.x,
        a.x,
        b.y - a.y + g * b.y,
        d.y - a.y + h * d.y,
        a.y,
        g,
        h,
        1.0,
    )
}
