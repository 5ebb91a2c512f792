use std::collections::BTreeSet;
use std::error::Error;

use gprop::film::{self, Size};
use gprop::gaussians::Gaussians;
use gprop::materials::Law;
use gprop::render::sh_color;
use gprop::simulate::animation::{Film, Shooting, Viewpoint};
use gprop::simulate::checkpoint::{Checkpoint, Snapshot};
use gprop::simulate::filling::{FillPoint, Parcel, fill};
use gprop::simulate::material::{Material, Soften};
use gprop::simulate::rigid::choice::{HARDLY_VISIBLE, INVISIBLE, Load, Reason, choose};
use gprop::simulate::{Frame, Ground, Input, Options, SimulateError, SimulationReport, simulate, simulated};
use gprop::words::progress::Progress;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::support::skipped;

/// A bar of two materials: Gaussians on its faces, cells inside.
struct Bar {
    gaussians: Gaussians,
    labels: Vec<u32>,
    materials: Vec<Material>,
    interior: Vec<FillPoint>,
}

/// Scene units of the bar: decimetres.
const METERS_PER_UNIT: f64 = 0.1;
const SIZE: [f64; 3] = [4.0, 1.0, 0.8];
const CELL: f64 = 0.1;

impl Bar {
    fn new() -> Self {
        let counts = SIZE.map(|s| (s / CELL).round() as usize);
        let mut bar = Self {
            gaussians: Gaussians { sh_degree: 3, ..Gaussians::default() },
            labels: vec![],
            materials: materials(),
            interior: vec![],
        };
        for n in 0..counts.iter().product() {
            let at = [n % counts[0], n / counts[0] % counts[1], n / (counts[0] * counts[1])];
            let position = at.map(|i| (i as f64 + 0.5) * CELL);
            let label = u32::from(position[0] > 3.0);
            bar.interior.push(FillPoint { position, label, volume: CELL.powi(3) });
            if (0..3).any(|a| at[a] == 0 || at[a] + 1 == counts[a]) {
                bar.labels.push(label);
                bar.push(n, position);
            }
        }
        bar
    }

    /// Adds a flat Gaussian whose colour depends on the direction.
    fn push(&mut self, n: usize, position: [f64; 3]) {
        let wave = |k: usize| ((n * 7 + k * 13) % 29) as f32 / 29.0 - 0.5;
        let g = &mut self.gaussians;
        g.positions.push(position.map(|x| x as f32));
        g.log_scales.push([-2.5, -3.0 + wave(1), -5.0]);
        g.rotations.push([1.0, wave(2), wave(3), wave(4)]);
        g.opacity_logits.push(3.0);
        g.sh_dc.push([0.9, -0.4, -0.8]);
        g.sh_rest.extend((0..45).map(|k| 0.3 * wave(k)));
    }

    fn input(&self) -> Input<'_> {
        Input {
            gaussians: &self.gaussians,
            labels: &self.labels,
            materials: &self.materials,
            interior: &self.interior,
            meters_per_unit: Some(METERS_PER_UNIT),
        }
    }
}

fn materials() -> Vec<Material> {
    let wood = Material {
        name: "oak".to_owned(),
        part_id: 1,
        caption: "handle".to_owned(),
        density_kg_m3: 700.0,
        youngs_modulus_pa: 1e10,
        poisson_ratio: 0.35,
        strength_pa: 5e7,
        law: Law::Elastic,
        moves_with: None,
    };
    let lead = Material {
        name: "lead".to_owned(),
        part_id: 2,
        caption: "head".to_owned(),
        density_kg_m3: 11340.0,
        youngs_modulus_pa: 1.6e10,
        poisson_ratio: 0.48,
        strength_pa: 1.2e7,
        law: Law::VonMises { yield_stress_pa: 1.2e7 },
        moves_with: None,
    };
    vec![wood, lead]
}

/// A short drop of an object that deforms as a whole, much softer than it is.
fn options() -> Options {
    Options { max_stiffness: Some(2e5), rigid: vec!["never".to_owned()], ..true_stiffness() }
}

fn true_stiffness() -> Options {
    Options { drop_height: 0.1, duration: Some(0.2), frames: 6, grid: 16, ..Options::default() }
}

/// All frames and the report of a run from the start.
fn run(input: &Input, options: &Options) -> (Vec<Frame>, SimulationReport) {
    let mut frames = Vec::new();
    let mut keep = |frame: &Frame, _: &Snapshot| {
        frames.push(frame.clone());
        Ok::<_, SimulateError>(())
    };
    let report = simulate(input, options, None, &mut keep, Progress::HIDDEN).unwrap();
    (frames, report)
}

