//! Generalised winding number: how often a surface winds around a point. It is 1 inside of a closed surface and 0 outside,
//! and between them near the openings of one that is not closed (Jacobson et al. 2013).
//!
//! Nearby triangles count by their solid angle (van Oosterom and Strackee 1983), far ones together by an expansion about
//! their middle (Barill et al. 2018, "Fast Winding Numbers for Soups and Clouds").

use std::f64::consts::PI;

use nalgebra::{Matrix3, Point3, Vector3};

use super::tree::{MOST_DEPTH, Tree, middle};

/// Triangles count together if they are this many times their radius away: the accuracy parameter beta of Barill et al.,
/// who recommend 2.
const FAR: f64 = 2.0;

/// The triangles of a tree, each with a weight.
pub struct Winding {
    /// Per triangle of the tree: 1, -1 if it is meant the other way round, or 0.
    weight: Vec<f64>,
    /// Per node of the tree.
    fields: Vec<Field>,
}

/// What the triangles of a node contribute far away.
#[derive(Debug, Clone, Copy)]
struct Field {
    /// The middle of the triangles by area.
    middle: Point3<f64>,
    area: f64,
    /// Square of the distance from which the expansion is good enough.
    far_squared: f64,
    /// Sum of the normals times areas.
    normal: Vector3<f64>,
    /// Sum over the triangles of the normal times area, times the transposed offset from the middle.
    skew: Matrix3<f64>,
}

impl Winding {
    /// With a weight for each triangle by its number in the surface.
    pub fn of(tree: &Tree, weight_of: impl Fn(u32) -> f64) -> Self {
        let weight: Vec<f64> = tree.number.iter().map(|n| weight_of(*n)).collect();
        let none = Field {
            middle: Point3::origin(),
            area: 0.0,
            far_squared: 0.0,
            normal: Vector3::zeros(),
            skew: Matrix3::zeros(),
        };
        let mut fields = vec![none; tree.nodes.len()];
        // Nodes come after those above them.
        for (at, node) in tree.nodes.iter().enumerate().rev() {
            let mut field = if node.second > 0 {
                Field::combined(&[fields[at + 1], fields[node.second as usize]])
            } else {
                let leaf = node.triangles();
                Field::combined(&leaf.map(|n| Field::of(&tree.corners[n], weight[n])).collect::<Vec<_>>())
            };
            let reach = (field.middle - node.low).abs().sup(&(field.middle - node.high).abs());
            field.far_squared = FAR * FAR * reach.norm_squared();
            fields[at] = field;
        }
        Self { weight, fields }
    }

    /// The winding number of a point, given the same tree.
    pub fn at(&self, tree: &Tree, point: Point3<f64>) -> f64 {
        let mut sum = 0.0;
        let mut stack = [0; MOST_DEPTH];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let at = stack[waiting] as usize;
            let (node, field) = (&tree.nodes[at], &self.fields[at]);
            let offset = field.middle - point;
            if offset.norm_squared() > field.far_squared {
                sum += field.far(offset);
            } else if node.second > 0 {
                stack[waiting] = node.second;
                stack[waiting + 1] = at as u32 + 1;
                waiting += 2;
            } else {
                sum += node.triangles().map(|n| self.weight[n] * solid_angle(&tree.corners[n], point)).sum::<f64>();
            }
        }
        sum / (4.0 * PI)
    }
}

impl Field {
    fn of(corners: &[Point3<f64>; 3], weight: f64) -> Self {
        let [a, b, c] = corners;
        let normal = (b - a).cross(&(c - a)) * 0.5;
        let (middle, area) = (middle(corners), normal.norm());
        Self { middle, area, far_squared: 0.0, normal: normal * weight, skew: Matrix3::zeros() }
    }

    fn combined(fields: &[Self]) -> Self {
        let area: f64 = fields.iter().map(|field| field.area).sum();
        let share = |field: &Self| if area > 0.0 { field.area / area } else { 1.0 / fields.len() as f64 };
        let middle = Point3::from(fields.iter().map(|field| field.middle.coords * share(field)).sum::<Vector3<f64>>());
        let moved = |field: &Self| field.skew + field.normal * (field.middle - middle).transpose();
        Self {
            middle,
            area,
            far_squared: 0.0,
            normal: fields.iter().map(|field| field.normal).sum(),
            skew: fields.iter().map(moved).sum(),
        }
    }

    /// The solid angle at a point from which the middle is `offset` away: the field of a dipole and its first derivative
    /// (equations 13 and 14 of Barill et al.).
    fn far(&self, offset: Vector3<f64>) -> f64 {
        let squared = offset.norm_squared();
        let per_cube = 1.0 / (squared * squared.sqrt());
        let dipole = self.normal.dot(&offset) * per_cube;
        let slope = self.skew.trace() - 3.0 * offset.dot(&(self.skew * offset)) / squared;
        dipole + slope * per_cube
    }
}

/// The solid angle of a triangle, positive seen from behind it (van Oosterom and Strackee 1983).
fn solid_angle(corners: &[Point3<f64>; 3], point: Point3<f64>) -> f64 {
    let [a, b, c] = corners.map(|corner| corner - point);
    let [la, lb, lc] = [a.norm(), b.norm(), c.norm()];
    let det = a.dot(&b.cross(&c));
    let cosines = la * lb * lc + a.dot(&b) * lc + a.dot(&c) * lb + b.dot(&c) * la;
    2.0 * det.atan2(cosines)
}
