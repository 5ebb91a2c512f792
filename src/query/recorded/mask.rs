//! The mask of a subject as run lengths, and how well two masks overlap.

use image::{GrayImage, RgbImage};
use serde::{Deserialize, Serialize};

use crate::segment::LabelMap;

/// A binary mask: its size and the lengths of its runs, row by row from the upper left corner, background first.
/// Written with the runs as one string, such as `"2045 12 500 14"`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub struct Mask {
    width: u32,
    height: u32,
    runs: Vec<u32>,
}

#[derive(Serialize, Deserialize)]
struct Written {
    width: u32,
    height: u32,
    runs: String,
}

impl Mask {
    /// The pixels of the subject with this id in a label map.
    pub fn of_id(map: &LabelMap, id: u16) -> Self {
        Self::of_pixels((map.width, map.height), map.labels.iter().map(|label| *label == id))
    }

    /// One mask for all regions of a label map: each has a picture of its own, one below the other. Two of them overlap only
    /// as far as the regions have the same numbers.
    pub fn of_regions(map: &LabelMap) -> Self {
        let most = map.labels.iter().copied().max().unwrap_or(0);
        let pixels = (1..=most).flat_map(|region| map.labels.iter().map(move |label| *label == region));
        Self::of_pixels((map.width, map.height.saturating_mul(u32::from(most))), pixels)
    }

    /// The pixels that the object covers at least half.
    pub fn of_foreground(foreground: &GrayImage) -> Self {
        Self::of_pixels(foreground.dimensions(), foreground.pixels().map(|pixel| pixel[0] >= 128))
    }

    /// `pixels` are those of a mask of this size, row by row: true inside.
    fn of_pixels((width, height): (u32, u32), pixels: impl Iterator<Item = bool>) -> Self {
        let mut runs = Vec::new();
        let mut inside = false;
        let mut length = 0;
        for pixel in pixels {
            if pixel != inside {
                runs.push(length);
                length = 0;
                inside = !inside;
            }
            length += 1;
        }
        runs.push(length);
        Self { width, height, runs }
    }

    /// Number of pixels inside.
    pub fn area(&self) -> u64 {
        self.spans().map(|(start, end)| end - start).sum()
    }

    /// Intersection over union, 0 to 1; 0 for masks of different sizes or two empty ones.
    pub fn iou(&self, other: &Self) -> f64 {
        if (self.width, self.height) != (other.width, other.height) {
            return 0.0;
        }
        let shared = self.intersection(other);
        let union = self.area() + other.area() - shared;
        if union == 0 { 0.0 } else { shared as f64 / union as f64 }
    }

    fn intersection(&self, other: &Self) -> u64 {
        let (mut mine, mut theirs) = (self.spans().peekable(), other.spans().peekable());
        let mut shared = 0;
        while let (Some(&(start, end)), Some(&(other_start, other_end))) = (mine.peek(), theirs.peek()) {
            shared += end.min(other_end).saturating_sub(start.max(other_start));
            if end <= other_end {
                mine.next();
            } else {
                theirs.next();
            }
        }
        shared
    }

    /// The mean colour of a picture inside the mask; black if the mask has another size or holds nothing.
    pub fn mean_color(&self, picture: &RgbImage) -> [u8; 3] {
        if picture.dimensions() != (self.width, self.height) || self.area() == 0 {
            return [0; 3];
        }
        let pixels = || {
            self.spans().flat_map(|(start, end)| picture.as_raw()[3 * start as usize..3 * end as usize].chunks_exact(3))
        };
        std::array::from_fn(|channel| {
            (pixels().map(|pixel| u64::from(pixel[channel])).sum::<u64>() / self.area()) as u8
        })
    }

    /// The runs inside the mask as `[start, end)` in pixels from the upper left corner, in ascending order.
    fn spans(&self) -> impl Iterator<Item = (u64, u64)> + '_ {
        let mut at = 0u64;
        self.runs.iter().enumerate().filter_map(move |(index, length)| {
            let start = at;
            at += u64::from(*length);
            (index % 2 == 1).then_some((start, at))
        })
    }
}

impl From<Mask> for Written {
    fn from(mask: Mask) -> Self {
        let runs: Vec<String> = mask.runs.iter().map(u32::to_string).collect();
        Self { width: mask.width, height: mask.height, runs: runs.join(" ") }
    }
}

/// Why a written mask is invalid.
#[derive(Debug, thiserror::Error)]
enum NoMask {
    #[error("{0:?} is not a run length of a mask")]
    Run(String),
    #[error("a mask of {width} x {height} has runs of {pixels} pixels")]
    Pixels { width: u32, height: u32, pixels: u64 },
}

impl TryFrom<Written> for Mask {
    type Error = NoMask;

    fn try_from(written: Written) -> Result<Self, NoMask> {
        let runs: Vec<u32> = written
            .runs
            .split_ascii_whitespace()
            .map(|run| run.parse().map_err(|_| NoMask::Run(run.to_owned())))
            .collect::<Result<_, _>>()?;
        let pixels: u64 = runs.iter().map(|run| u64::from(*run)).sum();
        if pixels != u64::from(written.width) * u64::from(written.height) {
            return Err(NoMask::Pixels { width: written.width, height: written.height, pixels });
        }
        Ok(Self { width: written.width, height: written.height, runs })
    }
}