#[test]
fn drops_the_object_and_reports_what_it_did() {
    let bar = Bar::new();
    let (frames, report) = run(&bar.input(), &options());
    assert_eq!(frames.len(), 6);
    assert_eq!(report.frames, frames.iter().map(|f| f.summary).collect::<Vec<_>>());
    // 0.1 m x 0.08 m x (0.3 m of oak and 0.1 m of lead).
    let mass = 0.008 * (0.3 * 700.0 + 0.1 * 11340.0);
    assert!((report.mass_kg / mass - 1.0).abs() < 1e-5, "{} kg, expected {mass}", report.mass_kg);
    assert_eq!(report.particles, bar.gaussians.len() + report.fill_particles);
    let filled: Vec<(&str, usize)> = report.filled.iter().map(|f| (f.part.as_str(), f.gaussians)).collect();
    let head = bar.labels.iter().filter(|l| **l == 1).count();
    assert_eq!(filled, [("handle", bar.gaussians.len() - head), ("head", head)]);
    assert!((report.filled[1].volume_m3 - 0.1 * 0.008).abs() < 1e-9 && report.filled.iter().all(|f| !f.skin));
    let softened: Vec<(&str, f64)> = report.softened.iter().map(|s| (s.material.as_str(), s.factor)).collect();
    assert_eq!(softened, [("oak", 2e5 / 1e10), ("lead", 2e5 / 1.6e10)]);
    assert_eq!(report.poisson_capped.len(), 1);
    // The step that the bound allows the softened material with the fastest waves: oak.
    assert_eq!(report.time_step.stiffest_material.as_deref(), Some("oak"));
    assert!(report.rigid.is_empty(), "{:?}", report.rigid);
    let (mu, lambda) = gprop::simulate::material::lame(2e5, 0.35);
    let wave = ((lambda + 2.0 * mu) / 700.0_f64).sqrt();
    assert!(report.dt_s <= 0.4 * report.grid_spacing_m / wave, "{} s", report.dt_s);
    // The longest step times their number is at least the whole time, since steps are shortened to end with a frame.
    assert!(report.substeps as f64 * report.dt_s >= 0.2 - 1e-9 && report.substeps > 100);
    // It falls freely by g t^2 / 2 within the first frame, and lies on the ground, to within a grid cell, in the last.
    let fallen = frames[0].summary.center_of_mass_m[2] - frames[1].summary.center_of_mass_m[2];
    assert!((fallen - 0.5 * 9.8 * 0.04 * 0.04).abs() < 1e-4, "{fallen} m");
    let lowest = frames[5].gaussians.positions.iter().map(|p| f64::from(p[2])).fold(f64::INFINITY, f64::min);
    let ground = report.ground_z_m / METERS_PER_UNIT;
    let spacing = report.grid_spacing_m / METERS_PER_UNIT;
    assert!((lowest - ground).abs() < spacing, "lowest at {lowest}, ground {ground}, spacing {spacing}");
}

/// A common factor keeps the ratio of what deforms; what is rigid, or not there at all, does not count.
#[test]
fn softening_by_a_common_factor_keeps_the_ratios() {
    let mut bar = soft_handle();
    let stiffer = Material { name: "steel".to_owned(), youngs_modulus_pa: 2e11, ..bar.materials[1].clone() };
    bar.materials.push(stiffer);
    let softened = |soften: Soften, rigid: &str| -> Vec<(String, f64)> {
        let short = Options { soften, rigid: vec![rigid.to_owned()], duration: Some(1e-4), frames: 2, ..options() };
        run(&bar.input(), &short).1.softened.into_iter().map(|s| (s.material, s.factor)).collect()
    };
    let owned =
        |rows: &[(&str, f64)]| rows.iter().map(|(name, factor)| ((*name).to_owned(), *factor)).collect::<Vec<_>>();
    // Of the handle, 1e6 Pa, and the head, 1.6e10 Pa, to 2e5 Pa.
    assert_eq!(softened(Soften::Cap, "never"), owned(&[("oak", 0.2), ("lead", 2e5 / 1.6e10)]));
    assert_eq!(softened(Soften::Common, "never"), owned(&[("oak", 2e5 / 1.6e10), ("lead", 2e5 / 1.6e10)]));
    assert_eq!(softened(Soften::Common, "head"), owned(&[("oak", 0.2)]));
}

/// The first frame is the scene, tilted as a whole: positions, covariances, colours from rotated directions.
#[test]
fn first_frame_is_the_tilted_scene() {
    let bar = Bar::new();
    let frame = &run(&bar.input(), &Options { frames: 2, duration: Some(1e-4), ..options() }).0[0];
    let (old, new) = (&bar.gaussians, &frame.gaussians);
    let matrix = |g: &Gaussians| {
        let edge = |i: usize| g.center(i) - g.center(0);
        Matrix3::from_columns(&[edge(39), edge(500), edge(old.len() - 1)])
    };
    let turn = matrix(new) * matrix(old).try_inverse().unwrap();
    assert!((turn.transpose() * turn - Matrix3::identity()).norm() < 1e-3, "{turn}");
    let tilt = UnitQuaternion::from_matrix(&turn).angle().to_degrees();
    assert!(tilt > 20.0 && tilt < 35.0, "{tilt} degrees");
    let direction = Vector3::new(0.48, -0.6, 0.64);
    for i in (0..old.len()).step_by(17) {
        let expected = turn * old.covariance(i) * turn.transpose();
        assert!((new.covariance(i) - expected).norm() < 1e-3 * expected.norm(), "Gaussian {i}");
        let before = sh_color(old, i, direction.map(|x| x as f32).into());
        let after = sh_color(new, i, (turn * direction).map(|x| x as f32).into());
        for c in 0..3 {
            assert!((before[c] - after[c]).abs() < 1e-3, "Gaussian {i}: {before:?} became {after:?}");
        }
    }
}

