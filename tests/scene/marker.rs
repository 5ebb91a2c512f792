//! The scale from a printed marker: photos of the hammer with a marker on the table beside it, as its cameras would show
//! it. The marker is as long as its side in the scene, so the true scale is one.

use std::path::Path;

use gprop::camera::{Camera, Distortion};
use gprop::scene::{self, Marker, Scene, SceneError, marker_board};
use gprop::units::{MetricScale, ScaleSource};
use image::{RgbImage, Rgba, RgbaImage};
use nalgebra::{Point2, Point3, Vector3};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::folder::{hammer, options};

/// The fixture's photos show little but the object; these have a margin of this many pixels around them.
const MARGIN: u32 = 104;
const SIDE_PX: u32 = 512 + 2 * MARGIN;
/// Side of the marker in scene units: 40 to 80 pixels in the photos, along its longer side.
const SIDE: f64 = 0.06;
/// Where it lies beside the hammer, and by how much it is turned in its plane.
const CENTER: [f64; 3] = [0.0, -0.1, 0.0];
const TURN: f64 = 0.3;
/// Light of ink, of paper, and of what is around them.
const INK: f64 = 0.03;
const PAPER: f64 = 0.8;
const AROUND: f64 = 0.85;
/// Every other photo: half of the time.
const STEP: usize = 2;

/// What the photos show.
struct Shot<'a> {
    marker: &'a str,
    lens: Distortion,
    /// Standard deviation of the blur in the photo with this number, in pixels.
    blur_px: fn(usize) -> f64,
    /// By how much the marker is moved while the photo with this number is taken.
    moved: fn(usize) -> f64,
    /// Whether the marker is there in the photo with this number.
    shows: fn(usize) -> bool,
}

const PLAIN: Shot =
    Shot { marker: "apriltag:36h11,7", lens: Distortion::None, blur_px: |_| 0.0, moved: |_| 0.0, shows: |_| true };

/// For each cell from the upper left one with the border, whether it is white: as the board has it.
fn cells(marker: &str) -> Vec<Vec<bool>> {
    let board = marker_board(&marker.parse().unwrap(), 1.0);
    let path = board.split("fill-rule=\"evenodd\" d=\"").nth(1).unwrap().split('"').next().unwrap();
    let numbers = |part: &str| -> Vec<f64> {
        let numbers = part.split(['h', 'v', ' ', 'z', '-']).filter(|number| !number.is_empty());
        numbers.map(|number| number.parse().unwrap()).collect()
    };
    let squares: Vec<Vec<f64>> = path.split('M').skip(1).map(numbers).collect();
    let ([left, top, side], cell) = ([squares[0][0], squares[0][1], squares[0][2]], squares[1][3]);
    let count = (side / cell).round() as usize;
    let mut white = vec![vec![false; count]; count];
    for hole in &squares[1..] {
        let [column, row, length] = [hole[0] - left, hole[1] - top, hole[2]].map(|mm| (mm / cell).round() as usize);
        white[row][column..column + length].fill(true);
    }
    white
}

