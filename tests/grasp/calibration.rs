//! Calibration curves: recovered, inverted, refused.

use std::process::Command;

use gprop::grasp::calibration::{CalibrationError, CalibrationPoint, Fit};
use gprop::grasp::gripper::GripperProfile;
use proptest::prelude::*;

const ENABLED: [f64; 2] = [15.0, 100.0];

/// Five measurements at each of eighteen commands, with errors of up to `noise` N in either direction.
fn measured(force_at: impl Fn(f64) -> f64, noise: f64) -> Vec<CalibrationPoint> {
    let off = [-1.0, -0.5, 0.0, 0.5, 1.0];
    let commands = (0..18).map(|k| 15.0 + 5.0 * f64::from(k));
    let point = |command: f64, off: f64| CalibrationPoint { command, force_n: force_at(command) + noise * off };
    commands.flat_map(|command| off.map(|off| point(command, off))).collect()
}

/// A curve like that of a real gripper: flat at first, then steep, then levelling off. Rises from 2 to 38 N.
fn s_curve(command: f64) -> f64 {
    let t = (command - 15.0) / 85.0;
    2.0 + 36.0 * t * t * (3.0 - 2.0 * t) * 0.6 + 36.0 * 0.4 * t
}

fn csv(points: &[CalibrationPoint]) -> String {
    let lines: String = points.iter().map(|p| format!("{}, {}\n", p.command, p.force_n)).collect();
    format!("command,force_n\n# load cell, 100 Hz\n{lines}")
}

#[test]
fn a_polynomial_is_found_again_and_inverted() {
    let fit = Fit::of(&measured(s_curve, 0.0), ENABLED).unwrap();
    // A polynomial of order 5 can represent a cubic: only the rounding of a least-squares solution is left.
    assert!(fit.max_residual_n < 1e-11, "{}", fit.max_residual_n);
    for force in [2.0, 5.5, 20.0, 37.9] {
        let command = fit.command_for(force);
        assert!((fit.force_at(command) - force).abs() < 1e-10 && (15.0..=100.0).contains(&command), "{force}");
    }
    assert_eq!((fit.command_for(0.0), fit.command_for(99.0)), (15.0, 100.0));
}

#[test]
fn noise_is_averaged_and_its_size_told() {
    let fit = Fit::of(&measured(s_curve, 0.4), ENABLED).unwrap();
    // Symmetric noise does not change the means, and so not the fit; its root mean square is 0.4 sqrt(0.5).
    assert!((fit.force_at(57.5) - s_curve(57.5)).abs() < 1e-10);
    assert!((fit.rms_residual_n - 0.4 * 0.5f64.sqrt()).abs() < 1e-10, "{}", fit.rms_residual_n);
    assert!((fit.max_residual_n - 0.4).abs() < 1e-10, "{}", fit.max_residual_n);
}

#[test]
fn what_is_below_the_enabled_commands_is_left_out() {
    let mut points = measured(s_curve, 0.0);
    points.push(CalibrationPoint { command: 5.0, force_n: 0.0 });
    let fit = Fit::of(&points, ENABLED).unwrap();
    assert_eq!(fit.left_out, 1);
    assert!(fit.max_residual_n < 1e-11);
}

#[test]
fn measurements_that_make_no_calibration_are_refused() {
    let points = measured(s_curve, 0.0);
    let refused = |points: &[CalibrationPoint]| Fit::of(points, ENABLED).unwrap_err();
    assert!(matches!(refused(&points[..25]), CalibrationError::TooFew { found: 5, .. }));
    assert!(matches!(refused(&points[5..]), CalibrationError::NotCovered { .. }));
    let mut negative = points.clone();
    negative[3].force_n = -1.0;
    assert!(matches!(refused(&negative), CalibrationError::Value { index: 4, .. }));
    // Fingers that stall: 10 + 30 (4 t^3 - 6 t^2 + 2.6 t) N falls from t = 1/2 - sqrt(0.4/12), command 41.98.
    let stalling = |command: f64| {
        let t = (command - 15.0) / 85.0;
        10.0 + 30.0 * t * (4.0 * t * t - 6.0 * t + 2.6)
    };
    let error = refused(&measured(stalling, 0.0));
    assert!(matches!(error, CalibrationError::NotMonotone { at, .. } if (41.9..42.2).contains(&at)), "{error}");
    assert!(error.to_string().contains("measure again"), "{error}");
}

proptest! {
    /// Every curve that rises gently enough for order 5 to follow is inverted everywhere.
    #[test]
    fn every_force_between_the_ends_has_its_command(
        linear in 5.0..60.0f64, bend in -0.9..0.9f64, share in 0.0..=1.0f64,
    ) {
        let curve = |command: f64| {
            let t = (command - 15.0) / 85.0;
            1.0 + linear * (t + 0.5 * bend * t * (1.0 - t))
        };
        let fit = Fit::of(&measured(curve, 0.0), ENABLED).unwrap();
        let force = fit.force_n[0] + share * (fit.force_n[1] - fit.force_n[0]);
        prop_assert!((fit.force_at(fit.command_for(force)) - force).abs() < 1e-9);
    }
}

fn calibrate(folder: &std::path::Path, arguments: &[&str]) -> std::process::Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gprop"));
    command.args(["grasp", "calibrate"]).args(arguments).current_dir(folder).output().unwrap()
}

#[test]
fn the_command_writes_a_plot_and_a_profile_that_grasps_use() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("points.csv"), csv(&measured(s_curve, 0.3))).unwrap();
    let output = calibrate(
        folder.path(),
        &["points.csv", "--gripper", "paper", "--plot", "fit.svg", "--profile", "mine.toml", "--json"],
    );
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["commands"].as_array().unwrap().len(), 18);
    assert_eq!(report["commands"][0]["count"], 5);
    let plot = std::fs::read_to_string(folder.path().join("fit.svg")).unwrap();
    assert_eq!(plot.matches("<circle").count(), 2 * 90);
    let profile = GripperProfile::load(folder.path().join("mine.toml").to_str().unwrap()).unwrap();
    assert!(profile.is_calibrated());
    assert!((profile.force_for(profile.command_for(20.0)) - 20.0).abs() < 1e-9);
    // 2 N at 15 and 38 N at 100 are the ends of the curve, and so of the gripper's range of force.
    assert!((profile.force_n[0] - 2.0).abs() < 1e-9 && (profile.force_n[1] - 38.0).abs() < 1e-9);
}

#[test]
fn the_command_refuses_bad_measurements() {
    let folder = tempfile::tempdir().unwrap();
    let write = |text: &str| std::fs::write(folder.path().join("points.csv"), text).unwrap();
    let refused = |needle: &str| {
        let output = calibrate(folder.path(), &["points.csv", "--gripper", "paper", "--profile", "mine.toml"]);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(needle) && message.contains("points.csv"), "{message}");
        assert!(!folder.path().join("mine.toml").exists());
    };
    refused("No such file");
    write("command;force\n15;2\n");
    refused("command");
    write("command,force_n\r\n15,2\r\n20,much\r\n");
    refused("line 3: field 1: ");
    write("command,force_n\n15,2\n20,3\n");
    refused("too few");
    write(&csv(&measured(|command| 40.0 - 0.2 * command, 0.0)));
    refused("falls");
}
