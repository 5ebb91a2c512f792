//! Animated GIF with one palette for all pictures.
//!
//! In order: [`Palette`] finds 255 colours for samples of the film (NeuQuant; Dekker, 1994) and maps any colour to its
//! nearest; an ordered dither (Bayer, 1973), which depends on the pixel's place alone, keeps still areas the same in
//! every picture; and each picture stores only the rectangle that changed, and in it only the pixels that did.

use std::borrow::Cow;

use color_quant::NeuQuant;
use gif::{DisposalMethod, Encoder, EncodingError, Frame, Repeat};
use image::{Rgb, RgbImage};

use crate::parallel;

/// Index of a pixel that stays as it is.
const UNCHANGED: u8 = 255;
/// Colours of the palette.
const COLORS: usize = 255;
/// Number of pixels of the samples from which the palette is learned.
const LEARNED_FROM: usize = 150_000;
/// NeuQuant looks at one in this many pixels of the samples.
const LEARNED_SHARE: i32 = 3;
/// Bits of each channel by which the nearest colour is looked up.
const BITS: u32 = 6;
/// Half the range of the dither, of 255: about half the distance of neighbouring colours of a palette for a film.
const DITHER: f32 = 5.0;
/// How long the last picture is shown before the film starts again, in hundredths of a second.
const LAST_CS: u16 = 100;
/// The shortest time for which browsers show a picture, in hundredths of a second.
const SHORTEST_CS: u32 = 2;

/// A GIF that is written picture by picture.
pub struct Gif {
    encoder: Encoder<Vec<u8>>,
    palette: Palette,
    fps: u32,
    /// The indices of the picture shown last, row by row.
    shown: Vec<u8>,
    /// The changes of the next picture to write; its time is known only when the next one comes.
    waiting: Option<Frame<'static>>,
    /// Number of pictures so far, and how long those written are shown.
    count: u32,
    written_cs: u32,
    last_cs: u16,
}

impl Gif {
    /// An endless GIF of pictures as large as the `samples`, which show what colours the film has.
    ///
    /// # Errors
    /// If the encoder fails.
    ///
    /// # Panics
    /// If there is no sample.
    pub fn new(fps: u32, samples: &[RgbImage]) -> Result<Self, EncodingError> {
        let palette = Palette::of(samples);
        let (width, height) = samples[0].dimensions();
        let sides = (width.min(u32::from(u16::MAX)) as u16, height.min(u32::from(u16::MAX)) as u16);
        let mut encoder = Encoder::new(Vec::new(), sides.0, sides.1, &palette.rgb)?;
        encoder.set_repeat(Repeat::Infinite)?;
        let shown = vec![UNCHANGED; width as usize * height as usize];
        Ok(Self { encoder, palette, fps, shown, waiting: None, count: 0, written_cs: 0, last_cs: LAST_CS })
    }

    /// The same, but the first picture follows the last without a pause.
    pub fn in_a_circle(self) -> Self {
        Self { last_cs: (100 / self.fps).max(SHORTEST_CS) as u16, ..self }
    }

    /// Adds a picture. Pictures that would be shown for less time than browsers can show one are left out.
    ///
    /// # Errors
    /// If the encoder fails.
    pub fn add(&mut self, picture: &RgbImage) -> Result<(), EncodingError> {
        let begins_cs = self.count * 100 / self.fps;
        self.count += 1;
        if self.waiting.is_some() && begins_cs < self.written_cs + SHORTEST_CS {
            return Ok(());
        }
        self.write_waiting((begins_cs - self.written_cs) as u16)?;
        let indices = self.palette.indices(picture);
        self.waiting = Some(changes(&self.shown, &indices, picture.width() as usize));
        self.shown = indices;
        Ok(())
    }

    /// The file.
    ///
    /// # Errors
    /// If the encoder fails.
    pub fn finish(mut self) -> Result<Vec<u8>, EncodingError> {
        self.write_waiting(self.last_cs)?;
        self.encoder.into_inner()
    }

    fn write_waiting(&mut self, shown_cs: u16) -> Result<(), EncodingError> {
        let Some(mut frame) = self.waiting.take() else { return Ok(()) };
        frame.delay = shown_cs;
        self.written_cs += u32::from(shown_cs);
        self.encoder.write_frame(&frame)
    }
}

/// The smallest frame that turns the picture `before` into `after`, both of `width` pixels.
fn changes(before: &[u8], after: &[u8], width: usize) -> Frame<'static> {
    let changed = |at: &usize| before[*at] != after[*at];
    let rows = || (0..after.len() / width).filter(|y| before[y * width..][..width] != after[y * width..][..width]);
    let (top, bottom) = (rows().next().unwrap_or(0), rows().next_back().unwrap_or(0));
    let column = |x: &usize| (top..=bottom).any(|y| changed(&(y * width + x)));
    let (left, right) = ((0..width).find(column).unwrap_or(0), (0..width).rev().find(column).unwrap_or(0));
    let pixels = (top..=bottom).flat_map(|y| (left..=right).map(move |x| y * width + x));
    let buffer: Vec<u8> = pixels.map(|at| if changed(&at) { after[at] } else { UNCHANGED }).collect();
    Frame {
        left: left as u16,
        top: top as u16,
        width: (right - left + 1) as u16,
        height: (bottom - top + 1) as u16,
        buffer: Cow::Owned(buffer),
        transparent: Some(UNCHANGED),
        dispose: DisposalMethod::Keep,
        ..Frame::default()
    }
}

