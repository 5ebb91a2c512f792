//! What only the user can say of an asset: whose it is, how it may be used, and what kind of thing it is.

use serde::Serialize;
use serde_json::Value;

/// Wikidata's item "physical object": gprop does not know what kind of thing it measured.
const PHYSICAL_OBJECT: &str = "Q223557";

/// Options of the metadata.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, clap::Args)]
pub struct Credits {
    /// Licence of the asset, for the metadata of USD, glTF and asset.json: CC-BY-4.0, for example.
    #[arg(long, value_name = "TEXT", value_parser = clap::builder::NonEmptyStringValueParser::new())]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub license: Option<String>,
    /// Author of the asset, likewise.
    #[arg(long, value_name = "TEXT", value_parser = clap::builder::NonEmptyStringValueParser::new())]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub author: Option<String>,
    /// Wikidata's item for this kind of thing, likewise: Q25294 is a hammer.
    #[arg(long, value_name = "ITEM", value_parser = item)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wikidata: Option<String>,
    /// Semantic label of the whole object in USD [default: prop]
    #[arg(long, value_name = "WORD", value_parser = clap::builder::NonEmptyStringValueParser::new())]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub semantic_label: Option<String>,
}

impl Credits {
    /// The asset's licence, or where to look for it.
    pub fn license(&self) -> &str {
        self.license.as_deref().unwrap_or("that of the splat")
    }

    pub fn author(&self) -> &str {
        self.author.as_deref().unwrap_or(concat!("gprop ", env!("CARGO_PKG_VERSION")))
    }

    pub fn wikidata(&self) -> &str {
        self.wikidata.as_deref().unwrap_or(PHYSICAL_OBJECT)
    }

    pub fn semantic_label(&self) -> &str {
        self.semantic_label.as_deref().unwrap_or("prop")
    }

    /// What was said, as JSON; `None` if nothing was.
    pub fn said(&self) -> Option<Value> {
        (*self != Self::default()).then(|| serde_json::to_value(self).expect("texts are plain data"))
    }
}

fn item(text: &str) -> Result<String, String> {
    let digits = text.strip_prefix('Q').unwrap_or_default();
    let is_item =
        (1..=12).contains(&digits.len()) && !digits.starts_with('0') && digits.bytes().all(|b| b.is_ascii_digit());
    if is_item { Ok(text.to_owned()) } else { Err("an item is Q and a number, such as Q25294".to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::item;

    #[test]
    fn an_item_is_q_and_a_number() {
        assert_eq!(item("Q25294").as_deref(), Ok("Q25294"));
        assert!(["", "Q", "25294", "q1", "Q0", "Q1 ", "Q1\"", "Q1234567890123"].iter().all(|text| item(text).is_err()));
    }
}
