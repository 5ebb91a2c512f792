//! Lines, discs and arrows with soft edges, and a scale bar.

use image::{Rgb, RgbImage};
use nalgebra::{Point2, Vector2};

use crate::lettering::{INK, Style, blend};

const WHITE: Rgb<u8> = Rgb([255; 3]);

/// A line of `width` pixels with round ends.
pub fn line(picture: &mut RgbImage, ends: [Point2<f64>; 2], width: f64, color: Rgb<u8>) {
    let along = ends[1] - ends[0];
    let squared = along.norm_squared().max(1e-12);
    cover(picture, ends, 0.5 * width, color, |at| {
        let share = ((at - ends[0]).dot(&along) / squared).clamp(0.0, 1.0);
        (at - (ends[0] + along * share)).norm() - 0.5 * width
    });
}

/// A horizontal bar with sharp ends that reaches `half` above and `half` below its line.
pub fn bar(picture: &mut RgbImage, ends: [Point2<f64>; 2], half: f64, color: Rgb<u8>) {
    let middle = nalgebra::center(&ends[0], &ends[1]);
    let wide = 0.5 * (ends[1].x - ends[0].x);
    cover(picture, ends, half, color, |at| ((at.x - middle.x).abs() - wide).max((at.y - middle.y).abs() - half));
}

/// A filled disc.
pub fn disc(picture: &mut RgbImage, center: Point2<f64>, radius: f64, color: Rgb<u8>) {
    cover(picture, [center; 2], radius, color, |at| (at - center).norm() - radius);
}

/// An arrow to `tip`, with a white edge that sets it off from the picture below.
pub fn arrow(picture: &mut RgbImage, from: Point2<f64>, tip: Point2<f64>, width: f64, color: Rgb<u8>) {
    let Some(along) = (tip - from).try_normalize(1e-9) else { return };
    let across = Vector2::new(-along.y, along.x);
    let wings = [1.0, -1.0].map(|side| tip - along * (3.0 * width) + across * (side * 2.2 * width));
    for (width, color) in [(width + 3.0, WHITE), (width, color)] {
        line(picture, [from, tip], width, color);
        wings.iter().for_each(|wing| line(picture, [*wing, tip], width, color));
    }
}

/// A disc with a number in it and a white edge. The number is dark on a light disc and white on a dark one.
pub fn numbered(picture: &mut RgbImage, center: Point2<f64>, radius: f64, color: Rgb<u8>, number: u32) {
    disc(picture, center, radius + 1.5, WHITE);
    disc(picture, center, radius, color);
    let light = color.0.iter().map(|&c| u32::from(c)).sum::<u32>() > 3 * 125;
    let style = Style::semibold((1.25 * radius).round() as u32).inked(if light { INK } else { WHITE });
    let text = number.to_string();
    let corner = center - Vector2::new(f64::from(style.width(&text)), f64::from(style.height())) * 0.5;
    style.write(picture, &text, (corner.x.round() as i32, corner.y.round() as i32));
}

/// A bar of a round length with its length above it, in the corner in which it covers least of what the picture shows on
/// white: of equal ones the lower left. Nothing if no round length fits.
pub fn scale_bar(picture: &mut RgbImage, pixels_per_meter: f64) {
    /// Longest bar, as a share of the picture's width.
    const LONGEST: f64 = 0.3;
    let (width, height) = (f64::from(picture.width()), f64::from(picture.height()));
    let Some((meters, text)) = round_length(LONGEST * width / pixels_per_meter) else { return };
    let style = Style::semibold((width / 32.0).clamp(12.0, 20.0) as u32);
    let thick = f64::from(style.px) / 5.0;
    let length = meters * pixels_per_meter;
    let (wide, high) = (length.max(f64::from(style.width(&text))), 3.0 * thick + f64::from(style.height()));
    let edge = 0.03 * width;
    let (lower, upper) = (height - edge - thick, edge + high - thick);
    let places = [(edge, lower), (width - edge - wide, lower), (edge, upper), (width - edge - wide, upper)];
    // In percent, since corners differ by a row or a column of pixels.
    let covered = |&(x, y): &(f64, f64)| {
        let within = |from: f64, length: f64, room: u32| from.max(0.0) as u32..((from + length) as u32).min(room);
        let rows = within(y + thick - high, high, picture.height());
        let columns = || within(x, wide, picture.width());
        let all = (rows.len() * columns().len()).max(1);
        let shown = |row| columns().filter(|&column| *picture.get_pixel(column, row) != WHITE).count();
        100 * rows.map(shown).sum::<usize>() / all
    };
    let (x, y) = places.into_iter().min_by_key(covered).expect("four corners");
    let ends = [Point2::new(x, y), Point2::new(x + length, y)];
    let tick = Vector2::new(0.0, 2.0 * thick);
    for (more, color) in [(3.0, WHITE), (0.0, INK)] {
        line(picture, ends, thick + more, color);
        ends.iter().for_each(|end| line(picture, [end - tick, end + tick], 0.7 * thick + more, color));
    }
    let left = x + 0.5 * (length - f64::from(style.width(&text)));
    haloed(picture, style, &text, (left.max(x) as i32, (y - 2.0 * thick) as i32 - style.height() as i32));
}

