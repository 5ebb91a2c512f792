//! Parts of several connected bodies, as one part or as many.

use gprop::parts::{BodiesAs, Options, PartsResult, parts};
use gprop::query::Form;
use gprop::units::{MetricScale, ScaleSource};
use gprop::words::progress::Progress;
use nalgebra::Point3;

use super::clouds::{Cloud, cameras};

const SCALE: MetricScale =
    MetricScale { meters_per_unit: 1.0, source: ScaleSource::Metric, provenance: String::new(), range: None };
const LEGS: [[f64; 2]; 4] = [[0.5, 0.5], [-0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]];

/// A ball on four rods that do not touch each other; the rods are part 1.
fn table(bodies: BodiesAs) -> PartsResult {
    let mut cloud = Cloud::sphere(Point3::new(0.0, 0.0, 0.3), 0.8, 6000, |_| 0);
    for [x, y] in LEGS {
        let mut leg = Cloud::default();
        leg.add_cylinder(0.12, [-1.0, -0.15], [true, false], 0.03, 1);
        for (point, normal, part) in leg.points {
            cloud.add(Point3::new(point.x + x, point.y + y, point.z), normal, part);
        }
    }
    let options = Options { volume_cells: 200_000, bodies, ..Options::default() };
    let (gaussians, field) = (cloud.gaussians(0.018), cloud.field(&[Form::Solid; 2]));
    parts(&gaussians, &field, &cameras(4.0, 40, |_| true), Some(&SCALE), &options, Progress::HIDDEN).unwrap()
}

#[test]
fn four_legs_are_one_part_or_four_of_the_same_mass() {
    let (one, four) = (table(BodiesAs::OnePart), table(BodiesAs::Parts));
    let (one, four) = (one.metric().unwrap(), four.metric().unwrap());
    assert_eq!((one.parts.len(), four.parts.len()), (2, 5));
    assert_eq!(one.object, four.object);
    let legs = &one.parts[1];
    assert_eq!(legs.bodies.len(), 4);
    let legs_mass = legs.mass_kg.unwrap();
    let mass = |part: &gprop::parts::Part| part.mass_kg.unwrap();
    let sum = |of: &dyn Fn(&gprop::parts::Part) -> f64| four.parts[1..].iter().map(of).sum::<f64>();
    for (whole, sum) in [
        (legs_mass.low, sum(&|p| mass(p).low)),
        (legs_mass.mid, sum(&|p| mass(p).mid)),
        (legs_mass.high, sum(&|p| mass(p).high)),
        (legs.bodies.iter().map(|b| b.mass_kg).sum(), sum(&|p| mass(p).mid)),
        (legs.gaussians as f64, sum(&|p| p.gaussians as f64)),
    ] {
        // Sums of the same terms in a different order.
        assert!((whole / sum - 1.0).abs() < 1e-12, "{whole} is not {sum}");
    }
    for leg in &four.parts[1..] {
        assert!(leg.caption.contains("of 4"), "{}", leg.caption);
        // Equal legs: a twentieth for the cells and the views that see them.
        assert!((mass(leg).mid * 4.0 / legs_mass.mid - 1.0).abs() < 0.05, "{:?}", leg.mass_kg);
        let [x, y, _] = leg.center_of_mass_m.unwrap();
        assert!(LEGS.iter().any(|[a, b]| (x - a).hypot(y - b) < 0.03), "{:?}", leg.center_of_mass_m);
    }
}
