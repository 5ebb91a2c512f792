//! Prints the mass of each part of a scene's object: `cargo run --release --example masses SCENE`.
//!
//! Does what `gprop parts SCENE` does, and reuses what that or an earlier run left in SCENE/gprop.

use std::error::Error;

use gprop::Pipeline;
use gprop::units::Estimate;

fn main() -> Result<(), Box<dyn Error>> {
    let scene = std::env::args_os().nth(1).ok_or("usage: masses SCENE")?;
    let parts = Pipeline::open(scene)?.parts()?;
    println!("{:>8} {:>8} {:>8}  {:<26} part", "kg", "from", "to", "material");
    for part in &parts.parts {
        row(&part.caption, &part.material, part.mass_kg);
    }
    row("the object", "", Some(parts.object.mass_kg));
    Ok(())
}

/// One line of the table; a part without a volume has no mass.
fn row(name: &str, material: &str, mass_kg: Option<Estimate>) {
    let number = |of: fn(&Estimate) -> f64| mass_kg.map_or("-".to_owned(), |mass| format!("{:.4}", of(&mass)));
    let (mid, low, high) = (number(|m| m.mid), number(|m| m.low), number(|m| m.high));
    println!("{mid:>8} {low:>8} {high:>8}  {material:<26} {name}");
}
