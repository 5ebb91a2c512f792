//! Drawing a view, and letting views vote: `cargo bench --bench vote`.
//!
//! A million Gaussians on a sphere, views of 800 x 800 pixels from all around, two parts in every label map.

use criterion::{Criterion, criterion_group, criterion_main};
use gprop::camera::{Camera, Distortion, Intrinsics};
use gprop::materials::MaterialLibrary;
use gprop::progress::Progress;
use gprop::query::{Answer, Answers, Form, Match, Outcome, PartAnswer};
use gprop::scene::gaussians::Gaussians;
use gprop::segment::LabelMap;
use gprop::vote::raster::{RenderOptions, render};
use gprop::vote::{Options, Rule, ViewInput, vote};
use nalgebra::{Isometry3, Point3, Vector3};

const COUNT: usize = 1_000_000;
const VIEWS: usize = 2;
const SIZE: u32 = 800;

/// Points spread evenly over the unit sphere (Fibonacci's spiral).
fn on_sphere(n: usize, count: usize) -> Vector3<f64> {
    let z = 1.0 - (2.0 * n as f64 + 1.0) / count as f64;
    let (sin, cos) = (n as f64 * std::f64::consts::PI * (3.0 - 5.0f64.sqrt())).sin_cos();
    Vector3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + Vector3::z() * z
}

fn cloud() -> Gaussians {
    Gaussians {
        positions: (0..COUNT).map(|n| on_sphere(n, COUNT).map(|v| v as f32).into()).collect(),
        // About one and a half times the distance between neighbours.
        log_scales: vec![[0.005f32.ln(); 3]; COUNT],
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; COUNT],
        opacity_logits: vec![1.0; COUNT],
        sh_dc: vec![[0.5; 3]; COUNT],
        sh_degree: 3,
        sh_rest: vec![0.01; COUNT * 45],
        antialiased: false,
        extra: Vec::new(),
    }
}

fn camera(n: usize) -> Camera {
    let size = f64::from(SIZE);
    let intrinsics = Intrinsics {
        width: SIZE,
        height: SIZE,
        fx: 1.2 * size,
        fy: 1.2 * size,
        cx: 0.5 * size,
        cy: 0.5 * size,
        distortion: Distortion::default(),
    };
    let eye = Point3::from(on_sphere(n, VIEWS) * 3.0);
    let flip = Isometry3::rotation(Vector3::x() * std::f64::consts::PI);
    let view = Isometry3::look_at_rh(&eye, &Point3::origin(), &Vector3::new(0.1, 0.2, 1.0));
    Camera { intrinsics, camera_from_world: flip * view }
}

/// Left half 1, right half 2.
fn map() -> LabelMap {
    let labels = (0..SIZE * SIZE).map(|pixel| 1 + u16::from(pixel % SIZE >= SIZE / 2)).collect();
    LabelMap { width: SIZE, height: SIZE, labels }
}

fn answers(names: &[String]) -> Answers {
    let material = &MaterialLibrary::builtin().materials()[0];
    let answer = Answer {
        caption: "half".to_owned(),
        family: material.family.clone(),
        material: material.name.clone(),
        density_kg_m3: material.density_kg_m3,
        youngs_modulus_pa: material.youngs_modulus_pa,
        poisson_ratio: material.poisson_ratio,
        yield_strength_pa: material.strength_pa,
        hardness: material.hardness,
        friction_rubber: material.friction_rubber,
        form: Form::Solid,
        confidence: 1.0,
        matched: Match::Exact,
        flags: Vec::new(),
    };
    let part =
        |view: &String, part| PartAnswer { view: view.clone(), part, outcome: Outcome::Answered(answer.clone()) };
    Answers { parts: names.iter().flat_map(|view| [part(view, 1), part(view, 2)]).collect() }
}

fn draw_and_vote(criterion: &mut Criterion) {
    let gaussians = cloud();
    let cameras: Vec<Camera> = (0..VIEWS).map(camera).collect();
    let names: Vec<String> = (0..VIEWS).map(|n| format!("{n:03}")).collect();
    let (map, answers) = (map(), answers(&names));
    let views: Vec<ViewInput> =
        names.iter().zip(&cameras).map(|(name, camera)| ViewInput { name, camera, map: &map }).collect();
    let library = MaterialLibrary::builtin();

    let mut group = criterion.benchmark_group("vote");
    group.sample_size(10);
    group.bench_function("draw a view", |bencher| {
        bencher.iter(|| render(&gaussians, &cameras[0], &RenderOptions::default()));
    });
    for rule in [Rule::Frequency, Rule::Contribution] {
        let options = Options { vote: rule, ..Options::default() };
        group.bench_function(format!("{VIEWS} views by {rule:?}"), |bencher| {
            bencher.iter(|| vote(&gaussians, &views, &answers, library, &options, Progress::Hidden).expect("votes"));
        });
    }
    group.finish();
}

criterion_group!(benches, draw_and_vote);
criterion_main!(benches);
