//! Checks properties against each other: what physics and measured tables allow together.

use super::Findings;
use crate::materials::{Law, Material, MaterialLibrary};
use crate::numeric::median;
use crate::units::{ShoreHardness, ShoreScale};

pub fn check(library: &MaterialLibrary, findings: &mut Findings) {
    for material in library.materials() {
        bulk_modulus(material, findings);
        strength_to_stiffness(material, findings);
        shore_hardness(material, findings);
        wood(material, findings);
        bar_speed(material, findings);
        dilatational_speed(material, findings);
        law(material, findings);
    }
    bending(library, findings);
}

/// Above diamond's, in Pa.
const STIFFEST_BULK: f64 = 5e11;

/// Bulk moduli of solid rubbers, in Pa; nu = 1/2 - E/6K.
const RUBBER_BULK: [f64; 2] = [0.5e9, 6e9];

/// If nu is capped, it does not determine K.
const POISSON_CAP: f64 = 0.4998;

fn bulk_modulus(material: &Material, findings: &mut Findings) {
    let nu = material.poisson_ratio.high;
    let bulk = material.youngs_modulus_pa.geometric_mid() / (3.0 * (1.0 - 2.0 * nu));
    findings.require(bulk <= STIFFEST_BULK, &material.name, "bulk_modulus", || {
        format!("E and nu give a bulk modulus of {bulk:.2e} Pa; at most {STIFFEST_BULK:e} is possible")
    });
    if material.family == "rubber" {
        let [softest, stiffest] = RUBBER_BULK;
        findings.require(
            (bulk >= softest || nu >= POISSON_CAP) && bulk <= stiffest,
            &material.name,
            "bulk_modulus",
            || format!("E and the upper nu give a bulk modulus of {bulk:.2e} Pa; solid rubbers have 0.5 to 6 GPa"),
        );
    }
}

/// Strength over E, 1st to 99th percentile of the source tables; `None` if large strain makes it meaningless.
fn strength_band(material: &Material) -> Option<[f64; 2]> {
    match material.family.as_str() {
        "metal" => Some([0.0002, 0.011]),
        "wood" => Some([0.004, 0.014]),
        "thermoplastic" => Some([0.004, 0.09]),
        "thermoset_composite" => Some([0.001, 0.09]),
        "glass" if material.name.ends_with("fibre") => Some([1.5e-4, 0.06]),
        "glass" | "ceramic" | "concrete" => Some([1.5e-4, 0.015]),
        "stone" => Some([2.5e-4, 0.035]),
        "foam" => Some([0.002, 1.0]),
        _ => None,
    }
}

fn strength_to_stiffness(material: &Material, findings: &mut Findings) {
    // Rubbery members of a plastic family stretch like rubber; loose grains have no tensile stiffness.
    let rubbery = material.hardness.is_some_and(|hardness| hardness.scale == ShoreScale::A)
        && material.family.starts_with("thermo");
    let loose = matches!(material.law, Law::DruckerPrager { .. });
    let Some([low, high]) = strength_band(material).filter(|_| !rubbery && !loose) else { return };
    let ratio = material.strength_pa.geometric_mid() / material.youngs_modulus_pa.geometric_mid();
    findings.require((low..=high).contains(&ratio), &material.name, "strength_to_stiffness", || {
        format!("strength/E is {ratio:.2e}; {} has {low:e} to {high:e}", material.family)
    });
}

/// Young's modulus in Pa of an elastomer of Shore A hardness, 10 to 95 (Gent 1958).
pub fn gent_modulus_pa(shore_a: f64) -> f64 {
    0.0981 * (56.0 + 7.62336 * shore_a) / (0.137505 * (254.0 - 2.54 * shore_a)) * 1e6
}

/// Young's modulus in Pa after Qi, Joyce and Boyce (2003), whose formula has a logarithm to base 10; Shore D counts as
/// A + 50.
pub fn qi_modulus_pa(hardness: ShoreScale, reading: f64) -> f64 {
    let shore = match hardness {
        ShoreScale::A => reading,
        ShoreScale::D => reading + 50.0,
    };
    10f64.powf(0.0235 * shore - 0.6403) * 1e6
}

