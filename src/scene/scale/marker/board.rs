//! A marker on a page for printing, with its size and a ruler.

use std::fmt::Write;

use super::families::Marker;

/// Length of the ruler in millimetres: it fits on any sheet, and a printer's error of half a percent shows on it.
const RULER_MM: usize = 100;
/// Free space around everything; few printers reach the edge of a sheet.
const MARGIN_MM: f64 = 10.0;
/// Height of the text.
const TEXT_MM: f64 = 4.0;
/// Height of the lines of text below the marker and of the ruler together.
const FOOT_MM: f64 = 38.0;

/// The page as SVG, in millimetres. The marker's side is `side_m` metres.
pub fn svg(marker: &Marker, side_m: f64) -> String {
    let side = side_m * 1e3;
    let cells = marker.family.cells();
    let cell = side / cells as f64;
    // The white ring that the detector needs is part of the page.
    let (left, top) = (MARGIN_MM + cell, MARGIN_MM + cell);
    let width = (side + 2.0 * cell).max(RULER_MM as f64 + 4.0 * TEXT_MM) + 2.0 * MARGIN_MM;
    let height = side + 2.0 * cell + FOOT_MM + 2.0 * MARGIN_MM;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" viewBox=\"0 0 {width} {height}\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n\
         <path fill=\"#000\" fill-rule=\"evenodd\" d=\"M{left} {top}h{side}v{side}h-{side}z"
    );
    let inner = marker.family.inner;
    let mut whites = marker.whites().into_iter().enumerate().filter(|(_, white)| *white).peekable();
    // White cells of a row that touch are one hole, so that no line shows between them.
    while let Some((at, _)) = whites.next() {
        let mut length = 1;
        while whites.next_if(|(next, _)| *next == at + length && next % inner != 0).is_some() {
            length += 1;
        }
        let (x, y) = (left + cell * (at % inner + 1) as f64, top + cell * (at / inner + 1) as f64);
        let length = cell * length as f64;
        let _ = write!(svg, "M{x} {y}h{length}v{cell}h-{length}z");
    }
    svg.push_str("\"/>\n");
    let mut line = top + side + cell + TEXT_MM;
    let mut text = |x: f64, y: f64, size: f64, anchor: &str, text: &str| {
        let _ = writeln!(
            svg,
            "<text x=\"{x}\" y=\"{y}\" font-family=\"sans-serif\" font-size=\"{size}\" text-anchor=\"{anchor}\">{text}</text>"
        );
    };
    text(MARGIN_MM, line, TEXT_MM, "start", &format!("{marker}, side of the black square {side:.1} mm"));
    line += 1.5 * TEXT_MM;
    text(MARGIN_MM, line, TEXT_MM, "start", &format!("--scale {marker}={side:.1}mm"));
    line += 1.5 * TEXT_MM;
    let how = "Print at 100 %. Measure the square, and give what you measure.";
    text(MARGIN_MM, line, 0.8 * TEXT_MM, "start", how);
    line += 0.8 * TEXT_MM;
    for mm in (0..=RULER_MM).step_by(10) {
        let label = if mm == RULER_MM { format!("{mm} mm") } else { mm.to_string() };
        text(MARGIN_MM + TEXT_MM + mm as f64, line + 2.5 * TEXT_MM, 0.7 * TEXT_MM, "middle", &label);
    }
    svg.push_str("<path stroke=\"#000\" stroke-width=\"0.2\" fill=\"none\" d=\"");
    let _ = write!(svg, "M{} {line}h{RULER_MM}", MARGIN_MM + TEXT_MM);
    for mm in 0..=RULER_MM {
        let tick = if mm % 10 == 0 {
            6.0
        } else if mm % 5 == 0 {
            4.5
        } else {
            3.0
        };
        let _ = write!(svg, "M{} {line}v{tick}", MARGIN_MM + TEXT_MM + mm as f64);
    }
    svg.push_str("\"/>\n</svg>\n");
    svg
}
