//! `gprop evaluate grasp`: the paper's rates, of recorded trials and of grasps that runs proposed.

use std::process::{Command, Output};

use gprop::evaluate::grasp::Evaluation;
use gprop::evaluate::grasp::predicted::GraspedObject;
use serde_json::{Value, json};

use crate::batch::ball::Balls;
use crate::run::gprop;

fn evaluate(table: &str, more: &[&str]) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.csv");
    std::fs::write(&path, table).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_gprop"));
    command.args(["evaluate", "grasp", "--outcomes"]).arg(path).args(more).output().unwrap()
}

fn policies(output: Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice::<Value>(&output.stdout).unwrap()["policies"].clone()
}

#[test]
fn the_papers_table_from_outcomes_like_its_own() {
    // Of 16 objects: MinGF picks up 8 and damages none; MidGF picks up 14 and damages 3; 11 are both
    // picked up and undamaged.
    let mut table = "object,policy,picked_up,undamaged\n".to_owned();
    for n in 0..16 {
        table += &format!("o{n},MinGF,{},true\no{n},MidGF,{},{}\n", n < 8, n < 14, n >= 3);
    }
    let policies = policies(evaluate(&table, &["--json"]));
    // The paper's table 3: 50, 100, 50 and 87.5, 81.25, 68.75 percent.
    assert_eq!(policies["MinGF"], serde_json::json!({ "pur": 0.5, "ndr": 1.0, "sr": 0.5, "count": 16 }));
    assert_eq!(policies["MidGF"], serde_json::json!({ "pur": 0.875, "ndr": 0.8125, "sr": 0.6875, "count": 16 }));
}