fn shore_hardness(material: &Material, findings: &mut Findings) {
    let Some(ShoreHardness { scale, range }) = material.hardness else { return };
    let youngs = material.youngs_modulus_pa.geometric_mid();
    let filled = material.name.contains("filled") || material.name == "lcp";
    let (model, expected, band) = match (material.family.as_str(), scale) {
        ("rubber" | "thermoplastic" | "thermoset_composite", ShoreScale::A) if range.mid() >= 10.0 => {
            ("Gent", gent_modulus_pa(range.mid()), [-0.6, 0.7])
        }
        ("rubber", ShoreScale::D) => ("Qi-Joyce-Boyce", qi_modulus_pa(scale, range.mid()), [-0.6, 1.4]),
        ("thermoplastic", ShoreScale::D) if !filled => {
            ("Qi-Joyce-Boyce", qi_modulus_pa(scale, range.mid()), [0.5, 1.4])
        }
        ("thermoplastic" | "thermoset_composite", ShoreScale::D) => {
            ("Qi-Joyce-Boyce", qi_modulus_pa(scale, range.mid()), [0.5, 2.6])
        }
        _ => return,
    };
    let decades = (youngs / expected).log10();
    findings.require((band[0]..=band[1]).contains(&decades), &material.name, "shore_to_stiffness", || {
        format!("E is 10^{decades:.2} times what {model} gives; expected 10^{} to 10^{}", band[0], band[1])
    });
}

/// Density of the cell wall, the ceiling of any wood, in kg/m3 (Wood Handbook, chapter 4).
const CELL_WALL: f64 = 1500.0;

/// E over density along the grain, in m2/s2: 1st to 99th percentile of 456 species, widened to bamboo.
const WOOD_SPECIFIC_STIFFNESS: [f64; 2] = [7.5e6, 30e6];

fn wood(material: &Material, findings: &mut Findings) {
    if material.family != "wood" {
        return;
    }
    findings.require(material.density_kg_m3.high <= CELL_WALL, &material.name, "wood", || {
        format!("denser than its cell wall, {CELL_WALL} kg/m3")
    });
    let [low, high] = WOOD_SPECIFIC_STIFFNESS;
    let specific = material.youngs_modulus_pa.geometric_mid() / material.density_kg_m3.mid();
    findings.require((low..=high).contains(&specific), &material.name, "wood", || {
        format!("E/density is {specific:.2e} m2/s2; along the grain it is {low:e} to {high:e}")
    });
}

/// The plausible speeds of a wave in a thin bar, sqrt(E/density), in m/s.
///
/// Stiff foams exceed the 300 m/s to which soft ones are held: ASTM D6817 requires 2.5 MPa of polystyrene of 14.4 kg/m3,
/// which gives 417 m/s.
fn bar_speed_band(material: &Material) -> [f64; 2] {
    let soft = material.youngs_modulus_pa.geometric_mid() < 1e6;
    match material.family.as_str() {
        "metal" => [1000.0, 5600.0],
        "glass" => [4000.0, 6000.0],
        "wood" => [2700.0, 6000.0],
        "thermoplastic" => [300.0, 2500.0],
        "rubber" => [10.0, 120.0],
        "foam" if soft => [5.0, 300.0],
        "foam" => [30.0, 3500.0],
        _ => [0.2, 18000.0],
    }
}

fn bar_speed(material: &Material, findings: &mut Findings) {
    let rubbery = material.hardness.is_some_and(|hardness| hardness.scale == ShoreScale::A);
    if material.family == "thermoplastic" && rubbery {
        return;
    }
    let speed = (material.youngs_modulus_pa.geometric_mid() / material.density_kg_m3.mid()).sqrt();
    let [low, high] = bar_speed_band(material);
    findings.require((low..=high).contains(&speed), &material.name, "bar_speed", || {
        format!("waves run at {speed:.0} m/s in a bar; {} has {low} to {high}", material.family)
    });
}

