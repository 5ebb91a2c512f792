//! The functions of the fuzz targets. gprop's own tests replay the corpus through the same functions.
//!
//! Whatever the bytes are, a reader ends with a value or an error: no panic, no endless loop, no memory beyond a small
//! multiple of the input. Readers that take a path are given a file in a temporary folder.

mod folders;
mod whole_line;

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use gprop::audit;
use gprop::config::{self, Flag, Owner, SceneValue};
use gprop::consensus::AskAbout;
use gprop::evaluate::grasp::{self as policies, Evaluation};
use gprop::evaluate::label_maps::LabelMaps;
use gprop::evaluate::{hardness, masks, mass};
use gprop::files::npz::Npz;
use gprop::grasp::gripper::GripperProfile;
use gprop::grasp::{CalibrationReport, GraspReport};
use gprop::materials::MaterialLibrary;
use gprop::query::answer::{self, Unknown};
use gprop::query::ask::cost::PriceTable;
use gprop::query::batch_api::{JobStatus, Submitted};
use gprop::query::client;
use gprop::query::question::Questions;
use gprop::query::recorded::{Recording, Recordings};
use gprop::query::{self, Answers, LabelSet, Prompts, Queries, batch_api, exchange};
use gprop::scene::cameras::{colmap, dataparser, gaussian_splatting, transforms};
use gprop::scene::dataset;
use gprop::scene::mesh::{MESH_FORMATS, PaintedMesh, sample};
use gprop::scene::splat::dot_splat as splat;
use gprop::scene::splat::ksplat;
use gprop::scene::splat::ply;
use gprop::scene::splat::sog;
use gprop::scene::splat::spz;
use gprop::segment::{LabelMap, Level, Segment, sam};
use gprop::simulate::checkpoint::Checkpoint;
use gprop::simulate::script::Script;
use gprop::simulate::{SimulationReport, compat};
use gprop::{parts, pipeline};

pub use folders::{finished_folder, scene_folder};
pub use whole_line::whole_line;

/// The function of a target, which takes the input bytes.
pub type Read = fn(&[u8]);

/// Every target by its name.
pub const TARGETS: [(&str, Read); 22] = [
    ("answers", answers),
    ("checkpoint", checkpoint),
    ("colmap", colmap),
    ("container", container),
    ("evaluation", evaluation),
    ("finished_folder", finished_folder),
    ("ksplat", ksplat),
    ("label_map", label_map),
    ("materials", materials),
    ("mesh", mesh),
    ("npz", npz),
    ("ply", ply),
    ("recordings", recordings),
    ("sam_decoder", sam_decoder),
    ("scene_folder", scene_folder),
    ("settings", settings),
    ("sog", sog),
    ("splat", splat),
    ("spz", spz),
    ("transforms", transforms),
    ("whole_line", whole_line),
    ("work_folder", work_folder),
];

/// URDF, MJCF, USD and glTF beside a mesh, audited and mended.
pub fn container(bytes: &[u8]) {
    let name = match bytes.first() {
        Some(b'#') => "model.usda",
        Some(b'{' | b'g') => "model.gltf",
        _ => "model.xml",
    };
    let mesh = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    let folder = folder_with(&[(name, bytes), ("mesh.obj", mesh)]);
    let args = audit::Args {
        paths: vec![folder.path().join(name)],
        fix: true,
        ignore: Vec::new(),
        collider_volume: 2.0,
        collider_distance: 0.1,
    };
    let report = audit::audit(&args).expect("the file is there");
    assert!(report.text().ends_with('\n'));
}

/// PLY of every encoding and the compressed PLY.
pub fn ply(bytes: &[u8]) {
    let _ = ply::parse(bytes);
}

/// The 32-byte rows of a .splat.
pub fn splat(bytes: &[u8]) {
    let _ = splat::parse(bytes);
}

/// The sections and buckets of a .ksplat of any compression level.
pub fn ksplat(bytes: &[u8]) {
    let _ = ksplat::parse(bytes);
}

/// A SOG bundle: the archive, its description and its pictures.
pub fn sog(bytes: &[u8]) {
    let _ = sog::parse(bytes);
}

/// SPZ of all versions, gzip and zstd streams included.
pub fn spz(bytes: &[u8]) {
    let _ = spz::parse(bytes);
}

/// Meshes; the first byte says in which format. What is read is also sampled.
pub fn mesh(bytes: &[u8]) {
    let Some((which, file)) = bytes.split_first() else { return };
    let format = &MESH_FORMATS[usize::from(*which) % MESH_FORMATS.len()];
    if let Ok(mesh) = format.parse(file) {
        assert!(mesh.surface.triangles.as_flattened().iter().all(|i| (*i as usize) < mesh.surface.vertices.len()));
        let _ = PaintedMesh::new(mesh).map(|painted| sample(&painted).map(|sampled| sampled.gaussians.len()));
    }
}

