//! The picture that shows the whole object from several sides, with its regions numbered in all of them.

use image::{GenericImage, GrayImage, Rgb, RgbImage};

use super::panel::{self, Area};
use super::{ENLARGED_AT_MOST, GAP, LABEL_PX, PAPER, Sheet};
use crate::lettering::Style;
use crate::scene::Photo;
use crate::segment::LabelMap;

/// The object as one view shows it.
#[derive(Debug, Clone, Copy)]
pub struct Side<'a> {
    pub view: &'a str,
    pub photo: &'a Photo,
    /// The regions to number, as large as the photo; `None` if the photo alone is shown.
    pub map: Option<&'a LabelMap>,
}

/// A line between two regions, and the ink around a number: light, so that it shows on dark things; its edge is dark, for
/// light ones.
const LINE: Rgb<u8> = Rgb([255, 255, 255]);
const EDGE: Rgb<u8> = Rgb([20, 20, 20]);
/// The ink of numbers: no material has it.
const NUMBER: Rgb<u8> = Rgb([255, 235, 0]);
/// Pixels of a sheet for each pixel of its numbers' type.
const NUMBER_SHARE: u32 = 70;

impl Sheet {
    /// The object from one to four sides, in panels A to D, on a sheet of at most `longest_side` pixels per side; above them
    /// the outer size of the object, if it is known, and, if `bare` asks for it, the first photos without lines and numbers.
    pub fn of_sides(sides: &[Side], outer_size: Option<&str>, bare: Bare, longest_side: u32) -> Self {
        let Layout { areas, columns, unmarked, head, panel: (width, height), label } =
            Layout::of(sides, outer_size.is_some(), bare, longest_side);
        let marked = || (b'A'..).zip(sides).zip(&areas).map(|((name, side), area)| Panel::new(name, side, *area));
        let panels: Vec<Panel> = marked().take(unmarked as usize).map(Panel::unmarked).chain(marked()).collect();
        let rows = (panels.len() as u32).div_ceil(columns);
        let size = (columns * (width + GAP) + GAP, head + rows * (height + label.height() + GAP) + GAP);
        let mut picture = RgbImage::from_pixel(size.0, size.1, PAPER);
        if let Some(text) = outer_size {
            label.write(&mut picture, text, (GAP as i32, GAP as i32));
        }
        for (n, panel) in (0..).zip(&panels) {
            let x = GAP + n % columns * (width + GAP);
            let y = head + GAP + n / columns * (height + label.height() + GAP);
            label.write(&mut picture, &panel.name, (x as i32, y as i32));
            let drawn = drawn(&panel.side, panel.area, (width, height), longest_side);
            picture.copy_from(&drawn, x, y + label.height()).expect("the sheet was made for its panels");
        }
        Self { picture }
    }
}

/// How the panels of a sheet are laid out, in pixels.
#[derive(Debug)]
pub struct Layout {
    /// By side, the part of its photo that its panels show.
    areas: Vec<Area>,
    columns: u32,
    /// Number of panels without lines, which come first.
    unmarked: u32,
    /// Height of the line with the outer size.
    head: u32,
    /// Width and height of every panel.
    panel: (u32, u32),
    label: Style,
}

impl Layout {
    /// That of [`Sheet::of_sides`].
    pub fn of(sides: &[Side], has_outer_size: bool, bare: Bare, longest_side: u32) -> Self {
        let (columns, rows) = if sides.len() > 3 { (2, 2) } else { (sides.len() as u32, 1) };
        let unmarked = if bare == Bare::First { columns } else { 0 };
        let rows = rows + unmarked / columns;
        let label = Style::semibold(LABEL_PX * (longest_side / 700).max(1));
        let head = if has_outer_size { label.height() + GAP } else { 0 };
        let width = (longest_side - GAP * (columns + 1)) / columns;
        let room = (longest_side - head - (GAP + label.height()) * rows - GAP) / rows;
        let areas: Vec<Area> = sides.iter().map(object_area).collect();
        let most = areas.iter().map(|area| area.height().saturating_mul(ENLARGED_AT_MOST)).max().unwrap_or(1);
        let tallest = areas.iter().map(|area| f64::from(width) / area.aspect()).fold(1.0, f64::max);
        let height = room.min(most.max(1)).min(tallest as u32).max(1);
        Self { areas, columns, unmarked, head, panel: (width, height), label }
    }

