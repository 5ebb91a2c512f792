//! The page of a capture: the numbered photo, and a row per object that links to its report.

use std::path::Path;

use minijinja::{Value, context};

use super::{Object, Objects};
use crate::report::style;
use crate::words::html::jpeg_url;
use crate::words::output::one_line;
use crate::words::readable::figures;
use crate::workdir::Artifact;

/// The page of the capture whose work folder is `root`; `photo` is the numbered one, as JPEG.
pub fn html(objects: &Objects, photo: &[u8], root: &Path) -> String {
    let row = |object: &Object| {
        let report = object.work.join(Artifact::ReportHtml.path());
        let mass = object.mass_kg.map(|mass| {
            let figures = figures(mass, 1.0);
            context! { mid => figures.mid, interval => figures.interval }
        });
        context! {
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
    let data = context! {
        name => one_line(&objects.name),
        shown_in => &objects.shown_in,
        photo => Value::from_safe_string(jpeg_url(photo)),
        rows => objects.objects.iter().map(row).collect::<Vec<_>>(),
        warnings => &objects.warnings,
    };
    style::engine().render_str(include_str!("page.html.j2"), data).expect("the template is a constant")
}