/// Oak and lead do not deform visibly in a fall of 4 cm: they move as one body, in a few steps, and keep their shape.
#[test]
fn stiff_parts_move_as_one_body() {
    let bar = Bar::new();
    let long = Options { duration: Some(1.0), ..true_stiffness() };
    let (frames, report) = run(&bar.input(), &long);
    let rigid: Vec<(&str, u32, Reason)> = report.rigid.iter().map(|p| (p.part.as_str(), p.body, p.because)).collect();
    assert_eq!(rigid, [("handle", 0, Reason::Stiff), ("head", 0, Reason::Stiff)]);
    assert!(report.softened.is_empty() && report.time_step.stiffest_material.is_none());
    assert!(report.substeps < 100 * 5, "{} steps for five frames", report.substeps);
    // v sqrt(rho / E) + rho g l / E with v from 0.1 longest sides of 0.4 m.
    let expected = (2.0 * 9.8 * 0.04 * 11340.0 / 1.6e10_f64).sqrt() + 11340.0 * 9.8 * 0.4 / 1.6e10;
    assert!((report.rigid[1].strain / expected - 1.0).abs() < 0.02, "{} {expected}", report.rigid[1].strain);
    let shape = |frame: &Frame| (frame.gaussians.center(0) - frame.gaussians.center(frame.gaussians.len() - 1)).norm();
    for frame in &frames {
        let change = shape(frame) / shape(&frames[0]) - 1.0;
        assert!(change.abs() < 1e-5, "frame {}: the shape changed by {change}", frame.index);
        let lowest = frame.gaussians.positions.iter().map(|p| f64::from(p[2])).fold(f64::INFINITY, f64::min);
        let gap = lowest - report.ground_z_m / METERS_PER_UNIT;
        assert!(gap > -1e-4, "frame {}: {gap} units below the ground", frame.index);
    }
    // It has come to rest on a face, without any energy left.
    let [before, last] = [&frames[4], &frames[5]].map(|frame| frame.summary.kinetic_energy_j);
    assert!(before < 1e-6 && last < 1e-6, "{before} J and {last} J");
    // Lead bears 12 MPa; a corner of it does not survive ground that does not give.
    for part in &report.rigid {
        assert_eq!(part.dents, part.peak_pressure_pa > part.strength_pa);
        assert!(part.peak_pressure_pa > 0.0, "{part:?}");
    }
    assert!(report.rigid[1].dents, "{:?}", report.rigid[1]);
}

/// A bar with a handle of rubber: it deforms, the head does not.
fn soft_handle() -> Bar {
    let mut bar = Bar::new();
    bar.materials[0].youngs_modulus_pa = 1e6;
    bar
}

/// The names of `--rigid` decide; a soft part that deforms has its true stiffness.
#[test]
fn the_user_chooses_what_is_rigid() {
    let bar = soft_handle();
    let rigid = |words: &[&str]| {
        let rigid = words.iter().map(|word| (*word).to_owned()).collect();
        let short = Options { duration: Some(0.01), frames: 2, rigid, ..true_stiffness() };
        let mut keep = |_: &Frame, _: &Snapshot| Ok::<_, SimulateError>(());
        simulate(&bar.input(), &short, None, &mut keep, Progress::HIDDEN)
    };
    let names = |report: SimulationReport| -> Vec<String> { report.rigid.into_iter().map(|part| part.part).collect() };
    let auto = rigid(&["auto"]).unwrap();
    assert_eq!((names(auto.clone()), auto.softened), (vec!["head".to_owned()], vec![]));
    assert_eq!(names(rigid(&["handle"]).unwrap()), ["handle"]);
    assert_eq!(names(rigid(&["head", "oak"]).unwrap()), ["handle", "head"]);
    let mut pot = bar.materials.clone();
    (pot[0].caption, pot[1].caption) = ("lid".to_owned(), "lid knob".to_owned());
    let parcel = |label: u32| Parcel { position_m: [f64::from(label), 0.0, 0.0], label, volume_m3: 1e-3, backed: true };
    let parcels = [0, 1].map(parcel);
    let chosen = |word: &str| {
        let load = Load::new(0.0, 9.8, 0.4, &[]);
        let reasons = choose(&[word.to_owned()], &load, &pot, &parcels, 0.025, INVISIBLE).unwrap().reasons;
        reasons.iter().map(Option::is_some).collect::<Vec<_>>()
    };
    // The exact name of a part means no other part.
    assert_eq!(
        [chosen("lid"), chosen("Lids"), chosen("knob")],
        [vec![true, false], vec![true, true], vec![false, true]]
    );
    assert!(rigid(&["never"]).unwrap().rigid.is_empty());
    let why = rigid(&["auto", "head"]).unwrap_err().to_string();
    assert!(why.contains("--rigid auto has to be given alone"), "{why}");
    let why = rigid(&["lid"]).unwrap_err().to_string();
    assert!(why.contains("`lid`") && why.contains("`handle`, `head`"), "{why}");
    // One end is pulled away from the other.
    let pulled = Options { scenario: "stretch".to_owned(), duration: Some(0.01), frames: 2, ..true_stiffness() };
    assert!(run(&bar.input(), &pulled).1.rigid.is_empty());
}

