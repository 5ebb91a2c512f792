//! The expensive half of the report: the three pictures of a 512 x 512 view, one of them rasterised, and their JPEGs.

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use gprop::materials::Law;
use gprop::query::Form;
use gprop::report::ViewPictures;
use gprop::scene;
use gprop::segment::LabelMap;
use gprop::units::Estimate;
use gprop::vote::{FieldLabel, MaterialField};

fn label(id: u32) -> FieldLabel {
    FieldLabel {
        id,
        caption: format!("part {id}"),
        material: "wood".to_owned(),
        family: "wood".to_owned(),
        density_kg_m3: Estimate::exactly(700.0),
        youngs_modulus_pa: Estimate::exactly(1e10),
        poisson_ratio: Estimate::exactly(0.3),
        yield_strength_pa: Estimate::exactly(1e8),
        hardness: None,
        friction_rubber: Estimate::exactly(0.7),
        form: Form::Solid,
        inside: None,
        bulk_reason: None,
        law: Law::Elastic,
    }
}

fn bench(criterion: &mut Criterion) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer");
    let scene = scene::load(&folder, &scene::Options::default()).expect("the fixture is a scene");
    let view = &scene.views[0];
    let (width, height) = (view.camera.intrinsics.width, view.camera.intrinsics.height);
    let map =
        LabelMap { width, height, labels: (0..width * height).map(|pixel| (pixel % width / 64) as u16).collect() };
    let part_label = (0..scene.gaussians.len() as u32).map(|i| i % 3).collect();
    let field = MaterialField::known((1..=3).map(label).collect(), part_label);
    let draw = || ViewPictures::draw(view, &map, &scene.gaussians, &field).expect("the photo is there");
    criterion.bench_function("report/view", |bencher| bencher.iter(|| black_box(draw())));
}

criterion_group!(benches, bench);
criterion_main!(benches);