/// The wave speed that limits the time step of an explicit simulation, sqrt(E (1 - nu) / ((1 + nu)(1 - 2 nu) density)),
/// in m/s: none may be faster than diamond's.
fn dilatational_speed(material: &Material, findings: &mut Findings) {
    let nu = material.poisson_ratio.mid();
    let lateral = (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu));
    let speed = (material.youngs_modulus_pa.geometric_mid() * lateral / material.density_kg_m3.mid()).sqrt();
    findings.require((0.2..=18500.0).contains(&speed), &material.name, "dilatational_speed", || {
        format!("pressure waves run at {speed:.1} m/s; 0.2 to 18500 is possible")
    });
}

/// The smallest yield strain at which von Mises softening still describes dough rather than metal.
const PLASTICINE_YIELD_STRAIN: f64 = 0.005;

fn law(material: &Material, findings: &mut Findings) {
    let strength = material.strength_pa;
    let within = |stress: f64| stress >= strength.low && stress <= 1.75 * strength.high;
    let (holds, wanted) = match material.law {
        Law::Elastic | Law::Fluid => (true, ""),
        Law::VonMises { yield_stress_pa } => (within(yield_stress_pa), "a yield stress within the strength"),
        Law::DruckerPrager { friction_angle_rad, cohesion_pa } => (
            (15.0..=50.0).contains(&friction_angle_rad.to_degrees()) && cohesion_pa <= strength.high,
            "a friction angle of 15 to 50 degrees and a cohesion within the strength",
        ),
        Law::Foam { yield_stress_pa, viscosity_pa_s } => {
            (within(yield_stress_pa) && viscosity_pa_s > 0.0, "a yield stress within the plateau and a viscosity")
        }
        Law::Snow { theta_c, theta_s, hardening } => (
            theta_s < theta_c && (1e-3..=7.5e-2).contains(&theta_c) && (5.0..=15.0).contains(&hardening),
            "theta_s below theta_c (Stomakhin et al.: 7.5e-3 and 2.5e-2) and a hardening of 5 to 15",
        ),
        Law::Plasticine { yield_stress_pa, softening } => (
            within(yield_stress_pa)
                && yield_stress_pa / material.youngs_modulus_pa.geometric_mid() >= PLASTICINE_YIELD_STRAIN
                && softening > 0.0,
            "a yield stress within the strength (times sqrt(3) for a cohesion) and at least 0.5% of E",
        ),
    };
    findings.require(holds, &material.name, "law", || format!("the law needs {wanted}: {:?}", material.law));
}

/// How far a strip of a family's median member bends before it fails: curvature times thickness, 2 strength / E.
///
/// Brittle solids bend least, then metals, plastics, soft sheets, rubber. Paper is left out: it fails by creasing,
/// which 2 strength / E does not describe.
fn bending(library: &MaterialLibrary, findings: &mut Findings) {
    let order: [&[&str]; 5] =
        [&["glass", "ceramic"], &["metal"], &["thermoplastic"], &["leather", "fabric"], &["rubber"]];
    let curvature = |families: &[&str]| {
        let members = library.materials().iter().filter(|material| families.contains(&material.family.as_str()));
        let least_strength = |material: &Material| material.strength_pa.low / material.youngs_modulus_pa.high;
        median(members.map(|material| 2.0 * least_strength(material)).collect()).unwrap_or_default()
    };
    for pair in order.windows(2) {
        let (stiffer, softer) = (curvature(pair[0]), curvature(pair[1]));
        findings.require(stiffer < softer, "library", "bending", || {
            format!("{:?} bend by {stiffer:.2e}, {:?} by {softer:.2e}: the order is wrong", pair[0], pair[1])
        });
    }
    let rubber = curvature(order[4]);
    findings.require(rubber > 0.5, "library", "bending", || {
        format!("rubber bends by only {rubber:.2}; expected more than 0.5")
    });
}
