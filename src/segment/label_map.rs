//! Label maps as 16-bit grey PNG, the form in which they are kept and exchanged.

use std::io::Cursor;

use image::{DynamicImage, ImageBuffer, ImageFormat, Luma};

use super::LabelMap;

/// Why bytes are no label map.
#[derive(Debug, thiserror::Error)]
pub enum LabelMapError {
    #[error("not a readable PNG: {0}")]
    Png(#[from] image::ImageError),
    #[error("a label map is a grey PNG of 16 (or 8) bits whose values are part ids; this one has pixels of type {0:?}")]
    Pixels(image::ColorType),
}

impl LabelMap {
    /// The label of a pixel.
    pub fn at(&self, x: u32, y: u32) -> u16 {
        self.labels[y as usize * self.width as usize + x as usize]
    }

    /// The map as a 16-bit grey PNG.
    pub fn to_png(&self) -> Result<Vec<u8>, LabelMapError> {
        let pixels: ImageBuffer<Luma<u16>, &[u16]> =
            ImageBuffer::from_raw(self.width, self.height, self.labels.as_slice())
                .expect("a label map has width x height labels");
        let mut bytes = Cursor::new(Vec::new());
        pixels.write_to(&mut bytes, ImageFormat::Png)?;
        Ok(bytes.into_inner())
    }

    /// The map in a grey PNG of 16 or 8 bits.
    pub fn from_png(bytes: &[u8]) -> Result<Self, LabelMapError> {
        let (width, height, labels) = match image::load_from_memory_with_format(bytes, ImageFormat::Png)? {
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
    fn other_pictures_are_refused() {
        let mut png = Cursor::new(Vec::new());
        image::RgbImage::new(2, 2).write_to(&mut png, ImageFormat::Png).unwrap();
        assert!(matches!(LabelMap::from_png(png.get_ref()), Err(LabelMapError::Pixels(_))));
        assert!(matches!(LabelMap::from_png(b"no png"), Err(LabelMapError::Png(_))));
    }
}