/// A point of the inside below the object's bounds, which leave out a few strays, does not carry the object.
#[test]
fn what_stands_on_the_ground_stays_there() {
    let mut bar = Bar::new();
    let position = [2.05, 0.55, -0.35];
    bar.interior.push(FillPoint { position, label: 0, volume: CELL.powi(3) });
    bar.labels.push(0);
    bar.push(0, position);
    let still = Options { drop_height: 0.0, tilt_deg: 0.0, duration: Some(0.02), frames: 2, ..true_stiffness() };
    let (frames, report) = run(&bar.input(), &still);
    assert_eq!(report.rigid.len(), 2, "{:?}", report.rigid);
    let [first, last] = [&frames[0], &frames[1]].map(|frame| frame.gaussians.center(0));
    // In free fall it would move by 0.02 units in this time; f32 positions are exact to 1e-5 units.
    assert!((last - first).norm() < 1e-3, "{first} moved to {last}");
    assert!((first.z - bar.gaussians.center(0).z).abs() < 1e-3, "it began at {first}");
}

/// A fall that ends in the air takes one step per frame, which does not count as a substep.
#[test]
fn free_fall_takes_no_substeps() {
    let bar = Bar::new();
    let high = Options { drop_height: 5.0, duration: Some(0.1), frames: 2, ..true_stiffness() };
    let report = run(&bar.input(), &high).1;
    assert_eq!((report.substeps, report.dt_s), (0, 0.0));
    let fallen = report.frames[0].center_of_mass_m[2] - report.frames[1].center_of_mass_m[2];
    // f32 positions some metres from the origin.
    assert!((fallen - 0.5 * report.gravity_m_s2 * 0.1 * 0.1).abs() < 1e-6, "{fallen} m");
}

/// The handle bends by less than a hundredth: if that cannot be simulated in time, it is rigid. The head is soft.
#[test]
fn what_is_too_stiff_to_simulate_in_time_is_rigid() {
    let mut bar = Bar::new();
    (bar.materials[0].youngs_modulus_pa, bar.materials[1].youngs_modulus_pa) = (3e9, 3e7);
    let positions: Vec<[f64; 3]> =
        (0..bar.gaussians.len()).map(|i| (bar.gaussians.center(i) * METERS_PER_UNIT).into()).collect();
    let parcels = fill(&positions, &bar.labels, &bar.interior, METERS_PER_UNIT, 0.025).unwrap().parcels;
    let load = Load::new(2.0, 9.8, 0.4, &[]);
    let reasons = |asked: &str, visible: f64| {
        choose(&[asked.to_owned()], &load, &bar.materials, &parcels, 0.025, visible).unwrap().reasons
    };
    assert_eq!(reasons("auto", INVISIBLE), [None, None]);
    assert_eq!(reasons("auto", HARDLY_VISIBLE), [Some(Reason::TooSlow), None]);
    assert_eq!(reasons("never", HARDLY_VISIBLE), [None, None]);
    // A drop of an hour in steps of microseconds cannot wait.
    let hour = Options {
        drop_height: 5.0,
        duration: Some(3600.0),
        frames: 2,
        max_simulation_minutes: 0.01,
        ..Options::default()
    };
    let refused = simulate(&bar.input(), &hour, None, &mut |_, _| panic!("it began"), Progress::HIDDEN);
    let Err(SimulateError::TooLong { minutes, .. }) = refused else { panic!("{refused:?}") };
    let alone = Options { max_stiffness: Some(2e7), rigid: vec!["handle".to_owned()], ..hour };
    let refused = simulate(&bar.input(), &alone, None, &mut |_, _| panic!("it began"), Progress::HIDDEN);
    let Err(SimulateError::TooLong { minutes: expected, .. }) = refused else { panic!("{refused:?}") };
    assert_eq!(minutes, expected, "the head is softened to 2e7 Pa, and the handle rigid");
}

/// A thin soft sleeve on a rigid bar moves with it.
#[test]
fn layers_move_with_what_they_lie_on() {
    let mut bar = Bar::new();
    bar.materials.push(Material {
        name: "rubber".to_owned(),
        caption: "sleeve".to_owned(),
        youngs_modulus_pa: 1e6,
        ..bar.materials[0].clone()
    });
    for point in &mut bar.interior {
        if point.position[0] < 1.0 && point.position[2] > 0.7 {
            point.label = 2;
        }
    }
    for (label, position) in bar.labels.iter_mut().zip(&bar.gaussians.positions) {
        if position[0] < 1.0 && position[2] > 0.7 {
            *label = 2;
        }
    }
    let report = run(&bar.input(), &Options { duration: Some(0.01), frames: 2, ..true_stiffness() }).1;
    let layers: Vec<(&str, Reason)> = report.rigid.iter().map(|part| (part.part.as_str(), part.because)).collect();
    assert_eq!(layers, [("handle", Reason::Stiff), ("head", Reason::Stiff), ("sleeve", Reason::Layer)]);
    assert!(report.rigid.iter().all(|part| part.body == 0), "{:?}", report.rigid);
}

