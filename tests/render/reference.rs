//! An independent renderer in double precision: no tiles, no early stop, no vector code, and different methods for
//! everything that the rasteriser computes: the Jacobian by finite differences of the projection, spherical harmonics
//! from associated Legendre functions, the inverse of the covariance by nalgebra.

use gprop::camera::Camera;
use gprop::gaussians::Gaussians;
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Point3, Vector2, Vector3};

/// A picture of `width * height` pixels, row by row.
pub struct Picture {
    pub rgb: Vec<[f64; 3]>,
    pub alpha: Vec<f64>,
}

/// Draws every Gaussian in front of the near plane (0.01) over the whole picture, nearest first.
pub fn render(gaussians: &Gaussians, camera: &Camera) -> Picture {
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let mut picture = Picture { rgb: vec![[0.0; 3]; width * height], alpha: vec![0.0; width * height] };

    let depth = |i: &usize| camera.point_in_camera(gaussians.center(*i)).z;
    let mut order: Vec<usize> = (0..gaussians.len()).filter(|i| depth(i) > 0.01).collect();
    order.sort_by(|i, j| depth(i).total_cmp(&depth(j)));

    let borders = borders(camera); // (2, 2)
    for i in order {
        let center = camera.point_in_camera(gaussians.center(i)); // (3)
        let pixel = camera.pixel(center).expect("in front of the camera").coords; // (2)
        let jacobian = jacobian(camera, borders, center); // (2, 3)
        let rotation = camera.camera_from_world.rotation.to_rotation_matrix(); // (3, 3)
        let in_camera: Matrix3<f64> = rotation * gaussians.covariance(i) * rotation.transpose(); // (3, 3)
        let covariance = jacobian * in_camera * jacobian.transpose() + Matrix2::identity() * 0.3; // (2, 2)
        let precision = covariance.try_inverse().expect("positive definite"); // (2, 2)
        let color = color(gaussians, i, camera); // (3)
        let opacity = gaussians.opacity(i);

        // Further out alpha < exp(-0.5 * 16) < 1/255.
        let radius = 4.0 * covariance.symmetric_eigenvalues().max().sqrt();
        // At this squared distance alpha < 1/255; the exponential need not be computed.
        let faint = 2.0 * (255.0 * opacity).ln() + 1e-9;
        let rows = range(pixel.y, radius, height);
        for y in rows {
            for x in range(pixel.x, radius, width) {
                let offset = Vector2::new(x as f64 + 0.5, y as f64 + 0.5) - pixel; // (2)
                let distance2 = offset.dot(&(precision * offset));
                if distance2 > faint {
                    continue;
                }
                let alpha = (opacity * (-0.5 * distance2).exp()).min(0.99);
                if alpha < 1.0 / 255.0 {
                    continue;
                }
                let at = y * width + x;
                let weight = alpha * (1.0 - picture.alpha[at]);
                picture.alpha[at] += weight;
                for (sum, value) in picture.rgb[at].iter_mut().zip(color) {
                    *sum += weight * value;
                }
            }
        }
    }
    picture
}

/// The pixels of `0..length` within `radius` of `center`.
fn range(center: f64, radius: f64, length: usize) -> std::ops::Range<usize> {
    let cut = |v: f64| v.clamp(0.0, length as f64) as usize;
    cut(center - radius - 1.0)..cut(center + radius + 1.0)
}

/// d pixel / d point in camera (2, 3) by central differences, evaluated with the line of sight clamped to 1.3 times
/// the half field of view (3DGS).
fn jacobian(camera: &Camera, borders: [[f64; 2]; 2], center: Point3<f64>) -> Matrix2x3<f64> {
    // From the middle of the picture, its border is at 1, lines of sight outside at most at 1.3.
    let cut = |axis: usize| {
        let [low, high] = borders[axis];
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        ((center[axis] / center.z - middle).clamp(-1.3 * half, 1.3 * half) + middle) * center.z
    };
    let at = Vector3::new(cut(0), cut(1), center.z);
    let step = 1e-5 * center.z;
    let columns: [Vector2<f64>; 3] = std::array::from_fn(|axis| {
        let mut offset = Vector3::zeros();
        offset[axis] = step;
        let pixel = |p: Vector3<f64>| camera.pixel(Point3::from(p)).expect("in front").coords;
        (pixel(at + offset) - pixel(at - offset)) / (2.0 * step)
    });
    Matrix2x3::from_columns(&columns)
}

