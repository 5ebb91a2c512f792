//! Parts that deform, for formats that have deformable bodies: [`tetrahedra`] with the part's mass, Young's modulus and Poisson's ratio, and
//! the nodes with which they hang on what is rigid.
//!
//! A part is soft if a gripper's pad visibly dents it: [`PRESS_PA`] strain it by [`VISIBLE`] or more, which holds up to
//! E = 10 MPa: foam, most rubbers, most food, knits and wadding. A cover of cloth or leather around a soft filling is as soft as
//! the filling, since it bends but hardly resists a pad. What flows (liquids, grains, snow) is not a deformable body.
//!
//! Soft parts that touch become one body, because no format ties two of them to each other: its modulus is that of its parts in series,
//! V / sum(V / E). A body whose tetrahedra would fill too little or too much of its space, because it is thin beside what their number
//! allows, stays rigid.

mod tetrahedra;

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::links::{Link, Weighed};
use super::shape::{self, Collider, Mesh, Painter, Shape, Skin};
use super::{Links, Model, body_name, links, names};
use crate::gaussians::SH_C0;
use crate::materials::Law;
use crate::parts::{Interior, Parts};
use crate::simulate::material::POISSON_CAP;
use crate::simulate::rigid::choice::HARDLY_VISIBLE;
use crate::vote::{Contents, FieldPart, Filled};
use tetrahedra::{Matter, Tetrahedra};

/// The pressure under a gripper's pad: 30 N on the 2.9 cm2 of a Franka Hand's.
const PRESS_PA: f64 = 1e5;
/// Strain that is visible.
const VISIBLE: f64 = HARDLY_VISIBLE;
/// The share of its own space that the tetrahedra of a body must fill, and its inverse the most.
const LEAST_FILLED: f64 = 0.75;
/// Families whose thin sheets bend rather than resist a pad.
const COVERS: [&str; 2] = ["fabric", "leather"];

/// A deformable body.
pub struct DeformableBody {
    pub name: String,
    /// The ids of the parts that it is made of, the one with the most matter first.
    pub parts: Vec<u32>,
    pub youngs_modulus_pa: f64,
    /// At most 0.45, as in the simulation: nearer to 0.5, tetrahedra do not deform as the material does.
    pub poisson_ratio: f64,
    /// In the object's axes, m.
    pub mesh: Tetrahedra,
    pub mass_kg: f64,
    /// Per element, kg.
    pub masses_kg: Vec<f64>,
    /// The nodes where it touches something rigid, each with the index of the link.
    pub attached: Vec<(u32, usize)>,
    pub skin: Skin,
    /// The mean colour of its surface, sRGB from 0 to 1.
    pub color: [f64; 3],
}

impl DeformableBody {
    /// A quarter of each element's mass to each of its nodes, kg.
    pub fn node_masses_kg(&self) -> Vec<f64> {
        let mut masses = vec![0.0; self.mesh.nodes.len()];
        for (element, mass) in self.mesh.elements.iter().zip(&self.masses_kg) {
            element.iter().for_each(|node| masses[*node as usize] += 0.25 * mass);
        }
        masses
    }

    /// Its mean density, kg/m3.
    pub fn density_kg_m3(&self) -> f64 {
        self.mass_kg / self.mesh.volumes().iter().sum::<f64>()
    }

    /// The links on which it hangs, each with its nodes.
    pub fn attachments(&self) -> BTreeMap<usize, Vec<u32>> {
        let mut attachments: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
        self.attached.iter().for_each(|(node, link)| attachments.entry(*link).or_default().push(*node));
        attachments
    }
}

/// How soft a part is.
#[derive(Debug, Clone, Copy)]
struct Softness {
    youngs_modulus_pa: f64,
    poisson_ratio: f64,
}

/// An object of which parts deform.
pub struct Deformable {
    pub bodies: Vec<DeformableBody>,
    /// What is rigid.
    pub links: Vec<Link>,
    /// Those of the links.
    pub colliders: Vec<Collider>,
}

impl Deformable {
    pub fn of(model: &Model, shape: &Shape, painter: &Painter, groups: &Groups, parts: &Parts) -> Self {
        let (weighed, soft) = (Weighed::of(parts), groups.parts());
        let mass_kg: BTreeMap<u32, f64> = soft.iter().map(|part| (*part, weighed.mass_kg(*part))).collect();
        let weighed = weighed.without(&soft);
        let links = match model.links {
            Links::One => links::one(model, &weighed, shape, painter).into_iter().collect(),
            Links::Parts => links::of(model, weighed, shape, painter),
        };
        let colliders = shape.colliders.iter().filter(|collider| !soft.contains(&collider.part)).cloned().collect();
        let bodies = groups.soft.iter().map(|group| body(model, shape, painter, group, &links, &mass_kg)).collect();
        Self { bodies, links, colliders }
    }
}