#[test]
fn same_bytes_on_one_two_and_three_threads() {
    for (bar, options) in [(Bar::new(), options()), (soft_handle(), true_stiffness())] {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run(&bar.input(), &options))
        };
        let one = on(1);
        assert!(one == on(2), "two threads differ from one");
        assert!(one == on(3), "three threads differ from one");
    }
}

#[test]
fn resumed_run_ends_in_the_same_bytes() {
    resumes(&Bar::new(), &options);
    resumes(&Bar::new(), &true_stiffness);
    resumes(&soft_handle(), &true_stiffness);
}

fn resumes(bar: &Bar, options: &dyn Fn() -> Options) {
    let (frames, report) = run(&bar.input(), &options());
    let mut saved = Vec::new();
    let mut stop_after_two = |frame: &Frame, snapshot: &Snapshot| {
        saved.clear();
        snapshot.write(&mut saved)?;
        if frame.index == 2 { Err(anyhow::anyhow!("the machine went down")) } else { Ok(()) }
    };
    let stopped = simulate(&bar.input(), &options(), None, &mut stop_after_two, Progress::HIDDEN);
    assert_eq!(stopped.unwrap_err().to_string(), "the machine went down");
    let checkpoint = Checkpoint::from_bytes(&saved).unwrap();
    assert_eq!(checkpoint.frames(), 3);
    let mut rest = Vec::new();
    let mut keep = |frame: &Frame, _: &Snapshot| {
        rest.push(frame.clone());
        Ok::<_, SimulateError>(())
    };
    let resumed = simulate(&bar.input(), &options(), Some(checkpoint.clone()), &mut keep, Progress::HIDDEN).unwrap();
    assert!(rest == frames[3..], "the resumed frames differ");
    assert_eq!(resumed, report);

    let other = Options { gravity: 1.6, ..options() };
    let foreign = simulate(&bar.input(), &other, Some(checkpoint), &mut |_, _| Ok(()), Progress::HIDDEN);
    assert!(matches!(foreign, Err(SimulateError::Checkpoint(_))), "{foreign:?}");
    for cut in [0, 7, 40, 60, saved.len() - 1] {
        assert!(matches!(Checkpoint::from_bytes(&saved[..cut]), Err(SimulateError::Checkpoint(_))), "cut at {cut}");
    }
}

/// A checkpoint whose numbers were changed: a particle with a law that does not exist, a particle and a rigid body far
/// outside the domain.
#[test]
fn a_checkpoint_with_a_damaged_state_is_refused() {
    const PARTICLE_BYTES: usize = 4 * 42;
    let bar = Bar::new();
    let short = |options: Options| Options { frames: 2, duration: Some(1e-3), ..options };
    let refused = |options: Options, damage: &dyn Fn(&mut [u8])| {
        let mut saved: Vec<u8> = Vec::new();
        let mut keep = |_: &Frame, snapshot: &Snapshot| {
            saved.clear();
            snapshot.write(&mut saved)?;
            Ok::<_, anyhow::Error>(())
        };
        simulate(&bar.input(), &options, None, &mut keep, Progress::HIDDEN).unwrap();
        damage(&mut saved);
        let checkpoint = Checkpoint::from_bytes(&saved).unwrap();
        match simulate(&bar.input(), &options, Some(checkpoint), &mut |_, _| Ok(()), Progress::HIDDEN) {
            Err(SimulateError::Checkpoint(why)) => why,
            other => panic!("{other:?}"),
        }
    };
    let law = |bytes: &mut [u8]| *bytes.last_chunk_mut().unwrap() = u32::MAX.to_le_bytes();
    assert!(refused(short(options()), &law).contains("particles"));
    let position = |bytes: &mut [u8]| {
        let last = bytes.len() - PARTICLE_BYTES;
        bytes[last..last + 4].copy_from_slice(&1e30_f32.to_le_bytes());
    };
    assert!(refused(short(options()), &position).contains("particles"));
    // A velocity that is not a number, and another mass: words 6 and 36.
    for (word, value) in [(6, f32::NAN), (36, 1e30)] {
        let number = |bytes: &mut [u8]| {
            let at = bytes.len() - PARTICLE_BYTES + 4 * word;
            bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        };
        assert!(refused(short(options()), &number).contains("particles"));
    }
    // A frame at another time.
    let time = |bytes: &mut [u8]| {
        let at = bytes.windows(10).position(|text| text == b"\"t_s\":0.0,").unwrap();
        bytes[at + 6] = b'9';
    };
    assert!(refused(short(options()), &time).contains("frames"));
    // Magic, version and identity; the record with its length; how many numbers follow; the body's centre of mass.
    let center = |bytes: &mut [u8]| {
        let record = u64::from_le_bytes(bytes[44..52].try_into().unwrap()) as usize;
        let first = 52 + record + 8;
        bytes[first..first + 8].copy_from_slice(&1e30_f64.to_le_bytes());
    };
    assert!(refused(short(true_stiffness()), &center).contains("rigid bodies"));
}

