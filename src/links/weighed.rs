//! What was found of each link, beside what the container claims.

use std::fmt::Write;
use std::path::Path;

use serde::Serialize;

use crate::parts::Parts;
use crate::pipeline::work_folder;
use crate::scene::mesh::containers::{Body, Container};
use crate::units::Estimate;
use crate::vote::FieldPart;
use crate::words::output::one_line;
use crate::words::readable::significant;
use crate::workdir::{self, Artifact};

/// The links of a container with their masses. Written as `links.json`; lengths in metres, in the frame of each link.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Links {
    /// `URDF` or `MJCF`.
    pub format: &'static str,
    /// In the order of the file.
    pub links: Vec<Link>,
}

/// A link of a URDF, or a body of an MJCF.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Link {
    /// As the container names it; an MJCF need not name it.
    pub name: String,
    /// The name of the mesh in `links/` that shows it, which links that look alike share; `None` if it has no shape.
    pub object: Option<String>,
    pub claimed: Claimed,
    /// What was found; `None` if the link has no shape, its run failed, or ended before the parts.
    pub found: Option<Found>,
}

/// What the container claims of a link.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Claimed {
    pub mass_kg: Option<f64>,
    pub center_of_mass_m: Option<[f64; 3]>,
}

/// What gprop found of a link.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Found {
    pub volume_m3: Estimate,
    pub mass_kg: Estimate,
    pub center_of_mass_m: [f64; 3],
    /// About the centre of mass, along the link's axes.
    pub inertia_kg_m2: [[f64; 3]; 3],
    /// The library rows of its parts, each once, in the order of the parts.
    pub materials: Vec<String>,
    /// Friction on rubber, the least of all parts.
    pub friction_rubber: f64,
}

impl Links {
    /// Reads the results of the objects in `folder`.
    pub(super) fn gather(container: &Container, object_of: &[Option<String>], folder: &Path) -> Self {
        let link = |(body, object): (&Body, &Option<String>)| Link {
            name: body.name.clone(),
            object: object.clone(),
            claimed: Claimed::of(body),
            found: object.as_ref().and_then(|object| Found::read(&folder.join(format!("{object}.glb")))),
        };
        Self { format: container.format.name(), links: container.bodies.iter().zip(object_of).map(link).collect() }
    }

    /// One line for each link with a shape.
    pub fn table(&self) -> String {
        let mut text = String::new();
        for link in self.links.iter().filter(|link| link.object.is_some()) {
            let claimed = link
                .claimed
                .mass_kg
                .map_or("the file states no mass".to_owned(), |kg| format!("said {} kg", significant(kg)));
            let found = match &link.found {
                Some(Found { mass_kg: Estimate { low, mid, high }, materials, .. }) => format!(
                    "gprop {} to {} kg, likely {} kg ({})",
                    significant(*low),
                    significant(*high),
                    significant(*mid),
                    materials.join(", ")
                ),
                None => "not weighed, because its run is not done".to_owned(),
            };
            let _ = writeln!(text, "{}: {claimed}; {found}", one_line(&link.name));
        }
        text
    }
}

impl Claimed {
    fn of(body: &Body) -> Self {
        let Some(inertial) = &body.inertial else { return Self::default() };
        let center = inertial.states_center.then(|| inertial.center_m().into());
        Self { mass_kg: inertial.mass_kg, center_of_mass_m: center }
    }
}

impl Found {
    /// The results of the run of a mesh, if it came to the parts.
    fn read(mesh: &Path) -> Option<Self> {
        let work = work_folder(mesh, None);
        let parts: Parts = workdir::read_json(&work.join(Artifact::Parts.path())).ok()?;
        let voted: Vec<FieldPart> = workdir::read_json(&work.join(Artifact::Labels.path())).ok()?;
        let weighed = || parts.parts.iter().filter(|part| part.mass_kg.is_some());
        let mut materials: Vec<String> = Vec::new();
        for part in weighed().filter(|part| part.volume_m3.is_some()) {
            if !materials.contains(&part.material) {
                materials.push(part.material.clone());
            }
        }
        let frictions = voted.iter().filter(|of| weighed().any(|part| part.id == of.id));
        Some(Self {
            volume_m3: parts.object.volume_m3,
            mass_kg: parts.object.mass_kg,
            center_of_mass_m: parts.object.center_of_mass_m,
            inertia_kg_m2: parts.object.inertia_kg_m2,
            materials,
            friction_rubber: frictions.map(|of| of.friction_rubber.mid).fold(f64::INFINITY, f64::min),
        })
    }
}
