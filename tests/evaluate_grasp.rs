//! `gprop evaluate grasp`: the paper's rates, recorded and predicted.

use std::process::{Command, Output};

use serde_json::Value;

fn evaluate(flag: &str, table: &str, more: &[&str]) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.csv");
    std::fs::write(&path, table).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_gprop"));
    command.args(["evaluate", "grasp", flag]).arg(path).args(more).output().unwrap()
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
    let policies = policies(evaluate("--outcomes", &table, &["--json"]));
    // The paper's table 3: 50, 100, 50 and 87.5, 81.25, 68.75 percent.
    assert_eq!(policies["MinGF"], serde_json::json!({ "pur": 0.5, "ndr": 1.0, "sr": 0.5, "count": 16 }));
    assert_eq!(policies["MidGF"], serde_json::json!({ "pur": 0.875, "ndr": 0.8125, "sr": 0.6875, "count": 16 }));
}

#[test]
fn predictions_by_hand() {
    // A block: F_min 1/2 * 2 * 9.8 / 0.5 = 19.6 N, F_max 1.1e-4 * 50e6 = 5500 N. A paper cup: F_min 0.098 N, F_max
    // 1/2 * 1.1e-4 * 2e9 * 4e-4 * 0.5 = 22 N. The paper's gripper presses with 0, 21.18 and 40 N.
    let table = "object,mass_kg,friction,strength_pa,youngs_modulus_pa,thickness_m,f_star_n\n\
                 block,2.0,0.5,50e6,12e9,0.05,29.8\ncup,0.01,0.5,20e6,2e9,0.0004,11\n";
    let policies = policies(evaluate("--objects", table, &["--json"]));
    let rates = |pur, ndr, sr| serde_json::json!({ "pur": pur, "ndr": ndr, "sr": sr, "count": 2 });
    assert_eq!(policies["MinGF"], rates(0.0, 1.0, 0.0));
    assert_eq!(policies["MidGF"], rates(1.0, 1.0, 1.0));
    assert_eq!(policies["MaxGF"], rates(1.0, 0.5, 0.5));
    assert_eq!(policies["gprop"], rates(1.0, 1.0, 1.0));
    let text = String::from_utf8(evaluate("--objects", table, &[]).stdout).unwrap();
    assert!(text.contains("predicted"), "{text}");
}

#[test]
fn the_readmes_table_of_the_scenes() {
    let policies = policies(evaluate("--objects", include_str!("../docs/grasp_scenes.csv"), &["--json"]));
    let readme = include_str!("../README.md");
    for policy in ["MinGF", "MidGF", "MaxGF", "gprop"] {
        let [pur, ndr, sr] = ["pur", "ndr", "sr"].map(|rate| 100.0 * policies[policy][rate].as_f64().unwrap());
        assert!(
            readme.contains(&format!("| {policy} | {pur:.0} | {ndr:.0} | {sr:.0} |")),
            "{policy}: {pur} {ndr} {sr}"
        );
    }
}

#[test]
fn tables_that_are_wrong_are_refused() {
    let refused = |flag: &str, table: &str, needle: &str| {
        let output = evaluate(flag, table, &[]);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(needle) && message.contains("table.csv"), "{message}");
    };
    refused("--outcomes", "object,policy,picked_up,undamaged\n", "no rows");
    refused("--outcomes", "object,policy,picked_up\na,b,true\n", "undamaged");
    refused("--outcomes", "object,policy,picked_up,undamaged\na,b,perhaps,true\n", "line: 2");
    let header = "object,mass_kg,friction,strength_pa,youngs_modulus_pa,thickness_m,f_star_n\n";
    refused("--objects", &format!("{header}cup,0.3,0,1e7,1e9,0.004,9\n"), "friction");
}
