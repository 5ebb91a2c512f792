//! Masses of the scenes from ground-truth part maps and materials, beside the truth.

use std::path::Path;
use std::time::Instant;

use gprop::parts::{Options, Parts, parts};
use gprop::progress::Progress;

use super::truth::{self, Truth};

fn measured(folder: &Path, options: &Options) -> (Parts, Truth) {
    let (scene, truth) = truth::load(folder);
    let field = truth::field(&scene, &truth, folder);
    let cameras: Vec<_> = scene.views.iter().map(|v| v.camera.clone()).collect();
    let start = Instant::now();
    let result = parts(&scene.gaussians, &field, &cameras, scene.scale.as_ref(), options, Progress::Hidden).unwrap();
    println!("{} in {:.2} s", scene.name, start.elapsed().as_secs_f64());
    let parts = result.metric().unwrap().clone();
    {
        // DEBUG
        let g = result.interior.grid;
        let mut f = std::fs::File::create(format!("/tmp/dump_{}.bin", scene.name)).unwrap();
        use std::io::Write;
        for d in g.dims {
            f.write_all(&(d as f64).to_le_bytes()).unwrap();
        }
        for d in [g.origin.x, g.origin.y, g.origin.z, g.cell] {
            f.write_all(&d.to_le_bytes()).unwrap();
        }
        let part: Vec<u8> = result.interior.part.iter().flat_map(|p| p.to_le_bytes()).collect();
        f.write_all(&part).unwrap();
        let part: Vec<u8> = result.interior.fraction.iter().flat_map(|p| p.to_le_bytes()).collect();
        f.write_all(&part).unwrap();
    }
    print(&parts, &truth);
    (parts, truth)
}

fn print(parts: &Parts, truth: &Truth) {
    for warning in &parts.warnings {
        println!("  warning: {warning}");
    }
    println!("  part           volume low    mid   high   true cm3    mass low    mid   high   true g   thick mm");
    for part in &parts.parts {
        let t = truth.parts.iter().find(|t| t.name == part.caption).unwrap();
        let (v, m) = (part.volume_m3.scaled(1e6), part.mass_kg.scaled(1e3));
        println!(
            "  {:14} {:9.1} {:6.1} {:6.1} {:8.1} {:12.1} {:6.1} {:6.1} {:8.1}  {:5.1} {:5.1} {:5.1}",
            part.caption,
            v.low,
            v.mid,
            v.high,
            t.volume_m3 * 1e6,
            m.low,
            m.mid,
            m.high,
            t.mass_kg * 1e3,
            part.thickness_m.low * 1e3,
            part.thickness_m.mid * 1e3,
            part.thickness_m.high * 1e3,
        );
    }
    let m = parts.object.mass_kg.scaled(1e3);
    let predicted = 0.5 * (m.low + m.high);
    let ratio = predicted / (truth.total_mass_kg * 1e3);
    println!(
        "  object {:.1} {:.1} {:.1} g, true {:.1}; MnRE {:.3}, mid {:.3}",
        m.low,
        m.mid,
        m.high,
        truth.total_mass_kg * 1e3,
        ratio.min(1.0 / ratio),
        m.mid / truth.total_mass_kg / 1e3
    );
}

#[test]
fn masses_of_the_scenes() {
    measured(&truth::hammer(), &Options::default());
    for name in ["mug", "table_lamp", "chair"] {
        if let Some(folder) = truth::beside(name) {
            measured(&folder, &Options::default());
        }
    }
}