    /// The place in the photo of a side, in pixels, that its panel shows at `at`, from the panel's upper left corner, from 0 to 1;
    /// `None` if there is no such side, or its panel shows no photo there.
    pub fn place_in_photo(&self, side: usize, at: [f64; 2]) -> Option<[f64; 2]> {
        panel::place_in_photo(*self.areas.get(side)?, self.panel, at)
    }
}

/// Whether a sheet also shows photos without lines and numbers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Bare {
    /// It shows none: the object fills its photos, so lines hide little of it.
    #[default]
    No,
    /// A row of them: of a thing in a room, photos show so few pixels that lines hide the rim or the gloss that tells what
    /// it is.
    First,
}

/// A panel of the sheet.
struct Panel<'a> {
    name: String,
    side: Side<'a>,
    area: Area,
}

impl<'a> Panel<'a> {
    fn new(name: u8, side: &Side<'a>, area: Area) -> Self {
        Self { name: char::from(name).to_string(), side: *side, area }
    }

    fn unmarked(self) -> Self {
        Self { name: format!("{} without lines", self.name), side: Side { map: None, ..self.side }, ..self }
    }
}

/// Everything that is foreground or numbered, with a margin.
fn object_area(side: &Side) -> Area {
    let (width, height) = side.photo.rgb.dimensions();
    let numbered = side.map.and_then(|map| panel::bounding_box(&mask(map)));
    let object = panel::bounding_box(&side.photo.foreground).into_iter().chain(numbered).reduce(Area::hull);
    object.map_or(Area { x0: 0, y0: 0, x1: width, y1: height }, |object| object.with_margin(width, height))
}

fn mask(map: &LabelMap) -> GrayImage {
    super::mask(map, |label| label != 0)
}

fn drawn(side: &Side, area: Area, size: (u32, u32), longest_side: u32) -> RgbImage {
    let mut picture = panel::object(side.photo, area, size);
    if let Some(map) = side.map {
        let labels = panel::labels(map, area, size);
        draw_lines(&mut picture, &labels);
        draw_numbers(&mut picture, &labels, Style::semibold((longest_side / NUMBER_SHARE).max(9)));
    }
    picture
}

/// Draws a light line, one pixel wide, on one side of every border between two regions, and a dark one on the other.
fn draw_lines(picture: &mut RgbImage, labels: &LabelMap) {
    let (width, height) = (labels.width, labels.height);
    let label = |x: u32, y: u32| labels.labels[(y * width + x) as usize];
    for y in 0..height {
        for x in 0..width {
            let here = label(x, y);
            let next = [(x + 1, y), (x, y + 1)].into_iter().filter(|&(x, y)| x < width && y < height);
            for (nx, ny) in next.filter(|&(nx, ny)| label(nx, ny) != here) {
                picture.put_pixel(x, y, LINE);
                picture.put_pixel(nx, ny, EDGE);
            }
        }
    }
}

/// Writes the number of every region where the region is widest.
fn draw_numbers(picture: &mut RgbImage, labels: &LabelMap, style: Style) {
    for (number, (x, y)) in widest_places(labels) {
        let text = number.to_string();
        let at = (x as i32 - style.width(&text) as i32 / 2, y as i32 - style.height() as i32 / 2);
        for (dx, dy) in [(-1, -1), (-1, 1), (1, -1), (1, 1), (-2, 0), (2, 0), (0, -2), (0, 2)] {
            style.inked(EDGE).write(picture, &text, (at.0 + dx, at.1 + dy));
        }
        style.inked(NUMBER).write(picture, &text, at);
    }
}

