use std::path::Path;

use gprop::evaluate::{filling, simulation};
use gprop::npz::Npz;
use gprop::progress::Progress;
use gprop::scene::gaussians::Gaussians;
use gprop::simulate::SimulateError;
use gprop::simulate::compat::config::Config;
use gprop::simulate::compat::law::Strength;
use gprop::simulate::compat::particle::Particle;
use gprop::simulate::compat::solver::Solver;
use gprop::simulate::compat::{run, strength_at};
use nalgebra::Vector3;

use crate::support::skipped;

/// The reference `name`; `None`, with a message, if this is not a development checkout.
fn reference(test: &str, name: &str) -> Option<Npz> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = ["../shared/reference/mpm", "../../shared/reference/mpm"].map(|folder| root.join(folder));
    let bytes = folders.iter().find_map(|folder| std::fs::read(folder.join(name)).ok());
    if bytes.is_none() {
        skipped(test, &format!("no ../shared/reference/mpm/{name}"));
    }
    bytes.map(|bytes| Npz::new(bytes).unwrap())
}

/// One law each; all ten trajectories take minutes and go through `gprop evaluate simulation`.
#[test]
fn reproduces_the_peers_trajectories() {
    for name in ["spin5k_g48_apic.npz", "drop_cube10k_g48_sand.npz", "drop_cube10k_g48_metal.npz"] {
        if let Some(mut npz) = reference("reproduces_the_peers_trajectories", name) {
            let comparison = simulation::compare(&mut npz, Progress::Hidden).unwrap();
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
    let at = |i: usize| 1.0 + (i as f32 + 0.5 - side as f32 / 2.0) * dx / 2.0;
    (0..side.pow(3))
        .map(|n| {
            let place = Vector3::new(at(n / side / side), at(n / side % side), at(n % side));
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

/// A small ball through all steps: selected, rotated, filled, simulated, rotated back.
#[test]
fn runs_a_configuration_on_a_scene() {
    let mut ball = Gaussians::default();
    let golden = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    for k in 0..4000 {
        let z = 1.0 - (k as f32 + 0.5) / 2000.0;
        let (radius, turn) = ((1.0 - z * z).sqrt(), golden * k as f32);
        ball.positions.push([radius * turn.cos(), radius * turn.sin(), z]);
        ball.log_scales.push([-3.0, -3.0, -3.0]);
        ball.rotations.push([1.0, 0.0, 0.0, 0.0]);
        // Every tenth is too faint to take part.
        ball.opacity_logits.push(if k % 10 == 0 { -6.0 } else { 2.0 });
        ball.sh_dc.push([0.5, 0.2, 0.1]);
    }
    let json = r#"{"rotation_degree": [90], "rotation_axis": [0], "scale": 1.0, "n_grid": 32, "g": [0, 0, -9.8],
        "frame_num": 2, "frame_dt": 0.02, "substep_dt": 1e-4, "boundary_conditions": [{"type": "bounding_box"}],
        "particle_filling": {"n_grid": 40, "density_threshold": 100.0, "search_threshold": 0.2}}"#;
    let config = Config::from_json(json).unwrap();
    let mut frames = Vec::new();
    let mut keep = |_: usize, _: &[Particle], gaussians: &Gaussians| {
        frames.push(gaussians.clone());
        Ok::<_, SimulateError>(())
    };
    let report = run(&ball, &config, &mut keep, Progress::Hidden).unwrap();
    assert_eq!((frames.len(), frames[0].len(), report.substeps), (3, 3600, 400));
    let too_large = Config::from_json(&json.replace("\"scale\": 1.0", "\"scale\": 2.5")).unwrap();
    match run(&ball, &too_large, &mut |_, _, _| Ok(()), Progress::Hidden) {
        Err(SimulateError::Configuration(why)) => assert!(why.contains("lower `scale`"), "{why}"),
        other => panic!("{other:?}"),
    }
    // A ball with a radius of 10 cells, without its shell.
    assert!(report.fill_particles > 2000 && report.fill_particles < 4200, "{}", report.fill_particles);
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
    assert_eq!(run(&ball, &config, &mut keep, Progress::Hidden).unwrap().fill_particles, report.fill_particles);
    assert_eq!(frames[0].len(), 3600 + report.fill_particles);
    // The shell's Gaussians reach 0.05 beyond the ball, a cell's diagonal is 0.17.
    let inside = |p: &[f32; 3]| p.iter().map(|x| x * x).sum::<f32>().sqrt() < 1.25;
    assert!(frames[0].positions[3600..].iter().all(inside));
    assert!(frames[0].log_scales[3600..].iter().all(|s| s.iter().all(|s| (s + 3.0).abs() < 1e-4)));
}
