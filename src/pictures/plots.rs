//! Plots as SVG: panels one below the other, each with its axes, a grid, and curves or dots with their names.
//!
//! Texts and axes are black on white; a page with other colours can select them by these two colours and restyle them.

use std::ops::Range;

use plotters::backend::SVGBackend;
use plotters::chart::ChartBuilder;
use plotters::drawing::{DrawingAreaErrorKind, IntoDrawingArea};
use plotters::element::Circle;
use plotters::series::LineSeries;
use plotters::style::{BLACK, Color, IntoFont, RGBColor, TextStyle, WHITE};

/// Size of a panel, pixels. The library places everything on whole pixels, so a picture that is larger than its display
/// size looks smooth.
const PANEL: (u32, u32) = (1600, 600);
/// Space for the numbers along the two axes, and for the names of several series, pixels.
const NUMBERS_BELOW: u32 = 90;
const NUMBERS_LEFT: u32 = 160;
const NAMES_RIGHT: u32 = 240;
/// Half the width of the number below the right end of an axis.
const HALF_A_NUMBER: u32 = 24;
const MARGIN: u32 = 24;
const FONT: &str = "sans-serif";
const CAPTION_SIZE: u32 = 36;
const TEXT_SIZE: u32 = 28;
/// Distance between two names.
const LINE: i32 = 36;
const CURVE_WIDTH: u32 = 4;
const DOT_RADIUS: u32 = 6;
/// Approximate number of labels along an axis.
const NUMBERS: usize = 8;
/// Distinguishable for colour-blind readers (Okabe and Ito, 2008), and dark enough on white.
const COLORS: [RGBColor; 4] =
    [RGBColor(0, 114, 178), RGBColor(213, 94, 0), RGBColor(0, 158, 115), RGBColor(204, 121, 167)];
/// Series over the same quantity, in the same unit.
pub struct Panel {
    /// The quantity drawn, with its unit.
    pub title: String,
    /// The quantity on the horizontal axis, with its unit.
    pub along: &'static str,
    pub series: Vec<Series>,
}

/// Points (x, y). Points that are not finite are left out.
pub struct Series {
    /// Shown in the colour of the series if the panel has several.
    pub name: &'static str,
    pub mark: Mark,
    pub points: Vec<(f64, f64)>,
}

/// How the points of a series are drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    Curve,
    Dots,
}

/// The panels as an SVG document.
pub fn svg(panels: &[Panel]) -> String {
    let mut text = String::new();
    draw(panels, &mut text).expect("a string can be written to");
    text
}

fn draw(panels: &[Panel], text: &mut String) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    let (width, height) = PANEL;
    let whole = SVGBackend::with_string(text, (width, height * panels.len() as u32)).into_drawing_area();
    whole.fill(&WHITE)?;
    // The same for all panels, so that their axes are below each other.
    let names = if panels.iter().any(|panel| panel.series.len() > 1) { NAMES_RIGHT } else { 0 };
    for (area, panel) in whole.split_evenly((panels.len(), 1)).iter().zip(panels) {
        let (along, up) = (axis(panel, |point| point.0), axis(panel, |point| point.1));
        let mut chart = ChartBuilder::on(area)
            .caption(&panel.title, (FONT, CAPTION_SIZE))
            .margin(MARGIN)
            .margin_right(MARGIN + names.max(HALF_A_NUMBER))
            .x_label_area_size(NUMBERS_BELOW)
            .y_label_area_size(NUMBERS_LEFT)
            .build_cartesian_2d(along.clone(), up.clone())?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(BLACK.mix(0.0))
            .bold_line_style(BLACK.mix(0.15))
            .label_style((FONT, TEXT_SIZE))
            .x_labels(NUMBERS)
            .y_labels(NUMBERS)
            .x_label_formatter(&|value| number(*value, &along))
            .y_label_formatter(&|value| number(*value, &up))
            .x_desc(panel.along)
            .draw()?;
        for ((line, series), color) in (0..).zip(&panel.series).zip(COLORS.into_iter().cycle()) {
            let points = series.points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite());
            match series.mark {
                Mark::Curve => chart.draw_series(LineSeries::new(points, color.stroke_width(CURVE_WIDTH)))?,
                Mark::Dots => {
                    chart.draw_series(points.map(|point| Circle::new(point, DOT_RADIUS, color.mix(0.6).filled())))?
                }
            };
            if panel.series.len() > 1 {
                let style = TextStyle::from((FONT, TEXT_SIZE).into_font()).color(&color);
                let below_the_title = (CAPTION_SIZE + 2 * MARGIN) as i32;
                area.draw_text(series.name, &style, ((width - names) as i32, below_the_title + line * LINE))?;
            }
        }
    }
    whole.present()
}

