//! Meshes as scenes: the rasteriser against closed forms, sampled surfaces, what the commands do with a mesh.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use gprop::camera::{Camera, Distortion, Intrinsics};
use gprop::inspect::inspect;
use gprop::render::triangles::{SAMPLES, Surface, SurfacePicture, draw};
use gprop::scene::mesh::{GAUSSIANS, Material, Mesh, PaintedMesh, sample};
use gprop::scene::{self, Options};
use gprop::words::progress::Progress;
use nalgebra::{Isometry3, Point3, Vector3};

use super::{parse, read};
use crate::run::gprop;

fn cup() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/cup/cup.glb")
}

/// A camera at the origin that looks along z.
fn camera(side: u32, focal: f64) -> Camera {
    let middle = 0.5 * f64::from(side);
    let intrinsics = Intrinsics {
        width: side,
        height: side,
        fx: focal,
        fy: focal,
        cx: middle,
        cy: middle,
        distortion: Distortion::None,
    };
    Camera { intrinsics, camera_from_world: Isometry3::identity() }
}

fn drawn(vertices: &[[f64; 3]], triangles: &[[u32; 3]], camera: &Camera) -> SurfacePicture {
    draw(Surface { vertices, triangles }, camera, |_| true, |point, _| [point.triangle as f32, 1.0, 0.0])
}

#[test]
fn depth_is_that_of_the_plane_and_coverage_that_of_its_outline() {
    // A tilted rectangle with corners at different depths: points of the plane n . p = d.
    let corners = [[-1.0, -0.8, 3.0], [1.2, -0.8, 4.0], [1.2, 0.9, 5.0], [-1.0, 0.9, 4.0]];
    let camera = camera(64, 70.0);
    let picture = drawn(&corners, &[[0, 1, 2], [0, 2, 3]], &camera);
    let [a, b, d] = [0, 1, 3].map(|corner| Vector3::from(corners[corner]));
    let normal = (b - a).cross(&(d - a));
    let pixel_of = |corner: [f64; 3]| camera.pixel(Point3::from(corner)).unwrap();
    let outline = corners.map(pixel_of);
    let is_inside = |x: f64, y: f64| {
        (0..4).all(|i| {
            let (from, to) = (outline[i], outline[(i + 1) % 4]);
            (to.x - from.x) * (y - from.y) - (to.y - from.y) * (x - from.x) >= 0.0
        })
    };
    let mut seen = 0;
    for y in 0..64 {
        for x in 0..64 {
            let pixel = y * 64 + x;
            let center = (x as f64 + 0.5, y as f64 + 0.5);
            let depth = f64::from(picture.depth[pixel]);
            assert_eq!(depth.is_finite(), is_inside(center.0, center.1), "{x} {y}");
            if depth.is_finite() {
                let ray = Vector3::new((center.0 - 32.0) / 70.0, (center.1 - 32.0) / 70.0, 1.0);
                // Depths are stored with 24 bits.
                assert!((depth - normal.dot(&a) / normal.dot(&ray)).abs() < 1e-6 * depth, "{x} {y}: {depth}");
                seen += 1;
            }
            let sample = |i: usize| (i as f64 + 0.5) / SAMPLES as f64;
            let covered = (0..SAMPLES * SAMPLES)
                .filter(|i| is_inside(x as f64 + sample(i % SAMPLES), y as f64 + sample(i / SAMPLES)))
                .count();
            assert_eq!(picture.coverage[pixel], covered as f32 / (SAMPLES * SAMPLES) as f32, "{x} {y}");
        }
    }
    assert!(seen > 500, "{seen}");
}

#[test]
fn nearer_triangles_hide_others_whatever_their_order_and_the_threads() {
    let vertices: Vec<[f64; 3]> = (0..300)
        .map(|i| {
            let (sin, cos) = (1.7 * f64::from(i)).sin_cos();
            [2.0 * sin, 2.0 * cos, 3.0 + f64::from(i % 7)]
        })
        .collect();
    let triangles: Vec<[u32; 3]> = (0..100).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let reversed: Vec<[u32; 3]> = triangles.iter().rev().copied().collect();
    let camera = camera(97, 60.0);
    let picture = drawn(&vertices, &triangles, &camera);
    let other = drawn(&vertices, &reversed, &camera);
    assert_eq!((&picture.depth, &picture.coverage), (&other.depth, &other.coverage));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(pool.install(|| drawn(&vertices, &triangles, &camera)), picture);
    assert!(picture.depth.iter().any(|depth| depth.is_finite()));
    // What reaches behind the camera is left out.
    let behind = drawn(&[[-1.0, 0.0, -1.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]], &[[0, 1, 2]], &camera);
    assert!(behind.coverage.iter().all(|coverage| *coverage == 0.0));
}

