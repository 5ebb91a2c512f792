//! Where the views put the surface, beside the true depth of held-out views.

use gprop::parts::front::DepthView;

use super::truth;

#[test]
fn the_front_is_where_the_surface_is() {
    for measured in crate::vote::scenes::all() {
        let mut off = Vec::new();
        let mut alpha_in = (0.0, 0.0);
        for view in &measured.held_out {
            let drawn = DepthView::of(&measured.scene.gaussians, &view.camera);
            let c = &drawn.camera.intrinsics;
            let w = c.width as usize;
            for y in 1..c.height as usize - 1 {
                for x in 1..w - 1 {
                    let i = y * w + x;
                    let inside = view.depth[i] > 0.0;
                    alpha_in.0 += f64::from(u8::from(inside));
                    alpha_in.1 += f64::from(u8::from(drawn.alpha[i] > 0.5));
                    let near: Vec<f32> = [i - 1, i + 1, i - w, i + w].iter().map(|&j| view.depth[j]).collect();
                    if !inside || near.iter().any(|d| (d - view.depth[i]).abs() > 0.01) || !drawn.depth[i].is_finite() {
                        continue;
                    }
                    let gx = f64::from(near[1] - near[0]) * 0.5 * c.fx / f64::from(view.depth[i]);
                    let gy = f64::from(near[3] - near[2]) * 0.5 * c.fy / f64::from(view.depth[i]);
                    let cos = 1.0 / (1.0 + gx * gx + gy * gy).sqrt();
                    if cos > 0.5 {
                        off.push(f64::from(drawn.depth[i] - view.depth[i]) * cos * 1e3);
                    }
                }
            }
        }
        off.sort_by(f64::total_cmp);
        let q = |s: f64| off[(s * off.len() as f64) as usize];
        println!(
            "{:12} mm: 10% {:.2} 25% {:.2} 50% {:.2} 75% {:.2} 90% {:.2}; silhouette area {:.4}",
            measured.scene.name,
            q(0.1),
            q(0.25),
            q(0.5),
            q(0.75),
            q(0.9),
            alpha_in.1 / alpha_in.0
        );
        let mean_near: f64 = {
            let t: Vec<f64> = off.iter().copied().filter(|o| o.abs() < 5.0).collect();
            t.iter().sum::<f64>() / t.len() as f64
        };
        println!("   mean within 5 mm {mean_near:.2}");
    }
    let _ = truth::hammer();
}
