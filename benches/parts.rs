//! The parts stage and the grasp on the hammer's 28,736 Gaussians at the default grid: carving with all 30 views, part
//! assignment, thickness, mass; then the places to grasp at and the forces. Then the parts stage again with each Gaussian split into
//! 35 pieces, 1,005,760 in all.

mod pieces;

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use gprop::gaussians::Gaussians;
use gprop::grasp::gripper::GripperProfile;
use gprop::grasp::surface::Surface;
use gprop::grasp::{self, grasp};
use gprop::materials::MaterialLibrary;
use gprop::parts::{self, parts};
use gprop::scene::{self, Scene};
use gprop::units::{Estimate, MetricScale, ScaleSource};
use gprop::vote::{FieldPart, MaterialField};
use gprop::words::progress::Progress;
use pieces::in_pieces;

fn hammer() -> Scene {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer");
    scene::load(&folder, &scene::Options::default()).expect("the fixture is a scene")
}

fn label(id: u32, density_kg_m3: f64) -> FieldPart {
    let mut label = FieldPart::of(id, &MaterialLibrary::builtin().materials()[0]);
    label.density_kg_m3 = Estimate::exactly(density_kg_m3);
    label
}

/// Head, handle and grip, separated by their position along the handle.
fn labelled(gaussians: &Gaussians) -> MaterialField {
    let label_at = |x: f32| u32::from(x < 0.1) + u32::from(x < -0.075);
    let labels = vec![label(1, 7850.0), label(2, 800.0), label(3, 1200.0)];
    MaterialField::known(labels, gaussians.positions.iter().map(|position| label_at(position[0])).collect())
}

fn bench(criterion: &mut Criterion) {
    let scene = hammer();
    let field = labelled(&scene.gaussians);
    let cameras = scene.cameras();
    let provenance = "rendered in metres".to_owned();
    let scale = MetricScale { meters_per_unit: 1.0, source: ScaleSource::Metric, provenance, range: None };
    let options = parts::Options::default();
    let measure_as = |gaussians: &Gaussians, field: &MaterialField| {
        parts(gaussians, field, &cameras, Some(&scale), &options, Progress::HIDDEN).expect("a hammer has parts")
    };
    let measure = || measure_as(&scene.gaussians, &field);
    let mut group = criterion.benchmark_group("parts");
    group.sample_size(10);
    group.bench_function("hammer", |bencher| bencher.iter(|| black_box(measure())));

    let fine = in_pieces(&scene.gaussians);
    let fine_field = labelled(&fine);
    group.bench_function("million", |bencher| bencher.iter(|| black_box(measure_as(&fine, &fine_field))));

    let measured = measure();
    let weighed = measured.metric().expect("the scale is known");
    let options = grasp::Options::default();
    let gripper = GripperProfile::load(&options.gripper).expect("the default gripper is built in");
    group.bench_function("grasp", |bencher| {
        bencher.iter(|| {
            let surface = Surface::of(&scene.gaussians, &field.part_index, &cameras, 1.0);
            grasp(black_box(weighed), &field.parts, Some(&surface), 1.0, &gripper, &options)
        });
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
