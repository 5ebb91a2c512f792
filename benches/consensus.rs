//! Finding the parts of the hammer's 28,736 Gaussians in ten views, whose true part maps stand in for SAM's segments; then with
//! each Gaussian split into 35 pieces, 1,005,760 in all. For both it prints the peak memory.

mod pieces;

use std::alloc::{GlobalAlloc, Layout, System};
use std::collections::BTreeSet;
use std::hint::black_box;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use criterion::{Criterion, criterion_group, criterion_main};
use gprop::consensus::{Parts, SegmentedView, find};
use gprop::gaussians::Gaussians;
use gprop::scene::{self, View};
use gprop::segment::{LabelMap, Level, Segment, ViewSegments};
use gprop::words::progress::Progress;
use pieces::in_pieces;

/// Counts the bytes in use.
struct Counting;

static IN_USE: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = IN_USE.fetch_add(layout.size(), Relaxed) + layout.size();
        MOST.fetch_max(now, Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The true part map of a view as its segments.
fn segments(folder: &Path, view: &View) -> ViewSegments {
    let path = folder.join("ground_truth/part_maps").join(format!("{}.png", view.name));
    let parts = image::open(path).expect("the fixture has a part map for every view").into_luma8();
    let labels: Vec<u16> = parts.as_raw().iter().map(|&part| u16::from(part.wrapping_add(1))).collect();
    let ids: BTreeSet<u16> = labels.iter().copied().filter(|&id| id > 0).collect();
    let last = ids.last().copied().unwrap_or(0);
    let segment = |id| Segment {
        id,
        area: labels.iter().filter(|&&other| other == id).count() as u32,
        bbox: [0, 0, parts.width(), parts.height()],
        predicted_iou: 1.0,
        stability_score: 1.0,
        level: Level::Small,
        parent: 0,
    };
    let segments = (1..=last).map(segment).collect();
    ViewSegments {
        view: view.name.clone(),
        segments,
        map: LabelMap { width: parts.width(), height: parts.height(), labels },
    }
}

fn bench(c: &mut Criterion) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer");
    let options = scene::Options::default();
    let scene = scene::load(&folder, &options).expect("the fixture is a scene");
    let chosen = scene.chosen_views(&options).expect("the fixture has views");
    let segments: Vec<ViewSegments> = chosen.iter().map(|view| segments(&folder, view)).collect();
    let found = |cloud: &Gaussians| -> Parts {
        let views = chosen.iter().zip(&segments);
        let views: Vec<SegmentedView> =
            views.map(|(view, segments)| SegmentedView { camera: &view.camera, cloud, segments }).collect();
        find(cloud, &[], &views, Progress::HIDDEN)
    };
    let mut group = c.benchmark_group("parts from ten views");
    group.sample_size(10);
    let mut of = |cloud: &Gaussians, name: &str| {
        let before = IN_USE.load(Relaxed);
        MOST.store(before, Relaxed);
        let parts = found(cloud);
        let bytes = MOST.load(Relaxed) - before;
        println!("{name}: {} parts; {} bytes per Gaussian at most", parts.count(), bytes / cloud.len());
        group.bench_function(name, |b| b.iter(|| black_box(found(cloud))));
    };
    of(&scene.gaussians, "28,736 Gaussians");
    of(&in_pieces(&scene.gaussians), "1,005,760 Gaussians");
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
