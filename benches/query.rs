//! The query stage without a model: drawing the sheets of a view, and replaying a scene's answers from recordings.

use std::borrow::Cow;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use gprop::consensus::AskAbout;
use gprop::materials::MaterialLibrary;
use gprop::query::ask::budget::Budget;
use gprop::query::recorded::{Answerer, Recording, Recordings};
use gprop::query::{Options, Prompts, Queries, ViewSubjects};
use gprop::scene::{ForegroundSource, Photo};
use gprop::segment::{LabelMap, Level, Segment, ViewSegments};
use gprop::words::progress::Progress;
use image::{GrayImage, Luma, Rgb, RgbImage};
use serde_json::{Value, json};

const SIDE: u32 = 512;
/// Segments of a view, side by side; SAM's middle level finds four to ten on an everyday object.
const SEGMENTS: u16 = 8;

fn view() -> (Photo, ViewSegments) {
    let label = |x: u32, y: u32| match (x, y) {
        (50..450, 100..400) => 1 + ((x - 50) * u32::from(SEGMENTS) / 400) as u16,
        _ => 0,
    };
    let rgb = RgbImage::from_fn(SIDE, SIDE, |x, y| match label(x, y) {
        0 => Rgb([255; 3]),
        segment => Rgb([segment as u8 * 25, (x * 7 % 200) as u8, (y * 5 % 200) as u8]),
    });
    let foreground = GrayImage::from_fn(SIDE, SIDE, |x, y| Luma([if label(x, y) == 0 { 0 } else { 255 }]));
    let labels = (0..SIDE * SIDE).map(|index| label(index % SIDE, index / SIDE)).collect();
    let segment = |id| Segment {
        id,
        area: 15_000,
        bbox: [50, 100, 400, 300],
        predicted_iou: 0.9,
        stability_score: 0.95,
        level: Level::Middle,
        parent: 0,
    };
    let map = LabelMap { width: SIDE, height: SIDE, labels };
    (
        Photo { rgb, foreground, foreground_source: ForegroundSource::Alpha, over_white: true },
        ViewSegments { view: "view".into(), map, segments: (1..=SEGMENTS).map(segment).collect() },
    )
}

fn answer(library: &MaterialLibrary) -> String {
    let row = &library.materials()[0];
    json!({
        "caption": "a part", "several_materials": false, "family": row.family, "material": row.name,
        "density_kg_m3": row.density_kg_m3, "youngs_modulus_mpa": [1, 1e6], "poisson_ratio": row.poisson_ratio,
        "yield_strength_mpa": [0.001, 1e4], "shore_scale": "none", "shore_hardness": null,
        "friction_rubber": row.friction_rubber, "form": "solid", "wall_thickness_mm": null, "confidence": 0.5
    })
    .to_string()
}

fn bench(criterion: &mut Criterion) {
    let (photo, segments) = view();
    let library = MaterialLibrary::builtin();
    let (prompts, options) = (Prompts::builtin(), Options::default());
    let ids: Vec<u16> = (1..=SEGMENTS).collect();
    let maps = [Cow::Borrowed(&segments.map)];
    let inputs = [ViewSubjects { name: "view", photo: &photo, maps: &maps, ids: &ids }];
    criterion.bench_function("query/sheets of a view with 8 segments", |bencher| {
        bencher.iter(|| {
            Queries::prepare(black_box(&inputs), library, &prompts, &options, AskAbout::Segments)
                .expect("the view is sound")
        });
    });

    let folder = tempfile::tempdir().expect("a temporary folder");
    let recordings = Recordings::open(&[], folder.path()).expect("the folder is empty");
    let queries =
        Queries::prepare(&inputs, library, &prompts, &options, AskAbout::Segments).expect("the view is sound");
    let answerer = Answerer { model: "bench".into(), parameters: Value::Null };
    for segment in &queries.subjects {
        let asked = segment.asked(queries.questions.first());
        let recording = Recording::new(&answerer, asked, answer(library), None, None);
        recordings.insert(&recording).expect("the folder is writable");
    }
    criterion.bench_function("query/replay of 8 segments", |bencher| {
        bencher.iter(|| {
            queries.run(&recordings, None, &Budget::new(None, None), Progress::HIDDEN).expect("all is recorded")
        });
    });
}

criterion_group!(benches, bench);
criterion_main!(benches);
