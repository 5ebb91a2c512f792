//! Numbers with units that suit them.

use crate::words::readable::significant;

pub fn length(meters: f64) -> String {
    match meters.abs() {
        m if m < 0.01 => format!("{} mm", significant(meters * 1e3)),
        m if m < 1.0 => format!("{} cm", significant(meters * 1e2)),
        _ => format!("{} m", significant(meters)),
    }
}

pub fn volume(m3: f64) -> String {
    match m3 {
        v if v < 1e-7 => format!("{} mm3", significant(m3 * 1e9)),
        v if v < 0.1 => format!("{} cm3", significant(m3 * 1e6)),
        _ => format!("{} m3", significant(m3)),
    }
}

pub fn mass(kg: f64) -> String {
    format!("{} kg", significant(kg))
}

/// A factor of 1 or more, whichever way round.
pub fn factor(ratio: f64) -> String {
    significant(ratio.max(1.0 / ratio))
}

/// Numbers with commas between them.
pub fn list(numbers: impl IntoIterator<Item = f64>) -> String {
    numbers.into_iter().map(significant).collect::<Vec<_>>().join(", ")
}
