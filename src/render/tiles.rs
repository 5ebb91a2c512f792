//! The splats that touch each tile, front to back.
//!
//! Splats are sorted by depth, then by index. Runs of [`RUN`] sorted splats are binned separately and in parallel; a
//! tile's list is the concatenation of its entries in all runs, so its order never depends on the number of threads.

use crate::parallel;

use super::project::{ALPHA_MIN, Splat};

/// Side of a tile in pixels.
pub const TILE: usize = 16;
/// Number of splats binned together: enough that a run's table of tiles is small compared with its entries.
const RUN: usize = 16_384;

/// Splats of one camera sorted front to back, and the tiles they touch.
pub(super) struct Tiles {
    pub columns: usize,
    pub rows: usize,
    pub splats: Vec<Splat>,
    runs: Vec<Run>,
}

/// The tiles touched by one run of sorted splats, as a compressed sparse table.
struct Run {
    /// Tile `t` holds `entries[starts[t]..starts[t + 1]]`. 32 bits would not do: if every splat of a run covers a picture of
    /// 8192 x 8192 pixels, there are 2^32 entries.
    starts: Vec<usize>,
    /// Positions in the sorted splats, ascending within a tile.
    entries: Vec<u32>,
}

impl Tiles {
    pub fn new(width: usize, height: usize, splats: Vec<Splat>) -> Self {
        let splats = sorted_by_depth(splats);
        let (columns, rows) = (width.div_ceil(TILE), height.div_ceil(TILE));
        let runs = parallel::map_range(splats.len().div_ceil(RUN), |n| {
            let first = n * RUN;
            Run::new(columns, rows, first as u32, &splats[first..splats.len().min(first + RUN)])
        });
        Self { columns, rows, splats, runs }
    }

    /// The splats that touch tile `t` (row by row), front to back.
    pub fn of(&self, t: usize) -> impl Iterator<Item = &Splat> {
        self.runs
            .iter()
            .flat_map(move |run| &run.entries[run.starts[t]..run.starts[t + 1]])
            .map(|&entry| &self.splats[entry as usize])
    }
}

fn sorted_by_depth(splats: Vec<Splat>) -> Vec<Splat> {
    // Depths are positive, so their bits sort in the same order; the position breaks ties and makes every key unique.
    let key = |position: usize| u64::from(splats[position].depth.to_bits()) << 32 | position as u64;
    let mut keys = parallel::map_range(splats.len(), key);
    parallel::sort_unstable_by(&mut keys, Ord::cmp);
    parallel::map(&keys, |&key| splats[(key & 0xffff_ffff) as usize])
}

impl Run {
    fn new(columns: usize, rows: usize, first: u32, splats: &[Splat]) -> Self {
        let mut starts = vec![0usize; columns * rows + 1];
        for splat in splats {
            for_touched_tiles(splat, columns, rows, |t| starts[t + 1] += 1);
        }
        for t in 0..columns * rows {
            starts[t + 1] += starts[t];
        }
        let mut next = starts.clone();
        let mut entries = vec![0u32; starts[columns * rows]];
        for (position, splat) in (first..).zip(splats) {
            for_touched_tiles(splat, columns, rows, |t| {
                entries[next[t]] = position;
                next[t] += 1;
            });
        }
        Self { starts, entries }
    }
}

/// Calls `touch` with every tile that the splat's ellipse of [`ALPHA_MIN`] meets, row by row.
fn for_touched_tiles(splat: &Splat, columns: usize, rows: usize, mut touch: impl FnMut(usize)) {
    let tile = TILE as f32;
    let (y_first, y_last) = (splat.center[1] - splat.reach[1], splat.center[1] + splat.reach[1]);
    let first_row = (y_first / tile).max(0.0) as usize;
    let last_row = ((y_last / tile).max(0.0) as usize).min(rows.saturating_sub(1));
    for row in first_row..=last_row {
        let top = row as f32 * tile - splat.center[1];
        let Some((left, right)) = span_of_band(splat, top, top + tile) else { continue };
        let first = ((splat.center[0] + left) / tile).max(0.0) as usize;
        let end = ((splat.center[0] + right) / tile).ceil().clamp(0.0, columns as f32) as usize;
        for column in first..end {
            touch(row * columns + column);
        }
    }
}

/// The extent of the ellipse to the left and right of its centre within the band `top..bottom` (px below its centre);
/// `None` if they do not meet.
fn span_of_band(splat: &Splat, top: f32, bottom: f32) -> Option<(f32, f32)> {
    let [a, b, c] = splat.conic;
    let q = 2.0 * (splat.opacity / ALPHA_MIN).ln();
    let (top, bottom) = (top.max(-splat.reach[1]), bottom.min(splat.reach[1]));
    if top > bottom {
        return None;
    }
    // Ends of the chord a x^2 + 2 b x y + c y^2 = q at height y.
    let chord = |y: f32| {
        let root = ((b * y).powi(2) - a * (c * y * y - q)).max(0.0).sqrt();
        ((-b * y - root) / a, (-b * y + root) / a)
    };
    let (top_chord, bottom_chord) = (chord(top), chord(bottom));
    // The ellipse is widest at these heights.
    let y_of_right = -b / c * splat.reach[0];
    let within = |y: f32| top <= y && y <= bottom;
    let left = if within(-y_of_right) { -splat.reach[0] } else { top_chord.0.min(bottom_chord.0) };
    let right = if within(y_of_right) { splat.reach[0] } else { top_chord.1.max(bottom_chord.1) };
    Some((left, right))
}
