//! Which way is up: given, found, in doubt; and scenes that stand in another frame.

use std::path::Path;
use std::process::Command;

use gprop::camera::Camera;
use gprop::gaussians::Gaussians;
use gprop::grasp::gripper::GripperProfile;
use gprop::grasp::surface::Surface;
use gprop::grasp::{self, GraspReport, grasp};
use gprop::parts::{self, Parts, parts};
use gprop::render::sh_rotation::ShRotation;
use gprop::render::{RenderOptions, render};
use gprop::scene::splat::ply;
use gprop::scene::{self, ObjectSource, Options, ScaleChoice, Scene, UpChoice, UpSource};
use gprop::words::progress::Progress;
use image::DynamicImage;
use nalgebra::{Matrix4, Point3, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::folder::{MadeUp, hammer, options};
use crate::batch::ball::Balls;
use crate::grasp::scenes::Measured;
use crate::run::gprop;
use crate::support::shared;
use crate::vote::build::{Blob, camera_at, cloud};

/// Turns that have nothing in common: one that makes y up, as many trainers do, upside down, and any.
fn turns() -> [UnitQuaternion<f64>; 3] {
    let quarter = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -0.5 * std::f64::consts::PI);
    let half = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI);
    [quarter, half, UnitQuaternion::from_euler_angles(0.6, -0.8, 2.3)]
}

/// The Gaussians turned and scaled about the origin, as an editor of splats does it.
fn moved(mut gaussians: Gaussians, turn: &UnitQuaternion<f64>, scale: f64) -> Gaussians {
    let rotation = turn.to_rotation_matrix();
    let rest = 3 * gaussians.sh_rest_per_channel();
    let turned = ShRotation::new(gaussians.sh_degree, &rotation);
    for i in 0..gaussians.len() {
        let own = turn * gaussians.rotation(i);
        gaussians.positions[i] = (rotation * gaussians.center(i) * scale).map(|side| side as f32).into();
        gaussians.rotations[i] = [own.w, own.i, own.j, own.k].map(|part| part as f32);
        gaussians.log_scales[i] = gaussians.log_scales[i].map(|log| log + scale.ln() as f32);
        if rest > 0 {
            turned.rotate(&mut gaussians.sh_rest[i * rest..(i + 1) * rest]);
        }
    }
    gaussians
}

fn write_splat(path: &Path, gaussians: &Gaussians) {
    let mut bytes = Vec::new();
    ply::write(&mut bytes, gaussians, &[]).unwrap();
    std::fs::write(path, bytes).unwrap();
}

/// A copy of a scene with a PLY and a transforms.json, without its photos, turned with its cameras, or without them.
fn turned_scene(source: &Path, turn: &UnitQuaternion<f64>, scale: f64, with_cameras: bool) -> TempDir {
    let folder = TempDir::new().unwrap();
    let splat = ply::read(&source.join("point_cloud.ply")).unwrap().gaussians;
    write_splat(&folder.path().join("point_cloud.ply"), &moved(splat, turn, scale));
    let text = std::fs::read(source.join("transforms.json")).unwrap();
    let mut transforms: Value = serde_json::from_slice(&text).unwrap();
    for frame in transforms["frames"].as_array_mut().unwrap().iter_mut().filter(|_| with_cameras) {
        let pose = &mut frame["transform_matrix"];
        let before = Matrix4::from_fn(|row, column| pose[row][column].as_f64().unwrap());
        let after = turn.to_homogeneous() * before;
        *pose = (0..4).map(|row| (0..4).map(|column| after[(row, column)]).collect::<Vec<f64>>()).collect();
    }
    std::fs::write(folder.path().join("transforms.json"), transforms.to_string()).unwrap();
    folder
}

fn of_hammer(more: Options) -> Options {
    Options { scale: ScaleChoice::Metric, images: Some(hammer().join("images")), ..more }
}

#[track_caller]
fn assert_within(what: &str, share: f64, found: f64, expected: f64) {
    println!("{what}: {found} instead of {expected}, {:+.2} %", 100.0 * (found / expected - 1.0));
    assert!((found - expected).abs() <= share * expected.abs(), "{what}: {found} instead of {expected}");
}