fn light(value: u8) -> f64 {
    let v = f64::from(value) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

fn encoded(light: f64) -> u8 {
    let v = if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
    (255.0 * v).round() as u8
}

/// The light of the marker and its paper at a place of the table; `None` beside the paper.
fn on_table(white: &[Vec<bool>], place: Point3<f64>, moved: f64) -> Option<f64> {
    let from_center = place - Point3::from(CENTER) - Vector3::x() * moved;
    let (sin, cos) = TURN.sin_cos();
    let along = |x: f64, y: f64| (x * from_center.x + y * from_center.y) / SIDE + 0.5;
    let count = white.len() as f64;
    let cell = |share: f64| (share * count).floor() as i64;
    let (column, row) = (cell(along(cos, sin)), cell(along(sin, -cos)));
    let last = white.len() as i64;
    // The margin is one cell wide.
    let on_paper = (-1..=last).contains(&column) && (-1..=last).contains(&row);
    let of_cell = || {
        let is_white = white.get(row as usize).and_then(|row| row.get(column as usize)).is_none_or(|white| *white);
        if is_white { PAPER } else { INK }
    };
    on_paper.then(of_cell)
}

/// A photo of the fixture with the marker behind the object.
fn photo(number: usize, camera: &Camera, object: &RgbaImage, shot: &Shot) -> RgbImage {
    /// Samples along each side of a pixel.
    const SAMPLES: u32 = 4;
    let (white, i) = (cells(shot.marker), camera.intrinsics);
    let world_from_camera = camera.camera_from_world.inverse();
    let eye = camera.center_in_world();
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| {
        let corner = Point3::from(CENTER) + Vector3::new(x, y, 0.0) * SIDE * 1.2;
        camera.pixel(camera.point_in_camera(corner)).unwrap()
    });
    let (low, high) = corners.iter().fold((corners[0], corners[0]), |(low, high), p| (low.inf(p), high.sup(p)));
    let is_near = |x: u32, y: u32| {
        let margin = 20.0;
        let p = Point2::new(f64::from(x), f64::from(y));
        (shot.shows)(number)
            && p.x > low.x - margin
            && p.y > low.y - margin
            && p.x < high.x + margin
            && p.y < high.y + margin
    };
    let table = |x: f64, y: f64| {
        let (u, v) = i.distortion.invert((x - i.cx) / i.fx, (y - i.cy) / i.fy)?;
        let ray = world_from_camera.rotation * Vector3::new(u, v, 1.0);
        on_table(&white, eye + ray * ((CENTER[2] - eye.z) / ray.z), (shot.moved)(number))
    };
    let mut lights = vec![[0.0; 3]; (SIDE_PX * SIDE_PX) as usize];
    for (at, pixel) in lights.iter_mut().enumerate() {
        let (x, y) = (at as u32 % SIDE_PX, at as u32 / SIDE_PX);
        let mut behind = AROUND;
        if is_near(x, y) {
            let place = |at: u32, n: u32| f64::from(at) + (f64::from(n) + 0.5) / f64::from(SAMPLES);
            let samples =
                (0..SAMPLES * SAMPLES).map(|n| table(place(x, n % SAMPLES), place(y, n / SAMPLES)).unwrap_or(AROUND));
            behind = samples.sum::<f64>() / f64::from(SAMPLES * SAMPLES);
        }
        let inside = |at: u32| at.checked_sub(MARGIN).filter(|at| *at < 512);
        let Rgba([r, g, b, alpha]) = inside(x).zip(inside(y)).map_or(Rgba([0; 4]), |(x, y)| *object.get_pixel(x, y));
        let alpha = f64::from(alpha) / 255.0;
        *pixel = [r, g, b].map(|value| alpha * light(value) + (1.0 - alpha) * behind);
    }
    let blur = (shot.blur_px)(number);
    let blurred = if blur > 0.0 { blurred(&lights, blur, &is_near) } else { lights };
    RgbImage::from_fn(SIDE_PX, SIDE_PX, |x, y| image::Rgb(blurred[(y * SIDE_PX + x) as usize].map(encoded)))
}

