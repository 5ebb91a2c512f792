//! A falling cube: particle substeps per second and, with `-- million`, the peak memory per particle, including the grid and
//! sorting. `cargo bench --bench simulate`; `simulate_peers.py` compares it with other solvers.

#![allow(clippy::disallowed_methods, reason = "a benchmark is not gprop")]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use gprop::mpm::boundary::{Boundary, Contact};
use gprop::mpm::laws::Law;
use gprop::mpm::particles::{IDENTITY, Particle};
use gprop::mpm::{Setting, Solver};

/// Laws, each with the initial value of its state.
const LAWS: [(&str, Law, f32); 4] = [
    ("elastic", Law::FixedCorotated, 0.0),
    ("von_mises", Law::VonMises { hardening: 0.0, softening: 0.0 }, 1e3),
    ("plasticine", Law::VonMises { hardening: 0.0, softening: 0.1 }, 1e3),
    // The cone of a friction angle of 30 degrees.
    ("sand", Law::DruckerPrager { apex_pa: 0.0 }, 0.326_6),
];

/// A cube of about `count` particles, eight per cell, in a domain of `cells` cells and 2 m, dropped on a sticky floor.
fn cube(count: usize, cells: usize, law: Law, state: f32) -> (Solver, usize, f32) {
    let spacing_m = 2.0 / cells as f32;
    let side = (count as f64).cbrt().round() as usize;
    let step = spacing_m / 2.0;
    let volume_m3 = step.powi(3);
    let at = |i: usize| 1.0 + (i as f32 + 0.5 - side as f32 / 2.0) * step;
    let particles: Vec<Particle> = (0..side * side * side)
        .map(|n| Particle {
            position_m: [at(n / side / side), at(n / side % side), at(n % side)],
            velocity_m_s: [0.0, 0.0, -1.0],
            compensation_m: [0.0; 3],
            affine: [0.0; 9],
            elastic: IDENTITY,
            deformation: IDENTITY,
            mass_kg: 1000.0 * volume_m3,
            volume_m3,
            mu: 1e5 / 2.6,
            lambda: 0.3e5 / (1.3 * 0.4),
            state,
            law: 0,
        })
        .collect();
    let setting = Setting {
        spacing_m,
        gravity_m_s2: [0.0, 0.0, -9.8],
        boundaries: vec![Boundary { point_m: [0.0, 0.0, 0.5], normal: [0.0, 0.0, 1.0], contact: Contact::Sticky }],
        domain_m: [[0.0; 3], [2.0; 3]],
        laws: vec![law],
    };
    let count = particles.len();
    (Solver::new(setting, particles), count, 0.3 * spacing_m / 11.6)
}

/// A value in kB of `/proc/self/status`, in bytes.
fn status_bytes(key: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    Some(1024.0 * line.trim_end_matches("kB").trim().parse::<f64>().ok()?)
}

/// Steps of a million particles, and the memory that they take from creation on.
fn million(c: &mut Criterion) {
    let mut group = c.benchmark_group("simulate");
    group.sample_size(10);
    let mut solver = None;
    group.bench_function("million", |b| {
        let (solver, dt_s) = solver.get_or_insert_with(million_with_its_memory);
        b.iter(|| solver.step(*dt_s).expect("the cube stays in its domain"));
    });
}

/// The cube of a million particles and its time step; prints its peak memory.
fn million_with_its_memory() -> (Solver, f32) {
    // Resets the peak to the present use.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let before = status_bytes("VmHWM:");
    let (name, law, state) = LAWS[1];
    let (mut solver, particles, dt_s) = cube(1_000_000, 256, law, state);
    // Long enough to sort twice.
    for _ in 0..80 {
        solver.step(dt_s).expect("the cube stays in its domain");
    }
    if let (Some(before), Some(most)) = (before, status_bytes("VmHWM:")) {
        println!("{name}: {:.0} bytes per particle at most", (most - before) / particles as f64);
    }
    (solver, dt_s)
}

fn substeps(c: &mut Criterion) {
    const STEPS: usize = 20;
    let mut group = c.benchmark_group("simulate");
    group.sample_size(10);
    for (name, law, state) in LAWS {
        for (count, cells) in [(20_000, 64), (100_000, 128)] {
            for threads in [1, 2] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
                let (mut solver, particles, dt_s) = cube(count, cells, law, state);
                group.throughput(Throughput::Elements((particles * STEPS) as u64));
                group.bench_function(BenchmarkId::new(name, format!("{count}/{cells}^3/{threads} threads")), |b| {
                    b.iter(|| {
                        pool.install(|| {
                            for _ in 0..STEPS {
                                solver.step(dt_s).expect("the cube stays in its domain");
                            }
                        });
                    });
                });
            }
        }
    }
}

criterion_group!(benches, substeps, million);
criterion_main!(benches);
