use std::io::{Cursor, Read, Write};

use gprop::evaluate::{filling, simulation};
use gprop::files::npz::Npz;
use gprop::gaussians::Gaussians;
use gprop::materials::{Law, MaterialLibrary};
use gprop::simulate::SimulateError;
use gprop::simulate::compat::config::Config;
use gprop::simulate::compat::estimated::Estimated;
use gprop::simulate::compat::law::Strength;
use gprop::simulate::compat::particle::Particle;
use gprop::simulate::compat::solver::Solver;
use gprop::simulate::compat::{run, strength_at};
use gprop::simulate::material::{SOFT_PA, Soften};
use gprop::units::Estimate;
use gprop::vote::FieldPart;
use gprop::words::progress::Progress;
use nalgebra::Vector3;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

use crate::support::{changed, shared};

/// The reference `name`; `None`, with a message, if it is not there.
fn reference(test: &str, name: &str) -> Option<Npz> {
    let path = shared(test, &format!("reference/mpm/{name}"))?;
    Some(Npz::new(std::fs::read(path).unwrap()).unwrap())
}

/// The reference cut to the first 13 of its 21 frames: its meta data, and every array with a row per frame.
fn begun(test: &str, name: &str) -> Option<Npz> {
    let whole = std::fs::read(shared(test, &format!("reference/mpm/{name}"))?).unwrap();
    let (mut whole, mut cut) = (ZipArchive::new(Cursor::new(whole)).unwrap(), ZipWriter::new(Cursor::new(Vec::new())));
    for n in 0..whole.len() {
        let mut file = whole.by_index(n).unwrap();
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        // NumPy has a text as 32-bit characters.
        let text = |text: &str| text.bytes().flat_map(|byte| [byte, 0, 0, 0]).collect::<Vec<u8>>();
        replace(&mut bytes, &text("\"n_frames\": 20"), &text("\"n_frames\": 12"));
        let first_row = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        if replace(&mut bytes[..first_row], b"'shape': (21,", b"'shape': (13,") {
            bytes.truncate(first_row + (bytes.len() - first_row) / 21 * 13);
        }
        cut.start_file(file.name().unwrap(), SimpleFileOptions::default()).unwrap();
        cut.write_all(&bytes).unwrap();
    }
    Some(Npz::new(cut.finish().unwrap().into_inner()).unwrap())
}

/// Replaces the first occurrence of `from` with as many bytes, if there is one.
fn replace(bytes: &mut [u8], from: &[u8], to: &[u8]) -> bool {
    let place = bytes.windows(from.len()).position(|window| window == from);
    if let Some(place) = place {
        bytes[place..place + to.len()].copy_from_slice(to);
    }
    place.is_some()
}

/// One law each, until the cubes have hit the ground and yielded; all ten whole trajectories take minutes and go through
/// `gprop evaluate simulation`.
#[test]
fn reproduces_the_peers_trajectories() {
    for name in ["spin5k_g48_apic.npz", "drop_cube10k_g48_sand.npz", "drop_cube10k_g48_metal.npz"] {
        if let Some(mut npz) = begun("reproduces_the_peers_trajectories", name) {
            let comparison = simulation::compare(&mut npz, Progress::HIDDEN).unwrap();
            assert!(comparison.within(), "{name}: {comparison}");
        }
    }
}

#[test]
fn fills_the_peers_cells() {
    for name in ["fill_shell64.npz", "fill_shell64_low.npz"] {
        if let Some(mut npz) = reference("fills_the_peers_cells", name) {
            let found = filling::compare(&mut npz).unwrap();
            assert_eq!((found.counts_differ, found.dense_differ, found.inside_differ), (0, 0, 0), "{name}: {found}");
            assert_eq!(found.added as i64, found.reference_added);
            assert!(found.volume_rel_max < 1e-6);
        }
    }
}

