//! The crate as other programs use it.

use std::any::TypeId;
use std::fs;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex};

use clap::{Arg, Args, Command};
use gprop::gaussians::bounds::Bounds;
use gprop::grasp::GraspError;
use gprop::parts::PartsError;
use gprop::scene::{ObjectBox, PhotoPoint, ScaleChoice};
use gprop::{CancelToken, ErrorKind, Event, Options, Pipeline, Plan, Stage};
use nalgebra::Point3;

use crate::batch::ball::Balls;
use crate::batch::contents;
use crate::query::{a, good_answer};
use crate::run::gprop;

/// The options of the first ball with the server that answers, and a short simulation.
fn options(balls: &Balls) -> Options {
    options_of(balls, 0)
}

fn options_of(balls: &Balls, number: usize) -> Options {
    let mut options = Options::of_scene(balls.scene(number)).unwrap();
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
    let mut pipeline = Pipeline::builder(balls.scene(0))
        .options(options)
        .plan(Plan::to(Stage::Report).without(Stage::Simulate))
        .open()
        .unwrap();
    let work = balls.scene(0).join("gprop");
    assert_eq!(pipeline.segments().unwrap().views.len(), 3);
    assert!(!work.join("answers.jsonl").exists(), "only what was asked for");
    assert_eq!(pipeline.answers().unwrap().all.len(), 6);
    let (field, parts) = (pipeline.field().unwrap(), pipeline.parts().unwrap());
    assert_eq!((field.part_index.len(), field.confidence.len()), (200, 200));
    assert!(parts.parts.len() <= field.parts.len() && parts.object.mass_kg.mid > 0.0);
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
    assert_eq!((program(&own), program(&theirs)), (8, 0), "stages that were reused");
    assert!(contents(own.path()) == contents(theirs.path()));
    let mut again = Pipeline::builder(balls.scene(0)).out(theirs.path()).open().unwrap();
    assert_eq!(again.parts().unwrap(), parts);
}

/// A run with a warning, in a process that does nothing else: see [`it_prints_nothing`].
#[test]
fn a_caller_of_the_pipeline() {
    let balls = Balls::new(1);
    fs::remove_file(balls.scene(0).join("images/002.png")).unwrap();
    let mut pipeline = Pipeline::builder(balls.scene(0)).options(options(&balls)).open().unwrap();
    assert_eq!(pipeline.segments().unwrap().views.len(), 2);
    pipeline.simulation().unwrap();
    pipeline.grasp().unwrap_err();
    drop(pipeline);
    // The program says what the library passes to `tracing`.
    let program = gprop().arg("inspect").arg(balls.scene(0)).output().unwrap();
    assert!(String::from_utf8_lossy(&program.stdout).contains("\nwarning"), "{program:?}");
}

#[test]
fn it_prints_nothing() {
    let mut caller = std::process::Command::new(std::env::current_exe().unwrap());
    caller.args(["--exact", "library::a_caller_of_the_pipeline", "--nocapture"]);
    let run = caller.output().unwrap();
    assert!(run.status.success(), "{run:?}");
    assert_eq!(String::from_utf8_lossy(&run.stderr), "");
    // What the harness of the tests prints, and no line more.
    let words = String::from_utf8_lossy(&run.stdout);
    let lines: Vec<&str> = words.lines().filter(|line| !line.is_empty()).collect();
    assert!(lines.len() == 3 && lines[1].ends_with(" ... ok"), "{words}");
}

