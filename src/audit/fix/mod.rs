//! `--fix`: inertias and centres of mass that follow from the shape and the stated mass are written into the file. Every byte
//! that does not state them stays.
//!
//! [`edit`] changes a text; [`urdf`] and [`mjcf`] know where their formats keep the numbers.

mod edit;
mod mjcf;
mod urdf;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};

use super::find::Found;
use super::judge::{Judged, JudgedBody};
use super::measure::Mass;
use super::{AuditError, Kind};
use crate::files;
use crate::files::write::Folder;
use crate::scene::mesh::containers::xml::Document;
use crate::scene::mesh::containers::{Body, Container, Format, Inertial};
use edit::Edits;

/// What is written for a body.
struct Target<'a> {
    inertial: &'a Inertial,
    /// The new centre of mass in the body's frame.
    center_m: Option<Vector3<f64>>,
    /// The new inertia about the centre, along the body's axes.
    inertia_kg_m2: Option<Matrix3<f64>>,
}

impl Target<'_> {
    /// False if a shape is so large or so small that computing with it ends in no number.
    fn is_finite(&self) -> bool {
        let mut numbers = self.center_m.iter().flatten().chain(self.inertia_kg_m2.iter().flatten());
        numbers.all(|number| number.is_finite())
    }

    /// The new inertia along the axes in which the file states it.
    fn inertia_as_stated(&self) -> Option<Matrix3<f64>> {
        let rotation = self.inertial.body_from_inertial.rotation.to_rotation_matrix();
        Some(rotation.matrix().transpose() * self.inertia_kg_m2? * rotation.matrix())
    }
}

/// Mends the files of a container; says what was done and what could not be.
///
/// # Errors
/// If a file cannot be written.
pub fn fix(container: &Container, found: &Found, judged: &Judged) -> Result<Vec<String>, AuditError> {
    let mut of_source: BTreeMap<usize, Vec<(&Body, Target)>> = BTreeMap::new();
    for (body, judged) in container.bodies.iter().zip(&judged.bodies) {
        if let Some(target) = target(body, judged) {
            of_source.entry(target.inertial.place.source).or_default().push((body, target));
        }
    }
    let mut done = Vec::new();
    for (source, targets) in of_source {
        let path = &container.sources[source];
        let Some(relative) = relative(path, &found.below).filter(|_| !path.is_symlink()) else {
            done.push(format!("not {path:?}: it is a link, or lies in another folder; name the file itself"));
            continue;
        };
        let Some(text) = mended(container.format, path, &targets) else { continue };
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
fn target<'a>(body: &'a Body, judged: &JudgedBody) -> Option<Target<'a>> {
    let inertial = body.inertial.as_ref()?;
    let Mass::Stated(mass) = judged.mass else { return None };
    let shapes = judged.size.best().filter(|_| mass > 0.0)?;
    let has = |kinds: &[Kind]| judged.findings.iter().any(|finding| kinds.contains(&finding.kind));
    let units_are_known = !has(&[Kind::Units]);
    let inertia = has(&[Kind::InertiaMissing, Kind::InertiaImpossible, Kind::InertiaPlaceholder, Kind::InertiaOff]);
    let center = has(&[Kind::Center]) || inertia && !inertial.states_center;
    (units_are_known && (inertia || center))
        .then(|| Target {
            inertial,
            center_m: center.then_some(shapes.moments.center),
            inertia_kg_m2: inertia.then(|| shapes.moments.inertia_kg_m2(mass)),
        })
        .filter(Target::is_finite)
}

/// The bytes of the file with the targets in it; `None` if it is no longer the file that was audited.
fn mended(format: Format, path: &Path, targets: &[(&Body, Target)]) -> Option<Vec<u8>> {
    let bytes = files::read(path).ok()?;
    let document = Document::parse(bytes.clone()).ok()?;
    let mut edits = Edits::of(&document);
    for (_, target) in targets {
        let node = document.element_at(target.inertial.place.bytes.start)?;
        match format {
            Format::Urdf => urdf::write(&mut edits, node, target),
            Format::Mjcf => mjcf::write(&mut edits, node, target),
        }
    }
    Some(edits.applied(&bytes))
}

fn said(body: &Body, target: &Target) -> String {
    let what = match (target.inertia_kg_m2.is_some(), target.center_m.is_some()) {
        (true, true) => "inertia and centre of mass",
        (true, false) => "inertia",
        (false, _) => "centre of mass",
    };
    format!("{}: {what} of its shape, with the stated mass and one density", body.name)
}
