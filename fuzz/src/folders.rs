//! The whole program on folders: the ball of [`whole_line`](super::whole_line) as a scene folder with its label maps and recorded
//! answers, and as the work folder of a finished run. The bytes change some of the files; the run must end with a result or
//! with an error whose exit code is not a bug's.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use gprop::ErrorKind;
use gprop::camera::Camera;
use gprop::materials::MaterialLibrary;
use gprop::pipeline::{Options, Pipeline, Plan, Stage};
use gprop::query::AnswerSource;
use gprop::scene::splat::ply;
use gprop::segment::LabelMap;
use gprop::units::Range;
use gprop::workdir::Checksum;
use image::{ImageFormat, Rgba, RgbaImage};
use nalgebra::{Matrix4, Vector4};
use serde_json::{Value, json};

use super::whole_line::{EYES, camera_at, gaussians, seen_by};

/// More instructions than this reveal nothing new.
const MOST_INSTRUCTIONS: usize = 16;

/// Files by their path in the scene folder, in order.
type Files = Vec<(PathBuf, Vec<u8>)>;

/// The scene and, below `gprop/`, what a run made of it.
static FINISHED: LazyLock<Files> = LazyLock::new(|| {
    let scene = tempfile::tempdir().expect("a temporary folder can be made");
    write_scene(scene.path());
    let server = TcpListener::bind("127.0.0.1:0").expect("a port is free");
    let address = server.local_addr().expect("it is bound");
    // It ends with the process.
    std::thread::spawn(move || answer_all(&server));
    let mut options = options(scene.path());
    options.query.answers = AnswerSource::Record;
    options.query.lmm_url = Some(format!("http://{address}/v1"));
    options.query.lmm_model = Some("fuzz".to_owned());
    options.setup.offline = false;
    run(scene.path(), options, Plan::to(Stage::Report)).expect("nothing is wrong yet");
    let mut files = Vec::new();
    collect(scene.path(), Path::new(""), &mut files);
    files.sort();
    files
});

/// A scene folder without a work folder, up to its parts.
pub fn scene_folder(bytes: &[u8]) {
    let mut files: Files = FINISHED.iter().filter(|(path, _)| !path.starts_with("gprop")).cloned().collect();
    change(&mut files, bytes, |_| true);
    run_changed(&files, Plan::to(Stage::Parts));
}

/// The work folder of a finished run, in which the simulation and everything after it are done again. Its checksums match its
/// files, as an attacker's would.
pub fn finished_folder(bytes: &[u8]) {
    let mut files = FINISHED.clone();
    change(&mut files, bytes, |path| path.starts_with("gprop"));
    seal(&mut files);
    run_changed(&files, Plan::to(Stage::Report).from(Stage::Simulate));
}

fn run_changed(files: &Files, plan: Plan) {
    let scene = tempfile::tempdir().expect("a temporary folder can be made");
    for (path, bytes) in files {
        let path = scene.path().join(path);
        fs::create_dir_all(path.parent().expect("it is below the scene")).expect("the folder is new");
        fs::write(path, bytes).expect("the folder is new");
    }
    if let Err(error) = run(scene.path(), options(scene.path()), plan) {
        assert!(error.kind() != ErrorKind::Bug, "{error:?}");
    }
}

fn run(scene: &Path, options: Options, plan: Plan) -> Result<(), gprop::Error> {
    Pipeline::builder(scene).options(options).plan(plan).open()?.run()
}

fn options(scene: &Path) -> Options {
    let mut options = Options::default();
    options.scene.scale = "metric".parse().expect("it is a scale");
    options.segment.segments = Some(scene.join("labels"));
    options.query.answers = AnswerSource::Replay;
    options.query.sheet_size = 256;
    options.setup.offline = true;
    options.parts.volume_cells = 1000;
    (options.simulate.grid, options.simulate.frames, options.simulate.duration) = (8, 2, Some(0.01));
    options
}

/// Carries out instructions of eight bytes: which file, what to do, where (2 bytes, a share of its length), with what (4 bytes).
fn change(files: &mut Files, bytes: &[u8], may: impl Fn(&Path) -> bool) {
    for &[file, what, low, high, value @ ..] in bytes.as_chunks::<8>().0.iter().take(MOST_INSTRUCTIONS) {
        let candidates: Vec<usize> = (0..files.len()).filter(|index| may(&files[*index].0)).collect();
        let Some(&index) = candidates.get(usize::from(file) % candidates.len().max(1)) else { return };
        let content = &mut files[index].1;
        let at = content.len() * usize::from(u16::from_le_bytes([low, high])) / 65536;
        match what {
            0..96 => content.iter_mut().skip(at).zip(value).for_each(|(byte, new)| *byte = new),
            96..144 => content.iter_mut().skip(at).take(1).for_each(|byte| *byte = value[0]),
            144..176 => drop(content.splice(at..at, value)),
            176..208 => drop(content.drain(at..content.len().min(at + usize::from(value[0])))),
            208..232 => content.truncate(at),
            232..244 => {
                drop(content.splice(at..at, vec![value[0]; usize::from(u16::from_le_bytes([value[1], value[2]]))]));
            }
            _ => drop(files.remove(index)),
        }
    }
}