/// Soft parts that touch, with their tetrahedra in the world's frame, scene units.
pub struct Group {
    /// The one with the most matter first.
    pub parts: Vec<u32>,
    softness: Softness,
    tetrahedra: Tetrahedra,
}

/// What is soft, and the ids of parts that are soft but too thin for tetrahedra.
#[derive(Default)]
pub struct Groups {
    pub soft: Vec<Group>,
    pub too_thin: Vec<u32>,
}

impl Groups {
    pub fn of(model: &Model, shape: &Shape, parts: &Parts) -> Self {
        let (labels, weighed) = (&model.field.parts, Weighed::of(parts));
        let heavy = labels.iter().filter(|label| weighed.mass_kg(label.id) > 0.0);
        let soft: BTreeMap<u32, Softness> = heavy.filter_map(|label| Some((label.id, softness(label)?))).collect();
        let mut groups = Self::default();
        for parts in touching(&soft.keys().copied().collect::<Vec<_>>(), shape) {
            let Some(group) = group(model.interior, labels, &soft, parts.clone()) else {
                groups.too_thin.extend(parts);
                continue;
            };
            groups.soft.push(group);
        }
        groups
    }

    /// The ids of all parts that deform.
    pub fn parts(&self) -> Vec<u32> {
        self.soft.iter().flat_map(|group| group.parts.iter().copied()).collect()
    }
}

/// `None` if a part is rigid.
fn softness(label: &FieldPart) -> Option<Softness> {
    let flows = |law: Law| matches!(law, Law::Fluid | Law::DruckerPrager { .. } | Law::Snow { .. });
    let most_pa = PRESS_PA / VISIBLE;
    let own = Softness { youngs_modulus_pa: label.youngs_modulus_pa.mid, poisson_ratio: label.poisson_ratio.mid };
    let found = match &label.inside {
        Some(Contents::Filled(Filled { law, youngs_modulus_pa, poisson_ratio, .. })) => {
            let bends = COVERS.contains(&label.family.as_str()) || own.youngs_modulus_pa <= most_pa;
            let filling = Softness { youngs_modulus_pa: youngs_modulus_pa.mid, poisson_ratio: poisson_ratio.mid };
            (bends && !flows(*law)).then_some(filling)
        }
        _ => (!flows(label.law)).then_some(own),
    };
    found.filter(|softness| softness.youngs_modulus_pa <= most_pa)
}

/// These parts in groups that touch.
fn touching(parts: &[u32], shape: &Shape) -> Vec<Vec<u32>> {
    let mut groups: Vec<Vec<u32>> = parts.iter().map(|part| vec![*part]).collect();
    for (a, b) in shape.contacts().keys() {
        let group_of = |part: &u32| groups.iter().position(|group| group.contains(part));
        let (Some(a), Some(b)) = (group_of(a), group_of(b)) else { continue };
        if a != b {
            let joined = groups.remove(a.max(b));
            groups[a.min(b)].extend(joined);
        }
    }
    groups
}

/// `None` if tetrahedra do not have its shape.
fn group(
    interior: &Interior,
    labels: &[FieldPart],
    soft: &BTreeMap<u32, Softness>,
    mut parts: Vec<u32>,
) -> Option<Group> {
    let mut matter = Vec::new();
    let mut shares: BTreeMap<u32, f64> = BTreeMap::new();
    let mut add = |cell: usize, label: u32, share: f64, density: fn(&FieldPart) -> f64| {
        let part = &labels[label as usize];
        if parts.contains(&part.id) && share > 0.0 {
            *shares.entry(part.id).or_default() += share;
            matter.push(Matter { cell, share, density_kg_m3: density(part) });
        }
    };
    interior.filled().for_each(|(cell, label, share)| add(cell, label, share, |part| part.density_kg_m3.mid));
    interior.fillings().for_each(|(cell, label, share)| {
        add(cell, label, share, |part| match &part.inside {
            Some(Contents::Filled(filled)) => filled.density_kg_m3.mid,
            _ => part.density_kg_m3.mid,
        });
    });
    matter.sort_by_key(|own| own.cell);
    let tetrahedra = Tetrahedra::of(&interior.grid, &matter)?;
    let volume = shares.values().sum::<f64>() * interior.grid.cell_volume();
    let filled = tetrahedra.volumes().iter().sum::<f64>() / volume;
    if !(LEAST_FILLED..=1.0 / LEAST_FILLED).contains(&filled) {
        return None;
    }
    let share = |part: &u32| shares.get(part).copied().unwrap_or(0.0);
    parts.sort_by(|a, b| share(b).total_cmp(&share(a)).then(a.cmp(b)));
    let whole: f64 = parts.iter().map(share).sum();
    let softness = Softness {
        youngs_modulus_pa: whole / parts.iter().map(|part| share(part) / soft[part].youngs_modulus_pa).sum::<f64>(),
        poisson_ratio: parts.iter().map(|part| share(part) * soft[part].poisson_ratio).sum::<f64>() / whole,
    };
    Some(Group { parts, softness, tetrahedra })
}

