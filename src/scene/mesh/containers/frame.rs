//! Frames of bodies in formats whose nodes may be scaled.

use nalgebra::{Isometry3, Matrix4, Point3, Translation3};

use crate::numeric::hull::Hull;
use crate::scene::mesh::Triangles;
use crate::scene::mesh::gltf::rotation_of;

/// Where a body stands: the place and the rotation of its node, without its scale.
pub struct Frame {
    pub world_from_body: Isometry3<f64>,
}

impl Frame {
    pub fn of(world_from_node: &Matrix4<f64>) -> Self {
        let place = Translation3::from(world_from_node.fixed_view::<3, 1>(0, 3).into_owned());
        Self { world_from_body: Isometry3::from_parts(place, rotation_of(world_from_node)) }
    }

    pub fn body_from_world(&self) -> Matrix4<f64> {
        self.world_from_body.inverse().to_homogeneous()
    }
}

/// How much a transform stretches each of its axes.
pub fn stretch(transform: &Matrix4<f64>) -> [f64; 3] {
    [0, 1, 2].map(|axis| transform.fixed_view::<3, 1>(0, axis).norm())
}

/// The convex hull of a surface; the surface itself if it spans no volume.
pub fn hull_of(surface: &Triangles) -> Triangles {
    let points: Vec<Point3<f64>> = surface.vertices.iter().map(|vertex| Point3::from(*vertex)).collect();
    let made = |hull: Hull| Triangles {
        vertices: hull.vertices.iter().map(|vertex| (*vertex).into()).collect(),
        triangles: hull.triangles,
    };
    Hull::inner(&points).map_or_else(|| surface.clone(), made)
}
