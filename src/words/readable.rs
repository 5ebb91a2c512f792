//! Numbers and names in readable form.

use crate::words::output::thousands;
use serde::Serialize;

use crate::units::Estimate;

/// Three significant digits, without an exponent if the number is of everyday size.
pub fn significant(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return "unbounded".to_owned();
    }
    // The place of the first digit after rounding: 999.6 is 1,000.
    let place = leading_place(value);
    let exponent = if (value.abs() / 10f64.powi(place - 2)).round() < 1000.0 { place } else { place + 1 };
    match exponent {
        3..=6 => {
            let unit = 10f64.powi(exponent - 2);
            format!("{}{}", if value < 0.0 { "-" } else { "" }, thousands(((value.abs() / unit).round() * unit) as u64))
        }
        -4..=2 => {
            let text = format!("{value:.*}", (2 - exponent).max(0) as usize);
            if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
        }
        _ => format!("{value:.2e}"),
    }
}

/// A number of bytes with its decimal unit.
pub fn bytes(count: u64) -> String {
    let (factor, unit) = match count {
        0..1000 => (1.0, "B"),
        1000..1_000_000 => (1e3, "kB"),
        1_000_000..1_000_000_000 => (1e6, "MB"),
        _ => (1e9, "GB"),
    };
    format!("{} {unit}", significant(count as f64 / factor))
}

/// An estimate as text, with the digits that its interval allows.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Figures {
    pub mid: String,
    /// `low to high`; `mid` if there is no spread.
    pub interval: String,
}

/// An estimate times `factor`, with the digits that its interval allows.
pub fn figures(estimate: Estimate, factor: f64) -> Figures {
    let [low, mid, high] = rounded([estimate.low, estimate.mid, estimate.high].map(|value| value * factor));
    Figures { mid, interval: joined(low, &high) }
}

/// A mass of `mass_kg`, with the digits that its interval allows: in grams if it is below a kilogram, else in kilograms.
/// The unit stands after `mid`.
pub fn mass(mass_kg: Estimate) -> Figures {
    let (factor, unit) = if mass_kg.mid < 1.0 { (1e3, "g") } else { (1.0, "kg") };
    let Figures { mid, interval } = figures(mass_kg, factor);
    Figures { mid: format!("{mid} {unit}"), interval }
}

/// `low to high` times a factor, with the digits that the interval allows; one number if both look the same.
pub fn interval(estimate: Estimate, factor: f64) -> String {
    let [low, high] = rounded([estimate.low, estimate.high].map(|value| value * factor));
    joined(low, &high)
}

fn joined(low: String, high: &str) -> String {
    if low == high { low } else { format!("{low} to {high}") }
}

/// Numbers in ascending order, all rounded to the last decimal place that the distance between the first and the last
/// allows. Zeros at the end of all of them are left out.
///
/// The place is that of the Particle Data Group (*Review of Particle Physics*, introduction, "Rounding"): half the
/// interval has two digits if they are at most 35, else one. A number much smaller than the interval keeps one digit,
/// and none has more than four.
fn rounded<const N: usize>(values: [f64; N]) -> [String; N] {
    /// Half the interval, as a multiple of its leading power of ten, has two digits if it is at most this.
    const TWO_DIGITS_UP_TO: f64 = 3.54;
    const MOST_DIGITS: i32 = 4;
    let half = 0.5 * (values[N - 1] - values[0]);
    let largest = values.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let is_everyday = (1e-4..1e7).contains(&largest);
    if !(half.is_finite() && half > 0.0 && is_everyday) {
        return values.map(significant);
    }
    let power = leading_place(half);
    let place = if half / 10f64.powi(power) <= TWO_DIGITS_UP_TO { power - 1 } else { power };
    let mut place = place.max(leading_place(largest) + 1 - MOST_DIGITS);
    let units = |value: f64, place: i32| (value / 10f64.powi(place)).round();
    while place < 0 && values.iter().all(|&value| units(value, place) % 10.0 == 0.0) {
        place += 1;
    }
    values.map(|value| {
        let place = if value == 0.0 { place } else { place.min(leading_place(value)) };
        let number = units(value, place) * 10f64.powi(place);
        let text =
            if place < 0 { format!("{number:.*}", place.unsigned_abs() as usize) } else { format!("{number:.0}") };
        grouped(&text)
    })
}

/// The decimal place of a number's first digit: 2 for 345.
fn leading_place(value: f64) -> i32 {
    value.abs().log10().floor() as i32
}

/// A decimal number with commas between groups of three digits.
fn grouped(text: &str) -> String {
    let (sign, rest) = text.strip_prefix('-').map_or(("", text), |rest| ("-", rest));
    let (whole, fraction) = rest.split_at(rest.find('.').unwrap_or(rest.len()));
    whole.parse().map_or_else(|_| text.to_owned(), |whole| format!("{sign}{}{fraction}", thousands(whole)))
}

/// Bytes in lower-case hexadecimal.
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_are_enough() {
        let cases =
            [(0.0, "0"), (0.6014, "0.601"), (12.0, "12"), (2.0 / 3.0, "0.667"), (9996.0, "10,000"), (6152.6, "6,150")];
        for (value, text) in
            cases.into_iter().chain([(999.6, "1,000"), (9_996_000.0, "1.00e7"), (0.000099996, "0.0001")])
        {
            assert_eq!(significant(value), text);
        }
        assert_eq!(significant(-1234.0), "-1,230");
        assert_eq!(significant(2.05e11), "2.05e11");
    }

    #[test]
    fn a_kilogram_and_more_is_not_shown_in_grams() {
        let cases = [
            ([0.8, 0.9, 1.2], "900 g", "800 to 1,200"),
            ([0.9, 1.0, 1.1], "1.0 kg", "0.9 to 1.1"),
            ([480.0, 532.0, 590.0], "530 kg", "480 to 590"),
            ([2e5, 5.07e5, 9e5], "510,000 kg", "200,000 to 900,000"),
        ];
        for ([low, mid, high], expected, interval) in cases {
            let shown = mass(Estimate::new(low, mid, high));
            assert_eq!((&*shown.mid, &*shown.interval), (expected, interval));
        }
    }

    #[test]
    fn an_interval_says_how_many_digits_its_numbers_have() {
        let cases = [
            ([0.4567, 0.6243, 0.8012], "0.62", "0.46 to 0.80"),
            ([415.3, 540.0, 658.1], "540", "420 to 660"),
            ([98.7, 118.3, 140.2], "118", "99 to 140"),
            ([3394.0, 7475.0, 12309.0], "7,000", "3,000 to 12,000"),
            ([7800.0, 7850.0, 7900.0], "7,850", "7,800 to 7,900"),
            ([0.27, 0.285, 0.3], "0.285", "0.270 to 0.300"),
            ([0.5, 0.6, 0.8], "0.6", "0.5 to 0.8"),
            ([4.0, 50.0, 130.0], "50", "4 to 130"),
            ([0.0, 1.0, 2.0], "1", "0 to 2"),
            ([12.0, 12.0, 12.0], "12", "12"),
            ([1e10, 2e10, 4e10], "2.00e10", "1.00e10 to 4.00e10"),
        ];
        for ([low, mid, high], middle, ends) in cases {
            let expected = Figures { mid: middle.to_owned(), interval: ends.to_owned() };
            assert_eq!(figures(Estimate::new(low, mid, high), 1.0), expected);
        }
        assert_eq!(interval(Estimate::new(0.27, 0.285, 0.3), 1.0), "0.27 to 0.30");
        assert_eq!(interval(Estimate::new(0.001, f64::NAN, 0.25), 1e3), "1 to 250");
    }
}
