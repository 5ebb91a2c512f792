//! `--up` as the user types it.

use std::fmt;
use std::str::FromStr;

use nalgebra::Vector3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::config::as_typed::as_typed;
use crate::scene::scale::point;

/// The axes by name.
const AXES: [(&str, [f64; 3]); 6] = [
    ("x", [1.0, 0.0, 0.0]),
    ("-x", [-1.0, 0.0, 0.0]),
    ("y", [0.0, 1.0, 0.0]),
    ("-y", [0.0, -1.0, 0.0]),
    ("z", [0.0, 0.0, 1.0]),
    ("-z", [0.0, 0.0, -1.0]),
];

/// `--up`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum UpChoice {
    /// Found in the scene.
    #[default]
    Auto,
    /// This unit vector in the input's frame.
    Along([f64; 3]),
}

/// The name of the axis that this is; `None` if it is none.
pub(super) fn axis_name(direction: &[f64; 3]) -> Option<&'static str> {
    AXES.into_iter().find(|(_, axis)| axis == direction).map(|(name, _)| name)
}

impl FromStr for UpChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        if let Some((_, axis)) = AXES.into_iter().find(|(name, _)| *name == text) {
            return Ok(Self::Along(axis));
        }
        let unit = point(text).and_then(|given| Vector3::from(given).try_normalize(f64::MIN_POSITIVE));
        unit.filter(|unit| unit.iter().all(|side| side.is_finite()))
            .map(|unit| Self::Along(unit.into()))
            .ok_or_else(|| "not `auto`, x, -x, y, -y, z, -z, or a direction X,Y,Z other than 0,0,0".to_owned())
    }
}

impl fmt::Display for UpChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Along(direction) => match axis_name(direction) {
                Some(name) => f.write_str(name),
                None => write!(f, "{},{},{}", direction[0], direction[1], direction[2]),
            },
        }
    }
}

/// Serialized in the form that users type.
impl Serialize for UpChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for UpChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        as_typed(deserializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_typed_is_shown_again() {
        for text in ["auto", "x", "-x", "y", "-y", "z", "-z", "0,0.6,-0.8"] {
            assert_eq!(text.parse::<UpChoice>().unwrap().to_string(), text);
        }
        assert_eq!("0,0,-2".parse::<UpChoice>().unwrap().to_string(), "-z");
        for nonsense in ["", "w", "0,0,0", "1,2", "1,2,NaN", "1,inf,0", "up"] {
            assert!(nonsense.parse::<UpChoice>().is_err(), "{nonsense}");
        }
    }
}
