//! Label maps as 16-bit grey PNG, the form in which they are stored and exchanged.

use std::collections::{BTreeMap, BTreeSet};

use image::codecs::png::PngEncoder;
use image::{DynamicImage, ImageBuffer, ImageFormat, ImageReader, Limits, Luma};

use crate::files;

use super::LabelMap;

/// Memory limit for decoding a map: 20,000 x 20,000 labels of two bytes, the largest map that gprop writes, plus what
/// the decoder itself needs.
const MOST_BYTES: u64 = 1 << 30;

/// The reason why bytes are not a valid label map.
#[derive(Debug, thiserror::Error)]
pub enum LabelMapError {
    #[error("not a readable PNG: {0}")]
    Png(#[from] image::ImageError),
    #[error(
        "a label map is a grey PNG of 16 (or 8) bits whose values are segment ids; this one has pixels of type {0:?}"
    )]
    Pixels(image::ColorType),
    #[error("its NumPy array cannot be used: {0}")]
    Npy(String),
    #[error("an array of segment ids is [height, width], [1, height, width] or [4, height, width]; this one is {0:?}")]
    NpyShape(Vec<u64>),
    #[error("an array of segment ids has type int32 or int64, or whole numbers of type float32; this one has {0}")]
    NpyType(String),
    #[error("it has {0} segments, more than 65,535")]
    TooManySegments(usize),
}

impl LabelMap {
    /// The label of a pixel.
    pub fn at(&self, x: u32, y: u32) -> u16 {
        self.labels[y as usize * self.width as usize + x as usize]
    }

    /// The pixels left, right, above and below one, as far as they are in the picture.
    pub fn beside(&self, pixel: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width as usize, self.height as usize);
        let (x, y) = (pixel % width, pixel / width);
        let beside = [
            (x > 0).then(|| pixel - 1),
            (x + 1 < width).then(|| pixel + 1),
            (y > 0).then(|| pixel - width),
            (y + 1 < height).then(|| pixel + width),
        ];
        beside.into_iter().flatten()
    }

    /// The ids that it shows, in order.
    pub fn ids(&self) -> Vec<u16> {
        let ids: BTreeSet<u16> = self.labels.iter().copied().filter(|id| *id != 0).collect();
        ids.into_iter().collect()
    }

    /// Makes a map from segment ids, which are renumbered from 1 in ascending order; negative ids are background.
    pub fn of_ids(width: u32, height: u32, ids: &[i64]) -> Result<Self, LabelMapError> {
        let distinct: BTreeSet<i64> = ids.iter().copied().filter(|&id| id >= 0).collect();
        if distinct.len() > usize::from(u16::MAX) {
            return Err(LabelMapError::TooManySegments(distinct.len()));
        }
        let number: BTreeMap<i64, u16> = distinct.into_iter().zip(1..).collect();
        let labels = ids.iter().map(|id| number.get(id).copied().unwrap_or(0)).collect();
        Ok(Self { width, height, labels })
    }

    /// The map with its ids renumbered from 1, without gaps.
    pub fn renumbered(&self) -> Result<Self, LabelMapError> {
        let ids: Vec<i64> = self.labels.iter().map(|&label| i64::from(label) - 1).collect();
        Self::of_ids(self.width, self.height, &ids)
    }

    /// The map at another size, by nearest-neighbour sampling.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let nearest =
            |index: u32, to: u32, from: u32| (u64::from(index) * 2 + 1) * u64::from(from) / (u64::from(to) * 2);
        let columns: Vec<u32> = (0..width).map(|x| nearest(x, width, self.width) as u32).collect();
        let mut labels = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            let row = nearest(y, height, self.height) as u32;
            labels.extend(columns.iter().map(|&x| self.at(x, row)));
        }
        Self { width, height, labels }
    }

    /// The map as a 16-bit grey PNG.
    pub fn to_png(&self) -> Result<Vec<u8>, LabelMapError> {
        let pixels: ImageBuffer<Luma<u16>, &[u16]> =
            ImageBuffer::from_raw(self.width, self.height, self.labels.as_slice())
                .expect("a label map has width x height labels");
        let mut bytes = Vec::new();
        pixels.write_with_encoder(PngEncoder::new(&mut bytes))?;
        Ok(bytes)
    }

    /// Reads the map from a grey PNG of 16 or 8 bits.
    pub fn from_png(bytes: &[u8]) -> Result<Self, LabelMapError> {
        let mut reader = ImageReader::with_format(files::picture_of(bytes), ImageFormat::Png);
        let mut limits = Limits::default();
        limits.max_alloc = Some(MOST_BYTES);
        reader.limits(limits);
        let (width, height, labels) = match reader.decode()? {
            DynamicImage::ImageLuma16(grey) => (grey.width(), grey.height(), grey.into_raw()),
            DynamicImage::ImageLuma8(grey) => {
                (grey.width(), grey.height(), grey.into_raw().into_iter().map(u16::from).collect())
            }
            other => return Err(LabelMapError::Pixels(other.color())),
        };
        Ok(Self { width, height, labels })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_survives_its_png() {
        let map = LabelMap { width: 3, height: 2, labels: vec![0, 1, 300, 65_535, 2, 0] };
        assert_eq!(LabelMap::from_png(&map.to_png().unwrap()).unwrap(), map);
    }

    #[test]
    fn resizing_takes_the_nearest_pixel() {
        let map = LabelMap { width: 2, height: 1, labels: vec![1, 2] };
        assert_eq!(map.resized(5, 2).labels, [1, 1, 2, 2, 2, 1, 1, 2, 2, 2]);
        assert_eq!(map.resized(2, 1), map);
    }

    #[test]
    fn renumbering_closes_gaps() {
        let map = LabelMap { width: 4, height: 1, labels: vec![7, 0, 300, 7] };
        assert_eq!(map.renumbered().unwrap().labels, [1, 0, 2, 1]);
    }

    #[test]
    fn other_pictures_are_refused() {
        let mut png = std::io::Cursor::new(Vec::new());
        image::RgbImage::new(2, 2).write_to(&mut png, ImageFormat::Png).unwrap();
        assert!(matches!(LabelMap::from_png(png.get_ref()), Err(LabelMapError::Pixels(_))));
        assert!(matches!(LabelMap::from_png(b"no png"), Err(LabelMapError::Png(_))));
    }
}