/// x/z at the left and right borders of the picture, y/z at the upper and lower ones: level with the principal point.
fn borders(camera: &Camera) -> [[f64; 2]; 2] {
    let i = &camera.intrinsics;
    let ends = |axis: usize, length: u32| {
        [0.0, f64::from(length)].map(|border| {
            let mut pixel = [i.cx, i.cy];
            pixel[axis] = border;
            line_of_sight(camera, pixel)[axis]
        })
    };
    [ends(0, i.width), ends(1, i.height)]
}

/// x/z and y/z of the line of sight that the camera shows at a pixel: by bisection along either axis in turn, since
/// tangential distortion moves both.
fn line_of_sight(camera: &Camera, pixel: [f64; 2]) -> [f64; 2] {
    let mut tangents = [0.0; 2];
    for axis in [0, 1].repeat(10) {
        let (mut low, mut high) = (-4.0, 4.0);
        for _ in 0..60 {
            tangents[axis] = 0.5 * (low + high);
            let found = camera.pixel(Point3::new(tangents[0], tangents[1], 1.0)).expect("in front")[axis];
            *(if found < pixel[axis] { &mut low } else { &mut high }) = tangents[axis];
        }
    }
    tangents
}

/// RGB (3) from the spherical harmonics, seen from the camera's centre.
fn color(gaussians: &Gaussians, i: usize, camera: &Camera) -> [f64; 3] {
    let direction = (gaussians.center(i) - camera.center_in_world()).normalize();
    let degree = usize::from(gaussians.sh_degree);
    let per_channel = (degree + 1) * (degree + 1) - 1;
    // Y_l^m is number l^2 + l + m.
    let harmonics: Vec<f64> =
        (0..=degree as i32).flat_map(|l| (-l..=l).map(move |m| harmonic(l, m, direction))).collect();
    std::array::from_fn(|channel| {
        let mut value = 0.5 + f64::from(gaussians.sh_dc[i][channel]) * harmonics[0];
        for at in 0..per_channel {
            let coefficient = gaussians.sh_rest[i * 3 * per_channel + channel * per_channel + at];
            value += f64::from(coefficient) * harmonics[at + 1];
        }
        value.max(0.0)
    })
}

/// Real spherical harmonic Y_l^m with the Condon-Shortley phase, polar axis z.
fn harmonic(l: i32, m: i32, direction: Vector3<f64>) -> f64 {
    let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
    let azimuth = direction.y.atan2(direction.x);
    let k = m.abs();
    let norm = (f64::from(2 * l + 1) / (4.0 * std::f64::consts::PI) * factorial(l - k) / factorial(l + k)).sqrt();
    let polar = norm * legendre(l, k, direction.z);
    match m {
        0 => polar,
        _ if m > 0 => 2.0f64.sqrt() * polar * (f64::from(k) * azimuth).cos(),
        _ => 2.0f64.sqrt() * polar * (f64::from(k) * azimuth).sin(),
    }
}

/// Associated Legendre function P_l^m(x) by the usual recurrences, with the factor (-1)^m.
fn legendre(l: i32, m: i32, x: f64) -> f64 {
    let mut diagonal = 1.0; // P_m^m
    for n in 1..=m {
        diagonal *= -f64::from(2 * n - 1) * (1.0 - x * x).sqrt();
    }
    let (mut before, mut value) = (0.0, diagonal);
    for n in m + 1..=l {
        let next = (f64::from(2 * n - 1) * x * value - f64::from(n + m - 1) * before) / f64::from(n - m);
        (before, value) = (value, next);
    }
    value
}