#[test]
fn several_scenes_are_open_at_once_and_each_runs_on_a_thread_of_its_own() {
    let balls = Balls::new(2);
    let open = |scene| Pipeline::builder(balls.scene(scene)).options(options_of(&balls, scene)).open().unwrap();
    let mut both = [open(0), open(1)];
    assert_eq!(both.each_mut().map(|pipeline| pipeline.segments().unwrap().views.len()), [3, 3]);
    let weigh = |mut pipeline: Pipeline| move || pipeline.parts().unwrap();
    let threads = both.map(|pipeline| std::thread::spawn(weigh(pipeline)));
    let together = threads.map(|thread| thread.join().unwrap());
    for (scene, parts) in together.into_iter().enumerate() {
        let out = tempfile::tempdir().unwrap();
        let alone = Pipeline::builder(balls.scene(scene)).out(&out).options(options_of(&balls, scene)).open();
        assert_eq!(alone.unwrap().parts().unwrap(), parts, "scene {scene}");
    }
}

#[test]
fn a_run_tells_its_steps_and_can_be_cancelled_and_continued() {
    let balls = Balls::new(1);
    let (done, steps) = (Arc::new(Mutex::new(Vec::new())), Arc::new(Mutex::new(Vec::new())));
    let token = CancelToken::default();
    let listener = {
        let (done, steps, token) = (Arc::clone(&done), Arc::clone(&steps), token.clone());
        move |event: &Event| match event {
            Event::StageDone { name, .. } => {
                done.lock().unwrap().push((*name).to_owned());
                if *name == "query" {
                    token.cancel();
                }
            }
            Event::Steps { what, done, of, .. } => steps.lock().unwrap().push(((*what).to_owned(), *done, *of)),
            _ => {}
        }
    };
    let builder = || Pipeline::builder(balls.scene(0)).options(options(&balls));
    let mut pipeline = builder().on_progress(listener).cancel_with(&token).open().unwrap();
    let error = pipeline.parts().unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Cancelled, "{error}");
    assert_eq!(*done.lock().unwrap(), ["scene", "segment", "consensus", "recognise", "refine", "query"]);
    assert!(steps.lock().unwrap().contains(&("query".to_owned(), 6, 6)), "{steps:?}");
    let work = balls.scene(0).join("gprop");
    assert!(work.join("answers.jsonl").exists() && !work.join("field.ply").exists());
    drop(pipeline);
    assert!(builder().open().unwrap().parts().unwrap().object.mass_kg.mid > 0.0);
}

/// The token is looked at between questions too: those that were answered are kept.
#[test]
fn cancelling_between_questions_keeps_the_answers() {
    let token = CancelToken::default();
    let cancels = token.clone();
    let balls = Balls::asked(1, move |_| {
        cancels.cancel();
        good_answer(a("wood"))
    });
    let mut options = options(&balls);
    options.query.lmm_parallel = 1;
    let builder = || Pipeline::builder(balls.scene(0)).options(options.clone());
    let error = builder().cancel_with(&token).open().unwrap().answers().unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Cancelled, "{error}");
    let recorded = fs::read_dir(balls.scene(0).join("recorded")).unwrap().map(|entry| entry.unwrap().path());
    let recorded = recorded.filter(|path| path.extension().is_some_and(|ending| ending == "json"));
    assert_eq!(recorded.count(), 1, "the answer that was on its way");
    assert_eq!(builder().open().unwrap().answers().unwrap().all.len(), 6);
}

#[test]
fn errors_say_what_kind_they_are() {
    let balls = Balls::new(1);
    let error = Pipeline::open(balls.folder()).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::Scene, "{error}");
    // Nothing is recorded, and no server is named.
    let error = Pipeline::open(balls.scene(0)).unwrap().answers().unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Answer, "{error}");

    let mut unscaled = options(&balls);
    unscaled.scene.scale = Options::default().scene.scale;
    let plan = Plan::to(Stage::Parts);
    let mut pipeline = Pipeline::builder(balls.scene(0)).options(unscaled).plan(plan).open().unwrap();
    pipeline.run().unwrap();
    for error in [pipeline.parts().unwrap_err(), pipeline.grasp().unwrap_err()] {
        assert!(matches!(error.downcast_ref(), Some(PartsError::ScaleUnknown)), "{error}");
        assert!(error.kind() == ErrorKind::Scene && error.to_string().contains("--scale"), "{error}");
    }

    let file = balls.scene(0).join("gprop.toml");
    for (line, words) in [
        ("lmm-url = \"http://h/v1\"", "a scene may not set `lmm-url`"),
        ("volume-cells = \"many\"", "invalid value 'many' for '--volume-cells"),
        ("volume-cell = 5", "unknown key"),
    ] {
        fs::write(&file, line).unwrap();
        let error = Options::of_scene(balls.scene(0)).unwrap_err();
        assert!(error.kind() == ErrorKind::Usage && error.to_string().contains(words), "{error}");
        assert!(error.to_string().contains("gprop.toml"), "{error}");
    }
}

