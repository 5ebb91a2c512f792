//! Values in USD's text format.

use crate::export::placement::{Axes, Placement};
use crate::files::json;
use crate::words::output::one_line;

/// A string literal of one line. Control characters are shown as escapes (the six characters `\u001b`), because USD does
/// not read JSON's escapes for them; quotation marks and backslashes are escaped as in JSON.
pub fn quoted(text: &str) -> String {
    json::compact(&one_line(text)).expect("a string is JSON")
}

/// USD stores these values in 32 bits; the text has the same precision.
pub fn triple([x, y, z]: [f64; 3]) -> String {
    format!("({}, {}, {})", x as f32, y as f32, z as f32)
}

/// A number with at most `digits` digits after the point, without trailing zeros.
pub fn rounded(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    let short = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

/// Several numbers as one value.
pub fn tuple(values: impl IntoIterator<Item = f64>, digits: usize) -> String {
    format!("({})", values.into_iter().map(|v| rounded(v, digits)).collect::<Vec<_>>().join(", "))
}

/// The head of a root layer with this default prim: metres, kilograms, z up, and the way back to the input's frame; `metadata`
/// are more lines of custom data.
pub fn head(name: &str, placement: &Placement, metadata: &str) -> String {
    format!(
        r#"#usda 1.0
(
    customLayerData = {{
        double[] input_from_asset = {input_from_asset}
{metadata}    }}
    defaultPrim = "{name}"
    kilogramsPerUnit = 1
    metersPerUnit = 1
    upAxis = "Z"
)
"#,
        input_from_asset = list(placement.input_from_asset(Axes::ZUp).into_iter().map(|n| n.to_string())),
    )
}

pub fn list(items: impl Iterator<Item = String>) -> String {
    let mut text = "[".to_owned();
    for (n, item) in items.enumerate() {
        text.push_str(if n > 0 { ", " } else { "" });
        text.push_str(&item);
    }
    text.push(']');
    text
}

/// The box around points.
pub fn extent(points: impl Iterator<Item = [f64; 3]>) -> String {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in points {
        for axis in 0..3 {
            (low[axis], high[axis]) = (low[axis].min(point[axis]), high[axis].max(point[axis]));
        }
    }
    format!("[{}, {}]", triple(low), triple(high))
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn a_literal_has_only_escapes_that_usd_reads() {
        assert_eq!(quoted("a \"lid\", 木"), r#""a \"lid\", 木""#);
        assert_eq!(quoted(r"C:\oak"), r#""C:\\oak""#);
        // The escapes are text, so their backslashes are escaped.
        assert_eq!(quoted("red\u{1b}[31m\nlid"), r#""red\\u001b[31m\\nlid""#);
    }
}
