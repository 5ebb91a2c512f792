//! Lens distortion: maps a point in the plane of an ideal pinhole (x/z, y/z) to where the real lens shows it, for every
//! camera model that COLMAP and nerfstudio write.
//!
//! A model has up to two steps. The first bends the radius as a whole (an equidistant fisheye, a field of view, a
//! division); the second applies the polynomial of Brown, Conrady and OpenCV to the result: radial, tangential, thin
//! prism.

use serde::{Deserialize, Serialize};

/// The deviation of a lens from a pinhole, on normalised image coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(tag = "model", rename_all = "snake_case")]
pub enum Distortion {
    /// An ideal pinhole.
    #[default]
    None,
    /// OpenCV's perspective lens (COLMAP: SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV).
    Perspective(Polynomial),
    /// An equidistant fisheye, radius = angle off the axis, then the polynomial of that angle (COLMAP: *_FISHEYE).
    Fisheye(Polynomial),
    /// Devernay and Faugeras 2001: radius = atan(2 r tan(omega/2)) / omega, omega in radians (COLMAP: FOV).
    FieldOfView { omega: f64 },
    /// Fitzgibbon 2001: r = r' / (1 + k r'^2) for the radius r' in the picture (COLMAP: DIVISION).
    Division { k: f64 },
    /// Khomutenko et al. 2016: r' = r / (alpha sqrt(beta r^2 + 1) + 1 - alpha) (COLMAP: EUCM).
    EnhancedUnified { alpha: f64, beta: f64 },
}

/// The Brown-Conrady polynomial with OpenCV's extensions, for a point (x, y) with r^2 = x^2 + y^2.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Polynomial {
    /// Coefficients of r^2, r^4, ... r^12 in the radial factor's numerator 1 + ...: OpenCV's k1 k2 k3 are the first
    /// three.
    pub radial: [f64; 6],
    /// Coefficients of r^2, r^4, r^6 in its denominator 1 + ...: OpenCV's k4 k5 k6.
    pub divisor: [f64; 3],
    /// p1, p2.
    pub tangential: [f64; 2],
    /// s1 s2 s3 s4: x gains s1 r^2 + s2 r^4, y gains s3 r^2 + s4 r^4.
    pub prism: [f64; 4],
    /// Whether the tangential and prism terms use the radially distorted point (Project Aria; COLMAP's
    /// RAD_TAN_THIN_PRISM_FISHEYE) instead of the undistorted one (all other models).
    pub prism_after_radial: bool,
}

impl Distortion {
    /// OpenCV's five coefficients.
    pub fn opencv(k1: f64, k2: f64, p1: f64, p2: f64, k3: f64) -> Self {
        Self::perspective(Polynomial {
            radial: [k1, k2, k3, 0.0, 0.0, 0.0],
            tangential: [p1, p2],
            ..Default::default()
        })
    }

    /// A perspective lens; [`Self::None`] if the polynomial does nothing.
    pub fn perspective(polynomial: Polynomial) -> Self {
        let nothing = Polynomial { prism_after_radial: polynomial.prism_after_radial, ..Default::default() };
        if polynomial == nothing { Self::None } else { Self::Perspective(polynomial) }
    }

    /// OpenCV's fisheye: k1 k2 k3 k4 of the angle.
    pub fn fisheye([k1, k2, k3, k4]: [f64; 4]) -> Self {
        Self::Fisheye(Polynomial { radial: [k1, k2, k3, k4, 0.0, 0.0], ..Default::default() })
    }

    /// True if the lens is an ideal pinhole.
    pub fn is_none(&self) -> bool {
        *self == Self::None
    }

    /// Distorts a point of the normalised image plane (x/z, y/z).
    pub fn apply(&self, x: f64, y: f64) -> (f64, f64) {
        let factor = self.bend(x * x + y * y).factor;
        match self.polynomial() {
            Some(polynomial) => polynomial.apply(x * factor, y * factor),
            None => (x * factor, y * factor),
        }
    }

    /// Jacobian of [`Self::apply`], row by row: `[[dx'/dx, dx'/dy], [dy'/dx, dy'/dy]]`.
    pub fn jacobian(&self, x: f64, y: f64) -> [[f64; 2]; 2] {
        let Bend { factor, slope } = self.bend(x * x + y * y);
        let bend = [[factor + slope * x * x, slope * x * y], [slope * x * y, factor + slope * y * y]];
        match self.polynomial() {
            Some(polynomial) => product(polynomial.jacobian(x * factor, y * factor), bend),
            None => bend,
        }
    }

