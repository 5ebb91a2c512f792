//! Energies and the centre of mass over time, as an SVG.

use super::SimulationReport;

/// Size of the drawing, and left, right, and height of a panel, pixels.
const SIZE: [f64; 2] = [760.0, 520.0];
const SPAN: [f64; 2] = [90.0, 600.0];
const PANEL: f64 = 190.0;
/// Top of each panel.
const TOPS: [f64; 2] = [30.0, 275.0];
/// Grid lines of a panel.
const LINES: usize = 4;
/// Dark enough on white, and told apart by the colour-blind (Okabe and Ito, 2008).
const COLORS: [&str; 4] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7"];

/// One curve: what it shows, and a value a frame.
type Curve = (&'static str, Vec<f64>);

/// Above kinetic, potential and elastic energy and their sum, in J, the potential energy being 0 with the centre of mass on the ground; below
/// the centre of mass, in m from where it was at the start.
pub fn svg(report: &SimulationReport) -> String {
    let frames = &report.frames;
    let of = |value: &dyn Fn(usize) -> f64| (0..frames.len()).map(value).collect::<Vec<f64>>();
    let kinetic = |i: usize| frames[i].kinetic_energy_j;
    let weight_n = report.mass_kg * report.gravity_m_s2;
    let potential = |i: usize| weight_n * (frames[i].center_of_mass_m[2] - report.ground_z_m);
    let elastic = |i: usize| frames[i].elastic_energy_j;
    let moved = |i: usize, a: usize| frames[i].center_of_mass_m[a] - frames[0].center_of_mass_m[a];
    let panels: [(&str, Vec<Curve>); 2] = [
        (
            "energy, J",
            vec![
                ("kinetic", of(&kinetic)),
                ("potential", of(&potential)),
                ("elastic", of(&elastic)),
                ("all", of(&|i| kinetic(i) + potential(i) + elastic(i))),
            ],
        ),
        (
            "centre of mass, m",
            vec![("x", of(&|i| moved(i, 0))), ("y", of(&|i| moved(i, 1))), ("z", of(&|i| moved(i, 2)))],
        ),
    ];
    let end_s = frames.last().map_or(0.0, |f| f.t_s);
    let times = of(&|i| frames[i].t_s / end_s.max(f64::MIN_POSITIVE));
    let [width, height] = SIZE;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    for ((title, curves), top) in panels.iter().zip(TOPS) {
        out += &panel(title, curves, &times, top);
    }
    let (middle, bottom) = ((SPAN[0] + SPAN[1]) / 2.0, TOPS[1] + PANEL + 34.0);
    out += &format!("<text x=\"{middle}\" y=\"{bottom}\" text-anchor=\"middle\">0 to {end_s:.3} s</text>\n</svg>\n");
    out
}

/// A panel's frame, grid, curves and their names at their ends.
fn panel(title: &str, curves: &[Curve], times: &[f64], top: f64) -> String {
    let values = || curves.iter().flat_map(|(_, values)| values.iter().copied()).chain([0.0]);
    let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    let range = (high - low).max(f64::MIN_POSITIVE);
    let y = |value: f64| top + PANEL * (1.0 - (value - low) / range);
    let x = |time: f64| SPAN[0] + (SPAN[1] - SPAN[0]) * time;
    let mut out = format!("<text x=\"{}\" y=\"{}\" font-weight=\"bold\">{title}</text>\n", SPAN[0], top - 10.0);
    for line in 0..=LINES {
        let value = low + range * line as f64 / LINES as f64;
        out += &format!(
            "<path d=\"M{} {y:.1}H{}\" stroke=\"#ddd\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{value:.3}</text>\n",
            SPAN[0],
            SPAN[1],
            SPAN[0] - 8.0,
            y(value) + 4.0,
            y = y(value),
        );
    }
    for (n, ((name, values), color)) in curves.iter().zip(COLORS).enumerate() {
        let points: Vec<String> =
            times.iter().zip(values).map(|(t, value)| format!("{:.1},{:.1}", x(*t), y(*value))).collect();
        out += &format!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.8\"/>\n\
             <text x=\"{}\" y=\"{}\" fill=\"{color}\">{name}</text>\n",
            points.join(" "),
            SPAN[1] + 14.0,
            top + 16.0 + 18.0 * n as f64,
        );
    }
    out
}
