//! Metric scale: the length of a scene unit in metres, from what the user knows, what the data set states, or
//! what a model estimates.
//!
//! Masses grow with its cube, so a typing error gives an absurd weight: the resulting size of the object is checked
//! against what can be photographed and what can be moved.

pub(super) mod marker;
pub(super) mod unit;

use std::fmt;
use std::str::FromStr;

use nalgebra::Point3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{MOST_ERROR, Scene, SceneError, View};
use crate::config::as_typed::as_typed;
use crate::config::option_values::with_unit;
use crate::gaussians::Gaussians;
use crate::gaussians::bounds::sides;
use crate::units::{MetricScale, Range, ScaleSource};
use marker::{FoundMarker, Marker};

/// Lengths range from a nanometre to a thousand kilometres: no length in a capture is shorter or longer.
const SHORTEST_M: f64 = 1e-9;
const LONGEST_M: f64 = 1e6;

/// `--scale`.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum ScaleChoice {
    /// As the data set states; unknown if it states nothing.
    #[default]
    Auto,
    /// The scene is in metres.
    Metric,
    /// Metres per scene unit.
    Factor(f64),
    /// Two points in scene units, and their distance in metres.
    KnownLength { from: [f64; 3], to: [f64; 3], meters: f64 },
    /// A side of the object's bounding box (0, 1, 2: along x, y, z) in metres. The scale has an interval, because it is uncertain
    /// which Gaussians at the ends are strays; with fewer than 200 Gaussians, none counts as one. The interval is estimated
    /// from the cloud alone, and is taken for one of 90 %: of the twelve sides of the four fixtures, it holds the true scale
    /// for nine, and misses that of the others by at most half a percent.
    BoundingBox { axis: usize, meters: f64 },
    /// Two views, and the distance between their cameras in metres.
    Cameras { a: String, b: String, meters: f64 },
    /// A printed marker in the photos, and the side of its black square in metres.
    Marker { marker: Marker, meters: f64 },
    /// A model is asked how long the object is.
    Estimate,
}

/// The data that the choices based on a measurement use.
pub(super) struct Measured<'a> {
    pub object: &'a Gaussians,
    /// Height of the surface on which the object stands, if it was cut out of what surrounds it.
    pub floor: Option<f64>,
    pub views: &'a [View],
    /// Metric scale by the data set's own convention.
    pub data_set: Option<MetricScale>,
}

/// The smallest length in metres that an object's longest side may have. A photo shows it over about a thousand pixels:
/// if it were below a millimetre, each pixel would be about the wavelength of light or finer, which no lens resolves.
const LEAST_SIDE_M: f64 = 1e-3;
/// The greatest such length. The questions that gprop answers (a mass, a fall, a grasp) are about things that move as
/// one piece, and none is longer: the longest ship measured 458 m.
const MOST_SIDE_M: f64 = 500.0;
/// Objects that are usually weighed and gripped are within this range; other sizes cause a warning.
const USUAL_SIDES_M: [f64; 2] = [0.01, 5.0];

impl ScaleChoice {
    /// Computes the scale of this choice; also returns a warning if the object's size would be unusual.
    ///
    /// # Errors
    /// [`SceneError::Scale`] if a length cannot be measured, or the object would have an impossible size.
    pub(super) fn metric_scale(&self, scene: &Measured) -> Result<(Option<MetricScale>, Option<String>), SceneError> {
        let Some(scale) = self.stated(scene)? else { return Ok((None, None)) };
        let warning = self.check_size(&scale, scene.object)?;
        Ok((Some(scale), warning))
    }