/// The field may have a part of which nothing is simulated, because all of its Gaussians were set aside.
#[test]
fn nothing_acts_on_a_part_that_is_not_simulated() {
    let mut bar = Bar::new();
    let lid = Material { name: "cork".to_owned(), caption: "lid".to_owned(), ..bar.materials[0].clone() };
    bar.materials.push(lid);
    // Not meant by the name of the lid, although it has the same word.
    bar.materials[1].caption = "lid knob".to_owned();
    let short = || Options { duration: Some(0.01), frames: 2, ..true_stiffness() };
    let anchored = Options { anchor: vec!["lid".to_owned()], ..short() };
    match simulate(&bar.input(), &anchored, None, &mut |_, _| Ok(()), Progress::HIDDEN) {
        Err(SimulateError::Part { part, names }) => {
            assert_eq!((part.as_str(), names.as_str()), ("lid", "handle`, `lead`, `lid knob`, `oak"));
        }
        other => panic!("{other:?}"),
    }
    let stiffened = Options { rigid: vec!["lid".to_owned()], ..short() };
    match simulate(&bar.input(), &stiffened, None, &mut |_, _| Ok(()), Progress::HIDDEN) {
        Err(SimulateError::Rigid { part, names }) => {
            assert_eq!((part.as_str(), names.as_str()), ("lid", "handle`, `lead`, `lid knob`, `oak"));
        }
        other => panic!("{other:?}"),
    }
}

/// A rigid body that turns so fast that its steps are far below the rounding of the time, or that a frame would take a
/// trillion of them.
#[test]
fn time_that_stands_still_or_crawls_stops_the_run() {
    let bar = Bar::new();
    for (rate, least_m_s) in [("1e20", 1e18), ("1e13", 1e11)] {
        let spun = Options {
            scenario: "twist".to_owned(),
            set: vec![format!("rate={rate}")],
            rigid: vec!["handle".to_owned(), "head".to_owned()],
            max_simulation_minutes: 0.001,
            ..true_stiffness()
        };
        match simulate(&bar.input(), &spun, None, &mut |_, _| Ok(()), Progress::HIDDEN) {
            Err(SimulateError::TooFast { speed_m_s, frame, .. }) => {
                assert!(speed_m_s > least_m_s && frame == 1, "{rate} rad/s: {speed_m_s} m/s");
            }
            other => panic!("{other:?}"),
        }
    }
}

/// Every frame takes a step, even if the object hardly moves: far more steps than fit into the time, but as expected.
#[test]
fn a_step_for_each_frame_stops_no_run() {
    let bar = Bar::new();
    let brief = Options { drop_height: 0.0, duration: Some(1e-6), frames: 50, ..options() };
    let report = run(&bar.input(), &Options { max_simulation_minutes: 1e-7, ..brief }).1;
    assert_eq!(report.substeps, 49);
}

#[test]
fn a_material_of_unknown_inside_is_named_once() {
    let mut bar = Bar::new();
    bar.materials[1].name = "oak".to_owned();
    let bare = Input { interior: &[], ..bar.input() };
    let report = run(&bare, &Options { frames: 2, duration: Some(1e-3), ..options() }).1;
    assert!(
        report.warnings.iter().any(|warning| warning.contains("the inside of oak, so only")),
        "{:?}",
        report.warnings
    );
}

/// Parts keep their volume, solids are filled, and parts whose inside is unknown count as full.
#[test]
fn filling_keeps_every_parts_volume() {
    let bar = Bar::new();
    let positions: Vec<[f64; 3]> =
        (0..bar.gaussians.len()).map(|i| (bar.gaussians.center(i) * METERS_PER_UNIT).into()).collect();
    let spacing_m = 0.025;
    let filled = fill(&positions, &bar.labels, &bar.interior, METERS_PER_UNIT, spacing_m).unwrap();
    for (label, expected) in [(0, 0.3 * 0.008), (1, 0.1 * 0.008)] {
        let volume: f64 = filled.parcels.iter().filter(|b| b.label == label).map(|b| b.volume_m3).sum();
        assert!((volume / expected - 1.0).abs() < 1e-9, "{volume} m3, expected {expected}");
    }
    assert!(filled.parcels.iter().all(|b| b.volume_m3 > 0.0));
    // The inside, clear of the faces, holds a parcel in every cube of half a grid cell.
    let cube = |b: &[f64; 3]| b.map(|x| (x / spacing_m * 2.0).floor() as i64);
    let cubes: BTreeSet<[i64; 3]> = filled.parcels.iter().map(|b| cube(&b.position_m)).collect();
    let expected: BTreeSet<[i64; 3]> =
        bar.interior.iter().map(|p| cube(&p.position.map(|x| x * METERS_PER_UNIT))).collect();
    assert_eq!(cubes, expected);
    let bare = fill(&positions, &bar.labels, &[], METERS_PER_UNIT, spacing_m).unwrap();
    assert_eq!((bare.parcels.len(), bare.assumed_full), (positions.len(), vec![0, 1]));
}