/// From the smallest to the largest coordinate, extended to round numbers; never empty, whatever the points are.
fn axis(panel: &Panel, coordinate: impl Fn(&(f64, f64)) -> f64) -> Range<f64> {
    let points = panel.series.iter().flat_map(|series| &series.points);
    let values = points.map(coordinate).filter(|value| value.is_finite());
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return 0.0..1.0;
    }
    let (extent, size) = (high - low, low.abs().max(high.abs()));
    // If the values are closer to each other than this, all numbers of six digits would be the same.
    if extent > 1e-6 * size {
        return rounded(low..high);
    }
    let half = if size > 0.0 { 0.5 * size } else { 1.0 };
    rounded(low - half..high + half)
}

/// The range, extended to multiples of 1, 2 or 5 times a power of ten, about as far apart as the numbers along an axis.
fn rounded(range: Range<f64>) -> Range<f64> {
    let wanted = (range.end - range.start) / NUMBERS as f64;
    let power = 10f64.powf(wanted.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|step| step * power).into_iter().find(|step| *step >= wanted);
    match step {
        // A billionth of a step is left for rounding errors, so that an end that is round already stays.
        Some(step) if step.is_finite() && step > 0.0 => {
            ((range.start / step + 1e-9).floor() * step)..((range.end / step - 1e-9).ceil() * step)
        }
        _ => range,
    }
}

/// A number along `axis`: up to six digits, with an exponent if it is very large or small; 0 for a residue of rounding.
fn number(value: f64, axis: &Range<f64>) -> String {
    let is_zero = value.abs() < 1e-9 * (axis.end - axis.start);
    let rounded: f64 = if is_zero { 0.0 } else { format!("{value:.5e}").parse().unwrap_or(value) };
    match rounded.abs() {
        size if size == 0.0 || (1e-4..1e6).contains(&size) => rounded.to_string(),
        _ => format!("{rounded:e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel(points: &[(f64, f64)]) -> Panel {
        let series = |mark| Series { name: "a & b", mark, points: points.to_vec() };
        Panel { title: "<b>, J".to_owned(), along: "time, s", series: vec![series(Mark::Curve), series(Mark::Dots)] }
    }

    #[test]
    fn a_plot_is_drawn_whatever_the_points_are() {
        let cases: [&[(f64, f64)]; 7] = [
            &[],
            &[(0.0, 0.0)],
            &[(1.0, 5.0), (2.0, 5.0)],
            &[(0.0, f64::NAN), (1.0, f64::INFINITY)],
            &[(0.0, 1e300), (1.0, -1e300)],
            &[(0.0, 1e-300), (1.0, 2e-300)],
            &[(0.0, 1.0), (1e-9, 1.0 + f64::EPSILON)],
        ];
        for points in cases {
            let text = svg(&[panel(points), panel(points)]);
            assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"), "{points:?}");
            assert!(!text.contains("NaN") && !text.contains("<b>"), "{points:?}: {text}");
        }
    }

    #[test]
    fn every_finite_dot_is_drawn_within_the_picture() {
        let text = svg(&[panel(&[(0.0, 1.0), (0.5, f64::NAN), (1.0, 2.0)])]);
        assert_eq!(text.matches("<circle").count(), 2);
        let (width, height) = PANEL;
        for circle in text.split("<circle").skip(1) {
            let place = |key: &str| -> u32 {
                let from = circle.find(key).unwrap() + key.len();
                circle[from..].split('"').next().unwrap().parse().unwrap()
            };
            assert!(place("cx=\"") < width && place("cy=\"") < height, "{circle}");
        }
    }

    #[test]
    fn axes_end_at_round_numbers() {
        let cases = [(0.0..0.89, 0.0..1.0), (15.0..100.0, 0.0..100.0), (-0.87..1.2, -1.0..1.5), (0.0..40.0, 0.0..40.0)];
        for (values, axis) in cases {
            let found = rounded(values);
            let apart = (found.start - axis.start).abs() + (found.end - axis.end).abs();
            assert!(apart < 1e-9, "{found:?}, not {axis:?}");
        }
    }

    #[test]
    fn numbers_are_short() {
        let cases = [(0.1 + 0.2, "0.3"), (-5.6e-17, "0"), (-1234.5, "-1234.5"), (2e11, "2e11"), (1e-7, "1e-7")];
        for (value, text) in cases {
            assert_eq!(number(value, &(0.0..1.0)), text);
        }
    }
}
