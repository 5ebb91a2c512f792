//! The whole pipeline from a splat to masses: a ball of a few hundred Gaussians with two parts, seen by three small cameras, whose
//! label maps and answers are given. The input bytes alter the Gaussians.

use std::sync::LazyLock;

use gprop::camera::{Camera, Distortion, Intrinsics};
use gprop::gaussians::Gaussians;
use gprop::materials::MaterialLibrary;
use gprop::parts::{self, parts};
use gprop::query::{Answer, Answers, Outcome, SubjectAnswer, SubjectId};
use gprop::scene::object::outliers;
use gprop::scene::splat::ply;
use gprop::segment::LabelMap;
use gprop::units::{Estimate, MetricScale, ScaleSource};
use gprop::vote::{self, VotingView, vote};
use gprop::words::progress::Progress;
use nalgebra::{Isometry3, Point3, Vector3};

const GAUSSIANS: usize = 300;
/// Metres, which are the scene's units.
const RADIUS: f64 = 0.1;
pub(super) const EYES: [[f64; 3]; 3] = [[0.4, 0.1, 0.05], [-0.2, 0.35, 0.0], [-0.15, -0.3, 0.2]];
/// Side of the pictures, px.
const SIDE: u32 = 48;
/// More instructions than this reveal nothing new.
const MOST_INSTRUCTIONS: usize = 64;

struct Ball {
    gaussians: Gaussians,
    cameras: Vec<Camera>,
    maps: Vec<LabelMap>,
    answers: Answers,
}

static BALL: LazyLock<Ball> = LazyLock::new(|| {
    let cameras: Vec<Camera> = EYES.map(camera_at).into();
    Ball { gaussians: gaussians(), maps: cameras.iter().map(seen_by).collect(), answers: answers(), cameras }
});

/// Carries out the instructions in the bytes, eight bytes each, and weighs the result: no mass is zero, infinite or NaN.
pub fn whole_line(bytes: &[u8]) {
    let ball = &*BALL;
    let mut changed = ball.gaussians.clone();
    bytes.as_chunks::<8>().0.iter().take(MOST_INSTRUCTIONS).for_each(|instruction| change(&mut changed, *instruction));
    let mut file = Vec::new();
    ply::write(&mut file, &changed, &[]).expect("memory takes everything");
    let Ok(loaded) = ply::parse(&file) else { return };
    let mut gaussians = loaded.gaussians;
    if outliers::set_aside(&mut gaussians, Progress::HIDDEN).is_err() {
        return;
    }
    let names: Vec<String> = (0..ball.cameras.len()).map(|view| view.to_string()).collect();
    let views = names.iter().zip(&ball.cameras).zip(&ball.maps);
    let views: Vec<_> = views.map(|((name, camera), map)| VotingView { name, camera, map }).collect();
    let (library, hidden) = (MaterialLibrary::builtin(), Progress::HIDDEN);
    let Ok(field) = vote(&gaussians, &views, &ball.answers, library, &vote::Options::default(), hidden) else { return };
    let scale =
        MetricScale { meters_per_unit: 1.0, source: ScaleSource::Metric, provenance: String::new(), range: None };
    let options = parts::Options { volume_cells: 1000, ..parts::Options::default() };
    let Ok(result) = parts(&gaussians, &field, &ball.cameras, Some(&scale), &options, hidden) else { return };
    let weighed = result.metric().expect("the scale is known");
    assert_number(weighed.object.mass_kg);
    assert_number(weighed.object.volume_m3);
    for part in &weighed.parts {
        part.mass_kg.into_iter().chain(part.volume_m3).chain(part.thickness_m).for_each(assert_number);
        assert_eq!(part.volume_m3.is_none(), part.no_volume.is_some());
    }
}

fn assert_number(estimate: Estimate) {
    let Estimate { low, mid, high } = estimate;
    assert!(0.0 <= low && low <= mid && 0.0 < mid && mid <= high && high.is_finite(), "{estimate:?}");
}

