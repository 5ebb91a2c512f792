//! Non-maximum suppression of boxes, as in `torchvision.ops.nms`.

use super::mask::Rect;

/// The indices of the boxes that are kept, best score first: each box in turn, unless it overlaps an already kept one
/// with an IoU above `max_iou`. Equal scores keep their order.
///
/// A box's sides are measured from its first to its last pixel, as in the public generator, so a box one pixel wide has
/// no area; two boxes without area do not suppress each other.
pub fn box_nms(boxes: &[Rect], scores: &[f32], max_iou: f32) -> Vec<usize> {
    let mut order: Vec<usize> = (0..boxes.len()).collect();
    order.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]));
    let mut kept: Vec<usize> = Vec::new();
    for candidate in order {
        // A comparison with NaN (no area) is false: not suppressed.
        if !kept.iter().any(|&better| box_iou(&boxes[better], &boxes[candidate]) > max_iou) {
            kept.push(candidate);
        }
    }
    kept
}

fn box_iou(a: &Rect, b: &Rect) -> f32 {
    let side = |start: u32, end: u32| end.saturating_sub(1).saturating_sub(start) as f32;
    let area = |r: &Rect| side(r.x0, r.x1) * side(r.y0, r.y1);
    let overlap = side(a.x0.max(b.x0), a.x1.min(b.x1)) * side(a.y0.max(b.y0), a.y1.min(b.y1));
    overlap / (area(a) + area(b) - overlap)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x0: u32, size: u32) -> Rect {
        Rect { x0, y0: 0, x1: x0 + size + 1, y1: size + 1 }
    }

    #[test]
    fn the_better_of_two_alike_survives() {
        let boxes = [square(0, 10), square(1, 10), square(20, 10)];
        // The first two share 9 x 10 of 110: IoU 0.818.
        assert_eq!(box_nms(&boxes, &[0.8, 0.9, 0.7], 0.7), [1, 2]);
        assert_eq!(box_nms(&boxes, &[0.8, 0.9, 0.7], 0.82), [1, 0, 2]);
    }

    #[test]
    fn a_suppressed_box_suppresses_nothing() {
        let boxes = [square(0, 10), square(2, 10), square(4, 10)];
        // Neighbours share 8 of 12 (0.667), the outer ones 6 of 14 (0.43).
        assert_eq!(box_nms(&boxes, &[0.9, 0.8, 0.7], 0.6), [0, 2]);
    }

    #[test]
    fn boxes_without_area_do_not_suppress_each_other() {
        assert_eq!(box_nms(&[square(3, 0), square(3, 0)], &[0.5, 0.5], 0.7), [0, 1]);
    }
}