/// The hammer with flawless labels, weighed and grasped with the default options: what is left is what gprop makes of its shape.
fn weighed_and_grasped(scene: &Scene) -> (Parts, GraspReport) {
    let (cameras, field) = (scene.cameras(), Measured::of(&hammer()).field);
    let (gaussians, scale) = (&scene.gaussians, scene.scale.as_ref());
    let found = parts(gaussians, field, &cameras, scale, &parts::Options::default(), Progress::HIDDEN).unwrap();
    let found = found.metric().unwrap().clone();
    let surface = Surface::of(gaussians, &field.part_index, &cameras, 1.0);
    let gripper = GripperProfile::load("paper").unwrap();
    let asked = grasp::Options { auto: true, ..Default::default() };
    let report = grasp(&found, &field.parts, Some(&surface), 1.0, &gripper, &asked).unwrap();
    (found, report)
}

#[test]
fn a_scene_in_any_frame_weighs_and_is_grasped_the_same() {
    let upright = scene::load(&hammer(), &of_hammer(Options::default())).unwrap();
    let (expected, best) = weighed_and_grasped(&upright);
    let turn = turns()[2];
    let folder = turned_scene(&hammer(), &turn, 1.0, true);
    let given = UpChoice::Along((turn * Vector3::z()).into());
    let load = |up: UpChoice| scene::load(folder.path(), &of_hammer(Options { up, ..Options::default() })).unwrap();
    for (scene, source) in [(load(given), UpSource::Given), (load(UpChoice::Auto), UpSource::Cameras)] {
        assert_eq!((scene.up.source, scene.up_in_doubt.as_deref()), (source, None));
        assert!(Vector3::from(scene.up.direction).angle(&(turn * Vector3::z())) < 1e-3, "{:?}", scene.up);
        assert_within("height", 1e-3, scene.object_bounds().size().z, upright.object_bounds().size().z);
    }
    let (found, report) = weighed_and_grasped(&load(UpChoice::Auto));
    for (found, expected) in found.parts.iter().zip(&expected.parts) {
        let (found, expected) = (found.mass_kg.unwrap(), expected.mass_kg.unwrap());
        // The border between parts follows the grid's cells, which lie otherwise.
        assert_within("a part's mass", 0.02, found.mid, expected.mid);
    }
    assert_within("mass", 0.01, found.object.mass_kg.mid, expected.object.mass_kg.mid);
    // A third of a cell's side.
    let [above, above_before] = [&found, &expected].map(|parts| parts.object.center_of_mass_m[2]);
    assert!((above - above_before).abs() < 3e-4, "{above} m instead of {above_before} m");
    assert_eq!((report.part_id, report.limited_by), (best.part_id, best.limited_by));
    assert_within("F_min", 0.01, report.f_min_n, best.f_min_n);
    assert_within("F_max", 0.01, report.f_max_n, best.f_max_n);
    assert_within("F*", 0.01, report.f_star_n, best.f_star_n);
}

#[test]
fn the_splat_is_kept_as_it_was_read() {
    let turn = turns()[2];
    let folder = turned_scene(&hammer(), &turn, 1.0, true);
    let scene = scene::load(folder.path(), &of_hammer(Options::default())).unwrap();
    assert_ne!(scene.up.direction, [0.0, 0.0, 1.0]);
    assert!(*scene.gaussians_as_read() == ply::read(&folder.path().join("point_cloud.ply")).unwrap().gaussians);
    let back = scene.in_input_frame();
    for (view, in_input) in scene.views.iter().zip(&back.views) {
        let [one, other] = [&scene.camera_in_input(&view.camera), &in_input.camera].map(Camera::center_in_world);
        assert!((one - other).norm() < 1e-12, "{one} {other}");
        assert!((scene.up.world_from_input() * one - view.camera.center_in_world()).norm() < 1e-12);
    }
    // What the cameras see is what they saw, view-dependent colours included.
    let upright = scene::load(&hammer(), &Options::default()).unwrap();
    assert!(upright.up.is_z() && std::ptr::eq(upright.gaussians_as_read(), &raw const upright.gaussians));
    let drawn = |scene: &Scene| {
        let small = scene.views[3].camera.intrinsics.resized(64, 64);
        let camera = Camera { intrinsics: small, ..scene.views[3].camera.clone() };
        render(&scene.gaussians, &camera, &RenderOptions::default()).rgb
    };
    let [one, other] = [&scene, &upright].map(drawn);
    let differences = one.as_flattened().iter().zip(other.as_flattened()).map(|(a, b)| (a - b).abs());
    let most = differences.fold(0.0, f32::max);
    assert!(most < 2e-3, "{most}");
}

