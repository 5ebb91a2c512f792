//! The geometry of prims, and where they stand.

use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix4, Point3, Rotation3, Unit, UnitQuaternion, Vector3};

use super::super::frame::{Frame, hull_of, stretch};
use super::super::{Geometry, OwnMesh};
use super::text::Prim;
use crate::scene::mesh::Triangles;
use crate::scene::mesh::assembly::{Assembly, Corner};
use crate::scene::mesh::gltf::quaternion;

/// Stands in the order of transforms before those that do not build upon the prim above.
const RESET: &str = "!resetXformStack!";

/// Whether a prim stands in the world, whatever is above it.
pub fn resets(prim: &Prim) -> bool {
    prim.texts("xformOpOrder").iter().any(|name| name == RESET)
}

/// A prim's own transform, in units of its layer.
pub fn parent_from_prim(prim: &Prim) -> Matrix4<f64> {
    let operations = prim.texts("xformOpOrder").iter().filter(|name| *name != RESET);
    operations.fold(Matrix4::identity(), |all, name| {
        let operation = match name.strip_prefix("!invert!") {
            Some(name) => operation(prim, name).and_then(Matrix4::try_inverse),
            None => operation(prim, name),
        };
        all * operation.unwrap_or_else(Matrix4::identity)
    })
}

fn operation(prim: &Prim, name: &str) -> Option<Matrix4<f64>> {
    let kind = name.strip_prefix("xformOp:")?.split(':').next()?;
    let about = |axis: Unit<Vector3<f64>>, degrees: f64| Rotation3::from_axis_angle(&axis, degrees.to_radians());
    let axis_of = |letter: char| match letter {
        'X' => Vector3::x_axis(),
        'Y' => Vector3::y_axis(),
        _ => Vector3::z_axis(),
    };
    match kind {
        "translate" => Some(Matrix4::new_translation(&prim.vector::<3>(name)?.into())),
        "scale" => Some(Matrix4::new_nonuniform_scaling(&prim.vector::<3>(name)?.into())),
        "orient" => {
            let [w, x, y, z] = prim.vector::<4>(name)?;
            Some(quaternion([x, y, z, w]).to_homogeneous())
        }
        // USD's matrices multiply rows from the left.
        "transform" => Some(Matrix4::from_column_slice(&prim.vector::<16>(name)?)),
        "rotateX" | "rotateY" | "rotateZ" => {
            Some(about(axis_of(kind.chars().last()?), prim.number(name)?).to_homogeneous())
        }
        _ => {
            // The first of the three letters turns first.
            let order = kind.strip_prefix("rotate").filter(|order| order.len() == 3)?;
            let degrees: [f64; 3] = prim.vector(name)?;
            let turns = order.chars().map(|letter| {
                let angle = degrees["XYZ".find(letter).unwrap_or(2)];
                about(axis_of(letter), angle)
            });
            Some(turns.fold(Rotation3::identity(), |all, turn| turn * all).to_homogeneous())
        }
    }
}

/// A prim whose geometry is read.
pub struct Shapes<'a> {
    pub file: &'a Path,
    /// Tells its mesh from others of the file.
    pub number: usize,
    pub prim: &'a Prim,
    /// In metres.
    pub body_from_prim: Matrix4<f64>,
}

impl Shapes<'_> {
    /// The geometry and its pose in the body; `None` if the prim has none.
    ///
    /// # Errors
    /// What is wrong with a mesh.
    pub fn geometry(&self) -> Result<Option<(Geometry, Isometry3<f64>)>, String> {
        let prim = self.prim;
        let [x, y, z] = stretch(&self.body_from_prim);
        let number = |name: &str, default: f64| prim.number(name).unwrap_or(default).abs();
        // Along the axis that it names; a container's geometries stand along z.
        let (turn, along, across) = match prim.text("axis").unwrap_or("Z") {
            "X" => (UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2), x, y),
            "Y" => (UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -std::f64::consts::FRAC_PI_2), y, x),
            _ => (UnitQuaternion::identity(), z, x),
        };
        let upright = UnitQuaternion::identity();
        let (geometry, turn) = match prim.kind.as_str() {
            "Mesh" => return Ok(self.mesh()?.map(|geometry| (geometry, Isometry3::identity()))),
            "Cube" => (Geometry::Box { half: [x, y, z].map(|side| 0.5 * number("size", 2.0) * side) }, upright),
            "Sphere" => (Geometry::Ellipsoid { half: [x, y, z].map(|side| number("radius", 1.0) * side) }, upright),
            "Cylinder" => {
                let (radius, half_length) = (number("radius", 1.0) * across, 0.5 * number("height", 2.0) * along);
                (Geometry::Cylinder { radius, half_length }, turn)
            }
            "Capsule" => {
                let (radius, half_length) = (number("radius", 0.5) * across, 0.5 * number("height", 1.0) * along);
                (Geometry::Capsule { radius, half_length }, turn)
            }
            "Plane" => (Geometry::Plane, upright),
            other @ ("Cone" | "Cylinder_1" | "Capsule_1" | "NurbsPatch" | "TetMesh") => {
                (Geometry::Other(other.to_owned()), upright)
            }
            _ => return Ok(None),
        };
        Ok(Some((geometry, Frame::of(&self.body_from_prim).world_from_body * turn)))
    }

    fn mesh(&self) -> Result<Option<Geometry>, String> {
        let surface = self.surface()?;
        if surface.triangles.is_empty() {
            return Ok(None);
        }
        let approximation = self.prim.text("physics:approximation");
        let surface = if approximation == Some("convexHull") { hull_of(&surface) } else { surface };
        let mesh = OwnMesh { file: self.file.to_owned(), number: self.number, surface: Arc::new(surface) };
        Ok(Some(Geometry::Own(mesh)))
    }

    /// The polygons in the body's frame, cut into triangles.
    fn surface(&self) -> Result<Triangles, String> {
        let list = |name: &str| self.prim.numbers(name).unwrap_or(&[]);
        let points = list("points").as_chunks::<3>().0;
        let mut assembly = Assembly::default();
        for (index, point) in points.iter().enumerate() {
            let point = self.body_from_prim.transform_point(&Point3::from(*point));
            let added = assembly.vertex(point.into(), None, || format!("point {index}"));
            added.map_err(|problem| problem.to_string())?;
        }
        let is_left_handed = self.prim.text("orientation") == Some("leftHanded");
        let is_mirrored = self.body_from_prim.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        let mut left = list("faceVertexIndices");
        for (face, count) in list("faceVertexCounts").iter().enumerate() {
            let place = || format!("face {face}");
            let corners;
            (corners, left) = left
                .split_at_checked(*count as usize)
                .ok_or_else(|| format!("{} has more corners than there are indices; export the mesh again", place()))?;
            let corner = |index: &f64| {
                let is_there = *index >= 0.0 && *index < points.len() as f64;
                is_there.then_some(Corner { vertex: *index as u32, texture_coordinates: None })
            };
            let mut corners: Vec<Corner> = corners.iter().map(corner).collect::<Option<_>>().ok_or_else(|| {
                format!("{} names a point that is not there, of {}; export the mesh again", place(), points.len())
            })?;
            if is_left_handed != is_mirrored {
                corners.reverse();
            }
            assembly.polygon(&corners, 0, place).map_err(|problem| problem.to_string())?;
        }
        Ok(assembly.into_surface())
    }
}
