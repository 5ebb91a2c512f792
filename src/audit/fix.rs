//! `--fix`: inertias and centres of mass that follow from the shape and the stated mass are written into the file. Every byte
//! that does not state them stays.

use std::collections::BTreeMap;
use std::path::Path;

use super::find::Found;
use super::judge::{Judged, JudgedBody};
use super::measure::Mass;
use super::{AuditError, Kind};
use crate::files;
use crate::files::write::Folder;
use crate::scene::mesh::containers::write::{Statement, with_statements};
use crate::scene::mesh::containers::{Body, Container, Format};

/// Mends the files of a container; says what was done and what could not be.
///
/// # Errors
/// If a file cannot be written.
pub fn fix(container: &Container, found: &Found, judged: &Judged) -> Result<Vec<String>, AuditError> {
    let mut of_source: BTreeMap<usize, Vec<(&Body, Statement)>> = BTreeMap::new();
    for (body, judged) in container.bodies.iter().zip(&judged.bodies) {
        if let (Some(inertial), Some(target)) = (&body.inertial, target(body, judged)) {
            of_source.entry(inertial.place.source).or_default().push((body, target));
        }
    }
    let mut done = Vec::new();
    for (source, targets) in of_source {
        let path = &container.sources[source];
        let Some(relative) = relative(path, &found.below).filter(|_| !path.is_symlink()) else {
            done.push(format!("not {path:?}: it is a link, or lies in another folder; name the file itself"));
            continue;
        };
        if container.format == Format::Usd {
            done.push(format!("not {path:?}: USD is only read"));
            continue;
        }
        let bytes = files::read_large(path).ok();
        let mended = bytes.and_then(|bytes| with_statements(container.format, &bytes, source, &targets));
        // A file that is no longer the one that was audited stays.
        let Some(text) = mended else { continue };
        let written = Folder::open(&found.below).and_then(|folder| folder.write(relative, |out| out.write_all(&text)));
        written.map_err(|source| AuditError::Unwritable { path: path.clone(), source })?;
        done.extend(targets.iter().map(|(body, target)| said(body, target)));
    }
    Ok(done)
}

/// The path as seen from a folder that holds it.
fn relative<'a>(path: &'a Path, folder: &Path) -> Option<&'a Path> {
    if folder == Path::new(".") && path.is_relative() { Some(path) } else { path.strip_prefix(folder).ok() }
}

/// What is to be written for a body, if anything follows from its shape and the stated mass.
fn target(body: &Body, judged: &JudgedBody) -> Option<Statement> {
    let inertial = body.inertial.as_ref()?;
    let Mass::Stated(mass) = judged.mass else { return None };
    let shapes = judged.size.best().filter(|_| mass > 0.0)?;
    let has = |kinds: &[Kind]| judged.findings.iter().any(|finding| kinds.contains(&finding.kind));
    let units_are_known = !has(&[Kind::Units]);
    let inertia = has(&[Kind::InertiaMissing, Kind::InertiaImpossible, Kind::InertiaPlaceholder, Kind::InertiaOff]);
    let center = has(&[Kind::Center]) || inertia && !inertial.states_center;
    (units_are_known && (inertia || center))
        .then(|| Statement {
            center_m: center.then_some(shapes.moments.center),
            inertia_kg_m2: inertia.then(|| shapes.moments.inertia_kg_m2(mass)),
            ..Statement::default()
        })
        .filter(Statement::is_finite)
}

fn said(body: &Body, target: &Statement) -> String {
    let what = match (target.inertia_kg_m2.is_some(), target.center_m.is_some()) {
        (true, true) => "inertia and centre of mass",
        (true, false) => "inertia",
        (false, _) => "centre of mass",
    };
    format!("{}: {what} of its shape, with the stated mass and one density", body.name)
}