/// Every key of the peer's own configurations, including the misspelt ones.
const ALL_KEYS: &str = r#"{
    "opacity_threshold": 0.02, "rotation_degree": [45.0, 6.5], "rotation_axis": [1, 2], "substep_dt": 1e-4,
    "frame_dt": 1e-2, "frame_num": 2, "E": 1e5, "yield_stress": 1e2, "nu": 0.3, "material": "metal", "hardening": 1,
    "xi": 0.1, "softening": 0.1, "friction_angle": 30, "plastic_viscosity": 1.0, "grid_v_damping_scale": 0.9999,
    "rpic_damping": 0.5, "pic_damping": 0, "density": 1000, "g": [0.0, 0.0, 0.0], "n_grid": 32, "grid_lim": 2,
    "scale": 0.5, "sim_area": [-2.1, 2.1, -2.7, 2.9, -2.0, 2.0],
    "additional_material_params": [{"point": [1, 1, 1.5], "size": [1, 1, 0.5], "nu": 0.4, "E": 2e6}],
    "particle_filling": {"n_grid": 50, "density_threshold": 40.0, "search_threshold": 0.5, "visualize": false,
        "search_exclude_direction": 0, "ray_cast_direction": 1, "max_particles_num": 2000000,
        "max_partciels_per_cell": 1, "smooth": true, "boundary": [0.7, 1.3, 0.7, 1.3, 0.7, 1.3]},
    "boundary_conditions": [
        {"type": "bounding_box"},
        {"type": "cuboid", "point": [1, 1, 0.5], "size": [1, 1, 0.1], "velocity": [0, 0, 0], "reset": 1},
        {"type": "particle_impulse", "force": [-0.18, 0, 0], "num_dt": 1, "start_time": 0},
        {"type": "surface_collider", "point": [1, 1, 0.2], "normal": [0, 0, 1], "surface": "slip", "friction": 0.1,
         "start_time": 0, "end_time": 1e3},
        {"type": "enforce_particle_translation", "point": [1, 1, 1], "size": [0.1, 1, 1], "velocity": [0, 0, 0],
         "start_time": 0, "end_time": 1},
        {"type": "enforce_particle_velocity_rotation", "point": [1, 1, 1], "normal": [1, 0, 0],
         "half_height_and_radius": [0.12, 0.6], "rotation_scale": 1.0, "translation_scale": 0.0, "start_time": 0.0,
         "end_time": 0.5},
        {"type": "release_particles_sequentially", "normal": [1, 0, 0], "start_position": 1.5, "end_position": 0.5,
         "num_layers": 50, "start_time": 0.0, "end_time": 1.5}],
    "mpm_space_vertical_upward_axis": [0, -1, 0], "mpm_space_viewpoint_center": [1, 1, 1], "default_camera_index": -1,
    "show_hint": false, "init_azimuthm": 150, "init_elevation": 10, "init_radius": 2.7, "move_camera": true,
    "delta_a": 0.04, "delta_e": 0.0, "delta_r": 0.0
}"#;