    /// Checks that the object has a possible size at this scale; returns a warning if it is unusual.
    fn check_size(&self, scale: &MetricScale, object: &Gaussians) -> Result<Option<String>, SceneError> {
        let [x, y, z] = sides(object, None).map(|side| side.length * scale.meters_per_unit);
        let longest = x.max(y).max(z);
        // An object that is a single point has no size to check.
        if longest == 0.0 {
            return Ok(None);
        }
        let size = format!("{} x {} x {}", length(x), length(y), length(z));
        if !(LEAST_SIDE_M..=MOST_SIDE_M).contains(&longest) {
            let problem = format!(
                "the object would be {size} ({}); its longest side must be {} to {}; give another --scale",
                scale.provenance,
                length(LEAST_SIDE_M),
                length(MOST_SIDE_M)
            );
            return Err(SceneError::Scale { given: self.to_string(), problem });
        }
        let is_usual = (USUAL_SIDES_M[0]..=USUAL_SIDES_M[1]).contains(&longest);
        let warning = format!("--scale {self} makes the object {size} ({}): is that its size?", scale.provenance);
        Ok((!is_usual).then_some(warning))
    }

    /// Whether the photos have to be searched for the scale.
    pub fn is_in_photos(&self) -> bool {
        matches!(self, Self::Marker { .. })
    }

    /// False for the choice that costs a question and is no more than a guess: only the user may make it, not a scene.
    pub fn may_be_of_scene(text: &str) -> bool {
        text.parse() != Ok(Self::Estimate)
    }

    fn stated(&self, scene: &Measured) -> Result<Option<MetricScale>, SceneError> {
        let refused = |problem: String| SceneError::Scale { given: self.to_string(), problem };
        let measured = |length: MeasuredLength, source, provenance: String| {
            let too_short =
                "the length measured in the scene is zero or too short to give a scale; measure a longer one";
            length.scale(source, &provenance).map(Some).ok_or_else(|| refused(too_short.to_owned()))
        };
        match self {
            Self::Auto => Ok(scene.data_set.clone()),
            Self::Marker { .. } | Self::Estimate => Ok(None),
            Self::Metric => {
                let provenance = "the scene is in metres, as given".to_owned();
                Ok(Some(MetricScale { meters_per_unit: 1.0, source: ScaleSource::Metric, provenance, range: None }))
            }
            Self::Factor(meters_per_unit) => {
                let provenance = format!("{meters_per_unit} m per scene unit, as given");
                let source = ScaleSource::Factor;
                Ok(Some(MetricScale { meters_per_unit: *meters_per_unit, source, provenance, range: None }))
            }
            Self::KnownLength { from, to, meters } => {
                let units = (Point3::from(*from) - Point3::from(*to)).norm();
                let length = MeasuredLength { meters: *meters, units, error: 0.0 };
                measured(length, ScaleSource::KnownLength, "distance between two points".to_owned())
            }
            Self::BoundingBox { axis, meters } => {
                let provenance = format!("{} side of the object's box", AXES[*axis]);
                let side = sides(scene.object, scene.floor)[*axis];
                if side.error > MOST_ERROR * side.length {
                    return Err(refused(format!(
                        "the {provenance} is too uncertain: without a few Gaussians at its ends, which may be strays, it would \
                         be {:.0} % shorter; measure a longer side",
                        100.0 * side.error / side.length
                    )));
                }
                let length = MeasuredLength { meters: *meters, units: side.length, error: side.error };
                measured(length, ScaleSource::BoundingBox, provenance)
            }
            Self::Cameras { a, b, meters } => {
                let center = |name: &str| {
                    let index = crate::scene::photos::view_names::index_of(scene.views, name);
                    index
                        .map(|index| scene.views[index].camera.center_in_world())
                        .map_err(|unknown| refused(unknown.to_string()))
                };
                let units = (center(a)? - center(b)?).norm();
                let provenance = format!("distance between the cameras of {a} and {b}");
                let length = MeasuredLength { meters: *meters, units, error: 0.0 };
                measured(length, ScaleSource::Cameras, provenance)
            }
        }
    }
}

/// A length that is known in metres and measured in the scene.
struct MeasuredLength {
    meters: f64,
    units: f64,
    /// How far off `units` may be.
    error: f64,
}

