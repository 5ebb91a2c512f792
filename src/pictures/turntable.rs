//! The object on a turntable: photo colours, parts, materials and stiffness in one picture.

use image::{DynamicImage, GenericImage, Rgb, RgbImage};

use super::figure::{Shown, ShownObject};
use super::panels::{self, Entry, Key};
use super::property::Property;
use super::{field_colors, legends};
use crate::camera::Camera;
use crate::film::{self, Size, orbit};
use crate::lettering::Style;
use crate::render::{Colors, RenderOptions, render};
use crate::scene::robust_bounds;

const PAPER: Rgb<u8> = Rgb([255; 3]);
/// How long a turn takes.
const TURN_S: u32 = 6;
/// Angle by which the cameras look down: enough to see into a cup, but not so much that only a table top shows.
const ELEVATION_RAD: f64 = 22.0 * std::f64::consts::PI / 180.0;
/// The tips of long objects lie beyond the robust bounds by this share of their size.
const BEYOND: f64 = 0.03;
/// Largest share of a cell's width that its legend takes if it is beside the picture.
const LEGEND_SHARE: f64 = 0.5;
/// Largest share of a cell's height that its legend takes if it is below the picture.
const LEGEND_BELOW: f64 = 0.5;

/// The film of a turn.
pub struct Turntable<'a> {
    object: ShownObject<'a>,
    panels: Vec<Panel>,
    layout: Layout,
    cameras: Vec<Camera>,
    /// Titles and legends.
    sheet: RgbImage,
}

struct Panel {
    title: &'static str,
    /// One colour per Gaussian; those of the photos if `None`.
    colors: Option<Vec<[f32; 3]>>,
    legend: Vec<Entry>,
}

/// Cells of equal size, each with a title, a legend and a picture.
struct Layout {
    size: Size,
    columns: u32,
    rows: u32,
    text_px: u32,
    /// Whether the legend is beside the picture; otherwise it is below.
    beside: bool,
    /// Lines of the longest legend, as far as there is room.
    lines: u32,
    /// Width of the widest legend.
    widest: u32,
}

impl<'a> Turntable<'a> {
    /// The film of `object`: photo colours, parts, materials and Young's modulus, or only what is `shown`.
    pub fn new(shown: Shown, object: ShownObject<'a>, film: film::Options) -> Self {
        let panels = panels_of(shown, object);
        let count = (TURN_S * film.fps) as usize;
        let bounds = robust_bounds(object.gaussians);
        let margin = bounds.size() * BEYOND;
        let corners: Vec<_> = orbit::corners([(bounds.min - margin).into(), (bounds.max + margin).into()]).collect();
        // Of the layouts, the one that shows the object largest.
        let layouts = [(panels.len() as u32, 1), (2.min(panels.len() as u32), (panels.len() as u32).div_ceil(2))];
        let with_cameras = layouts.into_iter().map(|(columns, rows)| {
            let layout = Layout::new(film.size, columns, rows, &panels);
            let cameras = orbit::turntable(&corners, 0.0, ELEVATION_RAD, count, layout.picture());
            let pixels_per_unit = cameras[0].intrinsics.fx / cameras[0].point_in_camera(bounds.center()).z;
            (layout, cameras, pixels_per_unit)
        });
        let (layout, cameras, _) = with_cameras.max_by(|a, b| a.2.total_cmp(&b.2)).expect("there are two layouts");
        let sheet = layout.sheet(&panels);
        Self { object, panels, layout, cameras, sheet }
    }

    /// Number of pictures.
    pub fn count(&self) -> usize {
        self.cameras.len()
    }

    /// A picture of the film.
    pub fn picture(&self, index: usize) -> RgbImage {
        let mut sheet = self.sheet.clone();
        for (n, panel) in (0..).zip(&self.panels) {
            let colors = panel.colors.as_deref().map_or(Colors::Sh, Colors::Fixed);
            let options = RenderOptions { colors, ..RenderOptions::default() };
            let picture = render(self.object.gaussians, &self.cameras[index], &options).to_image([1.0; 3]);
            let (x, y) = self.layout.picture_at(n);
            let picture = DynamicImage::ImageRgba8(picture).into_rgb8();
            sheet.copy_from(&picture, x, y).expect("the sheet was made for its pictures");
        }
        sheet
    }
}

fn panels_of(shown: Shown, object: ShownObject) -> Vec<Panel> {
    let field = object.field;
    let photo = || Panel { title: "Photo colours", colors: None, legend: Vec::new() };
    let parts =
        || Panel { title: "Parts", colors: Some(field_colors::part_colors(field)), legend: legends::parts(field) };
    let materials = || Panel {
        title: "Materials",
        colors: Some(field_colors::material_colors(field)),
        legend: legends::materials(field),
    };
    let property = |property: Property| Panel {
        title: property.title(),
        colors: Some(property.colors(field)),
        legend: property.legend(field),
    };
    let confidence = || Panel {
        title: "Confidence",
        colors: Some(field_colors::confidence_colors(field)),
        legend: legends::confidence(),
    };
    match shown {
        Shown::Figure => vec![photo(), parts(), materials(), property(Property::YoungsModulus)],
        Shown::Materials => vec![materials()],
        Shown::Parts => vec![parts()],
        Shown::Confidence => vec![confidence()],
        Shown::Hardness => vec![property(Property::Hardness)],
        Shown::YoungsModulus => vec![property(Property::YoungsModulus)],
        Shown::Density => vec![property(Property::Density)],
        Shown::Friction => vec![property(Property::Friction)],
    }
}

