//! Checks foams, composites and fabrics against their constituents in `constituents.csv`.

use super::Findings;
use crate::materials::bibliography::{Constituent, Relation};
use crate::materials::{Material, MaterialLibrary};

pub fn check(library: &MaterialLibrary, findings: &mut Findings) {
    for constituent in &library.constituents {
        let known = library.references.iter().any(|reference| reference.id == constituent.source);
        findings.require(known, &constituent.material, "source", || {
            format!("its constituent cites `{}`, which bibliography.csv does not have", constituent.source)
        });
        let Some(material) = library.materials().iter().find(|material| material.name == constituent.material) else {
            let message =
                format!("constituents.csv describes {:?}, which the library does not have", constituent.material);
            findings.error(&constituent.material, "constituent", message);
            continue;
        };
        match constituent.relation {
            Relation::CellWall => foam(material, constituent, findings),
            Relation::Fibre => fabric(material, constituent, findings),
            Relation::Reinforcement => composite(library, material, constituent, findings),
            Relation::Matrix => {}
        }
    }
    let described = |material: &Material| library.constituents.iter().any(|one| one.material == material.name);
    for material in library.materials().iter().filter(|one| matches!(one.family.as_str(), "foam" | "fabric")) {
        findings.require(described(material), &material.name, "constituent", || {
            "constituents.csv does not say what it is made of".to_owned()
        });
    }
}

/// Real foams scatter about the scaling laws by this factor (Gibson and Ashby 1997, figures 5.7 and 5.9).
const FOAM_SCATTER: f64 = 5.0;

/// Open cells: E = Es r^2; faces of closed cells add at most Es r; r is the relative density. The plateau is 0.05 Es
/// r^2 if cells buckle and 0.3 sigma_s r^1.5 if they yield; the smaller one comes first.
fn foam(material: &Material, wall: &Constituent, findings: &mut Findings) {
    let relative = material.density_kg_m3.mid() / wall.density_kg_m3;
    findings.require(relative < 1.0, &material.name, "foam_scaling", || {
        format!("as dense as solid {} or denser", wall.name)
    });
    let open = wall.youngs_modulus_pa * relative.powi(2);
    let most = (FOAM_SCATTER * open).max(wall.youngs_modulus_pa * relative);
    let youngs = material.youngs_modulus_pa.geometric_mid();
    findings.require(youngs >= open / FOAM_SCATTER && youngs <= most, &material.name, "foam_scaling", || {
        format!("E {youngs:.2e} Pa; cells of {} allow {:.2e} to {most:.2e}", wall.name, open / FOAM_SCATTER)
    });
    let Some(wall_strength) = wall.strength_pa else { return };
    let buckling = 0.05 * open;
    let yielding = 0.3 * wall_strength * relative.powf(1.5);
    let [least, most] = [buckling.min(yielding) / FOAM_SCATTER, buckling.max(yielding) * FOAM_SCATTER];
    let plateau = material.strength_pa.geometric_mid();
    findings.require((least..=most).contains(&plateau), &material.name, "foam_scaling", || {
        format!("plateau {plateau:.2e} Pa; cells of {} allow {least:.2e} to {most:.2e}", wall.name)
    });
}

/// Largest fraction of a cloth's volume that fibres fill: hexagonally packed yarns of packed fibres, 0.907^2, minus the
/// crimp.
const FIBRE_PACKING: f64 = 0.75;

fn fabric(material: &Material, fibre: &Constituent, findings: &mut Findings) {
    let densest = FIBRE_PACKING * fibre.density_kg_m3;
    findings.require(material.density_kg_m3.high <= densest, &material.name, "fabric", || {
        format!(
            "its density is up to {} kg/m3; {} cloth has at most {densest:.0}",
            material.density_kg_m3.high, fibre.name
        )
    });
    findings.require(material.youngs_modulus_pa.high < fibre.youngs_modulus_pa, &material.name, "fabric", || {
        format!("as stiff as its fibre, {} with {:.2e} Pa", fibre.name, fibre.youngs_modulus_pa)
    });
}

/// Tolerance for the rounding in tables.
const BOUND_SLACK: f64 = 1.1;

/// E lies between Reuss (phases in series) and Voigt (in parallel) of fibre and matrix.
fn composite(library: &MaterialLibrary, material: &Material, fibre: &Constituent, findings: &mut Findings) {
    let matrix =
        library.constituents.iter().find(|one| one.material == fibre.material && one.relation == Relation::Matrix);
    let Some(matrix) = matrix else {
        findings.error(
            &material.name,
            "constituent",
            "constituents.csv has its reinforcement but no matrix".to_owned(),
        );
        return;
    };
    let share = fibre.volume_fraction;
    let (stiff, soft) = (fibre.youngs_modulus_pa, matrix.youngs_modulus_pa);
    let reuss = 1.0 / (share.low / stiff + (1.0 - share.low) / soft) / BOUND_SLACK;
    let voigt = (share.high * stiff + (1.0 - share.high) * soft) * BOUND_SLACK;
    let youngs = material.youngs_modulus_pa;
    findings.require(youngs.low >= reuss && youngs.high <= voigt, &material.name, "composite_bounds", || {
        format!("E {:.2e} to {:.2e} Pa is not within Reuss {reuss:.2e} and Voigt {voigt:.2e}", youngs.low, youngs.high)
    });
    let mixed = |share: f64| share * fibre.density_kg_m3 + (1.0 - share) * matrix.density_kg_m3;
    // The reinforcement may be lighter than the matrix, as hollow glass spheres are.
    let ends = [mixed(share.low), mixed(share.high)];
    let (light, heavy) = (ends[0].min(ends[1]) / BOUND_SLACK, ends[0].max(ends[1]) * BOUND_SLACK);
    let density = material.density_kg_m3;
    findings.require(density.low >= light && density.high <= heavy, &material.name, "composite_bounds", || {
        format!("density {} to {} is not within the mixture's {light:.0} to {heavy:.0}", density.low, density.high)
    });
}