#[test]
fn reads_all_keys_and_refuses_others() {
    let config = Config::from_json(ALL_KEYS).unwrap();
    assert_eq!(config.boundary_conditions.len(), 7);
    assert_eq!(config.substeps_per_frame(), 100);
    let refused = |json: String| match Config::from_json(&json) {
        Err(SimulateError::Configuration(why)) => why,
        other => panic!("{other:?}"),
    };
    assert!(refused(ALL_KEYS.replace("\"xi\"", "\"chi\"")).contains("`chi`"));
    assert!(refused(ALL_KEYS.replace("partciels", "particles")).contains("max_particles_per_cell"));
    assert!(refused(ALL_KEYS.replace("\"num_dt\"", "\"steps\"")).contains("`steps`"));
    assert!(refused(ALL_KEYS.replace("\"nu\": 0.3", "\"nu\": 0.5")).contains("`nu`"));
    assert!(refused(ALL_KEYS.replace("\"density\": 1000", "\"density\": 0")).contains("`density`"));
    assert!(refused(ALL_KEYS.replace("metal", "wood")).contains("wood"));
    assert!(refused(ALL_KEYS.replace("\"slip\"", "\"sticky\"")).contains("sticky"));
    // 0.04 / 2e-5 is a little less than 2000 in floating point: the peer loses a substep.
    assert_eq!(Config::from_json(r#"{"frame_dt": 0.04, "substep_dt": 2e-5}"#).unwrap().substeps_per_frame(), 1999);
}

/// Particles at rest on a lattice of 2 x 2 x 2 per cell around the box's middle.
fn lattice(config: &Config, side: usize) -> Vec<Particle> {
    let dx = (config.grid_lim / config.n_grid as f64) as f32;
    let coordinate = |i: usize| 1.0 + (i as f32 + 0.5 - side as f32 / 2.0) * dx / 2.0;
    (0..side.pow(3))
        .map(|n| {
            let place = Vector3::new(coordinate(n / side / side), coordinate(n / side % side), coordinate(n % side));
            let (strength, density) = strength_at(config, &place);
            let volume = (dx / 2.0).powi(3);
            Particle::at_rest(place, volume, density * volume, strength)
        })
        .collect()
}

fn stepped(json: &str, side: usize, steps: usize) -> Solver {
    let config = Config::from_json(json).unwrap();
    let mut solver = Solver::new(&config, lattice(&config, side));
    for _ in 0..steps {
        solver.step(config.substep_dt).unwrap();
    }
    solver
}

/// A positive rate turns negatively about the normal, as in the peer: at +x from the axis z, towards -y. If all nodes
/// of a particle are surrounded by particles, splines transfer a linear velocity exactly.
#[test]
fn rotation_is_left_handed() {
    let solver = stepped(
        r#"{"g": [0, 0, 0], "n_grid": 32, "boundary_conditions": [{"type": "enforce_particle_velocity_rotation",
        "point": [1, 1, 1], "normal": [0, 0, 2], "half_height_and_radius": [1, 1], "rotation_scale": 1.5,
        "translation_scale": 0.25, "start_time": 0, "end_time": 1}]}"#,
        16,
        1,
    );
    let inner = 1.4 * 2.0 / 32.0;
    let from_axis = |p: &Particle| (p.position.x - 1.0, p.position.y - 1.0);
    let near = |p: &&Particle| from_axis(p).0.abs() < inner && from_axis(p).1.abs() < inner;
    assert_eq!(solver.particles.iter().filter(near).count(), 6 * 6 * 16);
    for p in solver.particles.iter().filter(near) {
        let (x, y) = from_axis(p);
        let expected = Vector3::new(1.5 * y, -1.5 * x, 0.25);
        // A step of 1e-4 s turns the position by 1.5e-4.
        assert!((p.velocity - expected).norm() < 5e-5, "at {x}, {y}: {} not {expected}", p.velocity);
    }
}

/// Released from the far end to `end_position`, layer by layer: particles beyond a layer's box fall freely.
#[test]
fn releases_layer_by_layer() {
    let json = r#"{"material": "sand", "n_grid": 32, "boundary_conditions": [{"type": "release_particles_sequentially",
        "normal": [1, 0, 0], "start_position": 1.5, "end_position": 0.5, "num_layers": 50, "start_time": 0,
        "end_time": 0.1}]}"#;
    // Layer i reaches 0.5 + (50 - i) / 50 and is released after 0.002 (i + 1) s: at 0.05 s those beyond x = 1 fall.
    let solver = stepped(json, 8, 500);
    let (far, near): (Vec<&Particle>, Vec<&Particle>) = solver.particles.iter().partition(|p| p.position.x > 1.0);
    let fall = |ps: &[&Particle]| ps.iter().map(|p| -p.velocity.z).sum::<f32>() / ps.len() as f32;
    assert!(fall(&far) > 0.02 && fall(&near) < 0.25 * fall(&far), "{} {}", fall(&far), fall(&near));
}

