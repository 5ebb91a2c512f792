//! Mass: that there is one, and that something of this size can weigh so much.

use std::sync::LazyLock;

use super::super::measure::Mass;
use super::{Finding, Kind, Subject, words};
use crate::materials::MaterialLibrary;
use crate::scene::mesh::containers::{Format, Geometry, Mobility, Shape};

/// Below this density only foams, fibres, honeycombs and fluff remain in the library. The lightest of the household objects
/// with published masses that gprop's tolerances are fitted on, an empty pitcher with its lid on, has 70 kg/m3 by its scan; a
/// mug of 16 g with 320 cm3, which a public benchmark has, 50 kg/m3. A twentieth on top is for the volume of coarse meshes.
pub const LIGHT_KG_M3: f64 = 50.0 * 1.05;
/// The density of lead. What is heavier is tantalum, gold, tungsten or platinum.
pub const HEAVY_KG_M3: f64 = 11_360.0;
/// How many materials are named.
const NAMED: usize = 3;

/// What has a mass and a density.
struct Stuff {
    name: &'static str,
    low: f64,
    high: f64,
}

/// Materials and fillings of the built-in library.
static STUFF: LazyLock<Vec<Stuff>> = LazyLock::new(|| {
    let library = MaterialLibrary::builtin();
    let materials = library.materials().iter().map(|material| (&material.name, material.density_kg_m3));
    let fillings = library.fillings().iter().map(|filling| (&filling.name, filling.density_kg_m3));
    materials.chain(fillings).map(|(name, density)| Stuff { name, low: density.low, high: density.high }).collect()
});

/// A mass that is missing, zero, or that a reader would make up.
pub fn missing(subject: &Subject) -> Option<Finding> {
    const REMEDY: &str = "state the mass: weigh it, or look it up";
    let body = subject.body;
    let is_part_of_moving = body.mobility != Mobility::Static;
    let collides = body.shapes.iter().any(|shape| shape.role.collides());
    // What is only seen and fixed to its parent is a decoration of the parent.
    let is_decoration = !collides && body.mobility == Mobility::Fixed;
    let problem = match subject.mass {
        Mass::Missing if body.inertial.is_some() => "it has inertial properties without a mass".to_owned(),
        Mass::Missing if body.shapes.is_empty() || is_decoration || !is_part_of_moving => return None,
        Mass::Missing => "it has shapes and no mass".to_owned(),
        Mass::Stated(mass) | Mass::OfShapes(mass) if mass < 0.0 => {
            format!("its mass is negative ({})", words::mass(mass))
        }
        Mass::Stated(0.0) if body.shapes.is_empty() || is_decoration || !is_part_of_moving => return None,
        Mass::Stated(0.0) if subject.container.format == Format::Gltf => {
            "its mass is 0, which stands for one without end".to_owned()
        }
        Mass::Stated(0.0) => {
            "its mass is 0, by which PyBullet fixes it to the world, and which other simulators refuse or replace"
                .to_owned()
        }
        Mass::OfShapes(0.0) if body.mobility == Mobility::Moves => "its shapes have no mass, and it moves".to_owned(),
        Mass::ByDefault(mass) if is_part_of_moving => format!(
            "neither mass nor density is stated, and {} the density of water, which makes about {}",
            if subject.container.format == Format::Mjcf { "MuJoCo takes" } else { "engines take" },
            words::mass(mass)
        ),
        Mass::Unknown | Mass::Stated(_) | Mass::OfShapes(_) | Mass::ByDefault(_) => return None,
    };
    Some(subject.finding(Kind::MassMissing, subject.mass_place(), problem, REMEDY))
}

/// A mass over volume that nothing has. The light end is judged by the least volume that the shapes can have, the heavy end
/// by their hull, since what a shell holds is not modelled.
pub fn density(subject: &Subject) -> Option<Finding> {
    let (Mass::Stated(mass) | Mass::OfShapes(mass)) = subject.mass else { return None };
    let best = subject.size.best()?;
    let [least, mid, _] = best.volume_m3?;
    let has = |holds: fn(&Shape) -> bool| subject.body.shapes.iter().any(holds);
    let is_endless = has(|shape| shape.geometry == Geometry::Plane);
    // What neither moves nor collides is there to be looked at.
    let is_picture = subject.body.mobility == Mobility::Static && !has(|shape| shape.role.collides());
    if mass <= 0.0 || is_endless || is_picture || !best.are_closed {
        return None;
    }
    let hull = subject.size.hull.as_ref().map_or(mid, |hull| hull.volume.max(mid));
    let (volume, judgement) = match () {
        () if mass / least < LIGHT_KG_M3 => (mid, light(mass / mid)),
        () if mass / hull > HEAVY_KG_M3 => (hull, heavy(mass / hull)),
        () => return None,
    };
    let density = crate::words::readable::significant(mass / volume);
    let problem = format!("{} for {} is {density} kg/m3: {judgement}", words::mass(mass), words::volume(volume));
    Some(subject.finding(Kind::Density, subject.mass_place(), problem, "weigh it, or mend the size of its shapes"))
}

fn light(density: f64) -> String {
    let lightest = STUFF.iter().min_by(|a, b| a.low.total_cmp(&b.low));
    match lightest {
        Some(lightest) if density < lightest.low => format!(
            "lighter than foam and than everything in the library (the lightest, {}, has {} kg/m3)",
            lightest.name, lightest.low
        ),
        _ => format!("as light as foam; it would have to be made of {}", made_of(density)),
    }
}

fn heavy(density: f64) -> String {
    let heaviest = STUFF.iter().max_by(|a, b| a.high.total_cmp(&b.high));
    match heaviest {
        Some(heaviest) if density > heaviest.high => format!(
            "heavier than everything in the library (the heaviest, {}, has {} kg/m3)",
            heaviest.name, heaviest.high
        ),
        _ => format!("heavier than lead; it would have to be made of {}", made_of(density)),
    }
}

/// The materials and fillings whose density is nearest.
fn made_of(density: f64) -> String {
    let distance = |stuff: &&Stuff| ((stuff.low * stuff.high).sqrt() / density).ln().abs();
    let holds = |stuff: &&Stuff| (stuff.low..=stuff.high).contains(&density);
    let mut nearest: Vec<&Stuff> = STUFF.iter().filter(holds).collect();
    if nearest.is_empty() {
        nearest = STUFF.iter().collect();
    }
    nearest.sort_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.name.cmp(b.name)));
    let names: Vec<&str> = nearest.iter().take(NAMED).map(|stuff| stuff.name).collect();
    names.join(" or ")
}
