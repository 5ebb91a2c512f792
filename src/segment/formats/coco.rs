//! A COCO data set of the segments, with their masks as compressed run lengths, as read by `pycocotools.mask.decode`.

use serde_json::{Value, json};

use super::super::{Segment, ViewSegments};

/// The segments of the views: `images`, `annotations` and the one category `segment`. The mask, area and box of a
/// segment include the segments in it; `segment` and `parent` are ids of the view's label map. `photos` are the file
/// names of the views' photos.
pub fn coco(views: &[ViewSegments], photos: &[String]) -> Value {
    let (mut images, mut annotations) = (Vec::new(), Vec::new());
    for (index, (view, photo)) in views.iter().zip(photos).enumerate() {
        let map = &view.map;
        images.push(json!({ "id": index + 1, "file_name": photo, "width": map.width, "height": map.height }));
        for (segment, runs) in view.segments.iter().zip(column_runs(view)) {
            annotations.push(json!({
                "id": annotations.len() + 1,
                "image_id": index + 1,
                "category_id": 1,
                "iscrowd": 0,
                "area": segment.area,
                "bbox": segment.bbox,
                "segmentation": { "size": [map.height, map.width], "counts": compressed(&runs) },
                "segment": segment.id,
                "parent": (segment.parent > 0).then_some(segment.parent),
                "predicted_iou": segment.predicted_iou,
                "stability_score": segment.stability_score,
            }));
        }
    }
    json!({ "images": images, "annotations": annotations, "categories": [{ "id": 1, "name": "segment" }] })
}

/// For each segment, the lengths of the alternating runs outside and inside it, column by column, beginning with
/// outside. The segments in it are inside.
fn column_runs(view: &ViewSegments) -> Vec<Vec<u32>> {
    let (map, segments) = (&view.map, &view.segments);
    // By id: the position in column order where the segment's last run ended, and its runs so far.
    let largest = segments.iter().map(|segment| segment.id).max().unwrap_or(0);
    let mut runs: Vec<(u32, Vec<u32>)> = vec![(0, Vec::new()); usize::from(largest) + 1];
    let mut position = 0;
    for x in 0..map.width {
        for y in 0..map.height {
            let mut id = map.at(x, y);
            while let Some((end, runs)) = runs.get_mut(usize::from(id)).filter(|_| id > 0) {
                match runs.last_mut() {
                    Some(run) if *end == position => *run += 1,
                    _ => runs.extend([position - *end, 1]),
                }
                *end = position + 1;
                id = view.parent(id);
            }
            position += 1;
        }
    }
    let finished = |segment: &Segment| {
        let (end, mut runs) = std::mem::take(&mut runs[usize::from(segment.id)]);
        runs.extend((end < position).then_some(position - end));
        runs
    };
    segments.iter().map(finished).collect()
}

/// COCO's `rleToString`: from the fourth number on, the difference from the number two before it. Each is written in
/// groups of five bits, the lowest first, with a sixth bit set if more follow, as characters starting at `0`.
fn compressed(runs: &[u32]) -> String {
    let mut text = String::new();
    for (index, &run) in runs.iter().enumerate() {
        let mut rest = i64::from(run) - if index > 2 { i64::from(runs[index - 2]) } else { 0 };
        loop {
            let group = (rest & 0x1f) as u8;
            rest >>= 5;
            let is_last = if group & 0x10 == 0 { rest == 0 } else { rest == -1 };
            text.push(char::from(group + if is_last { 48 } else { 48 + 0x20 }));
            if is_last {
                break;
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::super::{LabelMap, Level};
    use super::*;

    /// Expected texts from pycocotools 2.0: `mask.frPyObjects({"size": [h, w], "counts": runs}, h, w)["counts"]`.
    #[test]
    fn texts_are_pycocotools() {
        for (runs, text) in PYCOCOTOOLS {
            assert_eq!(compressed(runs), text, "{runs:?}");
        }
    }

    const PYCOCOTOOLS: [(&[u32], &str); 3] = [
        (&[1, 3, 2], "132"),
        (&[0, 500, 12, 3, 1000, 7, 478], "0d?<_@ln04f_O"),
        (&[7, 1, 40, 1, 38, 2, 100_000, 5, 3], "71X10N1jcQ33S[nL"),
    ];

    fn segment(id: u16, parent: u16, area: u32, bbox: [u32; 4]) -> Segment {
        Segment { id, area, bbox, predicted_iou: 0.9, stability_score: 0.9, level: Level::Small, parent }
    }

    #[test]
    fn runs_go_column_by_column() {
        let map = LabelMap { width: 3, height: 2, labels: vec![0, 1, 2, 1, 1, 2] };
        let segments = vec![segment(1, 0, 3, [0, 0, 2, 2]), segment(2, 0, 2, [2, 0, 1, 2])];
        // Columns: (0, 1), (1, 1), (2, 2).
        let view = ViewSegments { view: "view".into(), map, segments };
        assert_eq!(column_runs(&view), [vec![1, 3, 2], vec![4, 2]]);
    }

    #[test]
    fn a_mask_includes_the_segments_in_it_as_its_area_does() {
        // Segment 3 lies in 2, which lies in 1; segment 4 lies in none.
        let map = LabelMap { width: 4, height: 2, labels: vec![1, 2, 3, 4, 1, 1, 2, 0] };
        let segments = vec![
            segment(1, 0, 6, [0, 0, 3, 2]),
            segment(2, 1, 3, [1, 0, 2, 2]),
            segment(3, 2, 1, [2, 0, 1, 1]),
            segment(4, 0, 1, [3, 0, 1, 1]),
        ];
        let view = ViewSegments { view: "view".into(), map, segments };
        let runs = column_runs(&view);
        assert_eq!(runs[0], [0, 6, 2]);
        for (segment, runs) in view.segments.iter().zip(&runs) {
            let inside: u32 = runs.iter().skip(1).step_by(2).sum();
            assert_eq!(inside, segment.area, "segment {}", segment.id);
        }
        let written = coco(&[view], &["images/view.jpg".to_owned()]);
        assert_eq!(written["images"][0]["file_name"], "images/view.jpg");
        let annotations = written["annotations"].as_array().unwrap();
        let parents: Vec<&Value> = annotations.iter().map(|annotation| &annotation["parent"]).collect();
        assert_eq!(parents, [&Value::Null, &json!(1), &json!(2), &Value::Null]);
    }
}
