//! Volumes of clouds on balls, shells and tori against their closed forms.

use std::f64::consts::PI;

use gprop::parts::{Options, Parts, PartsResult, Source, VolumeMethod, parts};
use gprop::query::Form;
use gprop::units::{MetricScale, Range, ScaleSource};
use gprop::words::progress::Progress;
use nalgebra::{Point3, Vector3};

use super::clouds::{Cloud, cameras, cameras_of};

/// A scene unit of 0.5 m, so that a confusion of the two is noticed.
const SCALE: MetricScale =
    MetricScale { meters_per_unit: 0.5, source: ScaleSource::Factor, provenance: String::new(), range: None };

fn run(cloud: &Cloud, deviation: f64, forms: &[Form], options: &Options) -> PartsResult {
    let (gaussians, field) = (cloud.gaussians(deviation), cloud.field(forms));
    parts(&gaussians, &field, &cameras(4.0, 40, |_| true), Some(&SCALE), options, Progress::HIDDEN).unwrap()
}

fn with(volume: VolumeMethod, volume_cells: usize) -> Options {
    Options { volume, volume_cells, ..Options::default() }
}

fn wall(thickness_m: f64) -> Form {
    Form::Shell { wall_thickness_m: Range::exactly(thickness_m) }
}

/// Relative error of the object's volume against `units3` scene units cubed.
fn error(parts: &Parts, units3: f64) -> f64 {
    parts.object.volume_m3.mid / (units3 * 0.5f64.powi(3)) - 1.0
}

/// A ball of radius 1 of Gaussians 0.04 apart.
fn ball(part_of: impl Fn(Vector3<f64>) -> u32) -> Cloud {
    Cloud::sphere(Point3::new(0.1, -0.05, 0.02), 1.0, 8000, part_of)
}

/// Errors at rising numbers of cells, on photos of 1600 px: none may be above its bound, and each bound is below the
/// last.
fn converges(cloud: &Cloud, units3: f64, method: VolumeMethod, form: Form, bounds: [(usize, f64); 3]) {
    let (gaussians, field) = (cloud.gaussians(0.02), cloud.field(&[form]));
    let eyes = cameras_of(1600, 4.0, 40, |_| true);
    for (cells, bound) in bounds {
        let result = parts(&gaussians, &field, &eyes, Some(&SCALE), &with(method, cells), Progress::HIDDEN).unwrap();
        let error = error(result.metric().unwrap(), units3);
        println!("{method:?} {cells}: {:+.2} %", 100.0 * error);
        assert!(error.abs() <= bound, "{method:?} on {cells} cells is off by {error}, more than {bound}");
    }
}

const CELLS: [usize; 3] = [8_000, 64_000, 512_000];

/// A bound for each number of cells; each grid is twice as fine as the one before.
fn bounds(bounds: [f64; 3]) -> [(usize, f64); 3] {
    std::array::from_fn(|k| (CELLS[k], bounds[k]))
}

#[test]
fn carved_ball_converges() {
    converges(&ball(|_| 0), 4.0 / 3.0 * PI, VolumeMethod::Carve, Form::Solid, bounds([0.06, 0.03, 0.02]));
}

// The skin counts as material up to about a cell outside of it, so the error shrinks with the cell.
#[test]
fn filled_ball_converges() {
    converges(&ball(|_| 0), 4.0 / 3.0 * PI, VolumeMethod::Fill, Form::Solid, bounds([0.45, 0.16, 0.08]));
}

#[test]
fn walls_of_a_ball_converge() {
    // 0.04 m is 0.08 units: 4/3 pi (1 - 0.92^3). At 8,000 cells a cell is wider than the wall.
    let units3 = 4.0 / 3.0 * PI * (1.0 - 0.92f64.powi(3));
    converges(&ball(|_| 0), units3, VolumeMethod::Hybrid, wall(0.04), bounds([0.04, 0.03, 0.015]));
}

/// A mass goes with the cube of the scale, a wall's with its square; nothing else depends on the scale's interval.
#[test]
fn the_interval_of_the_scale_widens_every_mass() {
    let cloud = ball(|_| 0);
    let (gaussians, eyes) = (cloud.gaussians(0.02), cameras(4.0, 20, |_| true));
    for (method, form, power) in [
        (VolumeMethod::Hybrid, Form::Solid, 3),
        (VolumeMethod::Hybrid, wall(0.04), 2),
        (VolumeMethod::Carve, wall(0.04), 3),
        (VolumeMethod::Shell, Form::Solid, 2),
    ] {
        let options = with(method, 8_000);
        let field = cloud.field(&[form]);
        let weighed = |scale: &MetricScale| {
            let result = parts(&gaussians, &field, &eyes, Some(scale), &options, Progress::HIDDEN).unwrap();
            result.metric().unwrap().clone()
        };
        let range = Range::new(0.48, 0.53);
        let (exact, uncertain) = (weighed(&SCALE), weighed(&MetricScale { range: Some(range), ..SCALE }));
        let of_scale = |parts: &Parts| parts.object.width.iter().find(|width| width.source == Source::Scale).cloned();
        assert!(of_scale(&exact).is_none() && exact.meters_per_unit.is_none());
        let (width, mass) = (of_scale(&uncertain).unwrap().mass_kg, uncertain.object.mass_kg);
        for (end, of_range) in [(width.low, range.low), (width.high, range.high)] {
            // Rounding alone.
            assert!((end / mass.mid - (of_range / 0.5f64).powi(power)).abs() < 1e-9, "{form:?}: {width:?}");
        }
        assert_eq!(mass.mid, exact.object.mass_kg.mid);
        let quadrature = |exact: f64, alone: f64| (exact / mass.mid).ln().hypot((alone / mass.mid).ln());
        let expected = quadrature(exact.object.mass_kg.high, width.high);
        assert!(((mass.high / mass.mid).ln() - expected).abs() < 1e-9, "{form:?}: {mass:?}");
        let scale = uncertain.meters_per_unit.unwrap();
        assert!((scale.low - range.low).abs() < 1e-9 && (scale.high - range.high).abs() < 1e-9, "{scale:?}");
    }
}