    /// True if the lens model is not physical at the point (x/z, y/z): going outwards, its radial part turns back
    /// before it reaches the point. Fitted polynomials do so outside of the picture, and a point there would appear to
    /// lie in the picture.
    pub fn folds_back_at(&self, x: f64, y: f64) -> bool {
        let r2 = x * x + y * y;
        if let Self::Division { k } = *self {
            // Points beyond this radius are not in the picture.
            return 4.0 * k * r2 >= 1.0;
        }
        let factor = self.bend(r2).factor;
        self.polynomial().is_some_and(|polynomial| polynomial.folds_back_within(r2 * factor * factor))
    }

    /// The point of the normalised plane that [`Self::apply`] takes to (`x`, `y`), by Newton's method from the point
    /// itself, or, if that does not converge, from a point at the right distance from the centre; `None` if there is no
    /// such point that the lens can show.
    pub fn invert(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        self.invert_from((x, y), x, y).or_else(|| self.invert_from(self.at_distance_of(x, y), x, y))
    }

    fn invert_from(&self, start: (f64, f64), x: f64, y: f64) -> Option<(f64, f64)> {
        /// Newton's method converges quadratically; strong fisheyes near 80 degrees take about ten steps.
        const STEPS: usize = 50;
        const TOLERANCE: f64 = 1e-12;
        let (mut u, mut v) = start;
        for _ in 0..STEPS {
            let (found_x, found_y) = self.apply(u, v);
            let (ex, ey) = (found_x - x, found_y - y);
            if ex.hypot(ey) < TOLERANCE * (1.0 + x.hypot(y)) {
                return (!self.folds_back_at(u, v)).then_some((u, v));
            }
            let [[a, b], [c, d]] = self.jacobian(u, v);
            let determinant = a * d - b * c;
            let (du, dv) = ((d * ex - b * ey) / determinant, (a * ey - c * ex) / determinant);
            // The step is no longer than about the point's own distance; otherwise it could jump to where a steep lens
            // folds back.
            let limit = (0.5 + u.hypot(v)) / du.hypot(dv);
            u -= du * limit.min(1.0);
            v -= dv * limit.min(1.0);
        }
        None
    }

    /// The point in the direction of (`x`, `y`) that the lens maps to the distance of (`x`, `y`) from the centre, or to
    /// as much of that distance as the lens shows, by bisection.
    pub(crate) fn at_distance_of(&self, x: f64, y: f64) -> (f64, f64) {
        /// Gives the radius to within a relative error of 2^-40, up to 2^10 times the distance: no picture reaches
        /// 89.9 degrees.
        const HALVINGS: i32 = 40;
        const DOUBLINGS: i32 = 10;
        let distance = x.hypot(y);
        let is_too_far = |scale: f64| {
            let (found_x, found_y) = self.apply(scale * x, scale * y);
            self.folds_back_at(scale * x, scale * y) || found_x * x + found_y * y > distance * distance
        };
        let (mut near, mut far) = (0.0, f64::from(1 << DOUBLINGS));
        for _ in 0..HALVINGS + DOUBLINGS {
            let middle = 0.5 * (near + far);
            *(if is_too_far(middle) { &mut far } else { &mut near }) = middle;
        }
        (near * x, near * y)
    }

    fn polynomial(&self) -> Option<&Polynomial> {
        match self {
            Self::Perspective(polynomial) | Self::Fisheye(polynomial) => Some(polynomial),
            _ => None,
        }
    }

    /// The first step at a squared radius.
    fn bend(&self, r2: f64) -> Bend {
        match *self {
            Self::None | Self::Perspective(_) => Bend { factor: 1.0, slope: 0.0 },
            Self::Fisheye(_) => Bend::arctangent(r2),
            Self::FieldOfView { omega } => {
                let a = 2.0 * (0.5 * omega).tan();
                let Bend { factor, slope } = Bend::arctangent(a * a * r2);
                Bend { factor: factor * a / omega, slope: slope * a * a * a / omega }
            }
            Self::Division { k } => {
                let root = (1.0 - 4.0 * k * r2).max(0.0).sqrt();
                let factor = 2.0 / (1.0 + root);
                Bend { factor, slope: 2.0 * k * factor * factor / root }
            }
            Self::EnhancedUnified { alpha, beta } => {
                let root = (beta * r2 + 1.0).sqrt();
                let factor = 1.0 / (alpha * root + 1.0 - alpha);
                Bend { factor, slope: -factor * factor * alpha * beta / root }
            }
        }
    }
}

/// The factor that a point is multiplied by, and its change with the radius: (d factor / d r) / r.
struct Bend {
    factor: f64,
    slope: f64,
}

