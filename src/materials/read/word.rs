//! Reads cells through serde, so that the words of a column are the names with which the type itself is written.

use serde::de::value::StrDeserializer;
use serde::de::{self, Deserialize, Deserializer, IntoDeserializer, Visitor};
use serde::forward_to_deserialize_any;
use thiserror::Error;

/// Why a cell is not a value of a type.
#[derive(Debug, Error)]
pub enum Mismatch {
    #[error("is not {}", alternatives(.0))]
    Word(&'static [&'static str]),
    #[error("lacks `{0}`")]
    Missing(&'static str),
    #[error("{0}")]
    Other(String),
}

impl de::Error for Mismatch {
    fn custom<T: std::fmt::Display>(problem: T) -> Self {
        Self::Other(problem.to_string())
    }

    fn unknown_variant(_: &str, expected: &'static [&'static str]) -> Self {
        Self::Word(expected)
    }

    fn missing_field(field: &'static str) -> Self {
        Self::Missing(field)
    }
}

/// The variant of `T` that `text` names.
pub fn variant<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, Mismatch> {
    T::deserialize(StrDeserializer::new(text))
}

/// `a, b or c`.
pub fn alternatives(words: &[&str]) -> String {
    match words {
        [others @ .., last] if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        _ => words.concat(),
    }
}

/// A cell, or a part of one.
pub enum Cell<'a> {
    Word(&'a str),
    Number(f64),
}

impl<'de> Deserializer<'de> for Cell<'_> {
    type Error = Mismatch;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mismatch> {
        match self {
            Self::Word(word) => visitor.visit_str(word),
            Self::Number(number) => visitor.visit_f64(number),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map struct enum identifier ignored_any
    }
}

impl IntoDeserializer<'_, Mismatch> for Cell<'_> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}