impl MeasuredLength {
    /// The scale that follows from it; `None` if it is too short.
    fn scale(&self, source: ScaleSource, what: &str) -> Option<MetricScale> {
        let Self { meters, units, error } = *self;
        let least = units - error;
        if !(least > 0.0 && (meters / least).is_normal()) {
            return None;
        }
        let mut provenance = format!("{what}: {meters} m for {units:.6} scene units");
        if error > 0.0 {
            provenance += &format!(", within {:.2} %", 100.0 * error / units);
        }
        let range = (error > 0.0).then(|| Range::new(meters / (units + error), meters / least));
        Some(MetricScale { meters_per_unit: meters / units, source, provenance, range })
    }
}

impl Scene {
    /// The scale, with warnings, if `choice` says that the photos show a marker: all of them are searched.
    ///
    /// # Errors
    /// [`SceneError::Scale`] if the photos do not show it, or the object would have an impossible size; an error if a photo
    /// cannot be decoded.
    pub fn scale_in_photos(&self, choice: &ScaleChoice) -> Result<Option<(MetricScale, Vec<String>)>, SceneError> {
        let ScaleChoice::Marker { marker, meters } = choice else { return Ok(None) };
        let FoundMarker { scale, warning } = marker::find(*marker, *meters, &self.views)?;
        let unusual = choice.check_size(&scale, &self.gaussians)?;
        Ok(Some((scale, warning.into_iter().chain(unusual).collect())))
    }

    /// The scale if the object's longest side is within `longest_side_m`, which a model judged; with a warning if the object
    /// would have an unusual size. `taken_for` is what the model takes it for.
    ///
    /// # Errors
    /// [`SceneError::Scale`] if the object has no extent or would have an impossible size.
    pub fn estimated_scale(
        &self,
        taken_for: &str,
        longest_side_m: Range,
    ) -> Result<(MetricScale, Option<String>), SceneError> {
        let choice = ScaleChoice::Estimate;
        let units = self.longest_side();
        let range = Range::new(longest_side_m.low / units, longest_side_m.high / units);
        if !(range.low.is_normal() && range.high.is_normal()) {
            let problem = "the object has no extent, so its length says nothing about the scale".to_owned();
            return Err(SceneError::Scale { given: choice.to_string(), problem });
        }
        let scale = MetricScale {
            meters_per_unit: range.geometric_mid(),
            source: ScaleSource::Estimated,
            provenance: format!(
                "estimated: a model takes the object, {units:.6} scene units long, for {taken_for:?}, {} to {} long",
                length(longest_side_m.low),
                length(longest_side_m.high)
            ),
            range: Some(range),
        };
        let warning = choice.check_size(&scale, &self.gaussians)?;
        Ok((scale, warning))
    }
}