/// A resetting cuboid holds the whole grid before it begins; any other one does not.
#[test]
fn reset_holds_the_grid_before_its_start() {
    let fall = |reset: i32| {
        let json = format!(
            r#"{{"n_grid": 32, "boundary_conditions": [{{"type": "cuboid", "point": [1, 1, 0.2], "size": [1, 1, 0.1],
            "velocity": [0, 0, 0], "start_time": 0.005, "reset": {reset}}}]}}"#
        );
        stepped(&json, 8, 20).particles[0].velocity.z
    };
    assert_eq!(fall(1), 0.0);
    assert!((fall(0) + 9.8 * 0.002).abs() < 1e-4, "{}", fall(0));
}

/// Material boxes are open, the last one that contains a position counts, and density is inherited.
#[test]
fn material_boxes_override() {
    let config = Config::from_json(ALL_KEYS).unwrap();
    let (inside, density) = strength_at(&config, &Vector3::new(1.0, 1.0, 1.5));
    assert_eq!((inside, density), (Strength::new(2e6, 0.4, 1e2), 1000.0));
    assert_eq!(strength_at(&config, &Vector3::new(1.0, 1.0, 1.0)).0, Strength::new(1e5, 0.3, 1e2));
}

/// The surface of a ball of radius 1; every tenth Gaussian is too faint to take part.
fn ball(count: usize) -> Gaussians {
    let mut ball = Gaussians::default();
    let golden = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    for k in 0..count {
        let z = 1.0 - 2.0 * (k as f32 + 0.5) / count as f32;
        let (radius, turn) = ((1.0 - z * z).sqrt(), golden * k as f32);
        ball.positions.push([radius * turn.cos(), radius * turn.sin(), z]);
        ball.log_scales.push([-3.0, -3.0, -3.0]);
        ball.rotations.push([1.0, 0.0, 0.0, 0.0]);
        ball.opacity_logits.push(if k % 10 == 0 { -6.0 } else { 2.0 });
        ball.sh_dc.push([0.5, 0.2, 0.1]);
    }
    ball
}

/// A small ball through all steps: selected, rotated, filled, simulated, rotated back.
#[test]
fn runs_a_configuration_on_a_scene() {
    let ball = ball(4000);
    let json = r#"{"rotation_degree": [90], "rotation_axis": [0], "scale": 1.0, "n_grid": 32, "g": [0, 0, -9.8],
        "frame_num": 2, "frame_dt": 0.02, "substep_dt": 1e-4, "boundary_conditions": [{"type": "bounding_box"}],
        "particle_filling": {"n_grid": 40, "density_threshold": 100.0, "search_threshold": 0.2}}"#;
    let config = Config::from_json(json).unwrap();
    let mut frames = Vec::new();
    let mut keep = |_: usize, _: &[Particle], gaussians: &Gaussians| {
        frames.push(gaussians.clone());
        Ok::<_, SimulateError>(())
    };
    let report = run(&ball, &config, None, &mut keep, Progress::HIDDEN).unwrap();
    assert_eq!((frames.len(), frames[0].len(), report.substeps), (3, 3600, 400));
    let too_large = Config::from_json(&json.replace("\"scale\": 1.0", "\"scale\": 2.5")).unwrap();
    match run(&ball, &too_large, None, &mut |_, _, _| Ok(()), Progress::HIDDEN) {
        Err(SimulateError::Configuration(why)) => assert!(why.contains("lower `scale`"), "{why}"),
        other => panic!("{other:?}"),
    }
    // A ball with a radius of 10 cells, without its shell.
    assert!(report.fill_particles > 2000 && report.fill_particles < 4200, "{}", report.fill_particles);
    // Two billion in each of these cells would take terabytes.
    let crowded = json.replace("\"search_threshold\"", "\"max_partciels_per_cell\": 2000000000, \"search_threshold\"");
    match run(&ball, &Config::from_json(&crowded).unwrap(), None, &mut |_, _, _| Ok(()), Progress::HIDDEN) {
        Err(SimulateError::Configuration(why)) => assert!(why.contains("`max_particles_num`"), "{why}"),
        other => panic!("{other:?}"),
    }
    let start = &ball.positions[1];
    for a in 0..3 {
        assert!((frames[0].positions[0][a] - start[a]).abs() < 1e-4, "{:?} {start:?}", frames[0].positions[0]);
    }
    // It falls along the box's -z, which the rotation made from the world's -y; lengths in the box are half the
    // scene's.
    let fallen = start[1] - frames[2].positions[0][1];
    assert!((fallen - 2.0 * 0.5 * 9.8 * 0.04 * 0.04).abs() < 1e-3, "{fallen}");

    // To be visible, each particle of the inside gets a Gaussian that looks like the nearest one.
    let seen = json.replace("\"search_threshold\"", "\"visualize\": true, \"search_threshold\"");
    let config = Config::from_json(&seen.replace("\"frame_num\": 2", "\"frame_num\": 0")).unwrap();
    let mut frames = Vec::new();
    let mut keep = |_: usize, _: &[Particle], gaussians: &Gaussians| {
        frames.push(gaussians.clone());
        Ok::<_, SimulateError>(())
    };
    assert_eq!(run(&ball, &config, None, &mut keep, Progress::HIDDEN).unwrap().fill_particles, report.fill_particles);
    assert_eq!(frames[0].len(), 3600 + report.fill_particles);
    // The shell's Gaussians reach 0.05 beyond the ball, a cell's diagonal is 0.17.
    let inside = |p: &[f32; 3]| p.iter().map(|x| x * x).sum::<f32>().sqrt() < 1.25;
    assert!(frames[0].positions[3600..].iter().all(inside));
    assert!(frames[0].log_scales[3600..].iter().all(|s| s.iter().all(|s| (s + 3.0).abs() < 1e-4)));
}