/// The splat was turned and scaled without its cameras: `--align` brings them to it, and up is found where they are then.
#[test]
fn align_and_up_go_together() {
    let turn = turns()[2];
    let folder = turned_scene(&hammer(), &turn, 2.0, false);
    let align = format!("sim=2,{},{},{},{},0,0,0", turn.w, turn.i, turn.j, turn.k).parse().unwrap();
    let scene = scene::load(folder.path(), &of_hammer(Options { align, ..Options::default() })).unwrap();
    assert!(Vector3::from(scene.up.direction).angle(&(turn * Vector3::z())) < 1e-3, "{:?}", scene.up);
    let upright = scene::load(&hammer(), &Options::default()).unwrap();
    let [found, expected] = [&scene, &upright].map(|scene| scene.object_bounds().size().z);
    assert_within("height", 1e-3, found, 2.0 * expected);
    let misfit = gprop::inspect::misfit(&scene, &scene.chosen_views(&Options::default()).unwrap()).unwrap();
    assert_eq!(misfit, None);
}

/// The made-up scene's cameras have y up, and their photos are black.
#[test]
fn the_cameras_suggest_which_way_is_up() {
    let mut made_up = MadeUp::new();
    made_up.load().unwrap();
    let load = |made_up: &MadeUp, arguments: &[&str]| {
        scene::load(&made_up.path(""), &options(arguments).unwrap()).map(|scene| (scene.up.direction, scene.up.source))
    };
    let z = [0.0, 0.0, 1.0];
    assert_eq!(load(&made_up, &[]).unwrap(), ([0.0, 1.0, 0.0], UpSource::Cameras));
    assert_eq!(load(&made_up, &["--up", "-x"]).unwrap(), ([-1.0, 0.0, 0.0], UpSource::Given));
    assert_eq!(load(&made_up, &["--up", "z"]).unwrap(), (z, UpSource::Given));
    // What is given counts, but a forgotten sign is noticed.
    for (given, is_told) in [("-y", true), ("z", false), ("0,1,1", false), ("0.1,-0.1,0", true)] {
        let scene = scene::load(&made_up.path(""), &options(&["--up", given]).unwrap()).unwrap();
        assert_eq!(scene.warnings.iter().any(|text| text.contains("upside down")), is_told, "{given}");
    }
    assert_eq!(load(&made_up, &["--render-views", "4"]).unwrap(), (z, UpSource::Assumed));
    // Blender's file gives an angle of view and no focal length; there, z is up.
    let focal = made_up.transforms["fl_x"].take();
    made_up.transforms["camera_angle_x"] = json!(0.7);
    made_up.transforms.as_object_mut().unwrap().remove("fl_x");
    made_up.load().unwrap();
    let scene = scene::load(&made_up.path(""), &Options::default()).unwrap();
    assert_eq!((scene.up.direction, scene.up.source), (z, UpSource::DataSet));
    let doubt = scene.up_in_doubt.unwrap();
    for words in ["z by the data set's convention", "y by the cameras, 90 degrees", "--up"] {
        assert!(doubt.contains(words) && scene.warnings.contains(&doubt), "{doubt}");
    }
    // Two cameras are too few.
    made_up.transforms["fl_x"] = focal;
    made_up.transforms["frames"].as_array_mut().unwrap().truncate(2);
    made_up.load().unwrap();
    assert_eq!(load(&made_up, &[]).unwrap(), (z, UpSource::Assumed));
    assert!(options(&["--up", "w"]).unwrap_err().to_string().contains("X,Y,Z"));
}

