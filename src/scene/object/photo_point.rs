//! `--object-at`: a point of a photo.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::config::as_typed::as_typed;
use crate::config::option_values::OptionError;

/// A pixel of a view's photo.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PhotoPoint {
    /// The view's name, or that of its photo's file, without extension.
    pub view: String,
    /// From the left and from the top; of the photo as it is shown, after any rotation by its EXIF orientation.
    pub pixel: [u32; 2],
}

const FORM: &str =
    "not VIEW:X,Y: the photo's file name without extension, and a pixel of it, from the left and from the top";

impl PhotoPoint {
    /// Checks what a caller of the library may have set.
    ///
    /// # Errors
    /// If there is no name.
    pub(in crate::scene) fn check(&self) -> Result<(), OptionError> {
        if self.view.is_empty() {
            return Err(OptionError { flag: "--object-at", value: self.to_string(), remedy: FORM.to_owned() });
        }
        Ok(())
    }
}

impl FromStr for PhotoPoint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        // A fraction, as a program may copy it, is a place within that pixel.
        let side = |text: &str| {
            let side: f64 = text.trim().parse().ok()?;
            (0.0..f64::from(u32::MAX)).contains(&side).then_some(side as u32)
        };
        let point = text.rsplit_once(':').filter(|(view, _)| !view.is_empty()).and_then(|(view, at)| {
            let (x, y) = at.split_once(',')?;
            Some(Self { view: view.to_owned(), pixel: [side(x)?, side(y)?] })
        });
        point.ok_or_else(|| FORM.to_owned())
    }
}

impl fmt::Display for PhotoPoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{},{}", self.view, self.pixel[0], self.pixel[1])
    }
}

/// Serialized in the form that users type.
impl Serialize for PhotoPoint {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for PhotoPoint {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        as_typed(deserializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_shown_as_it_is_typed() {
        let point: PhotoPoint = "a:b:310.7,220".parse().unwrap();
        assert_eq!((point.to_string().as_str(), point.pixel), ("a:b:310,220", [310, 220]));
        for nonsense in ["", "310,220", ":310,220", "a:310", "a:-1,3", "a:1,NaN", "a:1,2,3"] {
            assert!(nonsense.parse::<PhotoPoint>().is_err(), "{nonsense}");
        }
    }
}