/// COLMAP's cameras, images and points, binary and text.
pub fn colmap(bytes: &[u8]) {
    let _ = colmap::parse_cameras_binary(bytes);
    let _ = colmap::parse_images_binary(bytes);
    let _ = colmap::parse_points_binary(bytes);
    let text = String::from_utf8_lossy(bytes);
    let _ = colmap::parse_cameras_text(&text);
    let _ = colmap::parse_images_text(&text);
    let _ = colmap::parse_points_text(&text);
}

/// nerfstudio's transforms.json and dataparser_transforms.json, 3DGS' cameras.json and cfg_args.
pub fn transforms(bytes: &[u8]) {
    let _ = transforms::parse(bytes);
    let _ = dataparser::parse(bytes);
    let _ = gaussian_splatting::parse(bytes);
    let _ = gaussian_splatting::TrainingArguments::parse(&String::from_utf8_lossy(bytes));
}

/// Label maps: PNG and NumPy arrays.
pub fn label_map(bytes: &[u8]) {
    let _ = LabelMap::from_png(bytes).map(|map| map.renumbered());
    for level in [Level::Small, Level::Middle, Level::Large] {
        let _ = LabelMap::from_npy(bytes, level);
    }
}

/// NumPy archives.
pub fn npz(bytes: &[u8]) {
    if let Ok(mut archive) = Npz::new(bytes.to_vec()) {
        for name in ["a", "x", "config"] {
            let _ = archive.f32s(name);
            let _ = archive.f64s(name);
            let _ = archive.i32s(name);
            let _ = archive.i64s(name);
            let _ = archive.text(name);
        }
    }
}

/// What gprop itself reads in the ONNX file of a SAM decoder.
pub fn sam_decoder(bytes: &[u8]) {
    let _ = sam::check_decoder(bytes);
}

/// Answers of a model or a person: an endpoint's response, the answer in it, `answers.jsonl`, the Batch API's files.
pub fn answers(bytes: &[u8]) {
    static QUESTIONS: LazyLock<Questions> = LazyLock::new(|| {
        let (guidance, context) = (query::Guidance::OneQuestion, query::Context::GlobalLocal);
        Questions::new(&Prompts::builtin(), MaterialLibrary::builtin(), guidance, context, AskAbout::Parts)
            .expect("the built-in prompts are good")
    });
    let text = String::from_utf8_lossy(bytes);
    for status in [200, 400, 429] {
        let _ = client::read_completion(status, &text);
    }
    let _ = QUESTIONS.read(QUESTIONS.first(), &text, MaterialLibrary::builtin(), Unknown::TakeNearest);
    let _ = batch_api::lines(&text, &str::to_owned);
    let _ = serde_json::from_slice::<JobStatus>(bytes).map(|status| status.problems());
    if let Ok(value) = serde_json::from_slice::<serde_json::Value>(bytes) {
        for unknown in [Unknown::Refuse, Unknown::TakeNearest] {
            let _ = answer::read(value.clone(), MaterialLibrary::builtin(), unknown);
        }
    }
    if let Ok(answers) = Answers::from_jsonl(&text) {
        assert_eq!(Answers::from_jsonl(&answers.to_jsonl()).ok(), Some(answers));
    }
}

/// Recordings with their masks; an export with the answers filled in: manifest, answers and origins, between zero bytes.
pub fn recordings(bytes: &[u8]) {
    if let Ok(recording) = serde_json::from_slice::<Recording>(bytes) {
        let mask = &recording.asked.mask;
        assert!((0.0..=1.0).contains(&mask.iou(mask)));
        let _ = recording.asked.content_sha256();
    }
    static PROMPTS: LazyLock<Prompts> = LazyLock::new(Prompts::builtin);
    static OPTIONS: LazyLock<query::Options> = LazyLock::new(query::Options::default);
    static QUERIES: LazyLock<Queries> = LazyLock::new(|| {
        Queries::prepare(&[], MaterialLibrary::builtin(), &PROMPTS, &OPTIONS, AskAbout::Parts)
            .expect("the built-in prompts are good")
    });
    let mut files = bytes.splitn(3, |byte| *byte == 0);
    let (Some(manifest), Some(answers), Some(origins)) = (files.next(), files.next(), files.next()) else { return };
    let folder = folder_with(&[("manifest.json", manifest), ("answers.jsonl", answers), ("origins.jsonl", origins)]);
    let recordings = Recordings::open(&[], &folder.path().join("recorded")).expect("there are none yet");
    let _ = exchange::import(folder.path(), Some("model"), &QUERIES, &recordings);
}

