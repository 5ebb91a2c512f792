//! Each part as a link of its own, fixed to a neighbour.
//!
//! The heaviest part is the root. From it, a tree follows the largest contacts: at each step, the part that shares most cell faces with one
//! that is in the tree already joins it, and is fixed where they touch. Fillings belong to the link of their shell, and a part that has no
//! closed surface or no collider to the root. So all masses, with the parallel axis theorem, make the one rigid body: each part has the share
//! of the object's mass that it has of the sum of all, since what is believed of the whole may differ from that sum.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::shape::{Contact, Painter, Shape, Skin, skin_of_parts, skins_of};
use super::{Model, body_name, names};
use crate::parts::Parts;

/// A part with a mass, a surface and colliders.
pub struct Link {
    pub name: String,
    /// The ids of the parts that it is made of: more than one if it took in others.
    pub parts: Vec<u32>,
    pub skin: Skin,
    pub inertial: Inertial,
    /// The index of the link to which it is fixed; `None` for the root.
    pub parent: Option<usize>,
    /// Where it is fixed, in the object's axes, m: the middle of its contact with the parent; 0 for the root.
    pub joint: Vector3<f64>,
}

/// Mass properties in the object's axes, which are those of all links.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertial {
    pub mass_kg: f64,
    pub center_m: Vector3<f64>,
    /// About the centre of mass, kg m2.
    pub inertia: Matrix3<f64>,
}

impl Inertial {
    pub fn new(mass_kg: f64, center_m: [f64; 3], inertia: [[f64; 3]; 3]) -> Self {
        Self { mass_kg, center_m: center_m.into(), inertia: Matrix3::from_fn(|row, column| inertia[row][column]) }
    }

    /// A mass at one place.
    pub fn of_point(mass_kg: f64, center_m: Vector3<f64>) -> Self {
        Self { mass_kg, center_m, inertia: Matrix3::zeros() }
    }

    /// Several as one body.
    pub fn together(bodies: &[Self]) -> Self {
        let mass_kg: f64 = bodies.iter().map(|body| body.mass_kg).sum();
        let center_m = bodies.iter().map(|body| body.center_m * body.mass_kg).sum::<Vector3<f64>>() / mass_kg;
        let about_center = |body: &Self| {
            let offset = body.center_m - center_m;
            let of_offset = Matrix3::identity() * offset.norm_squared() - offset * offset.transpose();
            body.inertia + of_offset * body.mass_kg
        };
        Self { mass_kg, center_m, inertia: bodies.iter().map(about_center).sum() }
    }

    /// Relative to another origin, with mass and inertia times a factor.
    fn scaled(self, factor: f64, origin: Vector3<f64>) -> Self {
        Self { mass_kg: self.mass_kg * factor, center_m: self.center_m - origin, inertia: self.inertia * factor }
    }
}

/// The masses of the parts with their fillings, which together are the object's.
pub struct Weighed {
    by_part: BTreeMap<u32, Vec<Inertial>>,
    /// By which they are multiplied.
    factor: f64,
}

impl Weighed {
    pub fn of(parts: &Parts) -> Self {
        let by_part = by_part(parts);
        let whole: f64 = by_part.values().flatten().map(|body| body.mass_kg).sum();
        Self { by_part, factor: parts.object.mass_kg.mid / whole }
    }

    /// Of a part with its fillings, kg.
    pub fn mass_kg(&self, part: u32) -> f64 {
        self.by_part.get(&part).into_iter().flatten().map(|body| body.mass_kg * self.factor).sum()
    }

    /// Without these parts.
    pub fn without(mut self, parts: &[u32]) -> Self {
        self.by_part.retain(|id, _| !parts.contains(id));
        self
    }
}

/// All of these parts as one link; `None` if they have no mass.
pub fn one(model: &Model, weighed: &Weighed, shape: &Shape, painter: &Painter) -> Option<Link> {
    let parts: Vec<u32> = weighed.by_part.keys().copied().collect();
    let bodies: Vec<Inertial> = weighed.by_part.values().flatten().copied().collect();
    let skin = skin_of_parts(painter, shape, &parts);
    if parts.is_empty() || skin.mesh.volume() <= 0.0 {
        return None;
    }
    let inertial = Inertial::together(&bodies).scaled(weighed.factor, shape.origin);
    let name = names::within(&body_name(model.name), &names::new(&model.field.parts, "rigid"));
    Some(Link { name, parts, skin, inertial, parent: None, joint: Vector3::zeros() })
}