/// A corner that lands on a sticky ground stays there; on any other it slides and bounces up again.
#[test]
fn ground_may_hold_what_lands() {
    let bar = Bar::new();
    let last = |ground| {
        let options = Options { ground, ground_friction: 0.0, duration: Some(0.4), frames: 3, ..options() };
        Vector3::from(run(&bar.input(), &options).1.frames[2].center_of_mass_m)
    };
    let [free, gliding, held] = [Ground::Separate, Ground::Slip, Ground::Sticky].map(last);
    let apart = [(free - held).norm(), (free - gliding).norm(), (gliding - held).norm()];
    assert!(apart.iter().all(|a| *a > 1e-3), "{free} {gliding} {held}");
}

#[test]
fn unknown_scale_is_simulated_at_a_stated_size() {
    let bar = Bar::new();
    let input = Input { meters_per_unit: None, ..bar.input() };
    let report = run(&input, &Options { frames: 2, duration: Some(1e-3), ..options() }).1;
    assert!(report.scale_assumed && report.warnings.iter().any(|w| w.contains("--scale")), "{report:?}");
    assert!((report.meters_per_unit * report.longest_side() - 0.5).abs() < 0.05, "{}", report.meters_per_unit);
}

#[test]
fn bad_input_is_refused_with_a_reason() {
    let bar = Bar::new();
    let refused = |input: &Input| {
        let mut keep = |_: &Frame, _: &Snapshot| Ok::<_, SimulateError>(());
        simulate(input, &options(), None, &mut keep, Progress::HIDDEN).unwrap_err().to_string()
    };
    let outcome_with = |change: &dyn Fn(&mut Material)| {
        let mut materials = materials();
        change(&mut materials[1]);
        refused(&Input { materials: &materials, ..bar.input() })
    };
    assert!(refused(&Input { gaussians: &Gaussians::default(), labels: &[], ..bar.input() }).contains("nothing"));
    assert!(outcome_with(&|m| m.poisson_ratio = 0.5).contains("Poisson's ratio of `lead` is 0.5"));
    assert!(outcome_with(&|m| m.density_kg_m3 = 0.0).contains("density of `lead` is 0"));
    assert!(outcome_with(&|m| m.youngs_modulus_pa = f64::NAN).contains("Young's modulus of `lead`"));
    assert!(outcome_with(&|m| m.law = Law::VonMises { yield_stress_pa: -1.0 }).contains("strength of `lead`"));
    let hollow = [FillPoint { position: [0.0; 3], label: 0, volume: -1.0 }];
    assert!(refused(&Input { interior: &hollow, ..bar.input() }).contains("volume of -1"));
    assert!(refused(&Input { labels: &bar.labels[1..], ..bar.input() }).contains("labels"));
    let strange: Vec<u32> = bar.labels.iter().map(|l| l + 1).collect();
    assert!(refused(&Input { labels: &strange, ..bar.input() }).contains("label 2"));
    let mut point = bar.gaussians.clone();
    point.positions.fill([1.0; 3]);
    assert!(refused(&Input { gaussians: &point, ..bar.input() }).contains("no size"));
    point.positions[3] = [f32::NAN, 0.0, 0.0];
    assert!(refused(&Input { gaussians: &point, ..bar.input() }).contains("Gaussian 3"));
}

#[test]
fn options_outside_their_domain_are_refused() {
    let bar = Bar::new();
    for options in [
        Options { frames: 0, ..options() },
        Options { frames: 1, ..options() },
        Options { duration: Some(f64::NAN), ..options() },
        Options { grid: 0, ..options() },
    ] {
        let refused = simulate(&bar.input(), &options, None, &mut |_, _| panic!("it began"), Progress::HIDDEN);
        assert!(matches!(refused, Err(SimulateError::Option(_))), "{refused:?}");
    }
}

/// A floater stays in its place and does not disturb the simulation.
#[test]
fn strays_stay_in_place() {
    let bar = Bar::new();
    let mut cloud = bar.gaussians.clone();
    cloud.positions[5] = [1e5, 0.0, 3.0];
    let input = Input { gaussians: &cloud, ..bar.input() };
    let (frames, report) = run(&input, &Options { frames: 2, duration: Some(0.02), ..options() });
    let last = &frames[1].gaussians;
    assert_eq!((last.positions[5], last.log_scales[5]), (cloud.positions[5], cloud.log_scales[5]));
    assert!(last.positions[4] != cloud.positions[4] && last.positions[6] != cloud.positions[6]);
    assert!(report.warnings.iter().any(|w| w.starts_with("1 Gaussian lies far")), "{:?}", report.warnings);
    let expected: Vec<bool> = (0..cloud.len()).map(|i| i != 5).collect();
    assert_eq!(simulated(&cloud), expected);
}

