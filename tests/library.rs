//! The crate as other programs use it.

use std::fs;

use gprop::exit::Exit;
use gprop::grasp::GraspError;
use gprop::parts::PartsError;
use gprop::pipeline::{Plan, Stage};
use gprop::{Options, Pipeline};

use crate::batch::ball::Balls;
use crate::batch::contents;
use crate::run::gprop;

/// The options of the first ball with the server that answers, and a short simulation.
fn options(balls: &Balls) -> Options {
    let mut options = Options::of_scene(balls.scene(0)).unwrap();
    let [_, url, _, model] = balls.answers();
    (options.query.lmm_url, options.query.lmm_model) = (Some(url), Some(model));
    (options.simulate.grid, options.simulate.frames, options.simulate.duration) = (16, 4, Some(0.04));
    options
}

#[test]
fn results_do_what_they_need() {
    let balls = Balls::new(1);
    let mut options = options(&balls);
    // Small enough for the gripper.
    options.scene.scale = "0.3".parse().unwrap();
    let mut pipeline = Pipeline::builder(balls.scene(0)).options(options).without_simulation().open().unwrap();
    let work = balls.scene(0).join("gprop");
    assert_eq!(pipeline.segments().unwrap().views.len(), 3);
    assert!(!work.join("answers.jsonl").exists(), "only what was asked for");
    assert_eq!(pipeline.answers().unwrap().segments.len(), 6);
    let field = pipeline.field().unwrap();
    assert_eq!((field.part_label.len(), field.confidence.len()), (200, 200));
    let labels = field.labels.len();
    let parts = pipeline.parts().unwrap();
    assert!(parts.parts.len() <= labels && parts.object.mass_kg.mid > 0.0);
    assert!(!work.join("grasp.json").exists() && !work.join("simulation").exists());
    let grasp = pipeline.grasp().unwrap();
    assert!(grasp.f_min_n > 0.0 && !work.join("simulation").exists());
    assert_eq!(pipeline.simulation().unwrap().frames.len(), 4, "only runs and reports leave it out");
}

#[test]
fn it_shares_its_work_folder_with_the_program() {
    let balls = Balls::new(1);
    let (own, theirs) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut pipeline = Pipeline::builder(balls.scene(0)).out(own.path()).options(options(&balls)).open().unwrap();
    let parts = pipeline.parts().unwrap();
    drop(pipeline);
    let program = |out: &tempfile::TempDir| {
        let mut command = gprop();
        command.arg("parts").arg(balls.scene(0)).args(["-q", "--lmm-model", "test-model", "--out"]).arg(out.path());
        assert!(command.output().unwrap().status.success());
        let record: serde_json::Value =
            serde_json::from_slice(&fs::read(out.path().join("run.json")).unwrap()).unwrap();
        record["stages"].as_array().unwrap().iter().filter(|stage| stage["reused"] == true).count()
    };
    assert_eq!((program(&own), program(&theirs)), (6, 0), "stages that were reused");
    assert!(contents(own.path()) == contents(theirs.path()));
    let mut again = Pipeline::builder(balls.scene(0)).out(theirs.path()).open().unwrap();
    assert_eq!(again.parts().unwrap(), parts);
}

#[test]
fn errors_say_what_kind_they_are() {
    let balls = Balls::new(1);
    let error = Pipeline::open(balls.folder()).err().unwrap();
    assert_eq!(error.kind(), Exit::Scene, "{error}");
    // Nothing is recorded, and no server is named.
    let error = Pipeline::open(balls.scene(0)).unwrap().answers().unwrap_err();
    assert_eq!(error.kind(), Exit::Answer, "{error}");

    let mut unscaled = options(&balls);
    unscaled.scene.scale = Options::default().scene.scale;
    let plan = Plan { to: Stage::Parts, from: None };
    let mut pipeline = Pipeline::builder(balls.scene(0)).options(unscaled).plan(plan).open().unwrap();
    pipeline.run().unwrap();
    for error in [pipeline.parts().unwrap_err(), pipeline.grasp().unwrap_err()] {
        assert!(matches!(error.downcast_ref(), Some(PartsError::ScaleUnknown)), "{error}");
        assert!(error.kind() == Exit::Scene && error.to_string().contains("--scale"), "{error}");
    }

    let file = balls.scene(0).join("gprop.toml");
    for (line, words) in [
        ("lmm-url = \"http://h/v1\"", "a scene may not set `lmm-url`"),
        ("volume-cells = \"many\"", "invalid value 'many' for '--volume-cells"),
        ("volume-cell = 5", "unknown key"),
    ] {
        fs::write(&file, line).unwrap();
        let error = Options::of_scene(balls.scene(0)).unwrap_err();
        assert!(error.kind() == Exit::Usage && error.to_string().contains(words), "{error}");
        assert!(error.to_string().contains("gprop.toml"), "{error}");
    }
}

