//! The prompts for SAM: a grid of points over the picture and over crops of it (the public `build_point_grid` and
//! `generate_crop_boxes`).

use super::mask::Rect;

/// A part of the picture that is encoded and prompted on its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Crop {
    pub rect: Rect,
    /// Points along each side of its grid.
    pub points_per_side: u32,
}

/// The whole picture, then `layers` layers of crops: layer i has 2^i crops per side. They overlap by `overlap` of the
/// picture's shorter side in the first layer and by less in each further one; their grids have `downscale`^i times
/// fewer points per side.
pub fn crops(width: u32, height: u32, points_per_side: u32, layers: u32, overlap: f64, downscale: u32) -> Vec<Crop> {
    let mut crops = vec![Crop { rect: Rect::of_size(width, height), points_per_side }];
    for layer in 1..=layers {
        let per_side = 1_u32 << layer;
        let overlap = (overlap * f64::from(width.min(height)) * (2.0 / f64::from(per_side))) as u32;
        let length = |side: u32| (overlap * (per_side - 1) + side).div_ceil(per_side);
        let (crop_width, crop_height) = (length(width), length(height));
        let points_per_side = (points_per_side / downscale.saturating_pow(layer).max(1)).max(1);
        for column in 0..per_side {
            for row in 0..per_side {
                let (x0, y0) = ((crop_width - overlap) * column, (crop_height - overlap) * row);
                let rect = Rect { x0, y0, x1: (x0 + crop_width).min(width), y1: (y0 + crop_height).min(height) };
                if rect.x0 < rect.x1 && rect.y0 < rect.y1 {
                    crops.push(Crop { rect, points_per_side });
                }
            }
        }
    }
    crops
}

/// As many of `per_side` points along each side as are worth asking if masks of fewer than `min_area` pixels do not count: with more,
/// the smallest that counts would hold more than [`ENOUGH`] points on the average.
pub fn worth_asking(per_side: u32, rect: &Rect, min_area: u32) -> u32 {
    let smallest = f64::from(rect.width()) * f64::from(rect.height()) / f64::from(min_area.max(1));
    per_side.min((ENOUGH * smallest).sqrt().ceil() as u32).max(1)
}

/// Two along each side of a square.
const ENOUGH: f64 = 4.0;

/// The centres of `per_side` x `per_side` equal cells of a picture, row by row, in pixels from its corner.
pub fn grid(width: u32, height: u32, per_side: u32) -> Vec<[f64; 2]> {
    let share = |index: u32| (f64::from(index) + 0.5) / f64::from(per_side);
    let rows = 0..per_side;
    rows.flat_map(|row| {
        (0..per_side).map(move |column| [share(column) * f64::from(width), share(row) * f64::from(height)])
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_cell_centres_row_by_row() {
        assert_eq!(grid(8, 4, 2), [[2.0, 1.0], [6.0, 1.0], [2.0, 3.0], [6.0, 3.0]]);
    }

    #[test]
    fn the_smallest_mask_that_counts_holds_four_points() {
        // 15 x 10 squares of 300 pixels.
        let rect = Rect::of_size(300, 150);
        assert_eq!(worth_asking(32, &rect, 300), 25, "600 points, rounded up to a square");
        assert_eq!(worth_asking(16, &rect, 300), 16);
        assert_eq!((worth_asking(32, &rect, 0), worth_asking(32, &Rect::of_size(3, 1), 300)), (32, 1));
    }

    #[test]
    fn crops_are_those_of_the_public_generator() {
        // As recorded with the reference masks of a picture of 800 x 535: crops of 491 x 359 at 0 and 309, 0 and 177.
        let crops = crops(800, 535, 16, 1, 512.0 / 1500.0, 1);
        let rects: Vec<_> = crops.iter().map(|crop| crop.rect).collect();
        let rect = |x0, y0, x1, y1| Rect { x0, y0, x1, y1 };
        assert_eq!(
            rects,
            [
                rect(0, 0, 800, 535),
                rect(0, 0, 491, 359),
                rect(0, 177, 491, 535),
                rect(309, 0, 800, 359),
                rect(309, 177, 800, 535)
            ]
        );
        assert!(crops.iter().all(|crop| crop.points_per_side == 16));
    }

    #[test]
    fn deeper_layers_have_sparser_grids_and_tiny_pictures_no_empty_crops() {
        let crops = crops(3, 1, 32, 2, 0.34, 2);
        assert_eq!(crops[0].points_per_side, 32);
        assert_eq!(crops.last().unwrap().points_per_side, 8);
        assert!(crops.iter().all(|crop| crop.rect.width() > 0 && crop.rect.height() > 0));
    }
}
