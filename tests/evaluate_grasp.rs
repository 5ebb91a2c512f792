//! `gprop evaluate grasp`: the paper's rates, of recorded trials and of grasps that runs proposed.

use std::process::{Command, Output};

use gprop::evaluate::grasp::predicted::GraspedObject;
use gprop::evaluate::grasp::{Evaluation, truth};
use gprop::grasp::gripper::GripperProfile;
use gprop::materials::MaterialLibrary;
use serde_json::Value;

use crate::batch::ball::Balls;
use crate::grasp::scenes::Measured;
use crate::parts::truth::hammer;
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

/// A ball with its `grasp.json` for the gripper in the second folder's `wide.toml`, and without ground truth.
fn grasped_ball() -> (Balls, tempfile::TempDir) {
    let (balls, home) = (Balls::new(1), tempfile::tempdir().unwrap());
    let wide = "name = \"wide\"\nforce_n = [1.0, 101.0]\nfinger_area_m2 = 1e-3\npad = \"rubber\"\nstroke_m = 0.4\n\
                [command]\nenabled_from = 0.0\nfull = 100.0\n";
    std::fs::write(home.path().join("wide.toml"), wide).unwrap();
    let mut run = gprop();
    run.env_remove("OPENAI_API_KEY").arg("grasp").arg(balls.scene(0)).args(balls.answers());
    let output = run.arg("--gripper").arg(home.path().join("wide.toml")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    (balls, home)
}

#[test]
fn a_proposal_is_judged_by_the_true_part_at_its_contacts() {
    let measured = Measured::of(&hammer());
    let gripper = GripperProfile::load("paper").unwrap();
    let report = measured.with_paper();
    let place = &report.candidates[0];
    let truth = truth::of(place, measured.scene, &hammer().join("ground_truth"), MaterialLibrary::builtin()).unwrap();
    // The parts of this scene were named like the true ones.
    assert_eq!((&truth.part, truth.thickness_m), (&place.part, place.thickness_m.mid));
    let by_hand = 0.5 * 0.6014543244497264 * 9.8 / truth.friction;
    let object = GraspedObject::new("hammer", report, truth, &gripper);
    assert_eq!((object.f_star_n, object.normalized_command), (report.f_star_n, report.normalized_command));
    assert!((object.true_f_min_n - by_hand).abs() < 1e-12, "{} is not {by_hand}", object.true_f_min_n);
    // Commands 15, 60 and 100 of a gripper that is linear from 0 N at 15 to 40 N at 100.
    let forces = [
        ("MinGF", 0.0),
        ("MidGF", 40.0 * 45.0 / 85.0),
        ("MaxGF", 40.0),
        ("gprop", report.force_n),
        ("F*", report.f_star_n),
    ];
    for (policy, force) in forces {
        let grasp = object.grasps[policy];
        assert!((grasp.force_n - force).abs() < 1e-9, "{policy}: {grasp:?}");
        assert_eq!((grasp.picked_up, grasp.undamaged), (force > by_hand, true), "{policy}");
    }
    let found = Evaluation::of_objects(vec![object]);
    assert_eq!((found.policies["MinGF"].pur, found.policies["gprop"].sr), (0.0, 1.0));
    let text = found.text();
    assert!(text.contains("own formulas") && text.contains("MidGF 21.2 N") && text.contains("slips"), "{text}");
}

#[test]
fn what_cannot_be_judged_is_refused() {
    let (balls, home) = grasped_ball();
    let refused = |gripper: &str, words: &[&str]| {
        let mut command = gprop();
        let output = command.args(["evaluate", "grasp", "--gripper", gripper]).arg(balls.scene(0)).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    };
    // Forces of another gripper say nothing about these.
    refused("paper", &["is for the gripper \"wide\"", "--gripper"]);
    refused(&home.path().join("wide.toml").display().to_string(), &["ground_truth/parts.json"]);
}

#[test]
fn a_fixed_force_of_zero_is_called_an_artefact_of_the_profile() {
    let paper = GripperProfile::load("paper").unwrap();
    assert_eq!(paper.force_for(15.0), 0.0, "the paper does not say how hard the fingers press at command 15");
    let (balls, _home) = grasped_ball();
    let report = std::fs::read(balls.scene(0).join("gprop/grasp.json")).unwrap();
    let report = serde_json::from_slice(&report).unwrap();
    let truth = truth::Truth {
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
    assert!(text.contains("MinGF 0.0 N") && text.contains("the rates of MinGF mean nothing"), "{text}");
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
    refused("object,policy,picked_up,undamaged\r\na,b,perhaps,true\r\n", "line 2: field 2: ");
}
