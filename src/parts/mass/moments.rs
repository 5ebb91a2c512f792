//! Volume integrals over a part's cells: centre and second moments, from which mass, centre of mass and inertia follow.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::parts::grid::Grid;

/// Integrals of 1, x and x x^T over a body, scaled to a given volume. World frame, scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    pub volume: f64,
    pub center: Point3<f64>,
    /// Integral of (x - c)(x - c)^T about the centre.
    pub second: Matrix3<f64>,
}

impl Moments {
    /// For each of `owners` owners, the moments of its shares of the cells; `None` for an owner without any. `shares`
    /// lists the shares: index of the cell, owner, share of the cell.
    pub fn of(grid: &Grid, shares: impl Iterator<Item = (usize, usize, f64)>, owners: usize) -> Vec<Option<Self>> {
        // Computed about the grid's middle rather than the world's origin, which may be far away.
        let origin = grid.middle();
        let mut sums = vec![(0.0, Vector3::zeros(), Matrix3::zeros()); owners];
        for (i, owner, share) in shares {
            let x = grid.center(grid.coords(i)) - origin;
            let (volume, first, second) = &mut sums[owner];
            *volume += share;
            *first += x * share;
            *second += x * x.transpose() * share;
        }
        // Each cell is a cube: its own second moment is that of a uniform segment along each axis.
        let own = Matrix3::identity() * (grid.cell * grid.cell / 12.0);
        let body = |(shares, first, second): (f64, Vector3<f64>, Matrix3<f64>)| {
            (shares > 0.0).then(|| {
                let mean = first / shares;
                let spread = second / shares - mean * mean.transpose() + own;
                let volume = shares * grid.cell_volume();
                Self { volume, center: origin + mean, second: spread * volume }
            })
        };
        sums.into_iter().map(body).collect()
    }

    /// The same body with its moments scaled to this volume.
    pub fn with_volume(self, volume: f64) -> Self {
        Self { volume, second: self.second * (volume / self.volume), ..self }
    }

    /// Several bodies combined, each weighted by its density: mass, centre of mass, second moment of mass.
    pub fn combined(bodies: &[(f64, Self)]) -> Option<Self> {
        let mass: f64 = bodies.iter().map(|(density, b)| density * b.volume).sum();
        if mass <= 0.0 {
            return None;
        }
        let first = bodies.iter().map(|(density, b)| b.center.coords * (density * b.volume)).sum::<Vector3<f64>>();
        let center = Point3::from(first / mass);
        let about_center = |(density, b): &(f64, Self)| {
            let offset = b.center - center;
            (b.second + offset * offset.transpose() * b.volume) * *density
        };
        Some(Self { volume: mass, center, second: bodies.iter().map(about_center).sum() })
    }

    /// Inertia about the centre for unit density: trace(S) I - S.
    pub fn inertia(&self) -> Matrix3<f64> {
        Matrix3::identity() * self.second.trace() - self.second
    }
}
