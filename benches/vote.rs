//! Drawing a view, and letting views vote: `cargo bench --bench vote`; the same in NumPy: `vote_numpy.py`.
//!
//! A million Gaussians on a sphere, ten views of 800 x 800 pixels from all around, two segments in every label map. Before the
//! timings, one vote by each rule prints its seconds, also as a multiple of those of a pass that only reads and blends, and
//! its memory beyond the cloud.

#![allow(clippy::disallowed_methods, reason = "a benchmark is not gprop")]

use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use gprop::camera::{Camera, Distortion, Intrinsics};
use gprop::gaussians::Gaussians;
use gprop::materials::MaterialLibrary;
use gprop::query::{Answer, Answers, Outcome, SubjectAnswer, SubjectId};
use gprop::render::{LANES, RenderOptions, Sink, Splat, render, visit};
use gprop::segment::LabelMap;
use gprop::vote::{Options, Rule, VotingView, vote};
use gprop::words::progress::Progress;
use nalgebra::{Isometry3, Point3, Vector3};

const COUNT: usize = 1_000_000;
const VIEWS: usize = 10;
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
        ..Gaussians::default()
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
    let answer = Answer::of(&MaterialLibrary::builtin().materials()[0]);
    let segment = |view: &String, segment| SubjectAnswer {
        view: view.clone(),
        subject: SubjectId::Segment(segment),
        outcome: Outcome::Answered(answer.clone()),
    };
    Answers::new(names.iter().flat_map(|view| [segment(view, 1), segment(view, 2)]).collect())
}

/// Counts weights above zero and does nothing else with them: the least that any vote must do.
#[derive(Default)]
struct Count(u64);

impl Sink for Count {
    fn add(&mut self, _: &Splat, _: usize, weights: &[f32; LANES], _: &[f32; LANES]) {
        self.0 += weights.iter().filter(|&&weight| weight > 0.0).count() as u64;
    }
}

/// A line of `/proc/self/status` in bytes; `None` if there is no such file.
fn memory(what: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(what))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? * 1024.0)
}

/// Bandwidth of reading and writing a block far larger than any cache, in bytes per second.
fn copy_bandwidth() -> f64 {
    let block = vec![1u8; 256 << 20];
    let start = Instant::now();
    let copy = std::hint::black_box(block.clone());
    2.0 * copy.len() as f64 / start.elapsed().as_secs_f64()
}

fn account(gaussians: &Gaussians, cameras: &[Camera], views: &[VotingView], answers: &Answers) {
    let start = Instant::now();
    let new = |_| Count::default();
    let counted = cameras.iter().flat_map(|camera| visit(gaussians, camera, &RenderOptions::default(), new));
    let blends: u64 = counted.map(|(_, count)| count.0).sum();
    let floor = start.elapsed().as_secs_f64();
    println!("blending alone: {floor:.2} s for {blends} blends, {:.0} million per second", blends as f64 / floor / 1e6);
    // Position, scale, rotation, opacity of every Gaussian, once per view.
    let read = (COUNT * 44 * cameras.len()) as f64;
    let bandwidth = copy_bandwidth();
    println!("reading the cloud once per view: {:.2} s at {:.1} GB/s", read / bandwidth, bandwidth / 1e9);
    for rule in [Rule::Frequency, Rule::Contribution] {
        // Resets the peak.
        let _ = std::fs::write("/proc/self/clear_refs", "5");
        let before = memory("VmRSS");
        let options = Options { vote: rule, ..Options::default() };
        let start = Instant::now();
        let field =
            vote(gaussians, views, answers, MaterialLibrary::builtin(), &options, Progress::HIDDEN).expect("votes");
        let seconds = start.elapsed().as_secs_f64();
        let most = memory("VmHWM").zip(before).map_or(f64::NAN, |(most, before)| (most - before) / COUNT as f64);
        let seen = field.views.iter().filter(|&&views| views > 0).count();
        println!(
            "{rule:?}: {seconds:.2} s, {:.1} times blending alone, {most:.0} bytes per Gaussian beyond the cloud; {seen} seen",
            seconds / floor
        );
    }
}

fn draw_and_vote(criterion: &mut Criterion) {
    let gaussians = cloud();
    let cameras: Vec<Camera> = (0..VIEWS).map(camera).collect();
    let names: Vec<String> = (0..VIEWS).map(|n| format!("{n:03}")).collect();
    let (map, answers) = (map(), answers(&names));
    let views: Vec<VotingView> =
        names.iter().zip(&cameras).map(|(name, camera)| VotingView { name, camera, map: &map }).collect();
    let library = MaterialLibrary::builtin();

    account(&gaussians, &cameras, &views, &answers);
    let mut group = criterion.benchmark_group("vote");
    group.sample_size(10);
    group.bench_function("draw a view", |bencher| {
        bencher.iter(|| render(&gaussians, &cameras[0], &RenderOptions::default()));
    });
    for rule in [Rule::Frequency, Rule::Contribution] {
        let options = Options { vote: rule, ..Options::default() };
        group.bench_function(format!("2 views by {rule:?}"), |bencher| {
            bencher
                .iter(|| vote(&gaussians, &views[..2], &answers, library, &options, Progress::HIDDEN).expect("votes"));
        });
    }
    group.finish();
}

criterion_group!(benches, draw_and_vote);
criterion_main!(benches);