impl Layout {
    fn new(size: Size, columns: u32, rows: u32, panels: &[Panel]) -> Self {
        // A cell of 320 pixels has type of 13.
        let text_px = (size.width / columns.max(2) / 24).min(size.height / 36).max(9);
        let lines = panels.iter().map(|panel| panel.legend.len() as u32).max().unwrap_or(0);
        let entries = panels.iter().flat_map(|panel| &panel.legend);
        let widest = entries.map(|entry| panels::entry_width(entry, text_px)).max().unwrap_or(0);
        let layout = Self { size, columns, rows, text_px, beside: rows > 1, lines, widest };
        Self { lines: lines.min(layout.room()), ..layout }
    }

    fn cell(&self) -> (u32, u32) {
        (self.size.width / self.columns, self.size.height / self.rows)
    }

    fn title(&self) -> Style {
        Style::semibold(self.text_px * 5 / 4)
    }

    fn margin(&self) -> u32 {
        self.text_px
    }

    fn line_height(&self) -> u32 {
        Style::regular(self.text_px).height() + self.text_px / 4
    }

    /// Height above the legend or the picture.
    fn head(&self) -> u32 {
        self.margin() / 2 + self.title().height()
    }

    /// The number of lines for which a cell has room.
    fn room(&self) -> u32 {
        let (_, height) = self.cell();
        let left = if self.beside {
            height.saturating_sub(self.head() + self.margin())
        } else {
            (LEGEND_BELOW * f64::from(height)) as u32
        };
        left / self.line_height()
    }

    fn legend_width(&self) -> u32 {
        let width = self.cell().0;
        if self.beside {
            self.widest.min((LEGEND_SHARE * f64::from(width)) as u32)
        } else {
            width.saturating_sub(2 * self.margin())
        }
    }

    fn picture(&self) -> Size {
        let (width, height) = self.cell();
        let (beside, below) = if self.beside {
            (self.margin() + self.legend_width(), 0)
        } else {
            (0, self.lines * self.line_height() + self.margin() / 2)
        };
        let least = |length: u32| length.max(16);
        let side = |whole: u32, taken: u32| least(whole.saturating_sub(taken));
        Size { width: side(width, beside), height: side(height, below + if self.beside { 0 } else { self.head() }) }
    }

    fn corner(&self, n: u32) -> (u32, u32) {
        let (width, height) = self.cell();
        (n % self.columns * width, n / self.columns * height)
    }

    fn picture_at(&self, n: u32) -> (u32, u32) {
        let (x, y) = self.corner(n);
        let (width, _) = self.cell();
        if self.beside { (x + width - self.picture().width, y) } else { (x, y + self.head()) }
    }

    fn sheet(&self, all: &[Panel]) -> RgbImage {
        let mut sheet = RgbImage::from_pixel(self.size.width, self.size.height, PAPER);
        for (n, panel) in (0..).zip(all) {
            let (x, y) = self.corner(n);
            let x = x + self.margin();
            self.title().write(&mut sheet, panel.title, (x as i32, (y + self.margin() / 2) as i32));
            let top = y + self.head() + if self.beside { self.margin() / 2 } else { self.picture().height };
            let (shown, left_out) = fitting(&panel.legend, self.lines);
            for (row, entry) in (0..).zip(shown.iter().chain(&left_out)) {
                let at = (x, top + row * self.line_height());
                panels::write_entry(&mut sheet, entry, at, self.legend_width(), self.text_px);
            }
        }
        sheet
    }
}

/// The entries of a legend that fit into so many lines, and the line that says how many do not.
fn fitting(legend: &[Entry], lines: u32) -> (&[Entry], Option<Entry>) {
    if legend.len() <= lines as usize {
        return (legend, None);
    }
    let shown = lines.saturating_sub(1) as usize;
    let left_out = Entry { text: format!("and {} more", legend.len() - shown), key: Key::None };
    (&legend[..shown], (lines > 0).then_some(left_out))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_legend_stays_in_its_cell_and_says_how_much_it_leaves_out() {
        let entry = |n: u32| Entry { text: format!("part {n}"), key: Key::Number(PAPER, n) };
        for (rows, columns) in [(2, 2), (1, 4)] {
            let panels: Vec<Panel> = [3, 40, 0, 5]
                .map(|count| Panel { title: "Parts", colors: None, legend: (1..=count).map(entry).collect() })
                .into();
            let layout = Layout::new(Size { width: 1280, height: 720 }, columns, rows, &panels);
            let (_, height) = layout.cell();
            let beside = layout.head() + layout.margin() / 2;
            let top = if layout.beside { beside } else { layout.head() + layout.picture().height };
            assert!(top + layout.lines * layout.line_height() <= height, "{rows} rows");
            assert!(layout.beside || layout.picture().height > height / 3, "{rows} rows");
            let (shown, left_out) = fitting(&panels[1].legend, layout.lines);
            assert_eq!(shown.len() as u32 + 1, layout.lines);
            assert_eq!(left_out.unwrap().text, format!("and {} more", 40 - shown.len()));
            assert!(fitting(&panels[3].legend, layout.lines).1.is_none());
        }
    }

    #[test]
    fn the_narrowest_film_has_no_room_for_legends() {
        let layout = Layout::new(Size { width: 64, height: 2160 }, 4, 1, &[]);
        assert_eq!((layout.cell().0, layout.legend_width()), (16, 0));
    }
}
