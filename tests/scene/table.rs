//! Every row of the table "you have ... type" in `docs/formats.md`: the folder is made as the row says, the command is run as
//! written there (up to a stage that needs no model), and its result is checked.

use std::path::{Path, PathBuf};
use std::process::Command;

use image::GrayImage;
use serde_json::{Value, json};

use super::cameras;
use super::folder::MadeUp;

/// The last cell of each row, in order.
fn commands() -> Vec<String> {
    let page = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/formats.md")).unwrap();
    let rows = page.lines().skip_while(|line| !line.starts_with("| you have |")).skip(2);
    let rows = rows.take_while(|line| line.starts_with('|'));
    let last_cell = |line: &str| line.trim_end_matches(" |").rsplit("| ").next().unwrap().trim_matches('`').to_owned();
    rows.map(last_cell).collect()
}

/// Runs a row's command on `folder`, with its placeholders for files and folders replaced, and returns `views.json`.
fn run(command: &str, folder: &Path, replaced: &[(&str, PathBuf)]) -> Value {
    run_to("scene", command, folder, replaced)
}

fn run_to(stage: &str, command: &str, folder: &Path, replaced: &[(&str, PathBuf)]) -> Value {
    let mut words = command.split(' ').map(|word| match word {
        "FOLDER" => folder.display().to_string(),
        _ => {
            let found = replaced.iter().find(|(name, _)| *name == word);
            found.map_or_else(|| word.to_owned(), |(_, path)| path.display().to_string())
        }
    });
    assert_eq!(words.next().as_deref(), Some("gprop"));
    let words: Vec<String> = words.collect();
    let is_run = words[0] == "run";
    let last_stage = if is_run { &["--to", stage][..] } else { &[] };
    // The photos do not show the made-up scene's one Gaussian, and `inspect` says so.
    let status = if words[0] == "inspect" { 3 } else { 0 };
    let ran = Command::new(env!("CARGO_BIN_EXE_gprop")).args(words).args(last_stage).output().unwrap();
    assert_eq!(ran.status.code(), Some(status), "{command}: {}", String::from_utf8_lossy(&ran.stderr));
    if !is_run {
        return Value::Null;
    }
    serde_json::from_slice(&std::fs::read(folder.join("gprop/views.json")).unwrap()).unwrap()
}

/// The made-up scene with its transforms.json written.
fn made_up() -> MadeUp {
    let made_up = MadeUp::new();
    made_up.load().unwrap();
    made_up
}

/// Moves the splat to where another trainer writes it.
fn with_splat_at(made_up: MadeUp, place: &str) -> MadeUp {
    let path = made_up.path(place);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::rename(made_up.path("point_cloud.ply"), path).unwrap();
    made_up
}

fn views(found: &Value) -> usize {
    found["views"].as_array().unwrap().len()
}

