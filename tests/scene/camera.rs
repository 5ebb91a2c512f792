//! Projection against finite differences and against the fixture's ground truth.

use gprop::camera::{Camera, Distortion, Intrinsics, Polynomial, camera_from_world_of_opengl, rotation_of};
use gprop::scene::{self, Options};
use nalgebra::{Isometry3, Matrix3, Matrix4, Point3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use super::folder::hammer;

/// Lenses of every model, as strong as real ones.
fn distortions() -> impl Strategy<Value = Distortion> {
    let polynomial = || {
        let radial = prop::array::uniform6(-0.3..0.3);
        let rest =
            (prop::array::uniform3(-0.1..0.1), prop::array::uniform2(-0.02..0.02), prop::array::uniform4(-0.02..0.02));
        (radial, rest, any::<bool>()).prop_map(|(radial, (divisor, tangential, prism), prism_after_radial)| {
            Polynomial { radial, divisor, tangential, prism, prism_after_radial }
        })
    };
    prop_oneof![
        Just(Distortion::None),
        brown(),
        polynomial().prop_map(Distortion::Perspective),
        polynomial().prop_map(Distortion::Fisheye),
        (0.1..2.0).prop_map(|omega| Distortion::FieldOfView { omega }),
        (-0.3..0.1).prop_map(|k| Distortion::Division { k }),
        (0.0..1.0, 0.5..2.0).prop_map(|(alpha, beta)| Distortion::EnhancedUnified { alpha, beta }),
    ]
}

/// Perspective lenses of three radial terms.
fn brown() -> impl Strategy<Value = Distortion> {
    let (radial, tangential) = (|| -0.4..0.4, || -0.02..0.02);
    (radial(), radial(), tangential(), tangential(), radial())
        .prop_map(|(k1, k2, p1, p2, k3)| Distortion::opencv(k1, k2, p1, p2, k3))
}

proptest! {
    #![proptest_config(super::proptest_config())]

    #[test]
    fn distortion_jacobian_is_the_slope_of_apply(lens in distortions(), x in -0.8..0.8, y in -0.8..0.8) {
        // Central differences with four points have an error of h^4/30 times the fifth derivative, plus rounding,
        // 1e-16/h.
        const H: f64 = 1e-4;
        const TOLERANCE: f64 = 1e-8;
        let slope = |dx: f64, dy: f64| {
            let image_at = |steps: f64| lens.apply(x + steps * dx, y + steps * dy);
            let ([near, far], [near_back, far_back]) = ([image_at(1.0), image_at(2.0)], [image_at(-1.0), image_at(-2.0)]);
            let slope = |near: f64, far: f64| (8.0 * near - far) / (12.0 * H);
            [slope(near.0 - near_back.0, far.0 - far_back.0), slope(near.1 - near_back.1, far.1 - far_back.1)]
        };
        let (along_x, along_y) = (slope(H, 0.0), slope(0.0, H));
        let numeric = [[along_x[0], along_y[0]], [along_x[1], along_y[1]]];
        let exact = lens.jacobian(x, y);
        for (numeric, exact) in numeric.as_flattened().iter().zip(exact.as_flattened()) {
            prop_assert!((numeric - exact).abs() < TOLERANCE, "{numeric} {exact}");
        }
    }

    #[test]
    fn a_lens_folds_back_where_its_radius_shrinks(lens in distortions(), r in 0.01..3.0) {
        // Goes outwards; the test skips radii within a step of the turning point, and lenses that turn back over less
        // than one of the 64 steps that gprop examines.
        const STEPS: usize = 3200;
        let radial_only = match lens {
            Distortion::Perspective(p) => Distortion::Perspective(radial_part(p)),
            Distortion::Fisheye(p) => Distortion::Fisheye(radial_part(p)),
            // Past the largest radius that a picture shows there is no radius to shrink.
            Distortion::Division { k } if 4.0 * k * r * r > 0.99 => return Ok(()),
            other => other,
        };
        let radius = |i: usize| radial_only.apply(r * i as f64 / STEPS as f64, 0.0).0;
        let steps: Vec<f64> = (0..STEPS).map(|i| radius(i + 1) - radius(i)).collect();
        let smallest_step = steps.iter().copied().fold(f64::INFINITY, f64::min);
        prop_assume!(smallest_step.abs() > 1e-6);
        prop_assume!(smallest_step < 0.0 || radius(STEPS + 1) > radius(STEPS));
        let shrinking = steps.iter().filter(|step| **step < 0.0).count();
        prop_assume!(shrinking == 0 || shrinking > STEPS / 64);
        prop_assert_eq!(radial_only.folds_back_at(r, 0.0), smallest_step < 0.0);
        prop_assert_eq!(lens.folds_back_at(0.6 * r, 0.8 * r), smallest_step < 0.0);
    }

    #[test]
    fn inverting_a_lens_undoes_it(lens in distortions(), x in -0.8..0.8, y in -0.8..0.8) {
        let (u, v) = lens.apply(x, y);
        if let Some((back_x, back_y)) = lens.invert(u, v) {
            let (again_u, again_v) = lens.apply(back_x, back_y);
            prop_assert!((again_u - u).hypot(again_v - v) < 1e-10);
        }
    }

    #[test]
    fn what_a_lens_shows_can_be_inverted(lens in brown(), x in -0.8..0.8f64, y in -0.8..0.8f64) {
        // The lens is one to one there: until well beyond the point, its radius grows faster than the tangential terms,
        // at most 0.02 each, can change within 0.8: (6 + 2 + 2 + 2) 0.02 0.8 = 0.19.
        const STEPS: usize = 100;
        const LEAST_SLOPE: f64 = 0.2;
        let Distortion::Perspective(polynomial) = lens else { unreachable!("brown makes no other") };
        let (radial, step) = (Distortion::Perspective(radial_part(polynomial)), 1.5 * x.hypot(y) / STEPS as f64);
        let radius = |i: usize| radial.apply(i as f64 * step, 0.0).0;
        prop_assume!((0..STEPS).all(|i| radius(i + 1) - radius(i) > LEAST_SLOPE * step));
        let (u, v) = lens.apply(x, y);
        let (back_x, back_y) = lens.invert(u, v).unwrap();
        prop_assert!((back_x - x).hypot(back_y - y) < 1e-8);
    }

    #[test]
    fn an_opengl_pose_becomes_the_same_camera(
        axis in prop::array::uniform3(-1.0..1.0f64), angle in -3.0..3.0f64, center in prop::array::uniform3(-5.0..5.0f64),
    ) {
        let axis = Vector3::from(axis);
        prop_assume!(axis.norm() > 0.1);
        let rotation = UnitQuaternion::from_scaled_axis(axis.normalize() * angle);
        let world_from_camera = Isometry3::from_parts(Vector3::from(center).into(), rotation);
        let camera_from_world = camera_from_world_of_opengl(&world_from_camera.to_homogeneous()).unwrap();
        // One unit right, two up and three ahead, in the axes of either convention.
        let in_opengl = Point3::new(1.0, 2.0, -3.0);
        let in_opencv = Point3::new(1.0, -2.0, 3.0);
        let found = camera_from_world * (world_from_camera * in_opengl);
        prop_assert!((found - in_opencv).norm() < 1e-9, "{found}");
    }
}

fn radial_part(polynomial: Polynomial) -> Polynomial {
    Polynomial { tangential: [0.0; 2], prism: [0.0; 4], ..polynomial }
}

/// By hand from the published formulas at (x, y) = (0.3, -0.4), r = 0.5.
#[test]
fn each_model_is_its_formula() {
    let (x, y, r): (f64, f64, f64) = (0.3, -0.4, 0.5);
    let check = |lens: Distortion, expected: (f64, f64)| {
        let found = lens.apply(x, y);
        assert!((found.0 - expected.0).hypot(found.1 - expected.1) < 1e-12, "{lens:?}: {found:?} {expected:?}");
    };
    // OpenCV: r2 = 0.25; radial = 1 + 0.1 * 0.25 + 0.2 * 0.0625 = 1.0375; 2 p1 x y = -0.0024; p2 (r2 + 2 x2) = 0.0086.
    check(
        Distortion::opencv(0.1, 0.2, 0.01, 0.02, 0.0),
        (0.3 * 1.0375 - 0.0024 + 0.0086, -0.4 * 1.0375 + 0.0057 - 0.0048),
    );
    let theta = r.atan();
    check(Distortion::fisheye([0.0; 4]), (x * theta / r, y * theta / r));
    let bent = theta * (1.0 + 0.1 * theta.powi(2) - 0.05 * theta.powi(8)) / r;
    check(Distortion::fisheye([0.1, 0.0, 0.0, -0.05]), (x * bent, y * bent));
    let rational =
        Polynomial { radial: [0.1, 0.0, 0.0, 0.0, 0.0, 0.0], divisor: [0.0, 0.2, 0.0], ..Default::default() };
    let factor = 1.025 / (1.0 + 0.2 * 0.0625);
    check(Distortion::Perspective(rational), (x * factor, y * factor));
    let prism = Polynomial { prism: [0.01, 0.02, 0.03, 0.04], ..Default::default() };
    check(Distortion::Perspective(prism), (x + 0.0025 + 0.02 * 0.0625, y + 0.0075 + 0.04 * 0.0625));
    let field_of_view = (2.0 * r * 0.45_f64.tan()).atan() / 0.9 / r;
    check(Distortion::FieldOfView { omega: 0.9 }, (x * field_of_view, y * field_of_view));
    // r' with r' / (1 + k r'^2) = r.
    let k = -0.2;
    let (dx, dy) = Distortion::Division { k }.apply(x, y);
    let in_picture = dx.hypot(dy);
    assert!((in_picture / (1.0 + k * in_picture * in_picture) - r).abs() < 1e-12);
    let unified = 1.0 / (0.4 * (1.1 * 0.25 + 1.0f64).sqrt() + 0.6);
    check(Distortion::EnhancedUnified { alpha: 0.4, beta: 1.1 }, (x * unified, y * unified));
}

#[test]
fn half_a_turn_is_read_as_such() {
    for [x, y, z] in [[1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]] {
        let turn = Matrix3::from_diagonal(&Vector3::new(x, y, z));
        assert!((rotation_of(&turn).unwrap().to_rotation_matrix().into_inner() - turn).norm() < 1e-15);
    }
}

#[test]
fn mirrored_and_scaled_poses_are_no_rotations() {
    let mirrored = Matrix4::from_diagonal(&nalgebra::Vector4::new(-1.0, 1.0, 1.0, 1.0));
    let scaled = Matrix4::from_diagonal(&nalgebra::Vector4::new(2.0, 2.0, 2.0, 1.0));
    assert!(camera_from_world_of_opengl(&mirrored).is_none());
    assert!(camera_from_world_of_opengl(&scaled).is_none());
    assert!(camera_from_world_of_opengl(&Matrix4::from_element(f64::NAN)).is_none());
}

#[test]
fn a_point_on_the_axis_meets_the_principal_point() {
    let intrinsics = Intrinsics {
        width: 640,
        height: 480,
        fx: 500.0,
        fy: 510.0,
        cx: 320.0,
        cy: 240.0,
        distortion: Distortion::default(),
    };
    let camera = Camera { intrinsics, camera_from_world: Isometry3::identity() };
    assert_eq!(camera.pixel(Point3::new(0.0, 0.0, 2.0)), Some(nalgebra::Point2::new(320.0, 240.0)));
    assert_eq!(camera.pixel(Point3::new(0.2, -0.4, 2.0)), Some(nalgebra::Point2::new(370.0, 138.0)));
    assert_eq!(camera.pixel(Point3::new(0.0, 0.0, -2.0)), None);
    let half = intrinsics.resized(320, 120);
    assert_eq!((half.fx, half.fy, half.cx, half.cy), (250.0, 127.5, 160.0, 60.0));
}

/// No part of the splat may lie in front of the ground-truth surface, and nearly all of it projects onto the object: a
/// wrong axis, a transposed rotation or a shifted principal point breaks both.
#[test]
fn gaussians_project_onto_the_ground_truth() {
    // The splat was trained on views whose depth is off by a few millimetres (fixture README).
    const DEPTH_TOLERANCE_M: f64 = 0.01;
    let truth = hammer().join("ground_truth");
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(hammer().join("point_cloud.ply"), folder.path().join("point_cloud.ply")).unwrap();
    std::fs::copy(truth.join("transforms_eval.json"), folder.path().join("transforms.json")).unwrap();
    std::fs::create_dir_all(folder.path().join("eval/images")).unwrap();
    for n in 0..6 {
        let image = format!("eval/images/{n:03}.png");
        std::fs::copy(truth.join(&image), folder.path().join(&image)).unwrap();
    }
    let scene = scene::load(folder.path(), &Options::default()).unwrap();
    let opaque: Vec<usize> = (0..scene.gaussians.len()).filter(|&i| scene.gaussians.opacity(i) > 0.5).collect();
    for view in &scene.views {
        let depth = image::open(truth.join(format!("eval/depth/{}.png", view.name))).unwrap().into_luma16();
        let (mut on_object, mut in_front) = (0, 0);
        for &i in &opaque {
            let point = view.camera.point_in_camera(scene.gaussians.center(i));
            let pixel = view.camera.pixel(point).unwrap();
            let Some(depth) = depth.get_pixel_checked(pixel.x as u32, pixel.y as u32) else { continue };
            // transforms_eval.json: depth_unit_m is 1e-4.
            let depth_m = f64::from(depth.0[0]) * 1e-4;
            on_object += usize::from(depth_m > 0.0);
            in_front += usize::from(depth_m > 0.0 && point.z < depth_m - DEPTH_TOLERANCE_M);
        }
        let (on_share, front_share) = (share(on_object, opaque.len()), share(in_front, on_object));
        println!("{}: {on_share:.4} on the object, {front_share:.4} of these before it", view.name);
        assert!(on_share > 0.99 && front_share < 0.01);
    }
}

fn share(part: usize, whole: usize) -> f64 {
    part as f64 / whole as f64
}
