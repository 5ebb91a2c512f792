//! Changes what containers state of masses, inertias and frictions, and leaves every other byte.
//!
//! [`edit`] changes a text; [`urdf`], [`mjcf`] and [`gltf`] know where their formats keep the numbers.

mod edit;
mod gltf;
mod mjcf;
mod urdf;

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};

use super::xml::Document;
use super::{Body, Format, Inertial};
use edit::Edits;

/// What is to be stated of a body; `None` leaves what is there.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Statement {
    pub mass_kg: Option<f64>,
    /// In the body's frame.
    pub center_m: Option<Vector3<f64>>,
    /// About the centre, along the body's axes.
    pub inertia_kg_m2: Option<Matrix3<f64>>,
    /// Sliding friction of all its colliders.
    pub friction: Option<f64>,
}

impl Statement {
    /// False if a shape is so large or so small that computing with it ends in no number.
    pub fn is_finite(&self) -> bool {
        let single = self.mass_kg.iter().chain(&self.friction);
        let mut numbers = single.chain(self.center_m.iter().flatten()).chain(self.inertia_kg_m2.iter().flatten());
        numbers.all(|number| number.is_finite())
    }

    /// The inertia along the axes in which the file states it.
    fn inertia_as_stated(&self, inertial: &Inertial) -> Option<Matrix3<f64>> {
        let rotation = inertial.body_from_inertial.rotation.to_rotation_matrix();
        Some(rotation.matrix().transpose() * self.inertia_kg_m2? * rotation.matrix())
    }
}

/// The text of a container's file with these statements in it; `None` if the bytes are not those that the bodies were read from.
/// Only bodies of this file are among the `statements`: those whose element, and inertial properties if they have any, are in
/// `source`.
pub fn with_statements(
    format: Format,
    bytes: &[u8],
    source: usize,
    statements: &[(&Body, Statement)],
) -> Option<Vec<u8>> {
    let is_urdf = match format {
        Format::Urdf => true,
        Format::Mjcf => false,
        Format::Gltf => return gltf::with_statements(bytes, statements),
        // It is only read.
        Format::Usd => return None,
    };
    let document = Document::parse(bytes.to_vec()).ok()?;
    let mut edits = Edits::of(&document);
    // A file that is included twice has each of its elements twice.
    let mut done = BTreeSet::new();
    for (body, statement) in statements {
        let inertial = body.inertial.as_ref();
        let place = inertial.map_or(&body.place, |inertial| &inertial.place);
        if place.source != source || !done.insert(place.bytes.start) {
            continue;
        }
        let node = document.element_at(place.bytes.start)?;
        match (is_urdf, inertial) {
            (true, Some(inertial)) => urdf::change(&mut edits, node, inertial, statement),
            (false, Some(inertial)) => mjcf::change(&mut edits, node, inertial, statement),
            (true, None) => urdf::add(&mut edits, node, statement),
            (false, None) => mjcf::add(&mut edits, node, statement),
        }
    }
    for (body, friction) in statements.iter().filter_map(|(body, statement)| Some((body, statement.friction?))) {
        if is_urdf {
            if body.place.source == source {
                urdf::set_friction(&mut edits, document.element_at(body.place.bytes.start)?, friction);
            }
            continue;
        }
        let colliders = body.shapes.iter().filter(|shape| shape.role.collides());
        for shape in colliders.filter(|shape| shape.place.source == source) {
            if done.insert(shape.place.bytes.start) {
                mjcf::set_friction(&mut edits, document.element_at(shape.place.bytes.start)?, friction);
            }
        }
    }
    if !is_urdf && statements.iter().any(|(_, statement)| statement.mass_kg.is_some()) {
        mjcf::let_masses_count(&mut edits, document.root());
    }
    Some(edits.applied(bytes))
}