/// Files that a person writes: `gprop.toml`, `config.toml`, scenarios, grippers, PhysGaussian's configurations, price tables, labels.
pub fn settings(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let flag = |name: &str, takes_value, scene| Flag { name: name.to_owned(), takes_value, scene, ..Flag::default() };
    let known = [
        flag("views", true, Some(SceneValue::Any)),
        flag("scale", true, Some(SceneValue::Any)),
        flag("images", true, Some(SceneValue::Path)),
        flag("offline", false, None),
    ];
    for owner in [Owner::Scene, Owner::User] {
        let _ = config::flags_in(&text, Path::new("gprop.toml"), owner, &known);
    }
    let _ = Script::from_toml(&text);
    let _ = GripperProfile::from_toml(&text, "fuzz");
    let _ = compat::config::Config::from_json(&text);
    let _ = PriceTable::from_csv(&text);
    // A word that is not a label is compared with all names, which is too slow here for more than a few words.
    if bytes.len() <= 64 {
        let folder = folder_with(&[("labels.txt", bytes)]);
        let _ = LabelSet::File(folder.path().join("labels.txt")).restrict(MaterialLibrary::builtin());
    }
}

/// A user's material library; the first byte says which of its tables.
pub fn materials(bytes: &[u8]) {
    const TABLES: [&str; 7] =
        ["mine", "families", "bibliography", "evidence", "reference", "constituents", "deviations"];
    let Some((which, table)) = bytes.split_first() else { return };
    let name = format!("{}.csv", TABLES[usize::from(*which) % TABLES.len()]);
    let _ = MaterialLibrary::load(folder_with(&[(&name, table)]).path());
}

/// The input files of `gprop evaluate` and `gprop grasp calibrate`, and a data set's own files.
pub fn evaluation(bytes: &[u8]) {
    const BLACK: &[u8] = include_bytes!("black.png");
    let folder = folder_with(&[
        ("table", bytes),
        ("named/0.png", BLACK),
        ("named/labels.json", bytes),
        ("numbered/0.png", BLACK),
        ("numbered/autosave_label.txt", bytes),
        ("set/splits.json", bytes),
        ("set/filtered_product_weights.json", bytes),
        ("set/scenes/one/transforms.json", b"{}"),
    ]);
    let table = folder.path().join("table");
    let _ = hardness::read_points(&table);
    let _ = policies::outcomes(&table).map(|outcomes| Evaluation::of_recorded(&outcomes).text());
    let mut gripper = GripperProfile::load("paper").expect("it is built in");
    let _ = CalibrationReport::of_file(&table, &mut gripper).map(|report| (report.text(), report.plot()));
    let _ = mass::from_json(&table, &table).map(mass::evaluate);
    let _ = mass::from_scene("one", &table, &table, &Default::default());
    let _ = masks::Reference::from_json(&String::from_utf8_lossy(bytes));
    for maps in ["named", "numbered"] {
        let _ = LabelMaps::open(&folder.path().join(maps)).map(|maps| maps.of("0", (1, 1)));
    }
    let _ = dataset::list(&folder.path().join("set"), None);
}

/// A simulation's checkpoint.
pub fn checkpoint(bytes: &[u8]) {
    let _ = Checkpoint::from_bytes(bytes);
}

/// The files of a work folder that gprop reads back: its JSON, `interior.bin`, and `labels.json` with `field.ply` behind a zero byte.
pub fn work_folder(bytes: &[u8]) {
    if let Ok(interior) = parts::Interior::from_bytes(bytes, 1000, 4) {
        let mut again = Vec::new();
        interior.write(&mut again).expect("memory takes everything");
        assert!(parts::Interior::from_bytes(&again, 1000, 4).is_ok_and(|found| found == interior));
    }
    let _ = serde_json::from_slice::<parts::Parts>(bytes);
    let _ = serde_json::from_slice::<Vec<Segment>>(bytes);
    let _ = serde_json::from_slice::<Submitted>(bytes);
    let _ = serde_json::from_slice::<gprop::batch::Outcome>(bytes);
    let _ = serde_json::from_slice::<GraspReport>(bytes);
    let _ = serde_json::from_slice::<SimulationReport>(bytes);
    let mut files = bytes.splitn(2, |byte| *byte == 0);
    let (Some(labels), Some(field)) = (files.next(), files.next()) else { return };
    let folder = folder_with(&[("labels.json", labels), ("field.ply", field)]);
    if let Ok((_, field)) = pipeline::stored_field(folder.path()) {
        let _ = gprop::vote::field_ply::columns(&field);
        let _ = gprop::pictures::field_colors::material_colors(&field);
    }
}

/// A temporary folder with these files.
fn folder_with(files: &[(&str, &[u8])]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("there is room for a temporary folder");
    for (name, bytes) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("it lies in the folder")).expect("there is room");
        fs::write(path, bytes).expect("there is room");
    }
    folder
}