/// Gives an option of a stage a value that it does not accept.
type Spoil = fn(&mut Options);

/// Every option of a stage that is a number, and values that it does not accept.
const OUTSIDE: &[(&str, Spoil)] = &[
    ("--views", |o| o.scene.views = NonZeroUsize::new(100_001).unwrap()),
    ("--render-views", |o| o.scene.render_views = NonZeroUsize::new(100_001)),
    ("--object-at", |o| o.scene.object_at = Some(PhotoPoint { view: String::new(), pixel: [1, 1] })),
    ("--object-box", |o| {
        o.scene.object_box = Some(ObjectBox(Bounds { min: Point3::origin(), max: [f64::NAN; 3].into() }));
    }),
    ("--scale", |o| o.scene.scale = ScaleChoice::Factor(f64::NAN)),
    ("--scale", |o| o.scene.scale = ScaleChoice::BoundingBox { axis: 2, meters: -0.1 }),
    ("--points-per-side", |o| o.segment.generator.points_per_side = 0),
    ("--min-predicted-iou", |o| o.segment.generator.min_predicted_iou = f32::NAN),
    ("--min-stability", |o| o.segment.generator.min_stability = 1.1),
    ("--stability-offset", |o| o.segment.generator.stability_offset = f32::INFINITY),
    ("--box-nms", |o| o.segment.generator.box_nms = -0.1),
    ("--crop-layers", |o| o.segment.generator.crop_layers = 5),
    ("--crop-nms", |o| o.segment.generator.crop_nms = f32::NAN),
    ("--crop-overlap", |o| o.segment.generator.crop_overlap = 1.0),
    ("--crop-points-downscale", |o| o.segment.generator.crop_points_downscale = 0),
    ("--min-region-area", |o| o.segment.generator.min_region_area = u32::MAX),
    ("--crop-margin", |o| o.segment.selection.crop_margin = f64::NAN),
    ("--whole-object", |o| o.segment.selection.whole_object = f64::NAN),
    ("--cull-iou", |o| o.segment.selection.cull_iou = 1.1),
    ("--cull-score", |o| o.segment.selection.cull_score = -0.1),
    ("--cull-inner", |o| o.segment.selection.cull_inner = f64::NAN),
    ("--ask-views", |o| o.consensus.ask_views = NonZeroUsize::new(1001).unwrap()),
    ("--max-questions", |o| o.query.max_questions = 1001),
    ("--sheet-size", |o| o.query.sheet_size = 0),
    ("--lmm-temperature", |o| o.query.lmm_temperature = f64::NAN),
    ("--lmm-max-tokens", |o| o.query.lmm_max_tokens = 0),
    ("--lmm-parallel", |o| o.query.lmm_parallel = 0),
    ("--lmm-timeout-s", |o| o.query.lmm_timeout_s = 0),
    ("--lmm-wait-s", |o| o.query.lmm_wait_s = u64::MAX),
    ("--lmm-retries", |o| o.query.lmm_retries = u32::MAX),
    ("--max-usd", |o| o.query.max_usd = Some(f64::NAN)),
    ("--max-usd", |o| o.query.max_usd = Some(f64::INFINITY)),
    ("--neighbors", |o| o.vote.neighbors = NonZeroUsize::new(1001).unwrap()),
    ("--volume-cells", |o| o.parts.volume_cells = 0),
    ("--carve-views", |o| o.parts.carve_views = 0),
    ("--fill-density", |o| o.parts.fill_density = 0.0),
    ("--wall-m", |o| o.parts.wall_m = f64::NAN),
    ("--min-body-share", |o| o.parts.min_body_share = 1.0),
    ("--min-part-share", |o| o.parts.min_part_share = f64::NAN),
    ("--known-mass", |o| o.parts.known_mass = Some(f64::NAN.into())),
    ("--known-mass-error", |o| o.parts.known_mass_error = Some(0.0)),
    ("--drop-height", |o| o.simulate.drop_height = -1.0),
    ("--tilt-deg", |o| o.simulate.tilt_deg = f64::INFINITY),
    ("--fixed-step", |o| o.simulate.fixed_step = Some(0.0)),
    ("--max-simulation-minutes", |o| o.simulate.max_simulation_minutes = f64::NAN),
    ("--duration", |o| o.simulate.duration = Some(f64::NAN)),
    ("--frames", |o| o.simulate.frames = 0),
    ("--frames", |o| o.simulate.frames = 1),
    ("--grid", |o| o.simulate.grid = 0),
    ("--gravity", |o| o.simulate.gravity = f64::NAN),
    ("--ground-friction", |o| o.simulate.ground_friction = -1.0),
    ("--max-stiffness", |o| o.simulate.max_stiffness = Some(0.0)),
    ("--cfl", |o| o.simulate.cfl = 0.0),
    ("--azimuth-deg", |o| o.simulate.viewpoint.azimuth_deg = Some(f64::NAN)),
    ("--elevation-deg", |o| o.simulate.viewpoint.elevation_deg = 91.0),
    ("--size", |o| o.simulate.viewpoint.film.size.width = 65),
    ("--fps", |o| o.simulate.viewpoint.film.fps = 0),
    ("--point", |o| o.grasp.point = Some([0.0, f64::NAN, 0.0])),
    ("--lift-angle-deg", |o| o.grasp.lift_angle_deg = f64::NAN),
    ("--max-curvature", |o| o.grasp.max_curvature = Some(0.0)),
    ("--safety-factor", |o| o.grasp.safety_factor = 0.9),
    ("--force-margin", |o| o.grasp.force_margin = 0.51),
];