/// A line with a white edge, its middle at `center`, moved inside the picture.
pub fn centered(picture: &mut RgbImage, style: Style, text: &str, center: Point2<f64>) {
    let corner = |middle: f64, length: u32, room: u32| {
        (middle - 0.5 * f64::from(length)).clamp(2.0, (f64::from(room) - f64::from(length) - 2.0).max(2.0)) as i32
    };
    let (width, height) = picture.dimensions();
    let at = (corner(center.x, style.width(text), width), corner(center.y, style.height(), height));
    haloed(picture, style, text, at);
}

/// A line with a white edge, which sets it off from the picture below.
fn haloed(picture: &mut RgbImage, style: Style, text: &str, at: (i32, i32)) {
    for (dx, dy) in (-2..=2).flat_map(|dy| (-2..=2).map(move |dx| (dx, dy))) {
        style.inked(WHITE).write(picture, text, (at.0 + dx, at.1 + dy));
    }
    style.write(picture, text, at);
}

/// The longest of 1, 2 and 5 times the powers of ten that is at most `meters`, and how it is written.
fn round_length(meters: f64) -> Option<(f64, String)> {
    if !(meters.is_finite() && meters > 1e-6) {
        return None;
    }
    let power = 10f64.powf(meters.log10().floor());
    // A thousandth for rounding: 0.5 m is a length of 0.5 m.
    let length = [5.0, 2.0, 1.0].map(|step| step * power).into_iter().find(|length| *length <= 1.001 * meters)?;
    let text = match length {
        _ if length >= 0.999 => format!("{length:.0} m"),
        _ if length >= 0.00999 => format!("{:.0} cm", 100.0 * length),
        _ if length >= 0.000_999 => format!("{:.0} mm", 1e3 * length),
        _ => format!("{:.0} µm", 1e6 * length),
    };
    Some((length, text))
}

/// Covers the pixels at which `distance` to the shape's edge, negative inside, is below half a pixel.
fn cover(
    picture: &mut RgbImage,
    ends: [Point2<f64>; 2],
    radius: f64,
    color: Rgb<u8>,
    distance: impl Fn(Point2<f64>) -> f64,
) {
    let range = |a: f64, b: f64, size: u32| {
        let (low, high) = (a.min(b) - radius - 1.0, a.max(b) + radius + 1.0);
        (low.clamp(0.0, f64::from(size)) as u32)..(high.clamp(0.0, f64::from(size)) as u32)
    };
    let (width, height) = picture.dimensions();
    for y in range(ends[0].y, ends[1].y, height) {
        for x in range(ends[0].x, ends[1].x, width) {
            let outside = distance(Point2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
            blend(picture, i64::from(x), i64::from(y), color, (0.5 - outside) as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_round() {
        for (meters, length, text) in [
            (0.0999, 0.05, "5 cm"),
            (0.1, 0.1, "10 cm"),
            (0.49, 0.2, "20 cm"),
            (1.7, 1.0, "1 m"),
            (60.0, 50.0, "50 m"),
            (0.009, 0.005, "5 mm"),
            (0.0003, 0.0002, "200 µm"),
        ] {
            let (found, written) = round_length(meters).unwrap();
            assert!((found - length).abs() < 1e-9 * length, "{meters}: {found}");
            assert_eq!(written, text);
        }
        for meters in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(round_length(meters), None);
        }
    }

    #[test]
    fn a_scale_bar_is_as_long_as_it_says() {
        let mut picture = RgbImage::from_pixel(600, 400, Rgb([120, 180, 90]));
        // 30 % of 600 px are 0.36 m, so the bar is 0.2 m, 100 px.
        scale_bar(&mut picture, 500.0);
        let row = 400 - 18 - 4;
        let dark = (0..600).filter(|x| picture.get_pixel(*x, row)[0] < 60).count();
        assert!((98..=106).contains(&dark), "{dark}");

        // An object in the lower left corner keeps clear of it.
        let mut picture = RgbImage::from_pixel(600, 400, WHITE);
        let object = Rgb([120, 180, 90]);
        (300..400).for_each(|y| (0..200).for_each(|x| picture.put_pixel(x, y, object)));
        scale_bar(&mut picture, 500.0);
        assert_eq!(picture.pixels().filter(|pixel| **pixel == object).count(), 100 * 200);
    }
}
