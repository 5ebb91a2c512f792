//! Numbers and names in readable form.

pub use crate::pictures::short;
use crate::units::Estimate;

/// Three significant digits, without an exponent if the number is of everyday size.
pub fn significant(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return "unbounded".to_owned();
    }
    let exponent = value.abs().log10().floor() as i32;
    match exponent {
        3..=6 => format!("{}{}", if value < 0.0 { "-" } else { "" }, thousands(value.round().abs() as u64)),
        -4..=2 => {
            let text = format!("{value:.*}", (2 - exponent).max(0) as usize);
            if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
        }
        _ => format!("{value:.2e}"),
    }
}

/// `low to high` times a factor; one number if both look the same.
pub fn interval(estimate: Estimate, factor: f64) -> String {
    let (low, high) = (significant(estimate.low * factor), significant(estimate.high * factor));
    if low == high { low } else { format!("{low} to {high}") }
}

/// Groups of three digits with commas between them.
pub fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_are_enough() {
        let cases = [(0.0, "0"), (0.6014, "0.601"), (12.0, "12"), (2.0 / 3.0, "0.667"), (28736.0, "28,736")];
        for (value, text) in cases {
            assert_eq!(significant(value), text);
        }
        assert_eq!(significant(-1234.0), "-1,234");
        assert_eq!(significant(2.05e11), "2.05e11");
    }
}
