//! `--object` as the user types it.

use std::fmt;
use std::num::NonZeroU32;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::config::as_typed::as_typed;

/// What the name of an object begins with; its number follows.
const PREFIX: &str = "object_";
/// Far more objects than stand on any table.
const MOST: u32 = 9999;

/// `--object`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ObjectChoice {
    /// `gprop run` takes all objects if several stand on the support, and other commands ask for one. Otherwise, the object is what the
    /// masks show, the only one, or else the densest cluster.
    #[default]
    Auto,
    /// The object with this number.
    One(ObjectNumber),
    /// Each object that stands on the support, one after the other.
    All,
}

/// The number of an object that stands on the support, from 1, as `gprop objects` lists it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct ObjectNumber(NonZeroU32);

impl ObjectNumber {
    /// The numbers of `count` objects.
    pub fn first(count: usize) -> impl Iterator<Item = Self> {
        (1..=u32::try_from(count).unwrap_or(u32::MAX)).filter_map(NonZeroU32::new).map(Self)
    }

    /// From 1.
    pub fn get(self) -> u32 {
        self.0.get()
    }
}

/// Its name, which is also that of its work folder: `object_2`.
impl fmt::Display for ObjectNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{PREFIX}{}", self.0)
    }
}

impl FromStr for ObjectNumber {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let number = text.strip_prefix(PREFIX).unwrap_or(text);
        let number = number.parse().ok().filter(|number: &NonZeroU32| number.get() <= MOST);
        number.map(Self).ok_or_else(|| NUMBERS.to_owned())
    }
}

/// What names an object.
const NUMBERS: &str = "an object's number or name as `gprop objects SCENE` lists them, such as 2 or object_2";

impl FromStr for ObjectChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "auto" => Ok(Self::Auto),
            "all" => Ok(Self::All),
            _ => text.parse().map(Self::One).map_err(|number: String| format!("not `auto`, `all`, or {number}")),
        }
    }
}

impl fmt::Display for ObjectChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::All => f.write_str("all"),
            Self::One(number) => number.fmt(f),
        }
    }
}

/// Serialized in the form that users type.
impl Serialize for ObjectChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for ObjectChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        as_typed(deserializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_typed_is_shown_again() {
        for text in ["auto", "all", "object_1", "object_9999"] {
            assert_eq!(text.parse::<ObjectChoice>().unwrap().to_string(), text);
        }
        assert_eq!("12".parse::<ObjectChoice>().unwrap().to_string(), "object_12");
        for nonsense in ["", "0", "object_0", "object_", "-1", "10000", "mug", "object_1.5"] {
            assert!(nonsense.parse::<ObjectChoice>().is_err(), "{nonsense}");
        }
    }
}
