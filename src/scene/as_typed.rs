//! Options that are written as they are typed.

use std::str::FromStr;

use serde::{Deserialize, Deserializer, de};

/// Reads an option that is written as it is typed.
pub(super) fn as_typed<'de, T: FromStr<Err = String>, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
}