/// Brings the checksums in `run.json` up to date.
fn seal(files: &mut Files) {
    let Some(record) = files.iter().position(|(path, _)| path == Path::new("gprop/run.json")) else { return };
    let Ok(mut json) = serde_json::from_slice::<Value>(&files[record].1) else { return };
    for stage in json["stages"].as_array_mut().into_iter().flatten() {
        for output in stage["outputs"].as_array_mut().into_iter().flatten() {
            let path = Path::new("gprop").join(output["path"].as_str().unwrap_or_default());
            let Some((_, content)) = files.iter().find(|(known, _)| *known == path) else { continue };
            let sealed = serde_json::to_value(Checksum::of(content)).expect("a checksum is plain data");
            let (Some(output), Value::Object(sealed)) = (output.as_object_mut(), sealed) else { continue };
            output.extend(sealed);
        }
    }
    files[record].1 = serde_json::to_vec(&json).expect("it was JSON");
}

fn write_scene(scene: &Path) {
    for folder in ["images", "labels"] {
        fs::create_dir(scene.join(folder)).expect("the folder is new");
    }
    let write = |path: &str, bytes: Vec<u8>| fs::write(scene.join(path), bytes).expect("the folder is new");
    let mut splat = Vec::new();
    ply::write(&mut splat, &gaussians(), &[]).expect("memory takes everything");
    write("point_cloud.ply", splat);
    let cameras: Vec<Camera> = EYES.map(camera_at).into();
    let mut frames = Vec::new();
    for (view, camera) in cameras.iter().enumerate() {
        let map = seen_by(camera);
        write(&format!("labels/{view}.png"), map.to_png().expect("a small map is a picture"));
        write(&format!("images/{view}.png"), photo(&map));
        frames.push(frame(&format!("images/{view}.png"), camera));
    }
    let i = cameras[0].intrinsics;
    let transforms = json!({
        "w": i.width, "h": i.height, "fl_x": i.fx, "fl_y": i.fy, "cx": i.cx, "cy": i.cy, "frames": frames,
    });
    write("transforms.json", transforms.to_string().into_bytes());
}

fn photo(map: &LabelMap) -> Vec<u8> {
    let picture = RgbaImage::from_fn(map.width, map.height, |x, y| match map.labels[(y * map.width + x) as usize] {
        0 => Rgba([0; 4]),
        1 => Rgba([150, 100, 60, 255]),
        _ => Rgba([90, 90, 100, 255]),
    });
    let mut png = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut png, ImageFormat::Png).expect("memory takes everything");
    png.into_inner()
}

/// A frame of transforms.json, whose cameras have y up and z backward.
fn frame(file: &str, camera: &Camera) -> Value {
    let opengl = Matrix4::from_diagonal(&Vector4::new(1.0, -1.0, -1.0, 1.0));
    let pose = camera.camera_from_world.inverse().to_homogeneous() * opengl;
    let rows: Vec<Vec<f64>> = (0..4).map(|row| (0..4).map(|column| pose[(row, column)]).collect()).collect();
    json!({ "file_path": file, "transform_matrix": rows })
}

/// A server that answers every question with the library's first wood.
fn answer_all(server: &TcpListener) {
    let wood = MaterialLibrary::builtin().of_family("wood").next().expect("the library has wood");
    let range = |range: Range, unit: f64| json!([range.low / unit, range.high / unit]);
    let answer = json!({
        "caption": "half a ball", "several_materials": false, "family": wood.family, "material": wood.name,
        "density_kg_m3": range(wood.density_kg_m3, 1.0), "youngs_modulus_mpa": range(wood.youngs_modulus_pa, 1e6),
        "poisson_ratio": range(wood.poisson_ratio, 1.0), "yield_strength_mpa": range(wood.strength_pa, 1e6),
        "shore_scale": "none", "shore_hardness": null, "friction_rubber": range(wood.friction_rubber, 1.0),
        "form": "shell", "wall_thickness_mm": [1, 2], "inside": "filled", "filling": "water", "fill_share": [0.9, 1.0],
        "bulk_density_kg_m3": null, "bulk_reason": null, "confidence": 0.8,
    });
    let completion = json!({
        "choices": [{ "index": 0, "finish_reason": "stop", "message": { "role": "assistant", "content": answer.to_string() } }],
        "usage": { "prompt_tokens": 1000, "completion_tokens": 100 },
    })
    .to_string();
    for stream in server.incoming().flatten() {
        let (mut stream, completion) = (stream, completion.clone());
        std::thread::spawn(move || {
            let mut request = Vec::new();
            let mut piece = [0; 65536];
            while !is_whole(&request) {
                match stream.read(&mut piece) {
                    Ok(0) | Err(_) => return,
                    Ok(count) => request.extend_from_slice(&piece[..count]),
                }
            }
            let head = format!("HTTP/1.1 200 OK\r\ncontent-length: {}\r\nconnection: close\r\n\r\n", completion.len());
            let _ = stream.write_all(&[head.as_bytes(), completion.as_bytes()].concat());
        });
    }
}

/// Whether all of the body that the head announces has arrived.
fn is_whole(request: &[u8]) -> bool {
    let Some(end) = request.windows(4).position(|four| four == b"\r\n\r\n") else { return false };
    let head = String::from_utf8_lossy(&request[..end]).to_lowercase();
    let length = head.lines().find_map(|line| line.strip_prefix("content-length:")?.trim().parse::<usize>().ok());
    request.len() >= end + 4 + length.unwrap_or(0)
}

fn collect(root: &Path, below: &Path, files: &mut Files) {
    for entry in fs::read_dir(root.join(below)).expect("it was written") {
        let entry = entry.expect("it was written");
        let path = below.join(entry.file_name());
        match entry.path().is_dir() {
            true => collect(root, &path, files),
            false => files.push((path, fs::read(entry.path()).expect("it was written"))),
        }
    }
}
