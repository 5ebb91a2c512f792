//! Options that are serialized in the form that users type.

use std::str::FromStr;

use serde::{Deserialize, Deserializer, de};

/// Reads an option that is serialized in the form that users type.
pub(crate) fn as_typed<'de, T: FromStr<Err = String>, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
}
