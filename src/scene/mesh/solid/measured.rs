//! A measured surface that can be asked, place by place, where its material is: what a grid is filled from.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use nalgebra::{Point3, Unit, Vector3};

use super::frame::Frame;
use super::material::{self, Material, PROBABLY, Turning};
use super::oriented::Oriented;
use super::sample::{Place, places};
use super::{Kind, Shell, Solid, SolidError, Topology, check};
use crate::parallel;
use crate::scene::mesh::Triangles;
use crate::units::Estimate;

/// The side of a place on which the material lies is looked for this far from the surface, as a share of the mesh's size:
/// ten times as far as the 32-bit numbers of most files may be off.
const BESIDE: f64 = 1e-6;

/// A surface with the solid that it bounds.
pub struct Measured {
    pub solid: Solid,
    frame: Frame,
    surface: Oriented,
    /// How often each component winds around its inside.
    turns: Vec<f64>,
    /// Per component, the body to which it belongs.
    body_of: Vec<u32>,
    /// How often the surface winds around places; made when it is first asked for.
    turning: OnceLock<Turning>,
}

/// A place on a surface. The mesh's frame and unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePlace {
    pub point: Point3<f64>,
    /// Out of the material; of a sheet, to its front.
    pub outward: Unit<Vector3<f64>>,
    /// How far a ray straight in goes until it leaves the material; `None` if there is none on either side.
    pub thickness: Option<f64>,
}

impl Measured {
    /// Measures a surface. Its triangles need not be oriented alike, nor be closed, nor share vertices.
    ///
    /// # Errors
    /// As for [`measure`](super::measure).
    pub fn of(surface: &Triangles) -> Result<Self, SolidError> {
        check(surface)?;
        let frame = Frame::of(surface);
        let oriented =
            Oriented::of(surface, &frame).ok_or(SolidError::NoArea { triangles: surface.triangles.len() })?;
        let Material { volume, moments, kind, doubts, inverted, turns, body_of } = material::material(&oriented);
        let shell = Shell::of(&oriented.corners, &frame);
        let has_volume = moments.volume > 0.0;
        let solid = Solid {
            kind: kind.scaled(|length| frame.length(length)),
            volume: Estimate::new(frame.volume(volume.low), frame.volume(volume.mid), frame.volume(volume.high)),
            center: if has_volume { frame.point_back(moments.center()) } else { shell.center },
            inertia: if has_volume { frame.inertia(&moments) } else { nalgebra::Matrix3::zeros() },
            shell,
            doubts,
            topology: Topology { inverted_components: inverted, ..oriented.topology },
        };
        Ok(Self { solid, frame, surface: oriented, turns, body_of, turning: OnceLock::new() })
    }

    /// The corners of the box around the surface.
    pub fn bounds(&self) -> (Point3<f64>, Point3<f64>) {
        let corners = self.surface.corners.iter().flatten().map(|corner| self.frame.point_back(*corner));
        let none = (Point3::from([f64::INFINITY; 3]), Point3::from([f64::NEG_INFINITY; 3]));
        corners.fold(none, |(low, high), corner| (low.inf(&corner), high.sup(&corner)))
    }

