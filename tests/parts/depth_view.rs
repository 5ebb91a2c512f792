//! The depth at which the views see the surface, compared with the true depth of held-out views.

use gprop::parts::DepthView;

use crate::vote::scenes::{HeldOut, all};

/// Neighbouring depths of one surface differ by less than this, in metres; pixels at an edge are not compared.
const EDGE_M: f32 = 0.01;
/// Surfaces seen at more than 60 degrees from their normal are not compared.
const FACING: f64 = 0.5;

/// The distance in millimetres, along its normal, by which the surface lies too deep, at every pixel that is compared.
fn errors_mm(drawn: &DepthView, view: &HeldOut) -> Vec<f64> {
    let c = &drawn.camera.intrinsics;
    let (w, h) = (c.width as usize, c.height as usize);
    let error = |i: usize| {
        let depth = view.depth[i];
        let beside = [i - 1, i + 1, i - w, i + w].map(|j| view.depth[j]);
        let is_edge = depth <= 0.0 || beside.iter().any(|d| (d - depth).abs() > EDGE_M);
        let slope = |a: f32, b: f32, focal: f64| f64::from(b - a) * 0.5 * focal / f64::from(depth);
        let (x, y) = (slope(beside[0], beside[1], c.fx), slope(beside[2], beside[3], c.fy));
        let cosine = 1.0 / (1.0 + x * x + y * y).sqrt();
        let comparable = !is_edge && drawn.depth[i].is_finite() && cosine > FACING;
        comparable.then(|| f64::from(drawn.depth[i] - depth) * cosine * 1e3)
    };
    (1..h - 1).flat_map(|y| (1..w - 1).map(move |x| y * w + x)).filter_map(error).collect()
}

#[test]
fn the_front_is_where_the_surface_is() {
    for measured in all() {
        let mut errors = Vec::new();
        for view in &measured.held_out {
            // The photos have 512 px: drawn at full size.
            errors.extend(errors_mm(&DepthView::of(&measured.scene.gaussians, &view.camera, 512), view));
        }
        errors.sort_by(f64::total_cmp);
        let quantile = |share: f64| errors[(share * errors.len() as f64) as usize];
        let [low, median, high] = [0.25, 0.5, 0.75].map(quantile);
        println!("{:12} {} pixels: {low:.2} {median:.2} {high:.2} mm", measured.scene.name, errors.len());
        // As the module's documentation says: measured 0.6 and 2.5.
        assert!(median.abs() < 0.8, "{}: median {median} mm", measured.scene.name);
        assert!(low > -3.0 && high < 3.0, "{}: quartiles {low} and {high} mm", measured.scene.name);
    }
}