/// What a weighing changes in the belief about a part (here its density and its volume), the simulation, the report and
/// the exports believe too.
#[test]
fn a_known_mass_counts_everywhere() {
    let balls = Balls::new(1);
    let mut options = options(&balls);
    options.scene.scale = "0.3".parse().unwrap();
    let open = |options: &Options| Pipeline::builder(balls.scene(0)).options(options.clone()).open().unwrap();
    let expected = open(&options).parts().unwrap().object.mass_kg.mid;
    options.parts.known_mass = Some(1.2 * expected);
    let mut pipeline = open(&options);
    let parts = pipeline.parts().unwrap();
    let simulated = pipeline.simulation().unwrap().mass_kg;
    let believed = parts.object.mass_kg.mid;
    assert!((believed / expected - 1.2).abs() < 0.02, "{believed} kg, expected {expected} kg before the weighing");
    // Masses of particles are in f32.
    assert!((simulated / believed - 1.0).abs() < 1e-5, "{simulated} kg fall, but the parts weigh {believed} kg");
    pipeline.run().unwrap();
    let report = fs::read(balls.scene(0).join("gprop/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    for part in &parts.parts {
        let labels = report["labels"].as_array().unwrap();
        let label = labels.iter().find(|label| label["id"] == part.id).unwrap();
        assert_eq!(label["density_kg_m3"]["mid"], part.density_kg_m3.mid, "{}", part.caption);
    }
}

/// For a report, a grasp that cannot be computed is a warning. Whoever asks for the grasp hears why; the plan stays.
#[test]
fn a_grasp_that_failed_says_why_after_a_run_too() {
    let balls = Balls::new(1);
    // The ball is wider than the gripper opens.
    let options = options(&balls);
    let mut pipeline = Pipeline::builder(balls.scene(0)).options(options).without_simulation().open().unwrap();
    pipeline.parts().unwrap();
    pipeline.run().unwrap();
    assert!(balls.scene(0).join("gprop/report.html").exists(), "the run goes on to the report");
    for _ in 0..2 {
        let error = pipeline.grasp().unwrap_err();
        assert!(error.downcast_ref::<GraspError>().is_some(), "{error}");
    }
    pipeline.run().unwrap();
}

/// The report is made without the simulation, which a later run adds.
#[test]
fn the_simulation_may_be_left_out() {
    let balls = Balls::new(1);
    let out = tempfile::tempdir().unwrap();
    let run = |flags: &[&str]| {
        let mut command = gprop();
        command.arg("run").arg(balls.scene(0)).args(["-q", "--frames", "3", "--duration", "0.02", "--grid", "16"]);
        command.current_dir(balls.scene(0)).args(["--images", "."]);
        command.arg("--out").arg(out.path()).args(balls.answers()).args(flags);
        let done = command.output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let report = fs::read(out.path().join("report.json")).unwrap();
        let page = fs::read_to_string(out.path().join("report.html")).unwrap();
        (serde_json::from_slice::<serde_json::Value>(&report).unwrap(), page)
    };
    let (report, page) = run(&["--no-simulate"]);
    assert!(report["simulation"].is_null() && !page.contains("<h2>Simulation</h2>"));
    let command = report["reproduction"]["command"].as_str().unwrap();
    assert!(command.starts_with("gprop run ball-0 --no-simulate "), "{command}");
    for path in [" --images=ball-0 ", " --segments=ball-0/labels "] {
        assert!(command.contains(path), "no{path}in: {command}");
    }
    assert!(!out.path().join("simulation").exists());
    let (report, page) = run(&[]);
    assert_eq!(report["simulation"]["frames"].as_array().unwrap().len(), 3);
    assert!(page.contains("<h2>Simulation</h2>") && out.path().join("simulation/simulation.json").exists());
    // The simulation's files stay, but the report leaves them out.
    let (report, _) = run(&["--no-simulate"]);
    assert!(report["simulation"].is_null() && out.path().join("simulation/simulation.json").exists());
    let mut command = gprop();
    command.arg("run").arg(balls.scene(0)).args(["--to", "simulate", "--no-simulate"]);
    assert_eq!(command.output().unwrap().status.code(), Some(2));
}
