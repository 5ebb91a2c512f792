//! The data for the page's viewer: the cloud, the parts' colours, and their properties as text and as numbers.

use serde::Serialize;

use crate::pictures::palette;
use crate::report::motion::Path;
use crate::report::{Cloud, Motion, Report, Sphere};
use crate::units::{Estimate, ShoreScale};
use crate::vote::{FieldPart, field_ply};
use crate::words::part_name::part_name;
use crate::words::readable::figures;

use super::css;

/// All data, as the script reads it.
#[derive(Serialize)]
pub(super) struct Viewer<'a> {
    cloud: Shown<'a>,
    /// In the order of the parts, which the cloud's Gaussians count from 0.
    parts: Vec<ViewerPart<'a>>,
    properties: Vec<Property>,
    motion: Option<Moves<'a>>,
}

/// The cloud without its columns.
#[derive(Serialize)]
pub struct Shown<'a> {
    count: usize,
    of: usize,
    corners: &'a [[f32; 3]; 2],
    log_scales: [f32; 2],
    sphere: Ball,
    eye: [f64; 3],
}

impl<'a> Shown<'a> {
    pub fn new(cloud: &'a Cloud) -> Self {
        let Cloud { count, of, corners, log_scales, sphere, eye, .. } = cloud;
        Self { count: *count, of: *of, corners, log_scales: *log_scales, sphere: (*sphere).into(), eye: (*eye).into() }
    }
}

#[derive(Serialize)]
struct Ball {
    center: [f64; 3],
    radius: f64,
}

impl From<Sphere> for Ball {
    fn from(Sphere { center, radius }: Sphere) -> Self {
        Self { center: center.into(), radius }
    }
}

/// The motion without its tracks. Paths turn about the centre of the cloud's sphere.
#[derive(Serialize)]
struct Moves<'a> {
    times_s: &'a [f64],
    ground_z: f64,
    sphere: Ball,
    /// In the order of the parts.
    paths: &'a [Path],
    /// Number of Gaussians with a track of their own.
    tracks: usize,
    corners: &'a [[f32; 3]; 2],
    log_scales: [f32; 2],
}

#[derive(Serialize)]
struct ViewerPart<'a> {
    id: u32,
    name: String,
    caption: &'a str,
    material: &'a str,
    color: String,
    material_color: String,
}

/// A property by which the object can be coloured.
#[derive(Serialize)]
struct Property {
    name: &'static str,
    unit: &'static str,
    /// True if it is coloured by its logarithm.
    log: bool,
    /// In the order of the parts; `None` if the part has no value.
    values: Vec<Option<Shade>>,
}

/// A value, as a number for the colour and as text.
#[derive(Serialize)]
struct Shade {
    value: f64,
    text: String,
}

/// The viewer's data for `report`, `cloud` and its `motion`.
pub(super) fn viewer<'a>(report: &'a Report, cloud: &'a Cloud, motion: Option<&'a Motion>) -> Viewer<'a> {
    let names = field_ply::material_names(&report.labels);
    let part = |part: &'a FieldPart| ViewerPart {
        id: part.id,
        name: part_name(&part.caption, &part.material),
        caption: &part.caption,
        material: &part.material,
        color: css(palette::part(part.id)),
        material_color: css(
            palette::material(names.iter().position(|name| *name == part.material).unwrap_or(0) as u32),
        ),
    };
    Viewer {
        cloud: Shown::new(cloud),
        parts: report.labels.iter().map(part).collect(),
        properties: properties(&report.labels),
        motion: motion.map(|motion| Moves {
            times_s: &motion.times_s,
            ground_z: motion.ground_z,
            sphere: motion.sphere.into(),
            paths: &motion.paths,
            tracks: motion.tracks.shown.len(),
            corners: &motion.tracks.corners,
            log_scales: motion.tracks.log_scales,
        }),
    }
}

fn properties(parts: &[FieldPart]) -> Vec<Property> {
    let estimates = |name, unit, factor, log, estimate_of: fn(&FieldPart) -> Estimate| {
        property(name, unit, factor, log, parts, |part| Some(estimate_of(part)))
    };
    let shore = |name, scale: ShoreScale| {
        property(name, "", 1.0, false, parts, |part| {
            part.hardness.filter(|hardness| hardness.scale == scale).map(|hardness| hardness.range.into())
        })
    };
    let all = [
        estimates("density", "kg/m³", 1.0, true, |part| part.density_kg_m3),
        estimates("Young's modulus", "GPa", 1e-9, true, |part| part.youngs_modulus_pa),
        estimates("Poisson's ratio", "", 1.0, false, |part| part.poisson_ratio),
        shore("hardness, Shore A", ShoreScale::A),
        shore("hardness, Shore D", ShoreScale::D),
        estimates("friction on rubber", "", 1.0, false, |part| part.friction_rubber),
        estimates("strength", "MPa", 1e-6, true, |part| part.yield_strength_pa),
    ];
    all.into_iter().filter(|property| property.values.iter().any(Option::is_some)).collect()
}

fn property(
    name: &'static str,
    unit: &'static str,
    factor: f64,
    log: bool,
    parts: &[FieldPart],
    estimate_of: impl Fn(&FieldPart) -> Option<Estimate>,
) -> Property {
    let shade = |estimate: Estimate| {
        let shown = figures(estimate, factor);
        let space = if unit.is_empty() { "" } else { " " };
        Shade { value: estimate.mid * factor, text: format!("{}{space}{unit} ({})", shown.mid, shown.interval) }
    };
    Property { name, unit, log, values: parts.iter().map(|part| estimate_of(part).map(shade)).collect() }
}
