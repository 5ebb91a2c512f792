//! The solid that a mesh bounds: volume, area, centre of mass, inertia and wall, each as certain as the mesh allows.
//!
//! [`measure`] works in a [`frame`] of its own:
//! 1. [`weld`] joins equal vertices; [`connected`] finds patches and components and orients the triangles of each alike;
//! 2. [`oriented`] turns closed components outward and, with [`facing`], open patches toward their surroundings;
//! 3. [`nesting`] finds which components lie inside of others, and which cross;
//! 4. [`mod@material`] sums the [`moments`] of what is closed exactly, and integrates the rest with [`quadrature`] over how often
//!    the surface winds around each place: [`mod@crossings`] count it for what is closed, [`winding`] numbers for the rest;
//!    [`mod@thickness`] recognises walls.
//!
//! [`Measured`] also says place by place where the material is. [`survey()`] looks at a mesh in a fraction of that time.
//!
//! Rays and winding numbers use the [`tree`]. The result depends on the surface alone: neither on the order of its triangles
//! nor on the number of threads.

mod connected;
mod crossings;
mod error;
mod facing;
mod frame;
mod material;
mod measured;
mod moments;
mod nesting;
mod oriented;
mod quadrature;
mod sample;
mod survey;
mod thickness;
mod tree;
mod weld;
mod winding;

use std::fmt;

use nalgebra::{Matrix3, Point3, Vector3};

use super::Triangles;
use crate::units::Estimate;
use crate::words::output::{agreeing, counted};
use connected::{Connected, area_of};
pub use error::SolidError;
use frame::Frame;
pub use measured::{Measured, SurfacePlace};
pub use survey::{Survey, survey};
use weld::Welded;

/// A triangle with less area than this, in the [`Frame`] of the measurement, has none.
const NO_AREA: f64 = 1e-15;
/// Maximum number of triangles: with three sides of each, all sides can be numbered in 32 bits.
const MOST_TRIANGLES: usize = (u32::MAX / 3) as usize;
/// Largest coordinate: its fifth power, in which inertia is, is far from the largest number.
const MOST_COORDINATE: f64 = 1e50;

/// What a mesh says about the solid that it shows. Lengths are in the mesh's unit, positions and axes in its frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Solid {
    pub kind: Kind,
    /// Volume of the material: of all that is enclosed, less voids. 0 to what it might hold for a [`Kind::Sheet`].
    pub volume: Estimate,
    /// The centre of mass if the material has one density; of a sheet, that of its area.
    pub center: Point3<f64>,
    /// Inertia about the centre at a density of 1 mass unit per cubed length unit; zero for a sheet.
    pub inertia: Matrix3<f64>,
    /// The surface as a thin shell: what it weighs if only a wall along it is material.
    pub shell: Shell,
    /// Why the volume is an interval, and what else may be wrong; empty if it is exact.
    pub doubts: Vec<Doubt>,
    /// How the triangles hang together.
    pub topology: Topology,
}

/// How a mesh bounds material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Closed surfaces that are full of material, apart from voids.
    Solid,
    /// A wall, of this thickness, between two sides that the mesh both has: its volume is that of the wall.
    Wall { thickness: Estimate },
    /// A surface with openings that encloses a volume: a solid of which a side is missing, or a vessel with a wall without
    /// thickness. Which of the two, the mesh does not say.
    Open,
    /// A surface that encloses nothing: a wall whose thickness the mesh does not say.
    Sheet,
}

/// The surface as a shell that is thin and everywhere of the same thickness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shell {
    pub area: f64,
    /// The centre of the area.
    pub center: Point3<f64>,
    /// Inertia about that centre at 1 mass unit per squared length unit.
    pub inertia: Matrix3<f64>,
}

/// How triangles hang together, after equal vertices are joined.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Topology {
    pub vertices: usize,
    /// Number of triangles without the degenerate ones and the duplicates that were left out.
    pub triangles: usize,
    pub components: usize,
    /// Number of components without boundaries in which neighbours can be oriented alike.
    pub closed_components: usize,
    /// Number of closed components that faced inward although nothing is around them.
    pub inverted_components: usize,
    /// Number of edges of only one triangle.
    pub boundary_edges: usize,
    /// Number of edges of more than two triangles.
    pub non_manifold_edges: usize,
    /// Number of edges whose two triangles cannot be oriented alike, as on a Moebius strip.
    pub twisted_edges: usize,
    /// Number of triangles that faced otherwise than most of their neighbourhood.
    pub misoriented_triangles: usize,
    /// Number of triangles without area.
    pub degenerate: usize,
    /// Number of triangles with the same corners as another, which were left out.
    pub duplicates: usize,
}