/// A die on a table, in photos that show all of it, drawn from cameras on a circle. The table's normal leans by `leaning` from
/// the circle's axis, and all is turned by `turn`.
fn table(leaning: f64, turn: &UnitQuaternion<f64>) -> TempDir {
    let folder = TempDir::new().unwrap();
    let lean = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), leaning);
    let grid = |count: i32, step: f32| {
        (-count..=count).flat_map(move |i| (-count..=count).map(move |j| [i as f32 * step, j as f32 * step]))
    };
    let top = grid(20, 0.05).map(|[x, y]| {
        let shade = 0.5 + 0.3 * (7.0 * x).sin() * (9.0 * y).cos();
        Blob { color: [shade, 0.6, 0.4], ..Blob::round([x, y, 0.0], 0.03, 0.95) }
    });
    let die = grid(3, 0.03).flat_map(|[x, y]| {
        (1..8).map(move |k| Blob {
            color: [0.1, 0.2, 0.2 + 0.1 * k as f32],
            ..Blob::round([x, y, 0.04 + 0.03 * k as f32], 0.02, 0.95)
        })
    });
    let splat = moved(moved(cloud(&top.chain(die).collect::<Vec<_>>()), &lean, 1.0), turn, 1.0);
    write_splat(&folder.path().join("point_cloud.ply"), &splat);
    std::fs::create_dir(folder.path().join("images")).unwrap();
    let mut frames = Vec::new();
    for n in 0..8 {
        let (sin, cos) = (f64::from(n) * std::f64::consts::FRAC_PI_4).sin_cos();
        let upright = camera_at([1.4 * cos, 1.4 * sin, 1.2], [0.0, 0.0, 0.1]);
        let camera = Camera { camera_from_world: upright.camera_from_world * turn.inverse(), ..upright };
        let drawn = render(&splat, &camera, &RenderOptions::default()).to_image([1.0; 3]);
        let file = format!("images/{n:03}.png");
        DynamicImage::ImageRgba8(drawn).into_rgb8().save(folder.path().join(&file)).unwrap();
        let opengl = Matrix4::from_diagonal(&[1.0, -1.0, -1.0, 1.0].into());
        let pose = camera.camera_from_world.inverse().to_homogeneous() * opengl;
        let rows: Vec<Vec<f64>> = (0..4).map(|row| (0..4).map(|column| pose[(row, column)]).collect()).collect();
        frames.push(json!({ "file_path": file, "transform_matrix": rows }));
    }
    let i = camera_at([1.0; 3], [0.0; 3]).intrinsics;
    let transforms =
        json!({ "w": i.width, "h": i.height, "fl_x": i.fx, "fl_y": i.fy, "cx": i.cx, "cy": i.cy, "frames": frames });
    std::fs::write(folder.path().join("transforms.json"), transforms.to_string()).unwrap();
    folder
}

#[test]
fn the_normal_of_the_support_is_up() {
    for turn in turns() {
        let leaning = 0.1;
        let folder = table(leaning, &turn);
        let scene = scene::load(folder.path(), &Options::default()).unwrap();
        let normal = turn * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), leaning) * Vector3::z();
        let off = Vector3::from(scene.up.direction).angle(&normal);
        assert!(off < 0.003, "{} degrees off", off.to_degrees());
        assert_eq!(
            (scene.up.source, scene.up_in_doubt.as_deref(), scene.object_source),
            (UpSource::Support, None, ObjectSource::Cluster)
        );
        assert!((scene.up.angle_to_cameras.unwrap() - leaning).abs() < 0.02, "{:?}", scene.up.angle_to_cameras);
        // The die alone is left, and it stands upright: 0.18 by 0.18 by 0.18 between the outermost centres.
        assert_eq!(scene.gaussians.len(), 7 * 7 * 7);
        let size = scene.object_bounds().size();
        assert!((size - Vector3::repeat(0.18)).z.abs() < 0.002, "{size}");
    }
}