#[test]
fn every_row_of_the_readme_works() {
    let commands = commands();
    let mut rows = commands.iter();
    let mut next = || rows.next().expect("a row for each case below").as_str();

    // A 3DGS output folder.
    let scene = made_up();
    cameras::as_3dgs_output(&scene);
    assert_eq!(views(&run(next(), &scene.path(""), &[])), 4);

    // A COLMAP model.
    let scene = made_up();
    cameras::as_colmap(&scene);
    assert_eq!(views(&run(next(), &scene.path(""), &[])), 4);

    // A nerfstudio export: trained at a quarter of the size, so the cameras move closer.
    let scene = with_splat_at(made_up(), "splat.ply");
    let identity = json!({"transform": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], "scale": 0.25});
    std::fs::write(scene.path("dataparser_transforms.json"), identity.to_string()).unwrap();
    let found = run(next(), &scene.path(""), &[]);
    let x = found["views"][0]["camera_from_world"]["translation"][0].as_f64().unwrap();
    assert!((x.abs() - 0.5).abs() < 1e-9, "{found}");

    // A Blender render.
    let scene = made_up();
    cameras::as_blender(&scene);
    assert_eq!(views(&run(next(), &scene.path(""), &[])), 4);

    // gsplat, Brush.
    let command = next();
    for place in ["ply/point_cloud_29999.ply", "export_30000.ply"] {
        let scene = with_splat_at(made_up(), place);
        assert_eq!(views(&run(command, &scene.path(""), &[])), 4);
    }

    // A compressed splat elsewhere.
    let scene = made_up();
    let elsewhere = tempfile::tempdir().unwrap();
    let splat = elsewhere.path().join("any.splat");
    std::fs::write(&splat, super::formats::splat_row([0.0; 3], [0.1; 3], [255; 4], [255, 128, 128, 128])).unwrap();
    std::fs::remove_file(scene.path("point_cloud.ply")).unwrap();
    assert_eq!(views(&run(next(), &scene.path(""), &[("FILE", splat)])), 4);

    // Cameras and photos elsewhere.
    let (scene, other) = (made_up(), made_up());
    let replaced = [("PATH", other.path("transforms.json")), ("DIR", other.path(""))];
    std::fs::remove_file(scene.path("transforms.json")).unwrap();
    let found = run(next(), &scene.path(""), &replaced);
    assert_eq!(found["views"][0]["image"], json!(other.path("images/000.png")));

    // Masks.
    let scene = made_up();
    let masks = tempfile::tempdir().unwrap();
    GrayImage::from_pixel(8, 6, image::Luma([255])).save(masks.path().join("001.png")).unwrap();
    assert_eq!(views(&run(next(), &scene.path(""), &[("DIR", masks.path().to_owned())])), 4);

    // Segments of another program.
    let scene = made_up();
    let labels = tempfile::tempdir().unwrap();
    for view in ["000", "001", "002", "003"] {
        GrayImage::from_fn(8, 6, |x, _| image::Luma([1 + u8::from(x < 4)]))
            .save(labels.path().join(format!("{view}.png")))
            .unwrap();
    }
    run_to("segment", next(), &scene.path(""), &[("DIR", labels.path().to_owned())]);
    let segments = std::fs::read(scene.path("gprop/segments/segments.json")).unwrap();
    let segments: Value = serde_json::from_slice(&segments).unwrap();
    assert_eq!(segments["views"]["002"]["segments"].as_array().unwrap().len(), 2, "{segments}");

    // A room; the one Gaussian lies a little further out than the page's box reaches.
    let command = next();
    let far = command.replace("-1,-1,-1:1,1,1", "-9,-9,-9:9,9,9");
    assert_eq!(views(&run(&far, &made_up().path(""), &[])), 4);

    // A measured scale: cameras 000 and 002 are four units apart.
    let found = run(next(), &made_up().path(""), &[]);
    assert_eq!(found["scale"]["meters_per_unit"], json!(0.2));
    assert_eq!(found["scale"]["source"], json!("cameras"));
    assert!(found["scale"]["provenance"].as_str().unwrap().contains("000 and 002"));

    // Inspection.
    let page = tempfile::tempdir().unwrap();
    let html = page.path().join("page.html");
    run(next(), &made_up().path(""), &[("FILE", html.clone())]);
    let html = std::fs::read_to_string(html).unwrap();
    // Three for each view, and the photos on which a box is dragged.
    assert_eq!(html.matches("data:image/jpeg;base64,").count(), 3 * 4 + 4);

    // A splat and no photos.
    let scene = made_up();
    std::fs::remove_dir_all(scene.path("images")).unwrap();
    std::fs::remove_file(scene.path("transforms.json")).unwrap();
    assert_eq!(views(&run(next(), &scene.path(""), &[])), 6);

    // A mesh; its own work folder is beside it.
    let folder = tempfile::tempdir().unwrap();
    let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/cup/cup.glb");
    let command = format!("{} --out {}", next(), folder.path().join("gprop").display());
    assert_eq!(views(&run(&command, folder.path(), &[("mug.glb", mesh)])), 10);
    assert!(rows.next().is_none(), "a row without a case");
}
