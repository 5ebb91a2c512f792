//! SI units everywhere: m, kg, s, Pa, N; angles in radians. Ranges, estimates, Shore hardness, metric scale: this
//! module defines the conventions for numbers.

use serde::{Deserialize, Serialize};

/// Gravitational acceleration in m/s^2, the value the paper's force equations use.
pub const GRAVITY_M_S2: f64 = 9.8;

/// The range of a property according to a library or an answer: between `low` and `high` (SI). Written as `[low, high]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(from = "[f64; 2]", into = "[f64; 2]")]
pub struct Range {
    pub low: f64,
    pub high: f64,
}

impl Range {
    /// The range between `low` and `high`.
    pub const fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    /// A range of one value.
    pub const fn exactly(value: f64) -> Self {
        Self::new(value, value)
    }

    /// The arithmetic middle: the value to use if one number is needed.
    pub fn mid(self) -> f64 {
        0.5 * (self.low + self.high)
    }

    /// The geometric middle, for quantities that are as likely too small by a factor as too large by it.
    pub fn geometric_mid(self) -> f64 {
        (self.low * self.high).sqrt()
    }

    /// An estimate of a quantity that is as likely too small by a factor as too large by it. Its middle is the geometric one, unless the
    /// range begins at next to nothing: then that would be next to nothing too, and the arithmetic one is taken.
    pub fn geometric_estimate(self) -> Estimate {
        const WIDEST: f64 = 20.0;
        let mid = if self.high < WIDEST * self.low { self.geometric_mid() } else { self.mid() };
        Estimate::new(self.low, mid, self.high)
    }

    /// The smallest range that holds both.
    pub fn hull(self, other: Self) -> Self {
        Self::new(self.low.min(other.low), self.high.max(other.high))
    }

    /// The intersection of this range with `bounds`; the nearest bound if there is none.
    pub fn clipped(self, bounds: Self) -> Self {
        Self::new(self.low.clamp(bounds.low, bounds.high), self.high.clamp(bounds.low, bounds.high))
    }

    /// True if both ends are finite and in order.
    pub fn is_valid(self) -> bool {
        self.low.is_finite() && self.high.is_finite() && self.low <= self.high
    }

    /// True if it is valid and no value in it is 0 or less, as a mass must be.
    pub fn is_positive(self) -> bool {
        self.low > 0.0 && self.is_valid()
    }
}

impl From<[f64; 2]> for Range {
    fn from([low, high]: [f64; 2]) -> Self {
        Self { low, high }
    }
}

impl From<Range> for [f64; 2] {
    fn from(range: Range) -> Self {
        [range.low, range.high]
    }
}

/// A number that gprop derived, with its 90 % interval: `low <= mid <= high` (SI).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Estimate {
    pub low: f64,
    pub mid: f64,
    pub high: f64,
}

impl Estimate {
    /// An estimate from its three values.
    pub const fn new(low: f64, mid: f64, high: f64) -> Self {
        Self { low, mid, high }
    }

    /// An estimate without spread.
    pub const fn exactly(value: f64) -> Self {
        Self::new(value, value, value)
    }

    /// Sum of two estimates whose errors may have the same sign: bounds add.
    pub fn plus(self, other: Self) -> Self {
        Self::new(self.low + other.low, self.mid + other.mid, self.high + other.high)
    }

    /// True if its values are finite, in order and more than 0, as those of a mass must be.
    pub fn is_positive(self) -> bool {
        Range::new(self.low, self.high).is_positive() && (self.low..=self.high).contains(&self.mid)
    }

    /// The estimate times a positive factor.
    pub fn scaled(self, factor: f64) -> Self {
        Self::new(self.low * factor, self.mid * factor, self.high * factor)
    }
}

/// One of the three values of an [`Estimate`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reading {
    Low,
    Mid,
    High,
}

impl Reading {
    /// That value of `estimate`.
    pub fn of(self, estimate: Estimate) -> f64 {
        match self {
            Self::Low => estimate.low,
            Self::Mid => estimate.mid,
            Self::High => estimate.high,
        }
    }

    /// The value at the other end.
    pub fn opposite(self) -> Self {
        match self {
            Self::Low => Self::High,
            Self::Mid => Self::Mid,
            Self::High => Self::Low,
        }
    }
}

impl From<Range> for Estimate {
    fn from(range: Range) -> Self {
        Self::new(range.low, range.mid(), range.high)
    }
}

/// The durometer a Shore hardness was read on (ASTM D2240). The scales are not comparable as numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub enum ShoreScale {
    A,
    D,
}

/// Shore hardness: a range on one of the two scales, each 0 to 100.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ShoreHardness {
    pub scale: ShoreScale,
    pub range: Range,
}

/// The length of a scene unit in metres, and the source of this number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct MetricScale {
    #[cfg_attr(test, schemars(extend("exclusiveMinimum" = 0)))]
    pub meters_per_unit: f64,
    pub source: ScaleSource,
    /// Where the scale comes from, in words.
    #[serde(default)]
    pub provenance: String,
    /// The 90 % interval of `meters_per_unit`; that from a side of the object's box is estimated from the splat alone.
    /// Missing if the scale is taken to be exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "Range"))]
    pub range: Option<Range>,
}

/// Where a metric scale came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ScaleSource {
    /// The user says that the scene is in metres.
    Metric,
    /// The data set's convention.
    DataSet,
    /// The format of a mesh, which has a fixed unit.
    Format,
    /// The user gave the factor.
    Factor,
    /// The user knows the distance between two points.
    KnownLength,
    /// The user knows a side of the object's bounding box.
    BoundingBox,
    /// The user knows the distance between two cameras.
    Cameras,
    /// Photos show a printed marker of known size.
    Marker,
    /// The user knows what the object weighs.
    KnownMass,
    /// A model judged how long the object is.
    Estimated,
}