fn inspect(folder: &TempDir, more: &[&str]) -> (Option<i32>, String, String) {
    let mut command: Command = gprop();
    let output = command.arg("inspect").arg(folder.path()).args(more).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn inspect_shows_what_is_up_and_fails_if_that_is_in_doubt() {
    let turn = turns()[2];
    let level = table(0.0, &turn);
    let page = level.path().join("page.html");
    let (code, text, error) = inspect(&level, &["--html", page.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{text}{error}");
    let line = text.lines().find(|line| line.starts_with("up ")).unwrap();
    assert!(
        line.contains("at right angles to the surface under the objects") && line.contains("with z up, the object is"),
        "{line}"
    );
    assert!(std::fs::read_to_string(page).unwrap().contains("up an arrow"));
    let (_, json, _) = inspect(&level, &["--json"]);
    let found: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(found["up"]["source"], "support");
    let direction: Vec<f64> = serde_json::from_value(found["up"]["direction"].clone()).unwrap();
    assert!(Vector3::from_vec(direction).angle(&(turn * Vector3::z())) < 0.003, "{json}");
    // A slope of 25 degrees, which the photographer did not see as level.
    let slope = table(0.436, &turn);
    let (code, text, error) = inspect(&slope, &[]);
    assert_eq!(code, Some(3), "{text}{error}");
    assert!(error.contains("which way is up is in doubt") && error.contains("--up X,Y,Z decides"), "{error}");
    let up = turn * Vector3::z();
    let given = format!("--up={},{},{}", up.x, up.y, up.z);
    let (code, text, error) = inspect(&slope, &[&given]);
    assert!(code == Some(0) && text.contains("as given"), "{text}{error}");
}

#[test]
fn a_box_is_in_the_frame_of_the_splat() {
    let turn = turns()[2];
    let folder = table(0.0, &turn);
    let at = turn * Point3::new(0.0, 0.0, 0.16);
    let half = 0.03;
    let given =
        format!("{},{},{}:{},{},{}", at.x - half, at.y - half, at.z - half, at.x + half, at.y + half, at.z + half);
    let object_box = Some(given.parse().unwrap());
    let scene = scene::load(folder.path(), &Options { object_box, ..Options::default() }).unwrap();
    assert!(!scene.up.is_z() && (1..30).contains(&scene.gaussians.len()), "{}", scene.gaussians.len());
    let read = scene.gaussians_as_read();
    assert!((0..read.len()).all(|i| (read.center(i) - at).amax() <= half));
    let world = scene.up.world_from_input();
    assert!((0..read.len()).all(|i| (world * read.center(i) - scene.gaussians.center(i)).norm() < 1e-6));
}

/// A run on turned balls: the field in the frame of the splat, the exports upright on the ground with the way back.
#[test]
fn exports_of_a_turned_scene_stand_on_the_ground_and_lead_back() {
    let balls = Balls::new(1);
    let (scene, turn) = (balls.scene(0), turns()[2]);
    let turned = turned_scene(&scene, &turn, 1.0, true);
    for name in ["point_cloud.ply", "transforms.json"] {
        std::fs::copy(turned.path().join(name), scene.join(name)).unwrap();
    }
    let out = scene.join("exported");
    let output = gprop()
        .env_remove("OPENAI_API_KEY")
        .arg("export")
        .arg(&scene)
        .args(balls.answers())
        .args(["--format", "mjcf,urdf,usda,glb,gltf-splat,npz,ply-parts,physgaussian", "--out"])
        .arg(&out)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| String::from_utf8_lossy(&std::fs::read(out.join(name)).unwrap()).into_owned();
    // The ball of 0.1 m around the input's origin stands on its lowest point.
    let mjcf = read("ball_0.xml");
    let rise: f64 = mjcf.split("pos=\"0 0 ").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
    assert!((0.09..0.13).contains(&rise), "{rise}");
    assert!(read("scene.xml").contains("size=\"0 0 0.05\" pos=\"0 0 0\""), "the floor is the ground");
    let numbers = |text: &str| -> Vec<f64> {
        text.split([' ', ',', '[', ']', ')', '(']).filter_map(|n| n.parse().ok()).take(16).collect()
    };
    let stated = |file: &str, after: &str| Matrix4::from_row_slice(&numbers(file.split(after).nth(1).unwrap()));
    let by_rows = "input_from_asset (4 x 4, by rows): ";
    for (name, matrix) in [
        ("MJCF", stated(&mjcf, by_rows)),
        ("URDF", stated(&read("ball_0.urdf"), by_rows)),
        ("USD", stated(&read("ball_0/usd/ball_0.usda"), "double[] input_from_asset = ")),
    ] {
        assert!(matrix.transform_point(&Point3::new(0.0, 0.0, rise)).coords.norm() < 1e-9, "{name}: {matrix}");
        let up = matrix.transform_vector(&Vector3::z());
        assert!(up.angle(&(turn * Vector3::z())) < 1e-3, "{name}: {matrix}");
    }
    for name in ["ball_0.glb", "ball_0_colliders.glb", "ball_0_splat.glb"] {
        let file = read(name);
        let matrix = stated(&file, "\"input_from_asset\":");
        assert!(matrix.transform_point(&Point3::new(0.0, rise, 0.0)).coords.norm() < 1e-9, "{name}: {matrix}");
        assert!(file.contains(&format!("\"translation\":[0.0,{rise},0.0]")), "{name}");
    }
    // The parts of the splat are pieces of the splat.
    let field = ply::read(&scene.join("gprop/field.ply")).unwrap().gaussians;
    let splat = ply::read(&scene.join("point_cloud.ply")).unwrap().gaussians;
    assert!(field.positions == splat.positions && field.rotations == splat.rotations);
    let part = std::fs::read_dir(out.join("ball_0/parts")).unwrap().next().unwrap().unwrap().path();
    let part = ply::read(&part).unwrap().gaussians;
    assert!(part.positions.iter().all(|position| splat.positions.contains(position)));
    let views: Value = serde_json::from_slice(&std::fs::read(scene.join("gprop/views.json")).unwrap()).unwrap();
    assert_eq!(views["up"]["source"], "cameras");
}

/// The true up of the table is in its ground truth; the plant's is -y, as its README says.
#[test]
fn up_of_other_peoples_captures() {
    let test = "up_of_other_peoples_captures";
    if let Some(folder) = shared(test, "tables/fit_breakfast") {
        let scene = scene::load(&folder, &Options::default()).unwrap();
        let truth: Value =
            serde_json::from_slice(&std::fs::read(folder.join("ground_truth/objects.json")).unwrap()).unwrap();
        let true_up: [f64; 3] = serde_json::from_value(truth["up_colmap"].clone()).unwrap();
        let off = Vector3::from(scene.up.direction).angle(&Vector3::from(true_up)).to_degrees();
        println!("breakfast: {off:.3} degrees off");
        assert!(off < 1.0 && scene.up.source == UpSource::Support, "{off} degrees, {:?}", scene.up);
    }
    if let Some(folder) = shared(test, "captures/plant") {
        let scene = scene::load(&folder, &Options::default()).unwrap();
        assert_eq!((scene.up.direction, scene.up.source), ([0.0, -1.0, 0.0], UpSource::Cameras));
        assert!(!scene.warnings.iter().any(|warning| warning.contains(" up ")), "{:?}", scene.warnings);
    }
    if let Some(folder) = shared(test, "captures/miku_plush") {
        let scene = scene::load(&folder, &Options::default()).unwrap();
        assert_eq!((scene.up.source, scene.up_in_doubt), (UpSource::Support, None));
        assert!(!scene.warnings.iter().any(|warning| warning.contains(" up ")), "{:?}", scene.warnings);
    }
}
