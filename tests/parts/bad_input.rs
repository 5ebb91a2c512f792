//! Clouds, fields and options that the parts stage must refuse, or process without a panic.

use gprop::camera::Camera;
use gprop::gaussians::Gaussians;
use gprop::parts::{Options, PartsError, PartsResult, VolumeMethod, parts};
use gprop::query::Form;
use gprop::units::{MetricScale, Range, ScaleSource};
use gprop::words::progress::Progress;
use nalgebra::{Point3, Vector3};

use super::clouds::{Cloud, cameras};

const SCALE: MetricScale =
    MetricScale { meters_per_unit: 1.0, source: ScaleSource::Metric, provenance: String::new(), range: None };

fn small() -> Options {
    Options { volume_cells: 20_000, ..Options::default() }
}

fn ball(part_of: impl Fn(Vector3<f64>) -> u32) -> Cloud {
    Cloud::sphere(Point3::origin(), 1.0, 2000, part_of)
}

fn run(cloud: &Cloud, forms: &[Form], options: &Options) -> Result<PartsResult, PartsError> {
    let (gaussians, field) = (cloud.gaussians(0.05), cloud.field(forms));
    parts(&gaussians, &field, &cameras(4.0, 20, |_| true), Some(&SCALE), options, Progress::HIDDEN)
}

#[test]
fn without_a_scale_there_are_shapes_but_no_kilograms() {
    let cloud = ball(|_| 0);
    let shell = Form::Shell { wall_thickness_m: Range::exactly(0.01) };
    let (gaussians, field) = (cloud.gaussians(0.05), cloud.field(&[shell]));
    let result = parts(&gaussians, &field, &cameras(4.0, 20, |_| true), None, &small(), Progress::HIDDEN).unwrap();
    assert!(result.shapes[0].volume.unwrap().mid > 3.0);
    assert!(result.warnings.iter().any(|w| w.contains("solid")), "{:?}", result.warnings);
    let error = result.metric().unwrap_err();
    assert!(error.to_string().contains("--scale"), "{error}");
}

/// `--volume shell` makes walls of solids too; the other methods do not.
#[test]
fn walls_that_lack_a_scale_are_missed_whatever_the_answers_form() {
    let cloud = ball(|_| 0);
    let (gaussians, field) = (cloud.gaussians(0.05), cloud.field(&[Form::Solid]));
    for (volume, lacks) in [(VolumeMethod::Shell, true), (VolumeMethod::Hybrid, false), (VolumeMethod::Carve, false)] {
        let (eyes, options) = (cameras(4.0, 20, |_| true), Options { volume, ..small() });
        let result = parts(&gaussians, &field, &eyes, None, &options, Progress::HIDDEN).unwrap();
        assert_eq!(result.warnings.iter().any(|w| w.contains("only in metres")), lacks, "{:?}", result.warnings);
    }
}

#[test]
fn volumes_go_with_the_cube_of_the_scale() {
    let cloud = ball(|_| 0);
    let (gaussians, field) = (cloud.gaussians(0.05), cloud.field(&[Form::Solid]));
    let options_at = |meters_per_unit| {
        let scale =
            MetricScale { meters_per_unit, source: ScaleSource::Factor, provenance: String::new(), range: None };
        let eyes = cameras(4.0, 20, |_| true);
        let result = parts(&gaussians, &field, &eyes, Some(&scale), &small(), Progress::HIDDEN).unwrap();
        result.metric().unwrap().object.clone()
    };
    let (one, tenth) = (options_at(1.0), options_at(0.1));
    assert!((tenth.mass_kg.mid / one.mass_kg.mid / 1e-3 - 1.0).abs() < 1e-12);
    assert!((tenth.inertia_kg_m2[0][0] / one.inertia_kg_m2[0][0] / 1e-5 - 1.0).abs() < 1e-12);
}

#[test]
fn what_cannot_be_measured_is_refused() {
    let cloud = ball(|_| 0);
    let (gaussians, field) = (cloud.gaussians(0.05), cloud.field(&[Form::Solid]));
    let eyes = cameras(4.0, 20, |_| true);
    let run = |gaussians: &Gaussians, field, eyes: &[Camera]| {
        parts(gaussians, field, eyes, Some(&SCALE), &small(), Progress::HIDDEN).unwrap_err()
    };
    assert_eq!(run(&Gaussians::default(), &field, &eyes), PartsError::NoGaussians);
    assert_eq!(run(&gaussians, &field, &[]), PartsError::NoViews);

    let mut shorter = field.clone();
    shorter.part_index.pop();
    assert_eq!(run(&gaussians, &shorter, &eyes), PartsError::FieldSize { field: 1999, gaussians: 2000 });
    let mut unknown = field.clone();
    unknown.part_index[7] = 5;
    assert_eq!(run(&gaussians, &unknown, &eyes), PartsError::Label { gaussian: 7, label: 5, labels: 1 });
    let mut broken = gaussians.clone();
    broken.positions[3][1] = f32::NAN;
    assert_eq!(run(&broken, &field, &eyes), PartsError::NotFinite { gaussian: 3 });
}

#[test]
fn cameras_that_do_not_fit_the_splat_leave_nothing() {
    let cloud = ball(|_| 0);
    let (gaussians, field) = (cloud.gaussians(0.05), cloud.field(&[Form::Solid]));
    let mut eyes = cameras(4.0, 20, |_| true);
    // Every camera looks past the ball, which is then outside its picture.
    for eye in &mut eyes {
        eye.camera_from_world.translation.x += 8.0;
    }
    let error = parts(&gaussians, &field, &eyes, Some(&SCALE), &small(), Progress::HIDDEN).unwrap_err();
    assert!(matches!(error, PartsError::NothingInside { .. }), "{error}");
}

