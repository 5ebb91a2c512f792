//! The largest curvature kappa_max that a part tolerates, by the family of its material.
//!
//! The paper takes 0.5 1/m for everything. gprop takes that for families whose walls dent or buckle long before the
//! material fails, and changes it in proportion to the strain at which a family fails (strength over Young's modulus,
//! the median over the library), relative to metals, in two cases:
//! - brittle families break before a metal wall would bend for good. Stone and concrete break in tension, at a tenth of
//!   the compressive strength that the library gives;
//! - families that spring back from a bend (rubber, foam, fabric, leather) tolerate more.

/// The paper's kappa_max, in 1/m.
pub const PAPER_1_M: f64 = 0.5;

/// Families whose kappa_max is not the paper's, in 1/m.
const BY_FAMILY: [(&str, f64); 8] = [
    ("glass", 0.19),
    ("ceramic", 0.22),
    ("stone", 0.058),
    ("concrete", 0.038),
    ("foam", 8.6),
    ("fabric", 39.0),
    ("leather", 57.0),
    ("rubber", 600.0),
];

/// kappa_max of a family, in 1/m.
pub fn of_family(family: &str) -> f64 {
    BY_FAMILY.iter().find(|(name, _)| *name == family).map_or(PAPER_1_M, |(_, curvature)| *curvature)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::MaterialLibrary;

    /// Median of strength over Young's modulus.
    fn strain_at_failure(family: &str) -> f64 {
        let materials = MaterialLibrary::builtin().of_family(family);
        let mut strains: Vec<f64> = materials.map(|m| m.strength_pa.mid() / m.youngs_modulus_pa.mid()).collect();
        strains.sort_by(f64::total_cmp);
        strains[strains.len() / 2]
    }

    #[test]
    fn the_table_follows_its_rule() {
        for (family, curvature) in BY_FAMILY {
            let tension = if ["stone", "concrete"].contains(&family) { 0.1 } else { 1.0 };
            let by_rule = PAPER_1_M * tension * strain_at_failure(family) / strain_at_failure("metal");
            // Two digits, and room for corrections of single materials.
            assert!((curvature / by_rule - 1.0).abs() < 0.05, "{family}: {curvature} is not {by_rule}");
        }
        assert_eq!((of_family("metal"), of_family("wood")), (PAPER_1_M, PAPER_1_M));
    }
}