impl Topology {
    /// Whether every edge belongs to two triangles that can be oriented alike.
    pub fn is_watertight(&self) -> bool {
        self.closed_components == self.components
    }
}

impl Topology {
    /// Of a surface as it is, without the components that are closed or inverted.
    fn of(welded: &Welded, connected: &Connected) -> Self {
        let sides = connected.edges.iter().map(<[_]>::len);
        let without_area = (0..welded.triangles.len()).filter(|n| area_of(&welded.corners(*n)) <= NO_AREA).count();
        Self {
            vertices: welded.points.len(),
            triangles: welded.triangles.len(),
            components: connected.components,
            closed_components: 0,
            inverted_components: 0,
            boundary_edges: sides.clone().filter(|sides| *sides == 1).count(),
            non_manifold_edges: sides.filter(|sides| *sides > 2).count(),
            twisted_edges: connected.twisted_edges,
            misoriented_triangles: connected.mended,
            degenerate: welded.degenerate + without_area,
            duplicates: welded.duplicates,
        }
    }
}

/// A reason why a volume is an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Doubt {
    /// Components with openings.
    Open { components: usize, boundary_edges: usize },
    /// Components that pass through others or themselves. What several enclose counts once; the volume is integrated
    /// numerically, with this relative error.
    Crossing { components: usize, error: f64 },
    /// Components inside of others that face the same way: either solids, which add nothing, or voids.
    NestedAlike { components: usize },
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Open { components, boundary_edges } => write!(
                f,
                "{} of the surface {} not closed ({}); what it surrounds by half or more counts as inside, and the interval \
                 is from three quarters to one quarter",
                counted(*components, "component"),
                agreeing(*components, "is", "are"),
                counted(*boundary_edges, "open edge"),
            ),
            Self::Crossing { components, error } => write!(
                f,
                "{} {} through others or themselves; what several enclose counts once, and the volume is integrated \
                 numerically (within {:.2} %)",
                counted(*components, "component"),
                agreeing(*components, "passes", "pass"),
                100.0 * error,
            ),
            Self::NestedAlike { components } => write!(
                f,
                "{} {} inside of others and {} the same way, so {} may be solid or void; the interval spans both",
                counted(*components, "component"),
                agreeing(*components, "lies", "lie"),
                agreeing(*components, "faces", "face"),
                agreeing(*components, "it", "they"),
            ),
        }
    }
}

/// Measures the solid that a surface bounds. Its triangles need not be oriented alike, nor be closed, nor share vertices.
///
/// # Errors
/// [`SolidError`] if there is no triangle with an area, or a triangle has a corner that does not exist or lies nowhere.
pub fn measure(surface: &Triangles) -> Result<Solid, SolidError> {
    Measured::of(surface).map(|measured| measured.solid)
}

fn check(surface: &Triangles) -> Result<(), SolidError> {
    let (vertices, triangles) = (&surface.vertices, &surface.triangles);
    if triangles.is_empty() {
        return Err(SolidError::Empty);
    }
    if triangles.len() > MOST_TRIANGLES {
        return Err(SolidError::TooMany { triangles: triangles.len(), most: MOST_TRIANGLES });
    }
    for (triangle, corners) in triangles.iter().enumerate() {
        for &index in corners {
            let position =
                *vertices.get(index as usize).ok_or(SolidError::Index { triangle, index, vertices: vertices.len() })?;
            if !position.iter().all(|x| x.abs() <= MOST_COORDINATE) {
                return Err(SolidError::Position { vertex: index, position, most: MOST_COORDINATE });
            }
        }
    }
    Ok(())
}

impl Kind {
    fn scaled(self, length: impl Fn(f64) -> f64) -> Self {
        match self {
            Self::Wall { thickness: Estimate { low, mid, high } } => {
                Self::Wall { thickness: Estimate::new(length(low), length(mid), length(high)) }
            }
            other => other,
        }
    }
}

impl Shell {
    /// From the exact integrals over triangles: of x x^T it is area / 12 times (a a^T + b b^T + c c^T + s s^T), with s the
    /// sum of the corners a, b, c.
    fn of(triangles: &[[Point3<f64>; 3]], frame: &Frame) -> Self {
        let (mut area, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
        for corners in triangles {
            let [a, b, c] = corners.map(|corner| corner.coords);
            let (own, sum) = (area_of(corners), a + b + c);
            area += own;
            first += sum * (own / 3.0);
            second +=
                (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose()) * (own / 12.0);
        }
        let moments = moments::Moments { volume: area, first, second };
        Self {
            area: frame.area(area),
            center: frame.point_back(moments.center()),
            // Areas have one length less than volumes.
            inertia: frame.inertia(&moments) * frame.length(1.0).recip(),
        }
    }
}
