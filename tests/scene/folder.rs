use std::path::{Path, PathBuf};

use gprop::scene::{self, Options, ply};

fn hammer() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer")
}

#[test]
fn hammer_loads() {
    let options = Options { scale: "metric".parse().unwrap(), ..Options::default() };
    let scene = scene::load(&hammer(), &options).unwrap();
    assert_eq!(scene.name, "hammer");
    assert_eq!(scene.gaussians.len(), 28_736);
    assert_eq!(scene.gaussians.sh_degree, 3);
    assert_eq!(scene.views.len(), 30);
    assert_eq!(scene.views[7].name, "007");
    assert_eq!(scene.scale.as_ref().unwrap().meters_per_unit, 1.0);
    assert_eq!(scene.warnings, Vec::<String>::new());
    let bounds = scene.object_bounds();
    println!("{bounds:?}");
    let chosen: Vec<_> = scene.chosen_views(&options).unwrap().into_iter().map(|view| view.name).collect();
    println!("{chosen:?}");
    assert_eq!(chosen.len(), 10);
    let photo = scene.views[0].photo().unwrap();
    assert_eq!(photo.rgb.dimensions(), (512, 512));
}

#[test]
fn writing_what_was_read_gives_the_same_bytes() {
    let original = std::fs::read(hammer().join("point_cloud.ply")).unwrap();
    let loaded = ply::parse(&original).unwrap();
    let mut written = Vec::new();
    ply::write(&mut written, &loaded.gaussians, &[]).unwrap();
    assert!(written == original, "the bytes differ");
}
