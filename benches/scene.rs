//! Loading a splat beside reading the same bytes: `cargo bench --bench scene`.
//!
//! A million Gaussians of 62 properties take 248 MB. Each load is measured with the file in the page cache, and so is the plain
//! read that it is compared with.

#![allow(clippy::disallowed_methods, reason = "a benchmark is not gprop")]

use std::fs::File;
use std::io::BufWriter;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gprop::gaussians::{ExtraProperty, Gaussians};
use gprop::scene::splat::ply;

const COUNT: usize = 1_000_000;

/// A cloud with normals and SH degree 3: the 62 properties of the original 3DGS code.
fn cloud() -> Gaussians {
    let value = |i: usize| (i as f32 * 0.618).fract() - 0.5;
    Gaussians {
        positions: (0..COUNT).map(|i| [value(i), value(i + 1), value(i + 2)]).collect(),
        log_scales: vec![[-4.0; 3]; COUNT],
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; COUNT],
        opacity_logits: (0..COUNT).map(value).collect(),
        sh_dc: vec![[0.5; 3]; COUNT],
        sh_degree: 3,
        sh_rest: (0..COUNT * 45).map(value).collect(),
        extra: ["nx", "ny", "nz"]
            .map(|name| ExtraProperty { name: name.to_owned(), values: vec![0.0; COUNT] })
            .to_vec(),
        ..Gaussians::default()
    }
}

fn load(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("point_cloud.ply");
    let file = File::create(&path).expect("a file in it");
    ply::write(BufWriter::new(file), &cloud(), &[]).expect("room for 248 MB");
    let size = path.metadata().expect("it is there").len();

    let mut group = criterion.benchmark_group("scene");
    group.sample_size(10).throughput(Throughput::Bytes(size));
    group.bench_function("read the bytes", |bencher| bencher.iter(|| std::fs::read(&path).expect("it is there")));
    group.bench_function("load the splat", |bencher| bencher.iter(|| ply::read(&path).expect("it is a splat")));
    group.finish();
}

criterion_group!(benches, load);
criterion_main!(benches);