/// A ball of wood with its grasp, and its truth: the weight, and that its two halves are glass.
fn grasped_ball(total_mass_kg: f64) -> (Balls, tempfile::TempDir) {
    let (balls, home) = (Balls::new(1), tempfile::tempdir().unwrap());
    let wide = "name = \"wide\"\nforce_n = [1.0, 101.0]\nfinger_area_m2 = 1e-3\npad = \"rubber\"\nstroke_m = 0.4\n\
                [command]\nenabled_from = 0.0\nfull = 100.0\n";
    std::fs::write(home.path().join("wide.toml"), wide).unwrap();
    let mut run = gprop();
    run.env_remove("OPENAI_API_KEY").arg("grasp").arg(balls.scene(0)).args(balls.answers());
    let output = run.arg("--gripper").arg(home.path().join("wide.toml")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let truth = balls.scene(0).join("ground_truth");
    std::fs::create_dir_all(truth.join("part_maps")).unwrap();
    for entry in std::fs::read_dir(balls.labels(0)).unwrap() {
        let from = entry.unwrap().path();
        std::fs::copy(&from, truth.join("part_maps").join(from.file_name().unwrap())).unwrap();
    }
    std::fs::write(
        truth.join("part_maps/labels.json"),
        r#"{"1": "soda-lime glass, float", "2": "soda-lime glass, float"}"#,
    )
    .unwrap();
    let half = |id: u16| {
        json!({
            "id": id, "name": "half", "family": "glass", "thickness_m": 0.001, "youngs_modulus_pa": 7e10,
            "friction_rubber_pad": 0.5,
        })
    };
    let parts = json!({ "total_mass_kg": total_mass_kg, "parts": [half(1), half(2)] });
    std::fs::write(truth.join("parts.json"), parts.to_string()).unwrap();
    (balls, home)
}

#[test]
fn what_a_run_proposed_is_judged_by_the_truth() {
    let (balls, home) = grasped_ball(5.0);
    let evaluate = |gripper: &str, more: &[&str]| {
        let mut command = gprop();
        command.args(["evaluate", "grasp"]).arg(balls.scene(0)).arg("--gripper").arg(gripper).args(more);
        command.output().unwrap()
    };
    let wide = home.path().join("wide.toml").display().to_string();
    let output = evaluate(&wide, &["--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let written = std::fs::read(balls.scene(0).join("gprop/grasp.json")).unwrap();
    let written: Value = serde_json::from_slice(&written).unwrap();
    let object = &found["objects"][0];
    for key in ["part", "f_min_n", "f_max_n", "f_star_n", "normalized_command", "feasible"] {
        assert_eq!(object[key], written[key], "{key} is that of grasp.json");
    }
    assert_eq!((&object["truth"]["part"], &object["truth"]["mass_kg"]), (&json!("half"), &json!(5.0)));
    let number = |value: &Value| value.as_f64().unwrap();
    // 1/2 * 5 kg * 9.8 m/s2 / 0.5; 1/2 * 1e-3 m2 * 7e10 Pa * 0.001 m * kappa_max of glass, which is below what
    // crushes it.
    assert!((number(&object["true_f_min_n"]) - 49.0).abs() < 1e-12, "{object}");
    let bends = 0.5 * 1e-3 * 7e10 * 0.001 * gprop::grasp::curvature::of_family("glass");
    assert!((number(&object["true_f_max_n"]) - bends).abs() < 1e-9 * bends, "{object}");
    // Commands 0, 100 * 45 / 85 and 100 of a gripper with 1 to 101 N.
    let middle = 1.0 + 100.0 * 45.0 / 85.0;
    for (policy, force) in
        [("MinGF", 1.0), ("MidGF", middle), ("MaxGF", 101.0), ("gprop", number(&written["f_star_n"]))]
    {
        let grasp = &object["grasps"][policy];
        assert!((number(&grasp["force_n"]) - force).abs() < 1e-9, "{policy}: {grasp}");
        assert_eq!((&grasp["picked_up"], &grasp["undamaged"]), (&json!(force >= 49.0), &json!(true)), "{policy}");
        assert_eq!(found["policies"][policy]["pur"], f64::from(force >= 49.0), "{policy}");
    }
    let text = String::from_utf8(evaluate(&wide, &[]).stdout).unwrap();
    assert!(text.contains("own formulas") && text.contains("MinGF 1.0 N") && text.contains("slips"), "{text}");
    // Forces of another gripper say nothing about these.
    let other = evaluate("paper", &[]);
    assert_eq!(other.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&other.stderr).contains("is for the gripper \"wide\""), "{other:?}");
}

#[test]
fn a_fixed_force_of_zero_is_called_an_artefact_of_the_profile() {
    let paper = gprop::grasp::gripper::GripperProfile::load("paper").unwrap();
    assert_eq!(paper.force_for(15.0), 0.0, "the paper does not say how hard the fingers press at command 15");
    let (balls, _home) = grasped_ball(1.0);
    let report = std::fs::read(balls.scene(0).join("gprop/grasp.json")).unwrap();
    let report = serde_json::from_slice(&report).unwrap();
    let truth = gprop::evaluate::grasp::truth::Truth {
        part: "half".to_owned(),
        family: "glass".to_owned(),
        mass_kg: 1.0,
        friction: 0.5,
        strength_pa: 1e7,
        youngs_modulus_pa: 7e10,
        thickness_m: 0.001,
    };
    let object = GraspedObject::new("ball", &report, truth, &paper);
    let text = Evaluation::of_objects(vec![object]).text();
    assert!(text.contains("MinGF 0.0 N") && text.contains("the rates of MinGF say nothing"), "{text}");
}

#[test]
fn tables_that_are_wrong_are_refused() {
    let refused = |table: &str, needle: &str| {
        let output = evaluate(table, &[]);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(needle) && message.contains("table.csv"), "{message}");
    };
    refused("object,policy,picked_up,undamaged\n", "no rows");
    refused("object,policy,picked_up\na,b,true\n", "undamaged");
    refused("object,policy,picked_up,undamaged\na,b,perhaps,true\n", "line: 2");
}