#[test]
fn samples_lie_on_the_surface_evenly_and_cover_it() {
    let mesh = read(&cup()).unwrap();
    let painted = PaintedMesh::new(mesh).unwrap();
    let sampled = sample(&painted).unwrap();
    let count = sampled.gaussians.len();
    assert!((0.7 * GAUSSIANS as f64..1.2 * GAUSSIANS as f64).contains(&(count as f64)), "{count}");
    assert_eq!(sample(&painted).unwrap(), sampled);
    let normal_of = |triangle: u32| {
        let [a, b, c] = painted.mesh.surface.triangles[triangle as usize]
            .map(|vertex| Vector3::from(painted.mesh.surface.vertices[vertex as usize]));
        (a, (b - a).cross(&(c - a)).normalize())
    };
    for (i, triangle) in sampled.triangles.iter().enumerate().step_by(97) {
        let (corner, normal) = normal_of(*triangle);
        let off = (sampled.gaussians.center(i).coords - corner).dot(&normal).abs();
        assert!(off < 1e-7, "Gaussian {i} is {off} m off its triangle");
        let thin = sampled.gaussians.rotation(i) * Vector3::z();
        assert!(thin.dot(&normal) > 0.999_999, "{thin:?} {normal:?}");
    }
    let inspection = inspect(&cup(), &Options::default(), Progress::HIDDEN).unwrap();
    assert_eq!(inspection.views.len(), 10);
    for view in &inspection.views {
        // A Gaussian reaches over an edge by about a third of a millimetre, of a cup that is 100 mm wide.
        assert!(view.mask_iou.unwrap() > 0.97 && view.psnr_db > 20.0, "{view:?}");
    }
    assert!(inspection.mesh.is_some_and(|mesh| (mesh.triangles, mesh.textures) == (9408, 2)), "{:?}", inspection.mesh);
}

#[test]
fn a_mesh_is_a_scene_with_views_all_around() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("cup.glb");
    fs::copy(cup(), &mesh).unwrap();
    let run = || gprop().arg("run").arg(&mesh).args(["--to", "scene", "--json"]).output().unwrap();
    let output = run();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let views: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.path().join("cup.gprop/views.json")).unwrap()).unwrap();
    assert_eq!(views["scale"]["meters_per_unit"], 1.0);
    let pictures = views["views"].as_array().unwrap();
    assert_eq!(pictures.len(), 10);
    for view in pictures {
        let picture = image::open(folder.path().join(view["image"].as_str().unwrap())).unwrap().into_rgba8();
        assert_eq!(picture.dimensions(), (1024, 1024));
        let covered = picture.pixels().filter(|pixel| pixel.0[3] == 255).count();
        assert!(covered > 100_000, "{covered} pixels of {view}");
        assert_eq!(picture.get_pixel(0, 0).0, [255, 255, 255, 0]);
    }
    let drawn = folder.path().join(pictures[0]["image"].as_str().unwrap());
    let before = fs::metadata(&drawn).unwrap().modified().unwrap();
    assert!(run().status.success());
    assert_eq!(fs::metadata(&drawn).unwrap().modified().unwrap(), before, "drawn again");
    let listed = gprop().arg("batch").arg(folder.path()).args(["--dry-run", "--json"]).output().unwrap();
    assert!(String::from_utf8_lossy(&listed.stdout).contains("\"cup\""), "{listed:?}");
}

/// Runs gprop on a mesh in a folder of its own, and says what was written beside it.
fn refused(name: &str, bytes: &[u8], flags: &[&str]) -> (Output, Vec<PathBuf>) {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join(name);
    fs::write(&mesh, bytes).unwrap();
    let output = gprop().arg("run").arg(&mesh).args(flags).output().unwrap();
    let written = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
    (output, written.filter(|path| *path != mesh).collect())
}

#[test]
fn broken_meshes_get_one_error_and_nothing_is_written() {
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let cases = [
        ("empty.obj", triangle.to_owned(), "has no triangles"),
        ("nan.obj", format!("v nan 0 0\n{triangle}f 1 2 3\n"), "line 1: a position is not a finite number"),
        ("range.obj", format!("{triangle}f 1 2 7\n"), "line 4: index 7 is out of range"),
        ("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n".to_owned(), "its triangles have no area"),
        ("outside.obj", format!("mtllib ../../../../etc/passwd\n{triangle}f 1 2 3\n"), "lies outside"),
    ];
    for (name, text, expected) in cases {
        let (output, written) = refused(name, text.as_bytes(), &[]);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{name}: {message}");
        assert!(message.contains(expected) && message.matches("error:").count() == 1, "{name}: {message}");
        assert!(written.is_empty(), "{name}: {written:?}");
    }
    let (output, _) = refused("a.obj", format!("{triangle}f 1 2 3\n").as_bytes(), &["--object-box=0,0,0:1,1,1"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("--object-box is for scenes"), "{output:?}");
    let (output, _) = refused("a.fbx", b"Kaydara", &[]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("not a mesh that gprop reads (.glb"), "{output:?}");
}

#[test]
fn the_unit_of_a_mesh_is_asked_for_or_doubted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    fs::write(&path, "v 0 0 0\nv 230 0 0\nv 0 100 0\nv 0 0 50\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n").unwrap();
    let load = |scale: &str| {
        let options = Options { scale: scale.parse().unwrap(), ..Options::default() };
        scene::load(&path, &options).unwrap()
    };
    let unknown = load("auto");
    assert_eq!(unknown.scale, None);
    assert!(unknown.warnings[0].contains("in mm it would be") && unknown.warnings[0].contains("--scale 0.001"));
    let absurd = load("metric");
    assert!(absurd.warnings[0].contains("is that its size?"), "{:?}", absurd.warnings);
    assert!(absurd.warnings[0].contains("in mm it would be"), "{:?}", absurd.warnings);
    assert!(load("0.001").warnings.is_empty());
    assert!(parse("a.obj", b"v 0 0 0\n").is_err());
}