/// A Gaussian blur, along rows and then along columns, near the marker.
fn blurred(lights: &[[f64; 3]], deviation: f64, is_near: &impl Fn(u32, u32) -> bool) -> Vec<[f64; 3]> {
    let reach = (3.0 * deviation).ceil() as i64;
    let weights: Vec<f64> = (-reach..=reach).map(|n| (-0.5 * (n as f64 / deviation).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    let side = i64::from(SIDE_PX);
    let mut lights = lights.to_vec();
    for (dx, dy) in [(1, 0), (0, 1)] {
        let before = lights.clone();
        for (at, pixel) in lights.iter_mut().enumerate() {
            let (x, y) = (at as i64 % side, at as i64 / side);
            if !is_near(x as u32, y as u32) {
                continue;
            }
            *pixel = [0.0; 3];
            for (n, weight) in (-reach..).zip(&weights) {
                let (x, y) = ((x + n * dx).clamp(0, side - 1), (y + n * dy).clamp(0, side - 1));
                let other = before[(y * side + x) as usize];
                (0..3).for_each(|c| pixel[c] += weight / sum * other[c]);
            }
        }
    }
    lights
}

impl Shot<'_> {
    /// The scene with these photos.
    fn taken(&self) -> TempDir {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::copy(hammer().join("point_cloud.ply"), path("point_cloud.ply")).unwrap();
        std::fs::create_dir(path("images")).unwrap();
        let text = std::fs::read_to_string(hammer().join("transforms.json")).unwrap();
        let mut transforms: Value = serde_json::from_str(&text).unwrap();
        for (key, value) in [("w", SIDE_PX), ("h", SIDE_PX), ("cx", SIDE_PX / 2), ("cy", SIDE_PX / 2)] {
            transforms[key] = json!(value);
        }
        if let Distortion::Perspective(lens) = self.lens {
            for (key, value) in ["k1", "k2", "p1", "p2"].iter().zip([&lens.radial[..2], &lens.tangential[..]].concat())
            {
                transforms[key] = json!(value);
            }
        }
        let original = scene::load(&hammer(), &options(&[]).unwrap()).unwrap();
        for (number, view) in original.views.iter().enumerate().step_by(STEP) {
            let mut camera = view.camera.clone();
            let i = &mut camera.intrinsics;
            (i.width, i.height, i.distortion) = (SIDE_PX, SIDE_PX, self.lens);
            (i.cx, i.cy) = (f64::from(SIDE_PX / 2), f64::from(SIDE_PX / 2));
            let object = image::open(&view.image).unwrap().to_rgba8();
            let picture = photo(number / STEP, &camera, &object, self);
            picture.save(path(&format!("images/{}.png", view.name))).unwrap();
        }
        let frames = transforms["frames"].as_array().unwrap().iter().step_by(STEP).map(|frame| {
            let mut frame = frame.clone();
            frame["file_path"] = json!(frame["file_path"].as_str().unwrap().replace(".webp", ".png"));
            frame
        });
        transforms["frames"] = frames.collect();
        std::fs::write(path("transforms.json"), transforms.to_string()).unwrap();
        folder
    }
}

fn load(folder: &Path, scale: &str) -> (Scene, scene::Options) {
    let options = options(&["--scale", scale]).unwrap();
    (scene::load(folder, &options).unwrap(), options)
}

fn measured(folder: &Path, scale: &str) -> Result<(MetricScale, Vec<String>), SceneError> {
    let (scene, options) = load(folder, scale);
    assert_eq!(scene.scale, None, "no photo was looked at yet");
    scene.scale_in_photos(&options.scale).map(Option::unwrap)
}

/// The requirement: half a percent of the length.
const MOST_ERROR: f64 = 0.005;

#[track_caller]
fn assert_true(scale: &MetricScale, truth: f64) {
    let range = scale.range.unwrap();
    let error = (scale.meters_per_unit / truth).ln();
    assert!(error.abs() <= MOST_ERROR, "{error:.5}: {}", scale.provenance);
    assert!(range.low < truth && truth < range.high, "{range:?}");
    assert!((range.high / range.low).ln() < 4.0 * MOST_ERROR, "{range:?}");
    assert_eq!(scale.source, ScaleSource::Marker);
}

#[test]
fn a_marker_gives_the_scale() {
    let folder = PLAIN.taken();
    let (scale, warnings) = measured(folder.path(), "apriltag:36h11,7=60mm").unwrap();
    assert_true(&scale, 1.0);
    assert!(warnings.is_empty(), "{warnings:?}");
    // Half the side, half the scale; the other way of writing it; the same bytes.
    let (half, _) = measured(folder.path(), "apriltag:tag36h11,7=0.03").unwrap();
    assert_eq!(half.meters_per_unit, 0.5 * scale.meters_per_unit);
    let again = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(again.install(|| measured(folder.path(), "apriltag:36h11,7=60mm").unwrap().0), scale);

    let unseen = measured(folder.path(), "apriltag:36h11,8=60mm").unwrap_err().to_string();
    for needle in ["--scale apriltag:36h11,8=0.06", "none of the 15 photos shows this marker", "apriltag:36h11,7 in 1"]
    {
        assert!(unseen.contains(needle), "{unseen}");
    }
    assert!(measured(folder.path(), "aruco:4x4_50,7=60mm").unwrap_err().to_string().contains("none of the 15 photos"));
}

#[test]
fn blurred_photos_and_a_lens_that_bends_lines_give_the_same_scale() {
    // Up to a third of a cell as seen from above, and more than a cell as seen from the side.
    let blurred = Shot { blur_px: |n| [0.0, 1.0, 2.5][n % 3], ..PLAIN }.taken();
    assert_true(&measured(blurred.path(), "apriltag:36h11,7=60mm").unwrap().0, 1.0);
    let all_blurred = Shot { blur_px: |_| 1.5, ..PLAIN }.taken();
    assert_true(&measured(all_blurred.path(), "apriltag:36h11,7=60mm").unwrap().0, 1.0);
    let lens = Distortion::opencv(-0.2, 0.05, 0.002, -0.002, 0.0);
    let bent = Shot { marker: "aruco:4x4_50,3", lens, ..PLAIN }.taken();
    assert_true(&measured(bent.path(), "aruco:DICT_4X4_50,3=60mm").unwrap().0, 1.0);
}

#[test]
fn views_that_disagree_are_left_out_and_named() {
    let folder = Shot { moved: |n| if n == 3 { 0.02 } else { 0.0 }, ..PLAIN }.taken();
    let (scale, warnings) = measured(folder.path(), "apriltag:36h11,7=60mm").unwrap();
    assert_true(&scale, 1.0);
    let off = format!("{:03} (", 3 * STEP);
    assert!(warnings.len() == 1 && warnings[0].contains(&off), "{off}: {warnings:?}");

    let once = Shot { shows: |n| n == 3, ..PLAIN }.taken();
    let message = measured(once.path(), "apriltag:36h11,7=60mm").unwrap_err().to_string();
    assert!(message.contains(&format!("only view {:03} shows this marker", 3 * STEP)), "{message}");

    let wandering = Shot { moved: |n| 0.01 * n as f64, ..PLAIN }.taken();
    let message = measured(wandering.path(), "apriltag:36h11,7=60mm").unwrap_err().to_string();
    assert!(message.contains("at different places") && message.contains("agree"), "{message}");
}

#[test]
fn the_scene_stage_finds_the_marker_and_later_stages_use_it() {
    let folder = Shot { shows: |n| n < 4, ..PLAIN }.taken();
    let run = |arguments: &[&str]| {
        let program = env!("CARGO_BIN_EXE_gprop");
        let output = std::process::Command::new(program).args(arguments).arg(folder.path()).output().unwrap();
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stdout).into_owned(),
            String::from_utf8_lossy(&output.stderr).into_owned(),
        )
    };
    std::fs::write(folder.path().join("gprop.toml"), "scale = \"apriltag:36h11,7=6cm\"\n").unwrap();
    let (code, _, told) = run(&["run", "--to", "scene"]);
    assert_eq!(code, Some(0), "{told}");
    let views = std::fs::read_to_string(folder.path().join("gprop/views.json")).unwrap();
    let views: Value = serde_json::from_str(&views).unwrap();
    assert_true(&serde_json::from_value(views["scale"].clone()).unwrap(), 1.0);
    let (_, inspected, _) = run(&["inspect", "--json"]);
    let inspected: Value = serde_json::from_str(&inspected).unwrap();
    assert_eq!(inspected["scale"], views["scale"]);
    // A sheet that says how large the object is has a line more.
    let height_of_sheet = |name: &str, scale: &[&str]| {
        let questions = folder.path().join(name);
        let (code, _, told) = run(&[&["query", "--direct", "--export", questions.to_str().unwrap()], scale].concat());
        assert_eq!(code, Some(0), "{told}");
        let sheet = std::fs::read_dir(questions.join("sheets")).unwrap().next().unwrap().unwrap().path();
        image::image_dimensions(sheet).unwrap().1
    };
    let without = height_of_sheet("without", &["--scale", "auto"]);
    let with = height_of_sheet("with", &["--fresh"]);
    assert!(with > without, "{with} {without}");

    std::fs::write(folder.path().join("gprop.toml"), "scale = \"apriltag:36h11,8=6cm\"\n").unwrap();
    let (code, _, told) = run(&["run", "--to", "scene"]);
    assert!(code == Some(3) && told.contains("none of the 15 photos shows this marker"), "{told}");
    let (code, _, told) = run(&["run", "--to", "scene", "--scale", "apriltag:36h11,600=6cm"]);
    assert!(code == Some(2) && told.contains("ids 0 to 586"), "{told}");
}

/// The board as a browser prints it would need a browser; here the square and its cells are where its text says.
#[test]
fn the_board_has_the_marker_in_its_true_size() {
    let board = marker_board(&"apriltag:16h5,2".parse::<Marker>().unwrap(), 0.06);
    for needle in
        ["width=\"136mm\"", "M20 20h60v60h-60z", "side of the black square 60.0 mm", "h100M", ">100 mm</text>"]
    {
        assert!(board.contains(needle), "{needle} is not in: {board}");
    }
    for marker in
        ["apriltag:36h11,7", "apriltag:25h9,1", "aruco:original,30", "aruco:mip_36h12,3", "aruco:7x7_1000,999"]
    {
        let white = cells(marker);
        let border = |n: usize| n == 0 || n + 1 == white.len();
        let mut count = 0;
        for (y, row) in white.iter().enumerate() {
            for (x, is_white) in row.iter().enumerate() {
                assert!(!(*is_white && (border(x) || border(y))), "{marker}: the border is black");
                count += usize::from(*is_white);
            }
        }
        assert!(count > 0, "{marker}");
    }
}