#[test]
fn carved_torus_converges() {
    let cloud = Cloud::torus(0.8, 0.25, 0.03);
    let units3 = 2.0 * PI * PI * 0.8 * 0.25f64.powi(2);
    converges(&cloud, units3, VolumeMethod::Carve, Form::Solid, bounds([0.22, 0.12, 0.06]));
}

#[test]
fn walls_far_thinner_than_a_cell_weigh_area_times_thickness() {
    // 1 mm is 0.002 units; a cell is 0.05.
    let result = run(&ball(|_| 0), 0.02, &[wall(0.001)], &with(VolumeMethod::Hybrid, 60_000));
    let error = error(result.metric().unwrap(), 4.0 * PI * 0.002);
    println!("thin wall: {:+.2} %", 100.0 * error);
    assert!(error.abs() < 0.05, "{error}");
}

#[test]
fn moments_of_a_ball() {
    let result = run(&ball(|_| 0), 0.02, &[Form::Solid], &with(VolumeMethod::Hybrid, 60_000));
    let object = &result.metric().unwrap().object;
    // The inertia of the measured ball: 2/5 m r^2 with r from the volume.
    let radius = (object.volume_m3.mid * 3.0 / (4.0 * PI)).cbrt();
    let inertia = 0.4 * object.mass_kg.mid * radius * radius;
    for axis in 0..3 {
        let center = [0.1, -0.05, 0.02][axis] * 0.5;
        // A hundredth of the radius: the splat consists of 8,000 pieces and is seen from 40 sides.
        assert!((object.center_of_mass_m[axis] - center).abs() < 0.005, "{:?}", object.center_of_mass_m);
        assert!((object.inertia_kg_m2[axis][axis] / inertia - 1.0).abs() < 0.02, "{:?}", object.inertia_kg_m2);
    }
}

#[test]
fn parts_meet_in_the_flat_surface_that_spans_their_seam() {
    // A cap above z = 0.5: pi h^2 (3 - h) / 3 with h = 0.5. Nearest-surface labels would give it a cone to the
    // centre.
    let cloud = ball(|n| u32::from(n.z > 0.5));
    let result = run(&cloud, 0.02, &[Form::Solid, Form::Solid], &with(VolumeMethod::Hybrid, 200_000));
    let parts = &result.metric().unwrap().parts;
    let cap = PI * 0.25 * 2.5 / 3.0 * 0.125;
    println!("cap: {:+.2} %", 100.0 * (parts[1].volume_m3.unwrap().mid / cap - 1.0));
    // The least-area dynamics stop within a block of cells of the flat interface.
    assert!(
        (parts[1].volume_m3.unwrap().mid / cap - 1.0).abs() < 0.15,
        "{} is not {cap}",
        parts[1].volume_m3.unwrap().mid
    );
}

#[test]
fn part_volumes_add_up_to_the_object() {
    let cloud = ball(|n| u32::from(n.z > 0.5));
    let result = run(&cloud, 0.02, &[Form::Solid, wall(0.02)], &with(VolumeMethod::Hybrid, 60_000));
    let parts = result.metric().unwrap();
    let sum: f64 = parts.parts.iter().map(|p| p.volume_m3.unwrap().mid).sum();
    assert!((sum / parts.object.volume_m3.mid - 1.0).abs() < 1e-12);
}

#[test]
fn thickness_is_wall_to_wall() {
    let mut cloud = Cloud::default();
    cloud.add_cylinder(0.9, [-0.1, 0.1], [true, true], 0.03, 0);
    let result = run(&cloud, 0.018, &[Form::Solid], &with(VolumeMethod::Hybrid, 200_000));
    let thickness = result.metric().unwrap().parts[0].thickness_m.unwrap();
    println!("disc: {thickness:?}");
    // A disc of 0.2 units, 0.1 m: within a cell (0.013 m).
    assert!((thickness.mid - 0.1).abs() < 0.013, "{thickness:?}");
}
