//! Gaussians that cannot belong to the object are set aside; scales that no object can have are refused.

use std::path::Path;

use gprop::gaussians::Gaussians;
use gprop::scene;
use gprop::scene::object::outliers::set_aside;
use gprop::scene::splat::ply;
use gprop::words::progress::Progress;

use super::folder::{assert_message, hammer, options};
use crate::vote::build::{Blob, Noise, cloud};

const NONE: [usize; 0] = [];

/// Round Gaussians of 0.02 spread evenly over a ball of radius 1, 0.06 apart.
fn ball() -> Gaussians {
    const COUNT: usize = 3000;
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let blob = |i: usize| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / COUNT as f64;
        let (sin, cos) = (golden * i as f64).sin_cos();
        let ring = (1.0 - z * z).sqrt();
        Blob::round([ring * cos, ring * sin, z].map(|v| v as f32), 0.02, 0.9)
    };
    cloud(&(0..COUNT).map(blob).collect::<Vec<_>>())
}

/// The Gaussians of the ball that are set aside after `change`.
fn found(change: impl FnOnce(&mut Gaussians)) -> Vec<usize> {
    let mut gaussians = ball();
    change(&mut gaussians);
    let said = set_aside(&mut gaussians, Progress::HIDDEN).unwrap();
    let marked: Vec<usize> = (0..gaussians.len()).filter(|&i| gaussians.is_set_aside(i)).collect();
    assert_eq!(said.as_ref().map_or(0, |said| said.count), marked.len());
    assert_eq!(said.map(|said| said.first), marked.first().copied());
    marked
}

#[test]
fn what_reaches_far_past_all_others_is_set_aside() {
    assert_eq!(found(|_| {}), NONE);
    for deviation in [0.3_f32, 1.0, 50.0, 1e30] {
        assert_eq!(found(|ball| ball.log_scales[17] = [deviation.ln(); 3]), [17], "{deviation}");
        // A needle: long along one axis alone.
        assert_eq!(found(|ball| ball.log_scales[18][2] = deviation.ln()), [18], "{deviation}");
        // However faint: a thousand faint ones hide as much as a solid one.
        let faint = |ball: &mut Gaussians| (ball.log_scales[19], ball.opacity_logits[19]) = ([deviation.ln(); 3], -3.0);
        assert_eq!(found(faint), [19], "{deviation}");
    }
    for far in [3.0, 1e4, 1e20, 3e38] {
        assert_eq!(found(|ball| ball.positions[20] = [far, -far, far]), [20], "{far}");
    }
}

#[test]
fn many_in_one_far_point_do_not_vouch_for_each_other() {
    let gather = |ball: &mut Gaussians| (0..3000).step_by(25).for_each(|i| ball.positions[i] = [9.0; 3]);
    assert_eq!(found(gather), (0..3000).step_by(25).collect::<Vec<_>>());
}

#[test]
fn what_lies_among_its_neighbours_stays() {
    // Almost twice as large as usual; small; turned; gone or solid.
    assert_eq!(found(|ball| ball.log_scales[17] = [0.035_f32.ln(); 3]), NONE);
    assert_eq!(found(|ball| ball.log_scales[17] = [0.001_f32.ln(); 3]), NONE);
    for quaternion in [[0.0; 4], [1e-30, 0.0, 0.0, 0.0], [1e30, 1e30, 0.0, 0.0]] {
        assert_eq!(found(|ball| ball.rotations[17] = quaternion), NONE);
    }
    for logit in [f32::NEG_INFINITY, -1e30, 1e30, f32::INFINITY] {
        assert_eq!(found(|ball| ball.opacity_logits[17] = logit), NONE);
    }
}

#[test]
fn a_crowd_is_set_aside_at_a_size_that_one_alone_may_have() {
    let enlarge = |ball: &mut Gaussians, step: usize| {
        (0..ball.len()).step_by(step).for_each(|i| ball.log_scales[i] = [0.09_f32.ln(); 3]);
    };
    assert_eq!(found(|ball| enlarge(ball, 1000)), NONE);
    assert_eq!(found(|ball| enlarge(ball, 20)).len(), 150);
}

#[test]
fn a_few_hundred_wild_gaussians_do_not_make_the_others_outliers() {
    let mut noise = Noise(7);
    let wild: Vec<usize> = (0..3000).filter(|_| noise.next() < 0.05).collect();
    let spoil = |ball: &mut Gaussians| {
        for &i in &wild {
            ball.positions[i] = std::array::from_fn(|_| noise.within(-40.0, 40.0));
            ball.log_scales[i] = [noise.within(0.0, 4.0); 3];
        }
    };
    assert_eq!(found(spoil), wild);
}

#[test]
fn too_few_gaussians_or_all_in_one_point_say_nothing() {
    let big = Blob::round([0.0; 3], 9.0, 0.9);
    let mut few = cloud(&[Blob::round([1.0, 0.0, 0.0], 0.01, 0.9), big]);
    assert_eq!(set_aside(&mut few, Progress::HIDDEN).unwrap(), None);
    let mut point = cloud(&[big; 100]);
    assert_eq!(set_aside(&mut point, Progress::HIDDEN).unwrap(), None);
}

#[test]
fn a_splat_of_nothing_else_is_an_error() {
    let mut gaussians = ball();
    gaussians.log_scales.iter_mut().for_each(|scales| *scales = [3.0; 3]);
    let error = set_aside(&mut gaussians, Progress::HIDDEN).unwrap_err();
    assert!(error.to_string().contains("3000 of 3000"), "{error}");
}

