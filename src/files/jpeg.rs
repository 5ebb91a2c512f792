//! Checks that a JPEG is complete: decoders fill missing data with grey, and half a photo is of no use.

/// True if following the markers of a JPEG (ITU-T T.81, annex B) leads to its end marker. Thumbnails before the picture
/// have end markers too, but inside segments that are skipped.
pub fn is_whole(bytes: &[u8]) -> bool {
    let mut rest = bytes;
    loop {
        // Between markers there may be a scan, in which 0xFF is only ever followed by 0 or begins a restart marker.
        let Some(at) =
            rest.windows(2).position(|pair| pair[0] == 0xFF && !matches!(pair[1], 0 | 1 | 0xD0..=0xD8 | 0xFF))
        else {
            return false;
        };
        if rest[at + 1] == 0xD9 {
            return true;
        }
        let Some(length) = rest.get(at + 2..at + 4) else { return false };
        let segment = usize::from(u16::from_be_bytes([length[0], length[1]]));
        let Some(after) = rest.get(at + 2 + segment..) else { return false };
        rest = after;
    }
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, ImageFormat, RgbImage};

    use super::*;

    fn jpeg() -> Vec<u8> {
        let picture = RgbImage::from_fn(40, 30, |x, y| image::Rgb([(x * 6) as u8, (y * 8) as u8, (x * y) as u8]));
        let mut bytes = std::io::Cursor::new(Vec::new());
        DynamicImage::from(picture).write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn no_beginning_of_a_jpeg_is_whole() {
        let whole = jpeg();
        assert!(is_whole(&whole));
        assert!(is_whole(&[whole.as_slice(), &[0; 10]].concat()), "cameras pad");
        for length in 0..whole.len() {
            assert!(!is_whole(&whole[..length]), "{length} of {}", whole.len());
        }
    }

    #[test]
    fn the_end_of_a_thumbnail_is_not_that_of_the_picture() {
        let thumbnail = jpeg();
        // An APP1 segment after the picture's first two bytes.
        let length = u16::try_from(thumbnail.len() + 2).unwrap().to_be_bytes();
        let whole = [&thumbnail[..2], &[0xFF, 0xE1], &length, &thumbnail, &thumbnail[2..]].concat();
        assert!(is_whole(&whole));
        assert!(!is_whole(&whole[..whole.len() - 100]));
    }
}
