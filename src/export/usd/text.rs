//! Values in USD's text format.

/// A string literal for any text: USD uses the same escapes as JSON.
pub fn quoted(text: &str) -> String {
    serde_json::to_string(text).expect("a string is JSON")
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

pub fn list(items: impl Iterator<Item = String>) -> String {
    format!("[{}]", items.collect::<Vec<_>>().join(", "))
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