/// A particle that the last step of a frame loses stops the run before the frame is kept.
#[test]
fn a_frame_with_a_lost_particle_is_not_kept() {
    // One step per frame, in which everything falls by g dt^2 = 400, far out of the box.
    let json = r#"{"n_grid": 32, "g": [0, 0, -1e6], "frame_num": 1, "frame_dt": 0.02, "substep_dt": 0.02}"#;
    let mut kept = 0;
    let mut keep = |_: usize, _: &[Particle], _: &Gaussians| {
        kept += 1;
        Ok::<_, SimulateError>(())
    };
    match run(&ball(100), &Config::from_json(json).unwrap(), None, &mut keep, Progress::HIDDEN) {
        Err(SimulateError::Lost { frame, .. }) => assert_eq!((frame, kept), (1, 1)),
        other => panic!("{other:?}"),
    }
}

/// The largest float below 8.5 cells of a tenth: times ten, it is rounded to 8.5 cells, from where a stencil reaches the
/// node beyond the last one.
#[test]
fn a_particle_at_the_rim_of_the_grid_is_lost() {
    let config = Config::from_json(r#"{"n_grid": 10, "grid_lim": 1}"#).unwrap();
    let place = 0.849_999_96_f32;
    assert!(place < 8.5 * 0.1 && place * 10.0 == 8.5);
    for at in [Vector3::new(place, 0.5, 0.5), Vector3::new(0.5, 0.5, place)] {
        let particle = Particle::at_rest(at, 1e-3, 1.0, Strength::new(1e5, 0.3, 0.0));
        assert!(Solver::new(&config, vec![particle]).step(1e-4).is_err(), "{at}");
    }
}

#[test]
fn a_region_without_gaussians_is_told() {
    let config = Config::from_json(r#"{"sim_area": [50, 60, 50, 60, 50, 60]}"#).unwrap();
    let mut keep = |_: usize, _: &[Particle], _: &Gaussians| Ok::<_, SimulateError>(());
    let why = run(&ball(100), &config, None, &mut keep, Progress::HIDDEN).unwrap_err().to_string();
    assert!(why.contains("`sim_area`") && why.contains("`opacity_threshold`"), "{why}");
}

fn label(law: Law, youngs_modulus_pa: f64, density_kg_m3: f64) -> FieldPart {
    changed(FieldPart::of(0, &MaterialLibrary::builtin().materials()[0]), |label| {
        (label.law, label.hardness) = (law, None);
        label.density_kg_m3 = Estimate::exactly(density_kg_m3);
        label.youngs_modulus_pa = Estimate::exactly(youngs_modulus_pa);
        label.poisson_ratio = Estimate::exactly(0.3);
        label.yield_strength_pa = Estimate::exactly(1e3);
    })
}

/// The last frame of a run: its Gaussians and its particles.
fn last(gaussians: &Gaussians, config: &Config, estimated: Option<&Estimated>) -> (Gaussians, Vec<Particle>) {
    let mut last = None;
    let mut keep = |_: usize, particles: &[Particle], gaussians: &Gaussians| {
        last = Some((gaussians.clone(), particles.to_vec()));
        Ok::<_, SimulateError>(())
    };
    let report = run(gaussians, config, estimated, &mut keep, Progress::HIDDEN).unwrap();
    assert_eq!(report.materials.len(), estimated.map_or(0, |estimated| estimated.materials.len()));
    last.unwrap()
}

/// A ball that falls onto the box's ground while it is pressed from above, so that it yields.
const PRESSED: &str = r#"{"n_grid": 24, "frame_num": 1, "frame_dt": 0.01, "substep_dt": 1e-4, "hardening": 1, "xi": 0.1,
    "particle_filling": {"n_grid": 30, "density_threshold": 100.0, "search_threshold": 0.2},
    "boundary_conditions": [{"type": "bounding_box"},
        {"type": "enforce_particle_translation", "point": [1, 1, 1.5], "size": [1, 1, 0.2], "velocity": [0, 0, -4],
         "start_time": 0, "end_time": 1}]"#;

/// If the whole field is of the configuration's material, the run has the same bytes as without the field.
#[test]
fn a_field_of_the_configurations_material_changes_no_byte() {
    let radius = (2.0_f64 / 3.0).sqrt() * 1e3;
    let cases = [
        (Law::Elastic, r#""material": "jelly""#.to_owned()),
        (Law::VonMises { yield_stress_pa: 1e3 }, format!(r#""material": "metal", "yield_stress": {radius}"#)),
        (
            Law::DruckerPrager { friction_angle_rad: 35_f64.to_radians(), cohesion_pa: 0.0 },
            r#""material": "sand", "friction_angle": 35"#.to_owned(),
        ),
        (
            Law::Foam { yield_stress_pa: 1e3, viscosity_pa_s: 5.0 },
            r#""material": "foam", "yield_stress": 1e3, "plastic_viscosity": 5"#.to_owned(),
        ),
        (
            Law::Plasticine { yield_stress_pa: 1e3, softening: 0.5 },
            format!(r#""material": "plasticine", "yield_stress": {radius}, "softening": {}"#, 0.5 * radius),
        ),
    ];
    let ball = ball(600);
    let labels_of = vec![0; ball.len()];
    let mut moved = Vec::new();
    for (law, material) in cases {
        let json = |other: &str| Config::from_json(&format!("{PRESSED}, {other}}}")).unwrap();
        let (same, other) =
            (json(&format!(r#"{material}, "E": 4e5, "nu": 0.3, "density": 500"#)), json(r#""material": "jelly""#));
        let labels = [label(law, 4e5, 500.0)];
        let estimated = Estimated::new(&labels_of, &labels, Soften::Cap, SOFT_PA);
        let plain = last(&ball, &same, None);
        assert!(plain.1.len() > 1000, "its inside is filled: {} particles", plain.1.len());
        assert!(plain == last(&ball, &same, Some(&estimated)), "{material}");
        // The field decides, not the configuration: with another material in it, hardly anything else is used.
        assert!(plain == last(&ball, &other, Some(&estimated)), "{material}");
        assert!(plain != last(&ball, &other, None), "{material}");
        moved.push(plain.0);
    }
    for (a, b) in (0..moved.len()).flat_map(|a| (0..a).map(move |b| (a, b))) {
        assert!(moved[a] != moved[b], "laws {a} and {b} do the same");
    }
}

/// Two balls that share no node move as each does in a run of its own material, inside included.
#[test]
fn every_particle_has_the_material_of_its_gaussian() {
    let one = ball(600);
    let mut two = one.clone();
    two.repeat(&(0..600).collect::<Vec<_>>());
    for (i, position) in two.positions.iter_mut().enumerate() {
        position[0] += if i < 600 { -2.0 } else { 2.0 };
    }
    let of_gaussian: Vec<u32> = (0..1200).map(|i| u32::from(i >= 600)).collect();
    let json = PRESSED.replace("\"n_grid\": 24", "\"n_grid\": 48").replace("\"n_grid\": 30", "\"n_grid\": 80");
    let config = Config::from_json(&format!("{json}}}")).unwrap();
    let laws = [label(Law::Elastic, 4e5, 500.0), label(Law::VonMises { yield_stress_pa: 1e3 }, 2e5, 900.0)];
    let outcome_with = |labels: &[FieldPart]| {
        let estimated = Estimated::new(&of_gaussian, labels, Soften::Cap, SOFT_PA);
        last(&two, &config, Some(&estimated)).1
    };
    let both = outcome_with(&laws);
    for (side, law) in laws.iter().enumerate() {
        let alone = outcome_with(&[law.clone(), law.clone()]);
        let is_here = |p: &&Particle| (p.position.x > 1.0) == (side == 1);
        let pairs: Vec<_> = both.iter().zip(&alone).filter(|(p, _)| is_here(p)).collect();
        assert!(pairs.len() > 700, "{} of {} particles", pairs.len(), both.len());
        for (p, q) in pairs {
            assert!(
                (p.position, p.trial, p.mass, p.strength) == (q.position, q.trial, q.mass, q.strength),
                "{p:?} {q:?}"
            );
        }
    }
}

/// Softening multiplies every stress; strains at yield, and ratios with a common factor, stay.
#[test]
fn the_field_is_softened_to_what_the_steps_allow() {
    let labels = [label(Law::VonMises { yield_stress_pa: 4e8 }, 2e11, 7800.0), label(Law::Elastic, 1e6, 1100.0)];
    let estimated_with = |soften| Estimated::new(&[0, 1], &labels, soften, SOFT_PA);
    let moduli = |soften| estimated_with(soften).materials.iter().map(|m| m.youngs_modulus).collect::<Vec<_>>();
    assert_eq!((moduli(Soften::Cap), moduli(Soften::Common)), (vec![2e7, 1e6], vec![2e7, 1e2]));
    let steel = &estimated_with(Soften::Cap).materials[0];
    let expected = (2.0_f64 / 3.0).sqrt() * 4e8 / 2e11;
    assert!((steel.yield_stress.unwrap() / steel.youngs_modulus / expected - 1.0).abs() < 1e-12);
    // The step suits the stiffest: pressure waves cross less than half a cell of 0.04.
    let keys = estimated_with(Soften::Cap).configuration(1);
    let wave = (2e7 * 0.7 / (1.3 * 0.4) / 7800.0_f64).sqrt();
    let light = (1e6 * 0.7 / (1.3 * 0.4) / 1100.0_f64).sqrt();
    let step = keys["substep_dt"].as_f64().unwrap();
    assert!(step <= 0.4 * 0.04 / wave.max(light) && step > 0.3 * 0.04 / wave.max(light), "{step}");
    assert_eq!((keys["material"].as_str().unwrap(), keys["E"].as_f64().unwrap()), ("jelly", 1e6));
    assert!(Config::from_map(keys).is_ok());
}
