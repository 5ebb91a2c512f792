//! Parsing the built-in material library, and looking up a material.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use gprop::materials::MaterialLibrary;

fn materials(criterion: &mut Criterion) {
    criterion.bench_function("parse the built-in library", |bencher| {
        bencher.iter(|| MaterialLibrary::parse_builtin().expect("the built-in library"));
    });
    let library = MaterialLibrary::builtin();
    criterion.bench_function("get by alias", |bencher| bencher.iter(|| library.get(black_box("Stainless Steel"))));
    criterion.bench_function("nearest of all names", |bencher| {
        bencher.iter(|| library.nearest(black_box("solid oak plank")));
    });
}

criterion_group!(benches, materials);
criterion_main!(benches);
