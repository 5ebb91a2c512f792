//! Segmentation, piece by piece: the cost per picture (scale and encode) and the cost per prompt (decode, then
//! enlarge, threshold and score three masks). `segment_generator.py` compares the whole with the public generator.
//!
//! A view of p prompts takes about 1 s to load, encode + p x decode, and 1 to 2 % more to score masks, on which the reference
//! generator spends two fifths of its time. A decode of MobileSAM (the same decoder as SAM's) takes 11 ms on one core of
//! an EPYC with AVX-512 and makes 1.7 billion multiplications and additions in matrix products. Its time, by `perf`:
//!
//! | | |
//! | --- | --- |
//! | products of pixels and tokens, seven of `[4096,256] x [256,64]` | 31 % |
//! | the two transposed convolutions | 29 % |
//! | the tokens' own layers | 10 % |
//! | GELU | 8 % |
//! | sums and layer norms of pixels | 7 % |
//! | softmax, and the rest | 15 % |
//!
//! The products run at 270 GFLOP/s, close to the core's peak, so they set a floor of 7 ms per prompt. Only fewer prompts can save more,
//! which is what `--point-prompts adaptive` does.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use gprop::segment::mask::Rect;
use gprop::segment::nms::box_nms;
use gprop::segment::preprocess::prepare;
use gprop::segment::sam::{LOGITS_SIDE, Sam};
use gprop::segment::upsample::Upsampler;
use gprop::setup;
use gprop::words::progress::Progress;
use image::RgbImage;

/// Logits of a blob that fills about a sixth of a picture, with a wavy edge.
fn logits() -> Vec<f32> {
    let side = LOGITS_SIDE as f32;
    let logit = |i: usize| {
        let (x, y) = ((i % LOGITS_SIDE) as f32, (i / LOGITS_SIDE) as f32);
        let radius = ((x - 0.4 * side).powi(2) + (y - 0.5 * side).powi(2)).sqrt();
        (0.23 * side - radius) * 0.2 + (x * 0.31).sin() * (y * 0.17).cos()
    };
    (0..LOGITS_SIDE * LOGITS_SIDE).map(logit).collect()
}

fn without_models(criterion: &mut Criterion) {
    let logits = logits();
    for (name, size, scaled) in [("512x512", (512, 512), (1024, 1024)), ("4000x3000", (4000, 3000), (1024, 768))] {
        let upsampler = Upsampler::new(size.0, size.1, scaled.0, scaled.1);
        criterion.bench_function(&format!("segment/score one mask, {name}"), |b| {
            b.iter(|| upsampler.score(&logits, 1.0));
        });
    }
    let boxes: Vec<Rect> =
        (0..1000).map(|i| Rect { x0: i % 37 * 8, y0: i % 41 * 8, x1: i % 37 * 8 + 60, y1: i % 41 * 8 + 60 }).collect();
    let scores: Vec<f32> = (0..1000).map(|i| (i * 7919 % 1000) as f32 / 1000.0).collect();
    criterion.bench_function("segment/box NMS, 1000 boxes", |b| b.iter(|| box_nms(&boxes, &scores, 0.7)));
}

fn with_models(criterion: &mut Criterion) {
    let files = match setup::obtain(&setup::Options::default(), Progress::HIDDEN) {
        Ok(files) => files,
        Err(error) => return eprintln!("skipped encode and decode: {error}"),
    };
    let sam = Sam::open(&files, None, 1).expect("the models are whole");
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/hammer/images/000.png");
    let picture: RgbImage = image::open(path).expect("the fixture is there").into_rgb8();
    criterion.bench_function("segment/scale and normalise, 512x512", |b| b.iter(|| prepare(&picture)));
    let prepared = prepare(&picture);
    let mut group = criterion.benchmark_group("segment");
    group.sample_size(10);
    group.bench_function("encode, one thread", |b| b.iter(|| sam.encode(&prepared.input)));
    let embedding = sam.encode(&prepared.input).expect("the encoder runs");
    group.bench_function("prepare an embedding", |b| b.iter(|| sam.prepare(&embedding, prepared.scaled)));
    let prepared = sam.prepare(&embedding, prepared.scaled).expect("the decoder runs");
    group.bench_function("decode one prompt, one thread", |b| {
        b.iter(|| sam.decode(&prepared, &[[512.0, 512.0]], &|_| [true; 3], |_, decoded| _ = black_box(decoded.logits)));
    });
}

criterion_group!(benches, without_models, with_models);
criterion_main!(benches);
