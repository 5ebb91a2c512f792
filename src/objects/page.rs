//! The page of a capture: its objects in 3D with their masses, the numbered photo, and a row per object that links to its report.

use std::path::Path;

use minijinja::value::Serde;
use minijinja::{Value, context};
use nalgebra::Point3;
use serde::Serialize;

use super::{Object, Objects};
use crate::pictures::palette;
use crate::report::{css, stage, style};
use crate::words::html::jpeg_url;
use crate::words::output::one_line;
use crate::words::readable::figures;
use crate::workdir::Artifact;

/// The data of the script.
#[derive(Serialize)]
struct Data<'a> {
    cloud: stage::Shown<'a>,
    /// By number.
    tops: Vec<[f64; 3]>,
}

/// The page of the capture whose work folder is `root`; `photo` is the numbered one, as JPEG.
pub fn html(objects: &Objects, photo: &[u8], root: &Path) -> String {
    let row = |(number, object): (u32, &Object)| {
        let report = object.work.join(Artifact::ReportHtml.path());
        let mass = object.mass_kg.map(|mass| {
            let figures = figures(mass, 1.0);
            context! { mid => figures.mid, interval => figures.interval }
        });
        context! {
            number,
            color => css(palette::part(number)),
            name => &object.name,
            caption => object.caption.as_deref().map(one_line),
            link => root.join(&report).is_file().then(|| report.to_string_lossy().into_owned()),
            mass,
            gaussians => object.gaussians,
            photos => object.photos,
            hidden => format!("{:.0}", 100.0 * object.hidden),
            error => &object.error,
        }
    };
    let table = &objects.table;
    let data = context! {
        name => one_line(&objects.name),
        shown_in => &objects.shown_in,
        photo => Value::from_safe_string(jpeg_url(photo)),
        rows => (1..).zip(&objects.objects).map(row).collect::<Vec<_>>(),
        warnings => &objects.warnings,
        data => Serde(Data {
            cloud: stage::Shown::new(&table.cloud),
            tops: table.tops.iter().map(|top: &Point3<f64>| top.coords.into()).collect(),
        }),
        cloud => stage::packed(&table.cloud),
        stage_style => Value::from_safe_string(stage::STYLE.to_owned()),
        script => Value::from_safe_string([stage::SCRIPT, include_str!("table.js")].concat()),
        viewer_code => stage::viewer_code(),
        licences => stage::LICENCES,
    };
    style::engine().render_str(include_str!("page.html.j2"), data).expect("the template is a constant")
}
