//! Meshes: closed, facing outward, and with two triangles at every edge. Each mesh is told of once, where it is first used.

use std::collections::BTreeSet;

use super::super::meshes::{MeshId, Meshes};
use super::{Finding, Kind, Subject, file_name};
use crate::scene::mesh::solid::Topology;
use crate::words::output::{agreeing, counted};

pub fn judge(subject: &Subject, meshes: &Meshes, told: &mut BTreeSet<MeshId>) -> Vec<Finding> {
    let mut findings = Vec::new();
    for shape in &subject.body.shapes {
        let Some(id) = MeshId::of(&shape.geometry) else { continue };
        let Some(Ok(mesh)) = meshes.get(&id) else { continue };
        let name =
            if id.number.is_none() { format!("the mesh {:?}", file_name(&id.file)) } else { "its mesh".to_owned() };
        if !told.insert(id) {
            continue;
        }
        let problems = problems(&mesh.topology);
        if !problems.is_empty() {
            let problem = format!("{name} {}", problems.join(", "));
            let remedy = "mend the mesh: its volume and inertia depend on it";
            findings.push(subject.finding(Kind::Surface, &shape.place, problem, remedy));
        }
    }
    findings
}

fn problems(topology: &Topology) -> Vec<String> {
    let mut problems = Vec::new();
    let (inverted, open) = (topology.inverted_components, topology.boundary_edges);
    if inverted > 0 {
        let parts = if inverted == topology.components {
            "is".to_owned()
        } else {
            format!("has {} that {}", counted(inverted, "component"), agreeing(inverted, "is", "are"))
        };
        problems.push(format!("{parts} turned inside out"));
    }
    if open > 0 {
        problems.push(format!(
            "is open ({})",
            counted(open, "edge") + agreeing(open, " has only one triangle", " have only one triangle")
        ));
    }
    if topology.non_manifold_edges > 0 {
        problems.push(format!("has {} of more than two triangles", counted(topology.non_manifold_edges, "edge")));
    }
    if topology.twisted_edges > 0 {
        problems.push(format!("has {} where it turns inside out", counted(topology.twisted_edges, "edge")));
    }
    problems
}