/// The time that a run takes is estimated first: days are refused.
#[test]
fn too_long_a_run_is_refused_before_it_starts() {
    let bar = Bar::new();
    let long = Options { duration: Some(3600.0), max_stiffness: Some(1e13), ..options() };
    let refused = simulate(&bar.input(), &long, None, &mut |_, _| panic!("it began"), Progress::HIDDEN);
    match refused {
        Err(SimulateError::TooLong { minutes, max_minutes }) => assert!(minutes > 600.0 && max_minutes == 120.0),
        other => panic!("{other:?}"),
    }
    run(&bar.input(), &options());
}

/// A particle that leaves the domain or becomes NaN stops the run with an error that names particle, time and cause; the
/// earlier frames are kept.
#[test]
fn domain_too_small_or_no_number_stops_the_run() {
    let bar = Bar::new();
    let stopped = |scenario: &str, set: &str| {
        let options = Options { scenario: scenario.to_owned(), set: vec![set.to_owned()], ..options() };
        let mut kept = 0;
        let mut keep = |_: &Frame, _: &Snapshot| {
            kept += 1;
            Ok(())
        };
        match simulate(&bar.input(), &options, None, &mut keep, Progress::HIDDEN) {
            Err(error @ SimulateError::Lost { frame, t_s, .. }) => {
                assert_eq!(frame, kept);
                (t_s, error.to_string())
            }
            other => panic!("{other:?}"),
        }
    };
    // Eight longest sides of room at 100 per second in each direction: after 0.08 s.
    let (t_s, why) = stopped("stretch", "speed=200");
    assert!((t_s - 0.08).abs() < 0.01 && why.contains("the domain") && why.contains("particle"), "{t_s}: {why}");
    let (t_s, why) = stopped("push", "force=1e40");
    assert!(t_s < 0.01 && why.contains("became NaN or infinite") && why.contains("lower"), "{t_s}: {why}");
}

/// Every picture shows the whole bar, and the films contain all pictures.
#[test]
fn film_shows_the_object_in_every_picture() {
    let bar = Bar::new();
    let (frames, report) = run(&bar.input(), &options());
    let all = vec![true; bar.gaussians.len()];
    let mut load = |index: usize| Ok::<_, Box<dyn Error + Send + Sync>>(frames[index].gaussians.clone());
    let viewpoint = |change: &dyn Fn(&mut Viewpoint)| {
        let mut viewpoint = Options::default().viewpoint;
        viewpoint.film = film::Options { size: Size { width: 480, height: 360 }, fps: 24 };
        change(&mut viewpoint);
        viewpoint
    };
    let mut shoot = |change: &dyn Fn(&mut Viewpoint)| {
        let mut pictures = Vec::new();
        let shooting = Shooting::new(&report, &viewpoint(change), None, &all);
        let mut keep = |picture| {
            pictures.push(picture);
            Ok(())
        };
        shooting.draw(&mut load, &mut keep, Progress::HIDDEN).unwrap();
        assert_eq!(pictures.len(), shooting.count());
        pictures
    };
    let pictures = shoot(&|_| ());
    let turned = shoot(&|v| v.turntable = true);
    let above = shoot(&|v| v.elevation_deg = 80.0);
    // At half speed, 24 pictures per second; the first and the last frame are both shown.
    let simulated_s = report.frames.last().unwrap().t_s;
    assert_eq!(pictures.len(), (2.0 * 24.0 * simulated_s).round() as usize + 1);
    assert!(pictures.len() > report.frames.len(), "pictures between the frames");
    assert!(pictures[1] != above[1] && pictures[3] != turned[3]);
    for (index, picture) in pictures.iter().chain(&turned).chain(&above).enumerate() {
        // The Gaussians are red, the ground is grey.
        let red: Vec<(u32, u32)> = picture
            .enumerate_pixels()
            .filter(|(_, _, p)| i32::from(p[0]) > i32::from(p[1]) + 40)
            .map(|(x, y, _)| (x, y))
            .collect();
        let share = red.len() as f64 / f64::from(picture.width() * picture.height());
        assert!(share > 0.02 && share < 0.5, "frame {index}: {share} of the picture is bar");
        let at_edge = |&(x, y): &(u32, u32)| x == 0 || y == 0 || x + 1 == picture.width() || y + 1 == picture.height();
        assert!(!red.iter().any(at_edge), "frame {index}: the bar is cut off");
    }
    let films = Shooting::new(&report, &viewpoint(&|_| ()), None, &all).films(&mut load, Progress::HIDDEN).unwrap();
    match films.film {
        Film::Mp4(film) => assert_eq!(&film[4..8], b"ftyp"),
        Film::Gif(_) => skipped("film_shows_the_object_in_every_picture", "no ffmpeg: no MP4"),
    }
    let decoder = image::codecs::gif::GifDecoder::new(std::io::Cursor::new(films.animation)).unwrap();
    let decoded = image::AnimationDecoder::into_frames(decoder).collect_frames().unwrap();
    // Every second picture: 12 per second.
    assert_eq!(decoded.len(), pictures.len().div_ceil(2));
    assert_eq!(decoded[0].buffer().dimensions(), pictures[0].dimensions());
}
