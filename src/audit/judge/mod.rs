//! What is wrong with a container, one file for each kind of claim.

mod center;
mod colliders;
mod friction;
mod inertia;
mod mass;
mod surface;
mod units;
mod words;

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::Matrix3;

use super::measure::{Mass, Size};
use super::meshes::{MeshId, Meshes, is_of_known_format};
use super::{Args, Finding, Kind};
use crate::scene::mesh::containers::{Body, Container, Format, Geometry, Inertial, Place};

/// What was found out about a container.
pub struct Judged {
    /// What belongs to no body.
    pub findings: Vec<Finding>,
    /// In the order of the container's bodies.
    pub bodies: Vec<JudgedBody>,
    /// Meshes that are not measured because gprop does not read their formats.
    pub unread: BTreeSet<String>,
}

/// What was found out about a body.
pub struct JudgedBody {
    pub findings: Vec<Finding>,
    pub mass: Mass,
    pub size: Size,
}

/// A body that is judged.
struct Subject<'a> {
    container: &'a Container,
    body: &'a Body,
    size: &'a Size,
    mass: Mass,
    args: &'a Args,
}

impl Subject<'_> {
    fn finding(&self, kind: Kind, place: &Place, problem: String, remedy: impl Into<String>) -> Finding {
        finding(self.container, kind, place, problem, remedy)
    }

    fn inertial(&self) -> Option<&Inertial> {
        self.body.inertial.as_ref()
    }

    /// Where the mass is written, or else the body.
    fn mass_place(&self) -> &Place {
        self.inertial().map_or(&self.body.place, |inertial| &inertial.place)
    }

    /// Whether engines compute the inertia and the centre that a file of this format leaves out.
    fn engines_fill_in(&self) -> bool {
        matches!(self.container.format, Format::Gltf | Format::Usd)
    }

    /// What to do about an inertia or a centre that is wrong.
    fn remedy_of_shape(&self) -> &'static str {
        match self.container.format {
            Format::Usd => "take that of the shape, or of the CAD model",
            Format::Urdf | Format::Mjcf | Format::Gltf => "take that of the shape (--fix), or of the CAD model",
        }
    }

    /// The inertia of the shape with this mass and one density, about its own centre along the body's axes.
    fn uniform_inertia(&self, mass_kg: f64) -> Option<Matrix3<f64>> {
        Some(self.size.best()?.moments.inertia_kg_m2(mass_kg))
    }
}

fn finding(container: &Container, kind: Kind, place: &Place, problem: String, remedy: impl Into<String>) -> Finding {
    Finding { kind, file: container.sources[place.source].clone(), line: place.line, problem, remedy: remedy.into() }
}

/// Judges a container and its bodies.
pub fn judge(container: &Container, meshes: &Meshes, args: &Args) -> Judged {
    let invalid = |problem: &crate::scene::mesh::containers::Problem| {
        finding(container, Kind::Invalid, &problem.place, problem.text.clone(), "mend it")
    };
    let mut findings: Vec<Finding> = container.problems.iter().map(invalid).collect();
    let mut sizes: Vec<(Size, Mass)> =
        container.bodies.iter().map(|body| (Size::of(body, meshes), Mass::of(body, meshes))).collect();
    scale_masses(container, &mut sizes);
    let mut told = BTreeSet::new();
    let mut unread = BTreeSet::new();
    let mut bodies = Vec::with_capacity(container.bodies.len());
    for (body, (size, mass)) in container.bodies.iter().zip(sizes) {
        let subject = Subject { container, body, size: &size, mass, args };
        let mut findings: Vec<Finding> = body.problems.iter().map(invalid).collect();
        findings.extend(unread_meshes(&subject, meshes, &mut unread));
        findings.extend(surface::judge(&subject, meshes, &mut told));
        findings.extend(claims(&subject));
        keep(&mut findings, args);
        bodies.push(JudgedBody { findings, mass, size });
    }
    keep(&mut findings, args);
    Judged { findings, bodies, unread }
}

/// What is wrong with the numbers that a body states. If the unit of the shapes is wrong, everything else follows from that.
fn claims(subject: &Subject) -> Vec<Finding> {
    let mut findings = Vec::new();
    findings.extend(mass::missing(subject));
    match units::judge(subject) {
        Some(wrong) => findings.push(wrong),
        None => {
            findings.extend(mass::density(subject));
            findings.extend(inertia::judge(subject));
            findings.extend(center::judge(subject));
            findings.extend(colliders::judge(subject));
        }
    }
    findings.extend(friction::judge(subject));
    findings
}

/// Leaves out what the user ignores and what is told twice, and sorts by line.
fn keep(findings: &mut Vec<Finding>, args: &Args) {
    findings.retain(|finding| !args.ignore.contains(&finding.kind));
    findings.sort_by(|a, b| (&a.file, a.line, a.kind).cmp(&(&b.file, b.line, b.kind)));
    findings.dedup();
}

/// Scales the masses to the total that the container sets.
fn scale_masses(container: &Container, sizes: &mut [(Size, Mass)]) {
    let Some(total) = container.total_mass_kg else { return };
    let sum: f64 = sizes.iter().filter_map(|(_, mass)| mass.kg()).sum();
    let is_known = sizes.iter().all(|(_, mass)| *mass != Mass::Unknown) && sum > 0.0;
    for (_, mass) in sizes {
        *mass = if is_known { mass.scaled(total / sum) } else { Mass::Unknown };
    }
}

/// The meshes of a body that could not be measured.
fn unread_meshes(subject: &Subject, meshes: &Meshes, unread: &mut BTreeSet<String>) -> Vec<Finding> {
    let mut findings = Vec::new();
    for shape in &subject.body.shapes {
        let Geometry::Mesh(used) = &shape.geometry else { continue };
        let (problem, remedy) = match &used.file {
            Err(problem) => {
                let text = problem.to_string();
                let (problem, remedy) = text.split_once("; ").unwrap_or((&text, "mend the name"));
                (format!("the mesh {problem}"), remedy.to_owned())
            }
            Ok(file) => match meshes.get(&MeshId { file: file.clone(), number: None }) {
                Some(Err(_)) if !is_of_known_format(file) => {
                    unread.insert(used.named.clone());
                    continue;
                }
                Some(Err(problem)) => {
                    let (problem, remedy) = problem.split_once("; ").unwrap_or((problem, "export the mesh again"));
                    (format!("the mesh {:?}: {problem}", used.named), remedy.to_owned())
                }
                _ => continue,
            },
        };
        findings.push(subject.finding(Kind::Mesh, &shape.place, problem, remedy));
    }
    findings
}

/// The name of a file without its folders.
fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