/// The body of a group whose parts have these masses, beside what is rigid.
fn body(
    model: &Model,
    shape: &Shape,
    painter: &Painter,
    group: &Group,
    links: &[Link],
    mass_kg: &BTreeMap<u32, f64>,
) -> DeformableBody {
    let own = names::of_parts(&model.field.parts);
    let mesh = in_axes(shape, &group.tetrahedra);
    let mass_kg: f64 = group.parts.iter().map(|part| mass_kg[part]).sum();
    let unscaled: Vec<f64> = mesh.volumes().iter().zip(&mesh.densities).map(|(v, rho)| v * rho).collect();
    let factor = mass_kg / unscaled.iter().sum::<f64>();
    DeformableBody {
        name: names::within(&body_name(model.name), &own[&group.parts[0]]),
        parts: group.parts.clone(),
        youngs_modulus_pa: group.softness.youngs_modulus_pa,
        poisson_ratio: group.softness.poisson_ratio.min(POISSON_CAP),
        mass_kg,
        masses_kg: unscaled.into_iter().map(|mass| mass * factor).collect(),
        attached: attached(model, shape, &group.tetrahedra, links),
        color: color(model, &group.parts),
        skin: shape::skin_of_parts(painter, shape, &group.parts),
        mesh,
    }
}

/// The mean colour of the Gaussians of these parts, sRGB from 0 to 1.
fn color(model: &Model, parts: &[u32]) -> [f64; 3] {
    let (mut sum, mut count) = ([0.0; 3], 0.0_f64);
    for (dc, part) in model.gaussians.sh_dc.iter().zip(model.field.part_ids()) {
        if parts.contains(&part) {
            count += 1.0;
            sum.iter_mut().zip(dc).for_each(|(sum, dc)| *sum += f64::from(0.5 + SH_C0 * dc).clamp(0.0, 1.0));
        }
    }
    sum.map(|sum| if count > 0.0 { sum / count } else { 0.5 })
}

/// The tetrahedra in metres, relative to the shape's origin.
fn in_axes(shape: &Shape, tetrahedra: &Tetrahedra) -> Tetrahedra {
    let scale = shape.meters_per_unit();
    let of = |nodes: Vec<Point3<f64>>| Tetrahedra { nodes, cell: tetrahedra.cell * scale, ..tetrahedra.clone() };
    let surface = Mesh { vertices: tetrahedra.nodes.clone(), triangles: tetrahedra.surface.clone() };
    let flat = of(shape.finished(surface).vertices);
    if flat.volumes().iter().all(|volume| *volume > 0.0) {
        return flat;
    }
    // A thin body whose underside would be flattened through its upper side.
    of(tetrahedra.nodes.iter().map(|node| node * scale - shape.origin).collect())
}

/// The nodes that lie within half a cell of something rigid, with the index of its link.
fn attached(model: &Model, shape: &Shape, tetrahedra: &Tetrahedra, links: &[Link]) -> Vec<(u32, usize)> {
    let grid = &model.interior.grid;
    let reach = 0.5 * tetrahedra.cell.min();
    let link_at = |node: &Point3<f64>| {
        let wide = Vector3::repeat(reach + grid.cell);
        let [x, y, z] = grid.cells_between(node - wide, node + wide)?;
        let mut nearest: Option<(f64, usize)> = None;
        for at in (z[0]..=z[1]).flat_map(|z| (y[0]..=y[1]).flat_map(move |y| (x[0]..=x[1]).map(move |x| [x, y, z]))) {
            let Some(part) = shape.part_of_cell(grid.index(at)) else { continue };
            let Some(link) = links.iter().position(|link| link.parts.contains(&part)) else { continue };
            let beyond = (node - grid.center(at)).abs().map(|d| (d - 0.5 * grid.cell).max(0.0)).norm();
            if beyond <= reach && nearest.is_none_or(|(least, _)| beyond < least) {
                nearest = Some((beyond, link));
            }
        }
        nearest.map(|(_, link)| link)
    };
    let nodes = tetrahedra.nodes.iter().zip(0..);
    nodes.filter_map(|(node, n)| Some((n, link_at(node)?))).collect()
}