#[test]
fn what_is_set_aside_is_transparent_and_stays_in_the_file() {
    let mut gaussians = ball();
    gaussians.log_scales[2] = [1.0; 3];
    let bytes = |gaussians: &Gaussians| {
        let mut bytes = Vec::new();
        ply::write(&mut bytes, gaussians, &[]).unwrap();
        bytes
    };
    let before = bytes(&gaussians);
    let clean = ball();
    let said = set_aside(&mut gaussians, Progress::HIDDEN).unwrap().unwrap().to_string();
    assert!(said.contains("set aside 1 of 3000") && said.contains("Gaussian 2 (counted from 0)"), "{said}");
    assert!(said.contains("neither drawn nor weighed") && !said.contains("scene units"), "{said}");
    assert_eq!(bytes(&gaussians), before);
    assert_eq!((gaussians.opacity(2), gaussians.opacity(3)), (0.0, clean.opacity(3)));

    // The mark stays with its Gaussian.
    let mut moved = gaussians.clone();
    moved.retain(&(0..3000).map(|i| i != 0).collect::<Vec<_>>());
    assert!(moved.is_set_aside(1) && !moved.is_set_aside(2));
    moved.append(&gaussians);
    assert!(moved.is_set_aside(1) && moved.is_set_aside(2999 + 2));
    moved.repeat(&[0, 1]);
    assert!(!moved.is_set_aside(5999) && moved.is_set_aside(6000) && moved.set_aside.len() == moved.len());
    let mut longer = clean.clone();
    longer.append(&gaussians);
    assert!(!longer.is_set_aside(2) && longer.is_set_aside(3002));
}

#[test]
fn nothing_is_set_aside_of_the_fixtures() {
    for name in ["hammer", "mug", "table_lamp", "chair"] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name);
        let scene = scene::load(&folder, &options(&["--scale", "metric"]).unwrap()).unwrap();
        assert!(scene.gaussians.set_aside.is_empty() && scene.warnings.is_empty(), "{name}: {:?}", scene.warnings);
    }
}

#[test]
fn scales_that_no_object_can_have_are_refused_with_the_size_they_make() {
    let load = |text: &str| scene::load(&hammer(), &options(&["--scale", text]).unwrap());
    // The hammer is 0.35 scene units long.
    for (text, size) in [
        ("3000", "1.1 km"),
        ("1e-3", "um"),
        ("bbox:x=1001", "1.0 km"),
        ("bbox:x=1e-5", "10.0 um"),
        ("known-length:0,0,0:0,0,1e-6=1", "km"),
        ("known-length:0,0,0:0,0,1e-150=1", "e149 m"),
        ("known-length:0,0,0:0,0,1e6=1", "e-7 m"),
        ("cameras:000,001=1e5", "km"),
        ("cameras:000,001=1e-6", "e-7 m"),
    ] {
        assert_message(load(text), &["--scale", "the object would be", size, "1.0 mm to 500.00 m", "another --scale"]);
    }
    // No length at all.
    assert_message(load("known-length:1,1,1:1,1,1=1"), &["zero"]);
    assert_message(load("cameras:000,000=1"), &["zero"]);
    for nonsense in [
        "0",
        "-1",
        "nan",
        "inf",
        "1e-300",
        "1e300",
        "bbox:x=0",
        "bbox:x=-1",
        "bbox:x=nan",
        "cameras:000,001=0",
        "cameras:000,001=inf",
        "known-length:0,0,0:0,0,1=-1",
        "known-length:0,0,nan:0,0,1=1",
        "known-length:0,0,0:0,0,inf=1",
    ] {
        assert!(options(&[&format!("--scale={nonsense}")]).is_err(), "{nonsense}");
    }
}

#[test]
fn unusual_sizes_get_a_warning_that_names_them() {
    let load = |text: &str| scene::load(&hammer(), &options(&["--scale", text]).unwrap()).unwrap();
    for (text, size) in [("0.02", "mm"), ("100", "is that its size?")] {
        let scene = load(text);
        let named = |warning: &String| warning.contains(&format!("--scale {text}")) && warning.contains(size);
        assert!(scene.warnings.iter().any(named), "{text}: {:?}", scene.warnings);
        assert!(scene.scale.is_some());
    }
    assert_eq!(load("bbox:x=0.3").warnings, Vec::<String>::new());
}

/// Half of 40,000 Gaussians are huge: a quarter reaches as far as f32 goes, from where all centres look equally far, and the ends of
/// another quarter lie in the middle of a sphere of centres. Without bounds, the searches visit all centres, billions in all.
#[test]
fn huge_gaussians_from_whose_ends_all_centres_are_equally_far_are_set_aside_soon() {
    const COUNT: usize = 40_000;
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let blob = |i: usize| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / COUNT as f64;
        let (sin, cos) = (golden * i as f64).sin_cos();
        let ring = (1.0 - z * z).sqrt();
        Blob::round([ring * cos, ring * sin, z].map(|v| v as f32), 0.005, 0.9)
    };
    let mut gaussians = cloud(&(0..COUNT).map(blob).collect::<Vec<_>>());
    for (i, scales) in gaussians.log_scales.iter_mut().enumerate().filter(|(i, _)| i % 2 == 0) {
        *scales = [if i % 4 == 0 { 46.0 } else { (1.0_f32 / 5.0_f32.sqrt()).ln() }; 3];
    }
    let said = set_aside(&mut gaussians, Progress::HIDDEN).unwrap().unwrap();
    assert!(said.count >= COUNT / 4, "{said}");
    assert!((0..COUNT).step_by(4).all(|i| gaussians.is_set_aside(i)));
}
