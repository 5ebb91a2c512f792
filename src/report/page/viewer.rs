//! The data for the page's viewer: the cloud, the parts' colours, and their properties as text and as numbers.

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde::Serialize;

use crate::pictures::palette;
use crate::report::numbers::{interval, short, significant};
use crate::report::{Cloud, Report};
use crate::units::{Estimate, ShoreScale};
use crate::vote::{FieldLabel, field_ply};

use super::css;

/// All data, as the script reads it.
#[derive(Serialize)]
pub(super) struct Viewer<'a> {
    cloud: Shown<'a>,
    /// By `part_label`.
    parts: Vec<ViewerPart<'a>>,
    properties: Vec<Property>,
}

/// The cloud without its columns.
#[derive(Serialize)]
struct Shown<'a> {
    count: usize,
    of: usize,
    corners: &'a [[f32; 3]; 2],
    log_scales: [f32; 2],
    center: [f64; 3],
    radius: f64,
    eye: [f64; 3],
}

#[derive(Serialize)]
struct ViewerPart<'a> {
    name: &'a str,
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
    /// By `part_label`; `None` if the part has no value.
    values: Vec<Option<Shade>>,
}

/// A value, as a number for the colour and as text.
#[derive(Serialize)]
struct Shade {
    value: f64,
    text: String,
}

/// The viewer's data for `report` and `cloud`.
pub(super) fn viewer<'a>(report: &'a Report, cloud: &'a Cloud) -> Viewer<'a> {
    let Cloud { count, of, corners, log_scales, bounds, eye, .. } = cloud;
    let names = field_ply::material_names(&report.labels);
    let part = |label: &'a FieldLabel| ViewerPart {
        name: short(&label.caption),
        material: &label.material,
        color: css(palette::part(label.id)),
        material_color: css(palette::material(
            names.iter().position(|name| *name == label.material).unwrap_or(0) as u32
        )),
    };
    Viewer {
        cloud: Shown {
            count: *count,
            of: *of,
            corners,
            log_scales: *log_scales,
            center: bounds.center().into(),
            radius: 0.5 * bounds.diagonal(),
            eye: (*eye).into(),
        },
        parts: report.labels.iter().map(part).collect(),
        properties: properties(&report.labels),
    }
}

/// The cloud's columns in base64.
pub(super) fn columns(cloud: &Cloud) -> String {
    BASE64.encode(&cloud.gzip)
}

fn properties(labels: &[FieldLabel]) -> Vec<Property> {
    let estimates = |name, unit, factor, log, of: fn(&FieldLabel) -> Estimate| {
        property(name, unit, factor, log, labels, |label| Some(of(label)))
    };
    let shore = |name, scale: ShoreScale| {
        property(name, "", 1.0, false, labels, |label| {
            label.hardness.filter(|hardness| hardness.scale == scale).map(|hardness| hardness.range.into())
        })
    };
    let all = [
        estimates("density", "kg/m³", 1.0, true, |label| label.density_kg_m3),
        estimates("Young's modulus", "GPa", 1e-9, true, |label| label.youngs_modulus_pa),
        estimates("Poisson's ratio", "", 1.0, false, |label| label.poisson_ratio),
        shore("hardness, Shore A", ShoreScale::A),
        shore("hardness, Shore D", ShoreScale::D),
        estimates("friction on rubber", "", 1.0, false, |label| label.friction_rubber),
        estimates("strength", "MPa", 1e-6, true, |label| label.yield_strength_pa),
    ];
    all.into_iter().filter(|property| property.values.iter().any(Option::is_some)).collect()
}

fn property(
    name: &'static str,
    unit: &'static str,
    factor: f64,
    log: bool,
    labels: &[FieldLabel],
    of: impl Fn(&FieldLabel) -> Option<Estimate>,
) -> Property {
    let shade = |estimate: Estimate| {
        let mid = significant(estimate.mid * factor);
        let space = if unit.is_empty() { "" } else { " " };
        Shade { value: estimate.mid * factor, text: format!("{mid}{space}{unit} ({})", interval(estimate, factor)) }
    };
    Property { name, unit, log, values: labels.iter().map(|label| of(label).map(shade)).collect() }
}
