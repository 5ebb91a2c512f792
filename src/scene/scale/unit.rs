//! The unit of a mesh whose file states none, or states one that makes it absurdly large or small.

use super::{USUAL_SIDES_M, length};

/// Units of modelling programs, with their length in metres.
const UNITS: [(&str, f64); 5] = [("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("inches", 0.0254), ("feet", 0.3048)];

/// The units in which a side of this many units would be of a usual size, with that size and the option that says so;
/// without the one that has `except` metres.
fn usual(side: f64, except: Option<f64>) -> Vec<String> {
    let fits = |meters: f64| (USUAL_SIDES_M[0]..=USUAL_SIDES_M[1]).contains(&(side * meters));
    let others =
        UNITS.into_iter().filter(|(_, meters)| except.is_none_or(|except| (meters / except - 1.0).abs() > 1e-9));
    others
        .filter(|(_, meters)| fits(*meters))
        .map(|(unit, meters)| format!("in {unit} it would be {} (--scale {meters})", length(side * meters)))
        .collect()
}

/// Which other unit is likely where a longest side of this many units is absurd at `meters_per_unit`; `None` if no unit makes it
/// usual.
pub(in crate::scene) fn likely(side: f64, meters_per_unit: Option<f64>) -> Option<String> {
    let usual = usual(side, meters_per_unit);
    (!usual.is_empty()).then(|| format!("Its longest side is {side:.4} units: {}.", usual.join(", ")))
}

/// What is said of a mesh whose file states no unit.
pub(in crate::scene) fn unstated(side: f64) -> String {
    let of_units = likely(side, None).unwrap_or_else(|| format!("Its longest side is {side:.4} units."));
    format!(
        "the format states no unit, so masses and forces are unknown until --scale says how long a unit is, or --known-mass how \
         heavy the object is. {of_units}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn millimetres_read_as_metres_are_recognised() {
        let hint = likely(230.0, Some(1.0)).unwrap();
        assert!(hint.contains("in mm it would be 230.0 mm (--scale 0.001)"), "{hint}");
        assert!(!hint.contains("in m it"), "{hint}");
        assert_eq!(likely(1e9, Some(1.0)), None);
        assert!(unstated(0.12).contains("in m it would be 120.0 mm (--scale 1)"));
    }
}