/// The links, each after its parent.
pub fn of(model: &Model, weighed: Weighed, shape: &Shape, painter: &Painter) -> Vec<Link> {
    let Weighed { by_part: mut weighed, factor } = weighed;
    let has_collider = |id: &u32| shape.colliders.iter().any(|collider| collider.part == *id);
    let solid: Vec<u32> = weighed.keys().copied().filter(has_collider).collect();
    let mut skins: BTreeMap<u32, Skin> = solid.iter().copied().zip(skins_of(painter, shape, &solid)).collect();
    skins.retain(|_, skin| skin.mesh.volume() > 0.0);
    let mass_of = |id: &u32| weighed[id].iter().map(|body| body.mass_kg).sum::<f64>();
    let Some(root) = skins.keys().copied().max_by(|a, b| mass_of(a).total_cmp(&mass_of(b)).then(b.cmp(a))) else {
        return Vec::new();
    };
    // What has no link of its own goes with the root.
    let homeless: Vec<u32> = weighed.keys().copied().filter(|id| !skins.contains_key(id)).collect();
    let taken_in: Vec<Inertial> = homeless.iter().flat_map(|id| weighed[id].clone()).collect();
    weighed.entry(root).or_default().extend(taken_in);
    let (own, body) = (names::of_parts(&model.field.parts), body_name(model.name));
    let ids: Vec<u32> = skins.keys().copied().collect();
    tree(root, &ids, shape)
        .into_iter()
        .map(|Fixed { part, parent, at }| {
            let inertial = Inertial::together(&weighed[&part]).scaled(factor, shape.origin);
            let joint = match (parent, at) {
                (None, _) => Vector3::zeros(),
                (Some(_), Some(at)) => at - shape.origin,
                // It touches nothing.
                (Some(_), None) => inertial.center_m,
            };
            let mut parts = vec![part];
            parts.extend(homeless.iter().filter(|_| part == root));
            let skin = skins.remove(&part).expect("a part is in the tree once");
            Link { name: names::within(&body, &own[&part]), parts, skin, inertial, parent, joint }
        })
        .collect()
}

/// The masses of each part and its fillings, by id.
fn by_part(parts: &Parts) -> BTreeMap<u32, Vec<Inertial>> {
    let mut weighed: BTreeMap<u32, Vec<Inertial>> = BTreeMap::new();
    for part in parts.whole_parts() {
        if let (Some(mass), Some(center), Some(inertia)) = (part.mass_kg, part.center_of_mass_m, part.inertia_kg_m2) {
            weighed.entry(part.id).or_default().push(Inertial::new(mass.mid, center, inertia));
        }
    }
    for filling in &parts.fillings {
        let body = Inertial::new(filling.mass_kg.mid, filling.center_of_mass_m, filling.inertia_kg_m2);
        weighed.entry(filling.inside_of).or_default().push(body);
    }
    weighed.retain(|_, bodies| bodies.iter().any(|body| body.mass_kg > 0.0));
    weighed
}

/// A part in the tree.
struct Fixed {
    part: u32,
    /// The index of the part to which it is fixed.
    parent: Option<usize>,
    /// The middle of their contact in the world's frame, m; `None` if they do not touch.
    at: Option<Vector3<f64>>,
}

/// The parts from the root on, along the largest contacts.
fn tree(root: u32, ids: &[u32], shape: &Shape) -> Vec<Fixed> {
    let contacts = shape.contacts();
    let mut tree = vec![Fixed { part: root, parent: None, at: None }];
    let mut left: Vec<u32> = ids.iter().copied().filter(|id| *id != root).collect();
    while !left.is_empty() {
        let mut best = (0, 0, Contact::default());
        for (n, part) in left.iter().enumerate() {
            for (parent, fixed) in tree.iter().enumerate() {
                let pair = (fixed.part.min(*part), fixed.part.max(*part));
                if let Some(contact) = contacts.get(&pair).filter(|contact| contact.faces > best.2.faces) {
                    best = (n, parent, *contact);
                }
            }
        }
        let (n, parent, contact) = best;
        let at = (contact.faces > 0).then(|| contact.sum / contact.faces as f64 * shape.meters_per_unit());
        tree.push(Fixed { part: left.remove(n), parent: Some(parent), at });
    }
    tree
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_balls_make_a_dumbbell() {
        let ball =
            |x: f64| Inertial { mass_kg: 2.0, center_m: Vector3::new(x, 0.0, 0.0), inertia: Matrix3::identity() * 0.1 };
        let whole = Inertial::together(&[ball(-0.5), ball(1.5)]);
        assert_eq!((whole.mass_kg, whole.center_m), (4.0, Vector3::new(0.5, 0.0, 0.0)));
        // 2 x 0.1, and across the axis 2 x 2 kg x 1 m2 more.
        assert_eq!(whole.inertia, Matrix3::from_diagonal(&Vector3::new(0.2, 4.2, 4.2)));
    }
}
