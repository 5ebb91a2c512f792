//! The cost of queries: a price table, and an estimate before anything is sent.

use serde::{Deserialize, Serialize};

use crate::query::recorded::Usage;
use crate::words::output::counted;

/// Characters per token of English; prose has 4, but names of materials take more tokens.
const CHARACTERS_PER_TOKEN: f64 = 3.5;
/// For a vision model about which nothing is known: one token per square of this many pixels per side (as for
/// Qwen2-VL).
const UNKNOWN_PATCH: u32 = 28;
const TOKENS_PER_MTOK: f64 = 1e6;
/// The share of the usual price that OpenAI charges for a request through the Batch API (its Batch API guide).
const BATCH_API_SHARE: f64 = 0.5;

/// Prices by model.
#[derive(Debug, Clone, PartialEq)]
pub struct PriceTable {
    prices: Vec<Price>,
}

/// The price of a model in US dollars per million tokens, and how it counts a picture.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Price {
    pub model: String,
    #[serde(deserialize_with = "usd_per_mtok")]
    pub input_usd_per_mtok: f64,
    #[serde(deserialize_with = "usd_per_mtok")]
    pub output_usd_per_mtok: f64,
    #[serde(deserialize_with = "image_tokens")]
    pub image_tokens: ImageTokens,
    /// When the price was read, as YYYY-MM-DD.
    pub as_of: String,
    pub source: String,
}

/// A price in US dollars per million tokens, as an option gives it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct UsdPerMtok {
    pub input: f64,
    pub output: f64,
}

/// How many tokens a picture takes, as OpenAI's guide to images describes it for its models.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ImageTokens {
    /// `base`, plus `tile` for each 512-pixel tile after the picture is shrunk to fit 2048 x 2048 and then to a short
    /// side of 768. Written `tiles BASE TILE`.
    Tiles { base: u64, tile: u64 },
    /// `factor` for each square of `side` pixels per side, of which there are at most `most`. Written `patches SIDE
    /// MOST FACTOR`.
    Patches { side: u32, most: u64, factor: f64 },
}

/// An amount in dollars, or a note that the price is unknown.
pub(in crate::query) fn dollars(usd: Option<f64>) -> String {
    usd.map_or_else(
        || "an unknown price (give it with --price IN,OUT in USD per million tokens)".to_owned(),
        |usd| format!("{usd:.4} USD"),
    )
}

/// A price table that cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("the price table cannot be read: {0}; its columns are those of prompts/prices.csv")]
pub struct PriceError(#[from] csv::Error);

/// The estimated cost of a number of requests.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Cost {
    pub requests: usize,
    pub input_tokens: u64,
    /// If the answers are of the usual length.
    pub output_tokens: u64,
    /// If the answers are as long as allowed.
    pub most_output_tokens: u64,
    /// `None` if the price table does not have the model, or if there are no requests.
    pub usd: Option<f64>,
    pub most_usd: Option<f64>,
}

impl PriceTable {
    /// The built-in table.
    pub fn builtin() -> Self {
        Self::from_csv(include_str!("../../../prompts/prices.csv")).expect("a test reads the built-in table")
    }

    /// A table from CSV text.
    pub fn from_csv(text: &str) -> Result<Self, PriceError> {
        let prices = csv::Reader::from_reader(text.as_bytes()).into_deserialize().collect::<Result<_, _>>()?;
        Ok(Self { prices })
    }

    /// The price of a model, also under a dated name (`gpt-4o-2024-08-06`) or a provider's (`openai/gpt-4o`).
    pub fn price(&self, model: &str) -> Option<&Price> {
        let name = model.rsplit('/').next().unwrap_or(model);
        self.prices.iter().find(|price| price.model == model).or_else(|| {
            self.prices.iter().find(|price| {
                name.strip_prefix(&price.model).is_some_and(|rest| {
                    rest.is_empty() || (rest.starts_with('-') && rest.chars().all(|c| c == '-' || c.is_ascii_digit()))
                })
            })
        })
    }
}

impl UsdPerMtok {
    /// One number for both, or two with a comma between them.
    pub(in crate::query) fn parse(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse().ok().filter(|usd: &f64| usd.is_finite() && *usd >= 0.0);
        let (input, output) = text.split_once(',').unwrap_or((text, text));
        let price = number(input).zip(number(output)).map(|(input, output)| Self { input, output });
        price.ok_or_else(|| "not a price; give US dollars per million tokens, such as 0 or 0.30,2.50".to_owned())
    }
}

impl Price {
    /// The price of a model of which nothing else is known.
    pub fn new(model: &str, UsdPerMtok { input, output }: UsdPerMtok) -> Self {
        Self {
            model: model.to_owned(),
            input_usd_per_mtok: input,
            output_usd_per_mtok: output,
            image_tokens: ImageTokens::UNKNOWN,
            as_of: String::new(),
            source: String::new(),
        }
    }

