//! Data sets: the small made-up folders of each layout in `fixtures/datasets`.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use gprop::Pipeline;
use gprop::pipeline::{Plan, Stage};
use gprop::scene::dataset::{self, Layout};
use gprop::scene::{self, Options};
use gprop::units::ScaleSource;

use super::folder::assert_message;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/datasets").join(name)
}

#[test]
fn abo_500_is_listed_with_split_and_mass() {
    let found = dataset::list(&fixture("abo"), None).unwrap();
    assert_eq!(found.layout, Layout::Abo);
    let short: Vec<_> = found.scenes.iter().map(|s| (s.name.as_str(), s.split.as_deref(), s.mass_kg)).collect();
    assert_eq!(
        short,
        [("B0000EXAM1_ATVPDKIKX0DER", Some("train"), Some(0.25)), ("B0000EXAM2_A1F83G8C2ARO7P", Some("test"), None)]
    );
    assert_eq!(
        found.warnings,
        ["1 scene of splits.json left out because it has no folder (first: `B0000EXAM3_ATVPDKIKX0DER`)"]
    );
    let scene = scene::load(&found.scenes[0].folder, &Options::default()).unwrap();
    let scale = scene.scale.unwrap();
    assert_eq!((scene.views.len(), scale.meters_per_unit, scale.source), (1, 1.0, ScaleSource::DataSet));
    // A splat of twice the size, with its photos or without.
    let align = "scale=2".parse().unwrap();
    for render_views in [None, Some(NonZeroUsize::MIN)] {
        let options = Options { align, render_views, ..Options::default() };
        let scale = scene::load(&found.scenes[0].folder, &options).unwrap().scale.unwrap();
        assert_eq!(scale.meters_per_unit, 0.5, "{render_views:?}");
    }
}

#[test]
fn a_scale_that_a_data_set_states_after_a_run_counts() {
    let (data_set, name) = (tempfile::tempdir().unwrap(), "scenes/B0000EXAM1_ATVPDKIKX0DER");
    let (original, scene) = (fixture("abo").join(name), data_set.path().join(name));
    std::fs::create_dir_all(scene.join("images")).unwrap();
    for file in ["point_cloud.ply", "transforms.json", "images/img_000.png"] {
        std::fs::copy(original.join(file), scene.join(file)).unwrap();
    }
    let scale = || {
        let plan = Plan::to(Stage::Scene);
        Pipeline::builder(&scene).plan(plan).open().unwrap().run().unwrap();
        let views = std::fs::read(scene.join("gprop/views.json")).unwrap();
        serde_json::from_slice::<serde_json::Value>(&views).unwrap()["scale"]["meters_per_unit"].as_f64()
    };
    assert_eq!(scale(), None);
    std::fs::copy(fixture("abo/splits.json"), data_set.path().join("splits.json")).unwrap();
    assert_eq!(scale(), Some(1.0));
}

#[test]
fn mvimgnet_is_listed_with_class() {
    let found = dataset::list(&fixture("mvimgnet"), None).unwrap();
    assert_eq!(found.layout, Layout::MvImgNet);
    let short: Vec<_> = found.scenes.iter().map(|s| (s.name.as_str(), s.class.as_deref())).collect();
    assert_eq!(short, [("113/0a00b1", Some("113")), ("7/1b000c", Some("7"))]);
    // Masks lie elsewhere, by class and instance.
    let options = Options { masks: Some(fixture("mvimgnet_masks/7/1b000c")), ..Options::default() };
    let scene = scene::load(&found.scenes[1].folder, &options).unwrap();
    assert_eq!(scene.views[0].name, "000");
    assert!(scene.views[0].mask.is_some());
    assert_eq!(scene.scale, None);
}

#[test]
fn any_folder_of_scenes_is_listed() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures");
    let found = dataset::list(&fixtures, None).unwrap();
    assert_eq!(found.layout, Layout::Scenes);
    assert!(found.scenes.iter().any(|scene| scene.name == "hammer"), "{:?}", found.scenes);
}

#[test]
fn a_work_folder_is_not_a_scene() {
    let scene = tempfile::tempdir().unwrap();
    let work = scene.path().join("gprop");
    std::fs::create_dir(scene.path().join("images")).unwrap();
    std::fs::create_dir(&work).unwrap();
    let splat = fixture("abo/scenes/B0000EXAM1_ATVPDKIKX0DER/point_cloud.ply");
    for result in ["field.ply", "field_recolored.ply"] {
        std::fs::copy(&splat, work.join(result)).unwrap();
    }
    std::fs::write(work.join("run.json"), "{}").unwrap();
    assert_message(dataset::list(scene.path(), None), &["no scenes in"]);
    assert_message(scene::load(scene.path(), &Options::default()), &["no splat in"]);
    let listed =
        || dataset::list(scene.path(), None).unwrap().scenes.iter().map(|s| s.name.clone()).collect::<Vec<_>>();
    // The user's own splat is one, whatever lies beside it; so is a splat that has the name of a result elsewhere.
    std::fs::copy(&splat, work.join("own.ply")).unwrap();
    assert_eq!(listed(), ["gprop"]);
    std::fs::remove_file(work.join("own.ply")).unwrap();
    std::fs::remove_file(work.join("run.json")).unwrap();
    assert_eq!(listed(), ["gprop"]);
}

#[test]
fn a_folder_without_scenes_is_refused() {
    let empty = tempfile::tempdir().unwrap();
    let list = |folder: &Path| dataset::list(folder, None).map(|found| panic!("{found:?}"));
    assert_message(list(empty.path()), &["no scenes in", "--layout"]);
    assert_message(list(Path::new("no/such")), &["no such scene folder"]);
    std::fs::create_dir(empty.path().join("scenes")).unwrap();
    std::fs::write(empty.path().join("splits.json"), "{").unwrap();
    assert_message(list(empty.path()), &["splits.json", "line 1"]);
}