/// Carries out one instruction: what to change, axis, which Gaussian (2 bytes), value (4 bytes). If the high bit of the first byte
/// is set, it changes every nth Gaussian instead of one, where n follows from the two bytes.
fn change(gaussians: &mut Gaussians, [what, axis, a, b, value @ ..]: [u8; 8]) {
    let (which, value) = (usize::from(u16::from_le_bytes([a, b])), f32::from_le_bytes(value));
    let (first, step) = if what & 0x80 == 0 { (which % GAUSSIANS, GAUSSIANS) } else { (0, 1 + which % 64) };
    let axis = usize::from(axis);
    for i in (first..GAUSSIANS).step_by(step) {
        match what & 0x7f {
            0..24 => gaussians.log_scales[i] = gaussians.log_scales[i].map(|scale| scale + value),
            24..40 => gaussians.log_scales[i] = [value; 3],
            40..56 => gaussians.log_scales[i][axis % 3] = value,
            56..72 => gaussians.opacity_logits[i] = value,
            72..88 => gaussians.positions[i][axis % 3] = value,
            88..104 => gaussians.positions[i] = [value; 3],
            104..116 => gaussians.rotations[i][axis % 4] = value,
            _ => gaussians.sh_dc[i][axis % 3] = value,
        }
    }
}

/// Spread evenly over the ball's surface.
pub(super) fn gaussians() -> Gaussians {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let mut gaussians = Gaussians::default();
    for index in 0..GAUSSIANS {
        let z = 1.0 - 2.0 * (index as f64 + 0.5) / GAUSSIANS as f64;
        let (sin, cos) = (golden * index as f64).sin_cos();
        let ring = (1.0 - z * z).sqrt();
        gaussians.positions.push([ring * cos, ring * sin, z].map(|side| (side * RADIUS) as f32));
        gaussians.log_scales.push([0.01f32.ln(); 3]);
        gaussians.rotations.push([1.0, 0.0, 0.0, 0.0]);
        gaussians.opacity_logits.push(3.0);
        gaussians.sh_dc.push([0.0; 3]);
    }
    gaussians
}

/// Looks at the ball's middle.
pub(super) fn camera_at(eye: [f64; 3]) -> Camera {
    // nalgebra's right-handed look_at gives x right, y up, z backward; half a turn about x makes it OpenCV's.
    let view = Isometry3::look_at_rh(&Point3::from(eye), &Point3::origin(), &Vector3::z());
    let flip = Isometry3::rotation(Vector3::x() * std::f64::consts::PI);
    let side = f64::from(SIDE);
    let middle = 0.5 * side;
    let intrinsics = Intrinsics {
        width: SIDE,
        height: SIDE,
        fx: side,
        fy: side,
        cx: middle,
        cy: middle,
        distortion: Distortion::None,
    };
    Camera { intrinsics, camera_from_world: flip * view }
}

/// Segment 1 is the upper half, segment 2 the lower.
pub(super) fn seen_by(camera: &Camera) -> LabelMap {
    let world_from_camera = camera.camera_from_world.inverse();
    let eye = world_from_camera.translation.vector;
    let i = camera.intrinsics;
    let label = |pixel: u32| {
        let [x, y] = [pixel % SIDE, pixel / SIDE].map(|side| f64::from(side) + 0.5);
        let along = Vector3::new((x - i.cx) / i.fx, (y - i.cy) / i.fy, 1.0);
        let along = (world_from_camera.rotation * along).normalize();
        let half = eye.dot(&along);
        let root = half * half - eye.norm_squared() + RADIUS * RADIUS;
        let hit = (root >= 0.0).then(|| eye + along * (-half - root.sqrt()));
        hit.map_or(0, |hit| if hit.z >= 0.0 { 1 } else { 2 })
    };
    LabelMap { width: SIDE, height: SIDE, labels: (0..SIDE * SIDE).map(label).collect() }
}

/// The upper half is of the library's first material, the lower of its second.
fn answers() -> Answers {
    let answer = |row: usize| Answer::of(&MaterialLibrary::builtin().materials()[row]);
    let of_view = |view: usize| {
        let segment = move |row: usize| SubjectAnswer {
            view: view.to_string(),
            subject: SubjectId::Segment(row as u16 + 1),
            outcome: Outcome::Answered(answer(row)),
        };
        (0..2).map(segment)
    };
    Answers::new((0..EYES.len()).flat_map(of_view).collect())
}