/// For every number on the map, by number, the pixel that is farthest from all others (chessboard distance); the first of
/// several.
fn widest_places(labels: &LabelMap) -> Vec<(u16, (u32, u32))> {
    let (width, height) = (labels.width as usize, labels.height as usize);
    let mut depth = vec![0u32; width * height];
    let same = |a: usize, b: usize| labels.labels[a] == labels.labels[b];
    let mut relax = |i: usize, neighbors: &[Option<usize>]| {
        let least = neighbors.iter().map(|n| n.filter(|&n| same(i, n)).map_or(0, |n| depth[n])).min().unwrap_or(0);
        depth[i] = if depth[i] == 0 { least + 1 } else { depth[i].min(least + 1) };
    };
    let place = |x: usize, y: usize, dx: isize, dy: isize| -> Option<usize> {
        let (x, y) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
        (x < width && y < height).then_some(y * width + x)
    };
    const BEFORE: [(isize, isize); 4] = [(-1, 0), (-1, -1), (0, -1), (1, -1)];
    for y in 0..height {
        for x in 0..width {
            relax(y * width + x, &BEFORE.map(|(dx, dy)| place(x, y, dx, dy)));
        }
    }
    for y in (0..height).rev() {
        for x in (0..width).rev() {
            relax(y * width + x, &BEFORE.map(|(dx, dy)| place(x, y, -dx, -dy)));
        }
    }
    let mut widest: std::collections::BTreeMap<u16, usize> = std::collections::BTreeMap::new();
    for (i, &label) in labels.labels.iter().enumerate().filter(|(_, label)| **label != 0) {
        let best = widest.entry(label).or_insert(i);
        if depth[i] > depth[*best] {
            *best = i;
        }
    }
    widest.into_iter().map(|(label, i)| (label, ((i % width) as u32, (i / width) as u32))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_stands_where_its_region_is_widest() {
        // A bar of 3 x 9 pixels that ends in a square of 7 x 7.
        let is_in = |x: u32, y: u32| (x < 9 && (3..6).contains(&y)) || ((9..16).contains(&x) && (1..8).contains(&y));
        let labels = (0..10).flat_map(|y| (0..20).map(move |x| u16::from(is_in(x, y)) * 4)).collect();
        let map = LabelMap { width: 20, height: 10, labels };
        assert_eq!(widest_places(&map), [(4, (12, 4))]);
    }

    /// A photo of 60 x 40 pixels whose columns 10 to 50 are the object.
    fn photo() -> Photo {
        Photo {
            rgb: RgbImage::from_pixel(60, 40, Rgb([90, 60, 30])),
            foreground: GrayImage::from_fn(60, 40, |x, _| image::Luma([if (10..50).contains(&x) { 255 } else { 0 }])),
            foreground_source: crate::scene::ForegroundSource::Mask,
            over_white: false,
        }
    }

    #[test]
    fn a_place_in_a_panel_is_one_in_the_photo() {
        let red = Rgb([255, 0, 0]);
        let mut photo = photo();
        (0..4).for_each(|n| photo.rgb.put_pixel(20 + n % 2, 30 + n / 2, red));
        let side = Side { view: "a", photo: &photo, map: None };
        for sides in [&[side; 3][..], &[side; 4]] {
            let layout = Layout::of(sides, true, Bare::First, 700);
            let (width, height) = layout.panel;
            let panel = panel::object(&photo, object_area(&side), layout.panel);
            let is_red = |(_, _, pixel): &(u32, u32, &Rgb<u8>)| pixel.0[0] > 200 && pixel.0[1] < 60;
            let found: Vec<[f64; 2]> =
                panel.enumerate_pixels().filter(is_red).map(|(x, y, _)| [f64::from(x), f64::from(y)]).collect();
            let mean = |axis: usize| found.iter().map(|at| at[axis] + 0.5).sum::<f64>() / found.len() as f64;
            let at = [mean(0) / f64::from(width), mean(1) / f64::from(height)];
            let [x, y] = layout.place_in_photo(0, at).unwrap();
            assert!((x - 21.0).abs() < 0.2 && (y - 31.0).abs() < 0.2, "{x}, {y} in {} panels", sides.len());
            let beside = [0.5, 0.01];
            assert!(width * 40 > height * 44 || layout.place_in_photo(0, beside).is_none(), "it is all photo");
        }
    }

    #[test]
    fn a_sheet_has_a_panel_for_each_side_and_stays_within_its_size() {
        let photo = photo();
        let map = LabelMap { width: 60, height: 40, labels: (0..40 * 60).map(|i| u16::from(i % 60 > 29)).collect() };
        let side = Side { view: "a", photo: &photo, map: Some(&map) };
        for count in 1..=4 {
            let plain = Sheet::of_sides(&vec![Side { map: None, ..side }; count], None, Bare::No, 512).picture;
            let size = Some("outer size 6 x 4 x 4 cm");
            let numbered = Sheet::of_sides(&vec![side; count], size, Bare::No, 512).picture;
            let with_bare = Sheet::of_sides(&vec![side; count], size, Bare::First, 512).picture;
            assert!(with_bare.height() > numbered.height());
            for sheet in [&plain, &numbered, &with_bare] {
                assert!(sheet.width() <= 512 && sheet.height() <= 512, "{:?}", sheet.dimensions());
            }
            let inked = |sheet: &RgbImage| sheet.pixels().filter(|pixel| **pixel == NUMBER).count();
            assert_eq!(inked(&plain), 0);
            assert_eq!(inked(&with_bare), inked(&numbered), "none in the panels without lines");
            assert!(inked(&numbered) >= 2 * count, "one number in each panel: {}", inked(&numbered));
        }
    }
}