/// A length in metres in a readable unit.
fn length(meters: f64) -> String {
    match meters {
        ..1e-6 | 1e6.. => format!("{meters:.1e} m"),
        ..1e-3 => format!("{:.1} um", meters * 1e6),
        ..1.0 => format!("{:.1} mm", meters * 1e3),
        ..1e3 => format!("{meters:.2} m"),
        _ => format!("{:.1} km", meters / 1e3),
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// The forms of `--scale`, for messages.
const FORMS: &str = "auto, metric, metres per scene unit, known-length:X,Y,Z:X,Y,Z=M, bbox:AXIS=M, cameras:A,B=M, \
                     apriltag:FAMILY,ID=M, aruco:DICT,ID=M or estimate";

/// The units in which a length can be given, the longest name first, and how many of them make a metre.
const UNITS: [(&str, f64); 3] = [("mm", 1e3), ("cm", 1e2), ("m", 1.0)];

/// A length in metres, or with its unit: `0.3`, `30cm`.
pub(super) fn length_m(text: &str) -> Option<f64> {
    with_unit(text, &UNITS).filter(|meters| (SHORTEST_M..=LONGEST_M).contains(meters))
}

impl FromStr for ScaleChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let text = text.trim();
        let parsed = match text.split_once([':', ' ']) {
            None if text == "auto" => Some(Self::Auto),
            None if text == "metric" => Some(Self::Metric),
            None if text == "estimate" => Some(Self::Estimate),
            // Metres per scene unit, not a length.
            None => length_m(text).filter(|_| !text.ends_with('m')).map(Self::Factor),
            Some((kind, _)) if Marker::is_kind(kind) => Some(text.parse::<SizedMarker>()?.into()),
            Some((kind, rest)) => rest.rsplit_once('=').zip(Some(kind)).and_then(|((what, meters), kind)| {
                let meters = length_m(meters)?;
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
        parsed.ok_or_else(|| match text.strip_prefix("bbox:").and_then(|rest| rest.split_once('=')) {
            Some((axis, _)) if !AXES.contains(&axis.trim()) => "AXIS in bbox:AXIS=M is x, y or z".to_owned(),
            _ => format!("not one of {FORMS}, with lengths in metres from {SHORTEST_M} to {LONGEST_M}, or with mm, cm or m after them")
        })
    }
}

/// A marker and the side of its black square in metres: `apriltag:36h11,0=0.08`, `aruco:4x4_50,7=80mm`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizedMarker {
    pub marker: Marker,
    pub meters: f64,
}

impl FromStr for SizedMarker {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (marker, side) = text.trim().rsplit_once('=').ok_or("the side of the black square is missing: MARKER=M")?;
        let meters = length_m(side).ok_or_else(|| {
            format!("{side:?} is not a length: metres from {SHORTEST_M} to {LONGEST_M}, or with mm, cm or m after it")
        })?;
        Ok(Self { marker: marker.parse()?, meters })
    }
}

impl fmt::Display for SizedMarker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.marker, self.meters)
    }
}

impl From<SizedMarker> for ScaleChoice {
    fn from(SizedMarker { marker, meters }: SizedMarker) -> Self {
        Self::Marker { marker, meters }
    }
}

/// Three finite numbers separated by commas.
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
            Self::Estimate => f.write_str("estimate"),
            Self::Factor(factor) => write!(f, "{factor}"),
            Self::KnownLength { from: [a, b, c], to: [x, y, z], meters } => {
                write!(f, "known-length:{a},{b},{c}:{x},{y},{z}={meters}")
            }
            Self::BoundingBox { axis, meters } => write!(f, "bbox:{}={meters}", AXES[*axis]),
            Self::Cameras { a, b, meters } => write!(f, "cameras:{a},{b}={meters}"),
            Self::Marker { marker, meters } => SizedMarker { marker: *marker, meters: *meters }.fmt(f),
        }
    }
}

/// Serialized in the form that users type.
impl Serialize for ScaleChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for ScaleChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        as_typed(deserializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_side_that_only_strays_make_long_gives_no_scale() {
        const COUNT: usize = 1000;
        // A rod along x. Along z, four Gaussians at either end are far away: more than count as strays for the length, and
        // fewer than for its error.
        let place = |i: usize| {
            let z = match i {
                0..4 => -10.0,
                4..8 => 10.0,
                _ => 0.0,
            };
            [i as f32 / COUNT as f32, 0.0, z]
        };
        let object = Gaussians {
            positions: (0..COUNT).map(place).collect(),
            log_scales: vec![[-5.0; 3]; COUNT],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; COUNT],
            opacity_logits: vec![3.0; COUNT],
            ..Gaussians::default()
        };
        let scene = Measured { object: &object, floor: None, views: &[], data_set: None };
        let scale = |text: &str| text.parse::<ScaleChoice>().unwrap().metric_scale(&scene);
        let message = scale("bbox:z=0.1").unwrap_err().to_string();
        for words in ["--scale bbox:z=0.1", "z side of the object's box is too uncertain", "measure a longer side"] {
            assert!(message.contains(words), "no {words:?} in: {message}");
        }
        assert!(scale("bbox:x=0.1").unwrap().0.unwrap().range.is_some());
    }
}