/// A caller who sets a field is told the same as a user who types the flag.
#[test]
fn options_that_a_caller_sets_are_checked() {
    let balls = Balls::new(1);
    assert_eq!(Options::default().check(), Ok(()));
    for (flag, spoil) in OUTSIDE {
        let mut options = options(&balls);
        spoil(&mut options);
        assert_eq!(options.check().expect_err(flag).flag, *flag);
        let error = Pipeline::builder(balls.scene(0)).options(options).open().err().expect(flag);
        assert!(error.kind() == ErrorKind::Usage && error.to_string().contains(flag), "{error}");
    }
    assert!(!balls.scene(0).join("gprop").exists());
    let command = Options::augment_args(Command::new("gprop"));
    let numbers = [
        TypeId::of::<f32>(),
        TypeId::of::<f64>(),
        TypeId::of::<u32>(),
        TypeId::of::<u64>(),
        TypeId::of::<usize>(),
        TypeId::of::<NonZeroUsize>(),
    ];
    let is_number = |argument: &&Arg| {
        argument.get_action().takes_values() && numbers.iter().any(|id| argument.get_value_parser().type_id() == *id)
    };
    for argument in command.get_arguments().filter(is_number) {
        let flag = format!("--{}", argument.get_long().unwrap());
        assert!(OUTSIDE.iter().any(|(known, _)| *known == flag), "give {flag} a check and a line in OUTSIDE");
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
    options.parts.known_mass = Some((1.2 * expected).into());
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
    let mut pipeline = Pipeline::builder(balls.scene(0))
        .options(options)
        .plan(Plan::to(Stage::Report).without(Stage::Simulate))
        .open()
        .unwrap();
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
