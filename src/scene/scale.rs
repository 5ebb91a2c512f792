//! Metric scale: how many metres a scene unit is, by what the user knows or the data set states.

use std::fmt;
use std::str::FromStr;

use nalgebra::Point3;
use serde::{Serialize, Serializer};

use super::bounds::Bounds;
use super::{SceneError, View};
use crate::units::{MetricScale, ScaleSource};

/// `--scale`.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum ScaleChoice {
    /// As the data set states; unknown where it states nothing.
    #[default]
    Auto,
    /// The scene is in metres.
    Metric,
    /// Metres per scene unit.
    Factor(f64),
    /// Two points in scene units, and their distance in metres.
    KnownLength { from: [f64; 3], to: [f64; 3], meters: f64 },
    /// A side of the object's bounding box (0, 1, 2: along x, y, z) in metres.
    BoundingBox { axis: usize, meters: f64 },
    /// Two views, and the distance of their cameras in metres.
    Cameras { a: String, b: String, meters: f64 },
}

/// What the choices that measure something measure it on.
pub(super) struct Measured<'a> {
    pub object: Bounds,
    pub views: &'a [View],
    /// Metres per scene unit by the data set's own convention.
    pub data_set: Option<MetricScale>,
}

impl ScaleChoice {
    /// The scale that this choice amounts to.
    pub(super) fn metric_scale(&self, scene: &Measured) -> Result<Option<MetricScale>, SceneError> {
        let refused = |problem: String| SceneError::Scale { given: self.to_string(), problem };
        let measured = |meters: &f64, units: f64, source, provenance: String| {
            if !(units > 0.0 && (meters / units).is_normal()) {
                return Err(refused("the length measured in the scene is zero".to_owned()));
            }
            let provenance = format!("{provenance}: {meters} m for {units:.6} scene units");
            Ok(Some(MetricScale { meters_per_unit: meters / units, source, provenance }))
        };
        match self {
            Self::Auto => Ok(scene.data_set.clone()),
            Self::Metric => {
                let provenance = "the scene is in metres, as given".to_owned();
                Ok(Some(MetricScale { meters_per_unit: 1.0, source: ScaleSource::Metric, provenance }))
            }
            Self::Factor(meters_per_unit) => {
                let provenance = format!("{meters_per_unit} m per scene unit, as given");
                let source = ScaleSource::Factor;
                Ok(Some(MetricScale { meters_per_unit: *meters_per_unit, source, provenance }))
            }
            Self::KnownLength { from, to, meters } => {
                let units = (Point3::from(*from) - Point3::from(*to)).norm();
                measured(meters, units, ScaleSource::KnownLength, "distance of two points".to_owned())
            }
            Self::BoundingBox { axis, meters } => {
                let provenance = format!("{} side of the object's box", AXES[*axis]);
                measured(meters, scene.object.size()[*axis], ScaleSource::BoundingBox, provenance)
            }
            Self::Cameras { a, b, meters } => {
                let center = |name: &String| {
                    let view = scene.views.iter().find(|view| view.name == *name);
                    view.map(|view| view.camera.center_in_world())
                        .ok_or_else(|| refused(format!("no view is named `{name}`")))
                };
                let units = (center(a)? - center(b)?).norm();
                measured(meters, units, ScaleSource::Cameras, format!("distance of the cameras of {a} and {b}"))
            }
        }
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// How `--scale` is written, for messages.
const FORMS: &str = "auto, metric, metres per scene unit, known-length:X,Y,Z:X,Y,Z=M, bbox:AXIS=M or cameras:A,B=M";

impl FromStr for ScaleChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let length = |text: &str| text.trim().parse().ok().filter(|m| f64::is_normal(*m) && *m > 0.0);
        let text = text.trim();
        let parsed = match text.split_once([':', ' ']) {
            None if text == "auto" => Some(Self::Auto),
            None if text == "metric" => Some(Self::Metric),
            None => length(text).map(Self::Factor),
            Some((kind, rest)) => rest.rsplit_once('=').zip(Some(kind)).and_then(|((what, meters), kind)| {
                let meters = length(meters)?;
                match kind {
                    "known-length" => {
                        let (from, to) = what.split_once(':')?;
                        Some(Self::KnownLength { from: point(from)?, to: point(to)?, meters })
                    }
                    "bbox" => {
                        let axis = AXES.iter().position(|axis| *axis == what.trim())?;
                        Some(Self::BoundingBox { axis, meters })
                    }
                    "cameras" => {
                        let (a, b) = what.split_once(',')?;
                        Some(Self::Cameras { a: a.trim().to_owned(), b: b.trim().to_owned(), meters })
                    }
                    _ => None,
                }
            }),
        };
        parsed.ok_or_else(|| format!("not one of {FORMS}, with lengths in metres above zero"))
    }
}

/// Three finite numbers with commas between.
pub(super) fn point(text: &str) -> Option<[f64; 3]> {
    let numbers: Vec<f64> = text.split(',').map(|number| number.trim().parse().ok()).collect::<Option<_>>()?;
    let point: [f64; 3] = numbers.try_into().ok()?;
    point.iter().all(|value| value.is_finite()).then_some(point)
}

impl fmt::Display for ScaleChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Metric => f.write_str("metric"),
            Self::Factor(factor) => write!(f, "{factor}"),
            Self::KnownLength { from: [a, b, c], to: [x, y, z], meters } => {
                write!(f, "known-length:{a},{b},{c}:{x},{y},{z}={meters}")
            }
            Self::BoundingBox { axis, meters } => write!(f, "bbox:{}={meters}", AXES[*axis]),
            Self::Cameras { a, b, meters } => write!(f, "cameras:{a},{b}={meters}"),
        }
    }
}

/// Written as it is typed.
impl Serialize for ScaleChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