impl Bend {
    /// factor = atan(r) / r.
    fn arctangent(r2: f64) -> Self {
        /// For r^2 below this, the series are exact to 1e-15, while the quotients lose digits.
        const SMALL: f64 = 1e-5;
        if r2 < SMALL {
            return Self {
                factor: 1.0 - r2 * (1.0 / 3.0 - r2 * (0.2 - r2 / 7.0)),
                slope: -2.0 / 3.0 + r2 * (0.8 - r2 * 6.0 / 7.0),
            };
        }
        let r = r2.sqrt();
        let factor = r.atan() / r;
        Self { factor, slope: (1.0 / (1.0 + r2) - factor) / r2 }
    }
}

impl Polynomial {
    fn apply(&self, x: f64, y: f64) -> (f64, f64) {
        let (radial, _) = self.radial_factor(x * x + y * y);
        let (rx, ry) = (x * radial, y * radial);
        let (px, py) = if self.prism_after_radial { (rx, ry) } else { (x, y) };
        let (dx, dy) = self.decentring(px, py);
        (rx + dx, ry + dy)
    }

    fn jacobian(&self, x: f64, y: f64) -> [[f64; 2]; 2] {
        let (radial, slope) = self.radial_factor(x * x + y * y);
        // d(radial)/dx = 2 x slope.
        let radial_jacobian =
            [[radial + 2.0 * x * x * slope, 2.0 * x * y * slope], [2.0 * x * y * slope, radial + 2.0 * y * y * slope]];
        let decentring = if self.prism_after_radial {
            product(self.decentring_jacobian(x * radial, y * radial), radial_jacobian)
        } else {
            self.decentring_jacobian(x, y)
        };
        std::array::from_fn(|row| std::array::from_fn(|column| radial_jacobian[row][column] + decentring[row][column]))
    }

    /// The radial factor at u = r^2 and its derivative with respect to u.
    fn radial_factor(&self, u: f64) -> (f64, f64) {
        let (numerator, numerator_slope) = one_plus(&self.radial, u);
        if self.divisor == [0.0; 3] {
            return (numerator, numerator_slope);
        }
        let (divisor, divisor_slope) = one_plus(&self.divisor, u);
        (numerator / divisor, (numerator_slope * divisor - numerator * divisor_slope) / (divisor * divisor))
    }

    /// The displacement that the tangential and prism terms add at (x, y).
    fn decentring(&self, x: f64, y: f64) -> (f64, f64) {
        let ([p1, p2], [s1, s2, s3, s4]) = (self.tangential, self.prism);
        let r2 = x * x + y * y;
        (
            2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + r2 * (s1 + r2 * s2),
            p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + r2 * (s3 + r2 * s4),
        )
    }

    fn decentring_jacobian(&self, x: f64, y: f64) -> [[f64; 2]; 2] {
        let ([p1, p2], [s1, s2, s3, s4]) = (self.tangential, self.prism);
        let r2 = x * x + y * y;
        let (prism_x, prism_y) = (2.0 * (s1 + 2.0 * r2 * s2), 2.0 * (s3 + 2.0 * r2 * s4));
        let cross = 2.0 * p1 * x + 2.0 * p2 * y;
        [
            [2.0 * p1 * y + 6.0 * p2 * x + prism_x * x, cross + prism_x * y],
            [cross + prism_y * x, 6.0 * p1 * y + 2.0 * p2 * x + prism_y * y],
        ]
    }

    /// True if r times the radial factor stops growing anywhere within the squared radius `u`.
    fn folds_back_within(&self, u: f64) -> bool {
        // d(r f)/dr = f + 2 u f'. If all other terms together are less than the leading one, no closer look is needed.
        let steepest = |coefficients: &[f64]| {
            let terms =
                coefficients.iter().zip(1..).map(|(k, power)| k.abs() * f64::from(2 * power + 1) * u.powi(power));
            terms.sum::<f64>()
        };
        if self.divisor == [0.0; 3] && steepest(&self.radial) < 1.0 {
            return false;
        }
        /// Real lenses turn back once and over a wide range of radii; a dip narrower than a step would be missed.
        const STEPS: u32 = 64;
        (1..=STEPS).any(|step| {
            let u = u * (f64::from(step) / f64::from(STEPS)).powi(2);
            let (factor, slope) = self.radial_factor(u);
            let divisor_is_sound = one_plus(&self.divisor, u).0 > 0.0;
            factor + 2.0 * u * slope <= 0.0 || !divisor_is_sound
        })
    }
}

/// 1 + c0 u + c1 u^2 + ... and its derivative with respect to u.
fn one_plus(coefficients: &[f64], u: f64) -> (f64, f64) {
    let (value, slope) = coefficients.iter().rev().fold((0.0, 0.0), |(value, slope), c| {
        // Horner for p(u) = c0 + c1 u + ..., of which u p(u) is wanted.
        (c + value * u, value + slope * u)
    });
    (1.0 + u * value, value + u * slope)
}

fn product(a: [[f64; 2]; 2], b: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
}