    /// The price of this usage in US dollars.
    pub fn usd(&self, usage: Usage) -> f64 {
        (usage.input_tokens as f64 * self.input_usd_per_mtok + usage.output_tokens as f64 * self.output_usd_per_mtok)
            / TOKENS_PER_MTOK
    }
}

impl ImageTokens {
    const UNKNOWN: Self = Self::Patches { side: UNKNOWN_PATCH, most: u64::MAX, factor: 1.0 };

    /// Tokens of a picture of this size in pixels.
    pub fn count(self, (width, height): (u32, u32)) -> u64 {
        match self {
            Self::Tiles { base, tile } => {
                let (width, height) = (f64::from(width), f64::from(height));
                let into_square = (2048.0 / width.max(height)).min(1.0);
                let short_side = (768.0 / (width.min(height) * into_square)).min(1.0);
                let tiles = |side: f64| (side * into_square * short_side / 512.0).ceil() as u64;
                base + tile * tiles(width) * tiles(height)
            }
            Self::Patches { side, most, factor } => {
                let patches = u64::from(width.div_ceil(side)) * u64::from(height.div_ceil(side));
                (patches.min(most) as f64 * factor).ceil() as u64
            }
        }
    }
}

impl Cost {
    /// The cost of one request with these texts and a sheet of this size in pixels, whose answer usually has `usual_tokens`
    /// and at most `max_tokens`.
    pub fn of_request(
        texts: &[&str],
        sheet: (u32, u32),
        usual_tokens: u64,
        max_tokens: u32,
        price: Option<&Price>,
    ) -> Self {
        let characters: usize = texts.iter().map(|text| text.chars().count()).sum();
        let text = (characters as f64 / CHARACTERS_PER_TOKEN).ceil() as u64;
        let image = price.map_or(ImageTokens::UNKNOWN, |price| price.image_tokens).count(sheet);
        let most_output_tokens = u64::from(max_tokens);
        let output_tokens = usual_tokens.min(most_output_tokens);
        let input_tokens = text + image;
        let usd = |output_tokens| price.map(|price| price.usd(Usage { input_tokens, output_tokens }));
        Self {
            requests: 1,
            input_tokens,
            output_tokens,
            most_output_tokens,
            usd: usd(output_tokens),
            most_usd: usd(most_output_tokens),
        }
    }

    /// The same cost through the Batch API.
    pub fn by_batch_api(self) -> Self {
        let share = |usd: Option<f64>| usd.map(|usd| usd * BATCH_API_SHARE);
        Self { usd: share(self.usd), most_usd: share(self.most_usd), ..self }
    }

    /// The sum of both.
    pub fn plus(self, other: Self) -> Self {
        match (self.requests, other.requests) {
            (0, _) => return other,
            (_, 0) => return self,
            _ => {}
        }
        let sum = |a: Option<f64>, b: Option<f64>| Some(a? + b?);
        Self {
            requests: self.requests + other.requests,
            input_tokens: self.input_tokens + other.input_tokens,
            output_tokens: self.output_tokens + other.output_tokens,
            most_output_tokens: self.most_output_tokens + other.most_output_tokens,
            usd: sum(self.usd, other.usd),
            most_usd: sum(self.most_usd, other.most_usd),
        }
    }
}

impl std::fmt::Display for Cost {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { requests, input_tokens, output_tokens, .. } = self;
        if *requests == 0 {
            return f.write_str("nothing");
        }
        let requests = counted(*requests, "request");
        write!(f, "{requests}, about {input_tokens} tokens in and {output_tokens} out, {}", dollars(self.usd))
    }
}

/// Refuses a price that cannot be compared with a budget, such as NaN.
fn usd_per_mtok<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    let usd = f64::deserialize(deserializer)?;
    if usd.is_finite() && usd >= 0.0 {
        return Ok(usd);
    }
    Err(serde::de::Error::custom(format!("{usd} is not a price: give a number of US dollars, 0 or more")))
}

fn image_tokens<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<ImageTokens, D::Error> {
    let text = String::deserialize(deserializer)?;
    let words: Vec<&str> = text.split_whitespace().collect();
    let parsed = match words[..] {
        [] => Some(ImageTokens::UNKNOWN),
        ["tiles", base, tile] => {
            base.parse().ok().zip(tile.parse().ok()).map(|(base, tile)| ImageTokens::Tiles { base, tile })
        }
        ["patches", side, most, factor] => side
            .parse()
            .ok()
            .filter(|side| *side > 0)
            .zip(most.parse().ok())
            .zip(factor.parse().ok().filter(|factor: &f64| factor.is_finite() && *factor >= 0.0))
            .map(|((side, most), factor)| ImageTokens::Patches { side, most, factor }),
        _ => None,
    };
    parsed.ok_or_else(|| {
        serde::de::Error::custom(format!(
            "{text:?} is neither empty nor `tiles BASE TILE` nor `patches SIDE MOST FACTOR`"
        ))
    })
}
