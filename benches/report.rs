//! The expensive half of the report: the three pictures of a 512 x 512 view, one of them rasterised, and their JPEGs.

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use gprop::materials::MaterialLibrary;
use gprop::report::ViewPictures;
use gprop::scene;
use gprop::segment::LabelMap;
use gprop::vote::{FieldPart, MaterialField};

fn bench(criterion: &mut Criterion) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer");
    let scene = scene::load(&folder, &scene::Options::default()).expect("the fixture is a scene");
    let view = &scene.views[0];
    let (width, height) = (view.camera.intrinsics.width, view.camera.intrinsics.height);
    let map =
        LabelMap { width, height, labels: (0..width * height).map(|pixel| (pixel % width / 64) as u16).collect() };
    let part_index = (0..scene.gaussians.len() as u32).map(|i| i % 3).collect();
    let material = &MaterialLibrary::builtin().materials()[0];
    let field = MaterialField::known((1..=3).map(|id| FieldPart::of(id, material)).collect(), part_index);
    let draw = || ViewPictures::draw(view, &map, &scene.gaussians, &field).expect("the photo is there");
    criterion.bench_function("report/view", |bencher| bencher.iter(|| black_box(draw())));
}

criterion_group!(benches, bench);
criterion_main!(benches);
