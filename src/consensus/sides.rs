//! The few views that together show the object from all sides, and as many of its parts as possible.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use crate::camera::Camera;
use crate::segment::LabelMap;

/// Two views this far apart show different sides of the object.
const OTHER_SIDE_DEG: f64 = 90.0;

/// Up to `most` of the views, by index, that show every part as large as any view does, from directions far apart; `first`
/// is among them. A view that shows a part half as large as the view that shows it largest counts half of it, and another side
/// of the object counts as much as another part. `maps` are the parts in each view.
pub fn sides(cameras: &[&Camera], center: Point3<f64>, maps: &[&LabelMap], first: usize, most: usize) -> Vec<usize> {
    let shown = shares(maps);
    let direction = |view: usize| -> Vector3<f64> { (cameras[view].center_in_world() - center).normalize() };
    let mut chosen = vec![first];
    while chosen.len() < most {
        let seen = |part: &u16| chosen.iter().filter_map(|view| shown[*view].get(part)).copied().fold(0.0, f64::max);
        let gain = |view: usize| -> f64 {
            let of_parts: f64 = shown[view].iter().map(|(part, share)| (share - seen(part)).max(0.0)).sum();
            let angle = |other: &usize| direction(view).angle(&direction(*other)).to_degrees();
            let nearest = chosen.iter().map(angle).fold(f64::INFINITY, f64::min);
            of_parts + (nearest / OTHER_SIDE_DEG).min(1.0)
        };
        let left = (0..cameras.len()).filter(|view| !chosen.contains(view));
        let gains = left.map(|view| (view, gain(view)));
        // Among equals the first.
        let best = gains.reduce(|best, next| if next.1 > best.1 { next } else { best });
        let Some((best, _)) = best else { break };
        chosen.push(best);
    }
    chosen
}

/// For every view, the parts that it shows, each with its number of pixels as a share of that in the view that shows most of
/// it.
fn shares(maps: &[&LabelMap]) -> Vec<BTreeMap<u16, f64>> {
    let count = |map: &&LabelMap| {
        let mut pixels: BTreeMap<u16, f64> = BTreeMap::new();
        map.labels.iter().filter(|label| **label != 0).for_each(|label| *pixels.entry(*label).or_default() += 1.0);
        pixels
    };
    let mut shown: Vec<BTreeMap<u16, f64>> = maps.iter().map(count).collect();
    let mut largest: BTreeMap<u16, f64> = BTreeMap::new();
    for (part, pixels) in shown.iter().flatten() {
        let most = largest.entry(*part).or_default();
        *most = most.max(*pixels);
    }
    shown.iter_mut().flatten().for_each(|(part, pixels)| *pixels /= largest[part]);
    shown
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::camera::{Distortion, Intrinsics};

    #[test]
    fn sides_show_all_parts_and_then_other_directions() {
        let intrinsics =
            Intrinsics { width: 4, height: 1, fx: 10.0, fy: 10.0, cx: 2.0, cy: 0.5, distortion: Distortion::default() };
        let camera = |turn_deg: f64| {
            let at = Point3::new(turn_deg.to_radians().cos(), turn_deg.to_radians().sin(), 0.0) * 5.0;
            let camera_from_world = Isometry3::look_at_lh(&at, &Point3::origin(), &Vector3::z());
            Camera { intrinsics, camera_from_world }
        };
        let cameras = [camera(0.0), camera(10.0), camera(180.0), camera(20.0)];
        let map = |labels: [u16; 4]| LabelMap { width: 4, height: 1, labels: labels.to_vec() };
        let maps = [map([1, 1, 0, 0]), map([1, 1, 0, 0]), map([1, 0, 0, 0]), map([2, 2, 3, 0])];
        let chosen = |most| sides(&cameras.each_ref(), Point3::origin(), &maps.each_ref(), 0, most);
        assert_eq!(chosen(2), [0, 3], "the view with two new parts");
        assert_eq!(chosen(3), [0, 3, 2], "the other side");
        assert_eq!(chosen(9).len(), 4, "there are no more");
    }
}