#[test]
fn what_a_file_tells_apart_is_known_of_each_gaussian() {
    // Seams of the textures do not part the cup or the coaster.
    let scene = scene::load(&cup(), &Options::default()).unwrap();
    let origins = scene.origins();
    assert_eq!(origins.len(), scene.gaussians.len());
    let mut distinct: Vec<[u32; 3]> =
        origins.iter().map(|origin| [origin.look, origin.shape, origin.surface]).collect();
    distinct.sort_unstable();
    distinct.dedup();
    assert_eq!(distinct, [[0; 3], [1; 3]]);
    let gray = |light: f32| Material { base_color: [light, light, light, 1.0], ..Material::default() };
    let mesh = Mesh { materials: vec![gray(0.2), gray(0.8), gray(0.2)], ..Mesh::default() };
    assert_eq!(mesh.looks(), [0, 1, 0]);
}

/// A box whose faces have two materials in two groups, with these names.
fn named_box(folder: &Path, [material, group]: [&str; 2]) -> PathBuf {
    let corners = (0..8)
        .map(|n| format!("v {} {} {}\n", 0.2 * f64::from(n & 1), 0.1 * f64::from(n >> 1 & 1), 0.1 * f64::from(n >> 2)));
    let corners: String = corners.collect();
    let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\n";
    let text =
        format!("mtllib box.mtl\n{corners}g {group}\nusemtl {material}\n{faces}usemtl plain\nf 1 5 7 3\nf 2 4 8 6\n");
    fs::write(folder.join("box.mtl"), format!("newmtl {material}\nKd 0.1 0.1 0.1\nnewmtl plain\nKd 0.8 0.8 0.8\n"))
        .unwrap();
    fs::write(folder.join("box.obj"), text).unwrap();
    folder.join("box.obj")
}

/// Every file below a folder, by its path in it.
fn files_below(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            let below = files_below(&path).into_iter();
            found.extend(below.map(|(inner, bytes)| (Path::new(path.file_name().unwrap()).join(inner), bytes)));
        } else {
            found.push((path.file_name().unwrap().into(), fs::read(&path).unwrap()));
        }
    }
    found.sort();
    found
}

#[test]
fn what_an_author_called_things_reaches_nobody_unless_the_user_says_so() {
    const NAMES: [&str; 2] = ["Leather_Black", "Cast_Iron_Anvil"];
    let asked = |names: [&str; 2], flags: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let mesh = named_box(folder.path(), names);
        let (work, labels, export) = ("box.gprop", folder.path().join("labels"), folder.path().join("export"));
        let run = |arguments: &[&str]| {
            let run = gprop()
                .args(&arguments[..1])
                .arg(&mesh)
                .args(&arguments[1..])
                .args(["--scale", "1", "--views", "3"])
                .output();
            let run = run.unwrap();
            assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
            [run.stdout, run.stderr].concat()
        };
        let mut said = run(&["run", "--to", "scene"]);
        fs::create_dir(&labels).unwrap();
        let drawn = files_below(&folder.path().join(work).join("rendered"));
        for (path, bytes) in drawn.iter().filter(|(path, _)| path.extension().is_some_and(|ending| ending == "png")) {
            let picture = image::load_from_memory(bytes).unwrap().into_rgba8();
            let covered = |x, y| image::Luma([u16::from(picture.get_pixel(x, y).0[3] > 127)]);
            let map = image::ImageBuffer::from_fn(picture.width(), picture.height(), covered);
            map.save(labels.join(path.file_name().unwrap())).unwrap();
        }
        let (labels, exported) = (labels.to_str().unwrap(), export.to_str().unwrap());
        said.extend(run(&[&["query", "--segments", labels, "--export", exported], flags].concat()));
        let written = files_below(&folder.path().join(work)).into_iter().map(|(_, bytes)| bytes).chain([said]);
        let shows = |name: &str| {
            let has = |bytes: &Vec<u8>| bytes.windows(name.len()).any(|window| window == name.as_bytes());
            written.clone().any(|bytes| has(&bytes)) || files_below(&export).iter().any(|(_, bytes)| has(bytes))
        };
        (NAMES.map(shows), files_below(&export))
    };
    let (shown, export) = asked(NAMES, &[]);
    assert_eq!(shown, [false; 2]);
    assert!(export.len() > 2, "{}", export.len());
    assert!(asked(["Ash_Wood", "Cushion"], &[]).1 == export, "other names, other sheets or prompts");
    assert_eq!(asked(NAMES, &["--hints", "names"]).0, [true; 2]);
}
