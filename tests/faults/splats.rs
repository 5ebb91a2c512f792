//! Splats in which some or all Gaussians are unlike any that a trainer writes, through the whole program.

use std::fs;
use std::path::Path;

use gprop::gaussians::Gaussians;
use gprop::scene::splat::ply;
use serde_json::Value;

use super::{assert_refused, run};
use crate::batch::ball::Balls;
use crate::run::gprop;

fn change(balls: &Balls, change: impl Fn(&mut Gaussians)) {
    let path = balls.scene(0).join("point_cloud.ply");
    let mut gaussians = ply::read(&path).unwrap().gaussians;
    change(&mut gaussians);
    ply::write(fs::File::create(&path).unwrap(), &gaussians, &[]).unwrap();
}

fn json(path: impl AsRef<Path>) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn one_giant_is_named_kept_in_the_field_and_weighs_nothing() {
    let (balls, clean, spoilt) = (Balls::new(1), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    assert!(run(&balls, clean.path()).status.success());
    change(&balls, |gaussians| gaussians.log_scales[5] = [-1.0; 3]);
    let output = run(&balls, spoilt.path());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let warnings = json(spoilt.path().join("run.json"))["stages"][0]["warnings"].to_string();
    assert!(warnings.contains("set aside 1 of 200 Gaussians") && warnings.contains("Gaussian 5 "), "{warnings}");
    let field = ply::read(&spoilt.path().join("field.ply")).unwrap().gaussians;
    assert_eq!((field.len(), field.log_scales[5]), (200, [-1.0; 3]));
    let mass = |out: &Path| json(out.join("parts.json"))["object"]["mass_kg"]["mid"].as_f64().unwrap();
    let ratio = mass(spoilt.path()) / mass(clean.path());
    // One of two hundred Gaussians is missing: a dent as large as their spacing.
    assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
}

#[test]
fn a_splat_with_nothing_left_in_it_ends_with_its_reason() {
    let balls = Balls::new(1);
    change(&balls, |gaussians| gaussians.log_scales.iter_mut().for_each(|scales| *scales = [3.0; 3]));
    let out = tempfile::tempdir().unwrap();
    assert_refused(&run(&balls, out.path()), 3, &["nothing is left of the splat", "set aside 200 of 200 Gaussians"]);

    let balls = Balls::new(1);
    change(&balls, |gaussians| gaussians.opacity_logits.fill(f32::NEG_INFINITY));
    assert_refused(&run(&balls, out.path()), 3, &["no Gaussian received a vote"]);
    assert!(!out.path().join("parts.json").exists());
}

#[test]
fn a_scale_that_makes_a_planet_of_a_ball_is_refused() {
    let balls = Balls::new(1);
    for (scale, words) in [
        ("known-length:0,0,0:0,0,0.001=100", ["the object would be", "km"]),
        ("cameras:000,001=1e-7", ["the object would be", "e-"]),
        ("1e5", ["the object would be", "km"]),
    ] {
        let command = ["--to", "scene", "--scale", scale];
        let output = gprop().arg("run").arg(balls.scene(0)).args(command).output().unwrap();
        assert_refused(&output, 3, &words);
    }
    let nonsense = gprop().arg("run").arg(balls.scene(0)).args(["--scale", "cameras:000,001=nan"]).output().unwrap();
    assert_eq!(nonsense.status.code(), Some(2));
}