#[test]
fn options_outside_their_domain_are_refused() {
    let wrong = [
        Options { volume_cells: 10, ..small() },
        Options { carve_views: 0, ..small() },
        Options { fill_density: 0.0, ..small() },
        Options { wall_m: f64::NAN, ..small() },
        Options { min_body_share: 1.0, ..small() },
    ];
    for options in wrong {
        assert!(matches!(run(&ball(|_| 0), &[Form::Solid], &options), Err(PartsError::Option(_))), "{options:?}");
    }
}

#[test]
fn a_part_of_one_gaussian_is_tiny_and_reported() {
    let first = Cloud::sphere(Point3::origin(), 1.0, 2000, |_| 0).points[0].1;
    let result = run(&ball(|n| u32::from(n == first)), &[Form::Solid; 2], &small()).unwrap();
    let parts = result.metric().unwrap();
    assert_eq!(parts.parts[1].gaussians, 1);
    assert!(parts.notes.iter().any(|w| w.contains("part 1")), "{:?}", parts.notes);
    assert_eq!(parts.warnings, Vec::<String>::new(), "one Gaussian of 2000 is nothing to worry about");
    // Less than a thousandth of the ball, 4/3 pi.
    assert!(parts.parts[1].volume_m3.is_none_or(|volume| volume.mid < 4e-3), "{:?}", parts.parts[1].volume_m3);
}

#[test]
fn a_label_without_gaussians_is_no_part() {
    let result = run(&ball(|_| 0), &[Form::Solid; 2], &small()).unwrap();
    assert_eq!(result.metric().unwrap().parts.len(), 1);
    assert_eq!(result.shapes.len(), 2);
}

#[test]
fn one_gaussian_flat_clouds_and_open_bowls_have_a_volume() {
    let mut single = Cloud::default();
    single.add(Point3::origin(), Vector3::z(), 0);
    let mut sheet = Cloud::default();
    for n in 0..900 {
        sheet.add(Point3::new(f64::from(n % 30) * 0.05, f64::from(n / 30) * 0.05, 0.0), Vector3::z(), 0);
    }
    let mut bowl = ball(|_| 0);
    bowl.points.retain(|(p, _, _)| p.z < 0.0);
    for cloud in [single, sheet, bowl] {
        for volume in [VolumeMethod::Hybrid, VolumeMethod::Fill] {
            let result = run(&cloud, &[Form::Solid], &Options { volume, ..small() }).unwrap();
            let volume = result.metric().unwrap().object.volume_m3;
            assert!(volume.low <= volume.mid && volume.mid <= volume.high && volume.mid > 0.0, "{volume:?}");
        }
    }
}

#[test]
fn what_has_no_volume_has_no_number_for_it() {
    let nothing = Form::Shell { wall_thickness_m: Range::exactly(0.0) };
    let halves = ball(|n| u32::from(n.z > 0.0));
    let result = run(&halves, &[Form::Solid, nothing], &small()).unwrap();
    assert_eq!(result.shapes[1].volume, None);
    let parts = serde_json::to_value(result.metric().unwrap()).unwrap();
    let [full, empty] = [&parts["parts"][0], &parts["parts"][1]];
    assert!(full["mass_kg"]["mid"].as_f64().unwrap() > 0.0 && full.get("no_volume").is_none(), "{full}");
    for key in ["volume_m3", "thickness_m", "mass_kg", "center_of_mass_m", "inertia_kg_m2"] {
        assert!(empty[key].is_null(), "{key}: {empty}");
    }
    assert_eq!(empty["no_volume"], "no_material");
    assert!(result.warnings.iter().any(|w| w.contains("\"part 1\"") && w.contains("no mass")), "{:?}", result.warnings);
}

#[test]
fn an_object_without_a_volume_is_an_error() {
    let nothing = Form::Shell { wall_thickness_m: Range::exactly(0.0) };
    let error = run(&ball(|_| 0), &[nothing], &small()).unwrap_err();
    assert!(matches!(error, PartsError::NoVolume { parts: 1, .. }), "{error:?}");
    assert!(error.to_string().contains("\"part 0\" (2,000 Gaussians) fills no cell"), "{error}");
}

#[test]
fn floaters_weigh_nothing() {
    let clean = ball(|_| 0);
    let mut littered = ball(|_| 0);
    for far in [3.0, 4.0, -5.0] {
        littered.add(Point3::new(far, far, 0.0), Vector3::z(), 0);
    }
    let mass = |cloud| run(cloud, &[Form::Solid], &small()).unwrap();
    let (clean, littered) = (mass(&clean), mass(&littered));
    assert!(littered.notes.iter().any(|w| w.contains("3 of 2003")), "{:?}", littered.notes);
    assert_eq!(littered.warnings, Vec::<String>::new());
    let ratio = littered.metric().unwrap().object.mass_kg.mid / clean.metric().unwrap().object.mass_kg.mid;
    // Floaters only hide a few pixels of the ball in a few views.
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
}

#[test]
fn threads_do_not_change_the_result() {
    let cloud = ball(|n| u32::from(n.z > 0.5));
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&cloud, &[Form::Solid; 2], &small()).unwrap())
    };
    assert_eq!(on(1), on(5));
}