/// The colours of a film.
struct Palette {
    /// R, G, B of each.
    rgb: Vec<u8>,
    /// The nearest colour for the upper [`BITS`] bits of each channel.
    nearest: Vec<u8>,
}

impl Palette {
    fn of(samples: &[RgbImage]) -> Self {
        let all: usize = samples.iter().map(|sample| sample.pixels().len()).sum();
        let pixels = samples.iter().flat_map(RgbImage::pixels).step_by((all / LEARNED_FROM).max(1));
        let rgba: Vec<u8> = pixels.flat_map(|&Rgb([r, g, b])| [r, g, b, 255]).collect();
        // The last entry is never shown.
        let mut rgb = NeuQuant::new(LEARNED_SHARE, COLORS, &rgba).color_map_rgb();
        rgb.resize(3 * COLORS, 0);
        rgb.extend([0; 3]);
        let levels = 1usize << BITS;
        let level = |value: usize| ((value * 255) / (levels - 1)) as i32;
        let nearest = parallel::map_range(levels.pow(3), |cell| {
            let wanted = [cell / levels / levels, cell / levels % levels, cell % levels].map(level);
            let distance = |n: usize| (0..3).map(|c| (wanted[c] - i32::from(rgb[3 * n + c])).pow(2)).sum::<i32>();
            (0..COLORS).min_by_key(|n| distance(*n)).unwrap_or(0) as u8
        });
        Self { nearest, rgb }
    }

    /// The dithered picture, as indices row by row.
    fn indices(&self, picture: &RgbImage) -> Vec<u8> {
        let width = picture.width() as usize;
        let most = ((1 << BITS) - 1) as f32;
        let pixels = picture.as_raw().as_chunks::<3>().0;
        parallel::map_range(pixels.len(), |at| {
            let rgb = pixels[at];
            let nudge = DITHER * threshold(at % width, at / width);
            let level = |value: u8| ((f32::from(value) + nudge).clamp(0.0, 255.0) / 255.0 * most).round() as usize;
            self.nearest[level(rgb[0]) << (2 * BITS) | level(rgb[1]) << BITS | level(rgb[2])]
        })
    }
}

/// Bayer's 8 x 8 matrix, from -1 to 1.
fn threshold(x: usize, y: usize) -> f32 {
    let (mut value, mut weight) = (0, 16);
    for bit in 0..3 {
        let (x, y) = (x >> bit & 1, y >> bit & 1);
        value += weight * (2 * (x ^ y) + y);
        weight /= 4;
    }
    (value as f32 - 31.5) / 31.5
}

#[cfg(test)]
mod tests {
    use image::AnimationDecoder;
    use image::codecs::gif::GifDecoder;

    use super::*;

    /// A disc that moves over a gradient.
    fn picture(n: u32) -> RgbImage {
        RgbImage::from_fn(120, 80, |x, y| {
            let from_disc = (f64::from(x) - 20.0 - 8.0 * f64::from(n)).hypot(f64::from(y) - 40.0);
            if from_disc < 15.0 { Rgb([200, 60, 30]) } else { Rgb([x as u8, 120 + y as u8, 200]) }
        })
    }

    fn film(fps: u32, count: u32) -> Vec<u8> {
        let mut gif = Gif::new(fps, &[picture(0), picture(count - 1)]).unwrap();
        (0..count).for_each(|n| gif.add(&picture(n)).unwrap());
        gif.finish().unwrap()
    }

    #[test]
    fn every_picture_of_the_film_is_nearly_the_one_that_was_added() {
        let frames =
            GifDecoder::new(std::io::Cursor::new(film(24, 9))).unwrap().into_frames().collect_frames().unwrap();
        assert_eq!(frames.len(), 9);
        for (n, frame) in (0..).zip(&frames) {
            let apart =
                |(a, b): (&image::Rgba<u8>, &Rgb<u8>)| (0..3).map(|c| f64::from(a[c].abs_diff(b[c]))).sum::<f64>();
            let added = picture(n);
            let error: f64 = frame.buffer().pixels().zip(added.pixels()).map(apart).sum();
            let mean = error / 3.0 / f64::from(120 * 80);
            // The dither moves a channel by up to 5, a palette of 255 colours by a little less.
            assert!(mean < 6.0, "picture {n} is off by {mean}");
        }
        let seconds: f64 = frames[..8]
            .iter()
            .map(|frame| {
                let (ms, by) = frame.delay().numer_denom_ms();
                f64::from(ms) / f64::from(by) / 1e3
            })
            .sum();
        assert!((seconds - 8.0 / 24.0).abs() < 0.011, "{seconds}");
        assert_eq!(film(24, 9), film(24, 9));
    }

    #[test]
    fn a_film_with_too_many_pictures_per_second_leaves_some_out() {
        let frames =
            GifDecoder::new(std::io::Cursor::new(film(60, 7))).unwrap().into_frames().collect_frames().unwrap();
        assert!((4..7).contains(&frames.len()), "{}", frames.len());
    }

    #[test]
    fn what_stands_still_costs_nothing() {
        let still = |count: u32| {
            let mut gif = Gif::new(24, &[picture(0)]).unwrap();
            (0..count).for_each(|_| gif.add(&picture(0)).unwrap());
            gif.finish().unwrap().len()
        };
        assert!(still(20) < still(1) + 19 * 40, "{} and {}", still(1), still(20));
    }
}