    /// Whether a place is material: the surface winds around it. Nothing is of a [`Kind::Sheet`].
    pub fn is_material(&self) -> impl Fn(Point3<f64>) -> bool + Sync + '_ {
        let is_material = self.is_material_in_frame();
        move |point| is_material(self.frame.point(point.into()))
    }

    /// The same for places in the frame of the measurement.
    fn is_material_in_frame(&self) -> impl Fn(Point3<f64>) -> bool + Copy + Sync + '_ {
        let turning = (self.solid.kind != Kind::Sheet)
            .then(|| self.turning.get_or_init(|| Turning::of(&self.surface, &self.turns)));
        move |point| turning.is_some_and(|turning| turning.around(&self.surface.tree, point).sum() > PROBABLY)
    }

    /// Number of bodies that the mesh consists of: surfaces that neither lie in each other nor cross. 1 if it is not closed, since
    /// nothing tells where the inside of each ends.
    pub fn bodies(&self) -> u32 {
        let is_closed = self.solid.topology.is_watertight();
        self.body_of.iter().max().filter(|_| is_closed).map_or(1, |last| last + 1)
    }

    /// `count` points of the surface, each for the same area, and the bodies on which they lie.
    pub fn points_of_bodies(&self, count: usize) -> Vec<(Point3<f64>, u32)> {
        let body = |place: &Place| self.body_of[self.surface.component_of[place.triangle as usize] as usize];
        self.spread(count).into_iter().map(|place| (self.frame.point_back(place.point), body(&place))).collect()
    }

    /// For each of the places `from + n * step`, for n below `count`, the body in which it lies; `None` if it lies in none or in
    /// several.
    pub fn bodies_along(&self, from: Point3<f64>, step: Vector3<f64>, count: usize) -> Vec<Option<u32>> {
        let start = self.frame.point(from.into());
        let line = self.frame.point((from + step).into()) - start;
        let mut hits = Vec::new();
        self.surface.tree.hits(start, line.normalize(), |hit| hits.push(hit));
        hits.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        let mut hits = hits.into_iter().peekable();
        let mut layers: BTreeMap<u32, i32> = BTreeMap::new();
        let body_at = |n: usize| {
            let distance = n as f64 * line.norm();
            while let Some(hit) = hits.next_if(|hit| hit.distance <= distance) {
                let body = self.body_of[self.surface.component_of[hit.triangle as usize] as usize];
                *layers.entry(body).or_default() += if hit.leaves { -1 } else { 1 };
            }
            let mut around = layers.iter().filter(|(_, layers)| **layers > 0).map(|(body, _)| *body);
            around.next().filter(|_| around.next().is_none())
        };
        (0..count).map(body_at).collect()
    }

    /// `count` points of the surface, each for the same area, and the directions out of what the surface encloses there.
    pub fn points(&self, count: usize) -> Vec<(Point3<f64>, Vector3<f64>)> {
        let outward = |place: &Place| {
            let turns = self.turns[self.surface.component_of[place.triangle as usize] as usize];
            self.frame.direction_back(place.normal.into_inner() * turns)
        };
        self.spread(count).into_iter().map(|place| (self.frame.point_back(place.point), outward(&place))).collect()
    }

    /// `count` places on the surface, each for the same area.
    pub fn places(&self, count: usize) -> Vec<SurfacePlace> {
        let is_material = self.is_material_in_frame();
        let place = |place: &Place| {
            let beside = |side: f64| place.point + place.normal.into_inner() * (side * BESIDE);
            let sides = [-1.0, 1.0].map(|side| is_material(beside(side)));
            let outward = if sides == [false, true] { -place.normal } else { place.normal };
            let inward = -outward.into_inner();
            let start = place.point + inward * BESIDE;
            let thickness = (sides[0] != sides[1]).then(|| self.way_out(start, inward, is_material)).flatten();
            SurfacePlace {
                point: self.frame.point_back(place.point),
                outward: Unit::new_unchecked(self.frame.direction_back(outward.into_inner())),
                thickness: thickness.map(|length| self.frame.length(length + BESIDE)),
            }
        };
        parallel::map(&self.spread(count), place)
    }

    fn spread(&self, count: usize) -> Vec<Place> {
        let all: Vec<u32> = (0..self.surface.corners.len() as u32).collect();
        places(&self.surface.corners, &all, count)
    }

    /// How far a ray that starts in the material goes until it leaves it at a surface, in the frame of the measurement.
    fn way_out(
        &self,
        from: Point3<f64>,
        direction: Vector3<f64>,
        is_material: impl Fn(Point3<f64>) -> bool,
    ) -> Option<f64> {
        let mut hits = Vec::new();
        self.surface.tree.hits(from, direction, |hit| hits.push(hit.distance));
        hits.sort_by(f64::total_cmp);
        hits.into_iter().find(|distance| !is_material(from + direction * (distance + BESIDE)))
    }
}
