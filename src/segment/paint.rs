//! Makes a label map from SAM's masks of one level: chooses those that are segments of the object and paints them from
//! large to small.
//!
//! The paper's code culls first, then leaves out the largest mask and paints the others over the foreground, whose
//! uncovered pixels are one more segment. gprop leaves out whatever is not a segment *before* culling: a mask of the whole
//! object would otherwise cause every segment below half its size to be culled (see [`super::cull`]).

use super::candidate::Candidate;
use super::cull::cull;
use super::mask::Mask;
use super::options::Options;
use super::regions::drop_small_islands;
use super::{LabelMap, Level, Segment};

/// A mask on the foreground with SAM's scores; they are zero if it is not one of SAM's masks.
struct Layer {
    mask: Mask,
    predicted_iou: f32,
    stability: f32,
}

/// Paints `candidates` onto the pixels of `foreground`. Masks and foreground must have the same size.
///
/// A segment that is the rest of the object, covered by no mask, has zero predicted IoU and stability. An object in
/// which nothing is found, or that is too small to have segments, is one such segment.
pub fn paint(candidates: &[Candidate], foreground: &Mask, options: &Options) -> (LabelMap, Vec<Segment>) {
    let min_area = u64::from(options.generator.min_region_area).max(1);
    let mut layers = segment_layers(candidates, foreground, options, min_area);
    layers.sort_by_key(|layer| std::cmp::Reverse(layer.mask.area()));
    layers.extend(rest_layer(&layers, foreground, min_area));
    if layers.is_empty() {
        layers.push(Layer { mask: foreground.clone(), predicted_iou: 0.0, stability: 0.0 });
    }
    loop {
        let map = label_map(&layers, foreground);
        let scores: Vec<(f32, f32)> = layers.iter().map(|layer| (layer.predicted_iou, layer.stability)).collect();
        let segments = segment_list(&map, &scores, options.flat_level());
        // A layer below others may be left with scraps; it is dropped, and its scraps go to the layer below it.
        let scrap =
            segments.iter().filter(|segment| u64::from(segment.area) < min_area).min_by_key(|segment| segment.area);
        match scrap {
            Some(scrap) if layers.len() > 1 => drop(layers.remove(usize::from(scrap.id) - 1)),
            _ => return (map, segments),
        }
    }
}

/// The candidates that are segments, clipped to the foreground.
fn segment_layers(candidates: &[Candidate], foreground: &Mask, options: &Options, min_area: u64) -> Vec<Layer> {
    let object_area = foreground.area() as f64;
    let on_object = |candidate: &Candidate| {
        let mask = candidate.mask.intersected(foreground);
        let area = mask.area();
        let is_segment = area >= min_area
            && candidate.is_on_foreground(area)
            && (area as f64) < options.selection.whole_object * object_area;
        is_segment.then_some(Layer { mask, predicted_iou: candidate.predicted_iou, stability: candidate.stability })
    };
    let mut layers: Vec<Option<Layer>> = candidates.iter().filter_map(on_object).map(Some).collect();
    let (masks, scores): (Vec<&Mask>, Vec<f64>) =
        layers.iter().flatten().map(|layer| (&layer.mask, f64::from(layer.predicted_iou * layer.stability))).unzip();
    let kept = cull(&masks, &scores, &options.selection);
    kept.into_iter().filter_map(|i| layers[i].take()).collect()
}

/// The foreground that no layer covers, without its small islands.
fn rest_layer(layers: &[Layer], foreground: &Mask, min_area: u64) -> Option<Layer> {
    let uncovered = layers.iter().fold(foreground.clone(), |rest, layer| rest.intersected(&layer.mask.complement()));
    let (mask, _) = drop_small_islands(uncovered, min_area);
    (mask.area() >= min_area).then_some(Layer { mask, predicted_iou: 0.0, stability: 0.0 })
}

/// Each pixel gets label i + 1, where layer i is the last that covers it.
fn label_map(layers: &[Layer], foreground: &Mask) -> LabelMap {
    let (width, height) = (foreground.width(), foreground.height());
    let mut map = LabelMap { width, height, labels: vec![0; width as usize * height as usize] };
    for (index, layer) in layers.iter().enumerate() {
        let label = u16::try_from(index + 1).expect("SAM is not prompted often enough for 65,535 segments");
        for y in 0..height {
            let row = &mut map.labels[y as usize * width as usize..][..width as usize];
            for &(start, end) in layer.mask.row(y) {
                row[start as usize..end as usize].fill(label);
            }
        }
    }
    map
}

/// The segments of the map, none of which lies in another. `scores` are the predicted IoU and stability of the segments from
/// 1 on; larger labels do not count.
pub(super) fn segment_list(map: &LabelMap, scores: &[(f32, f32)], level: Level) -> Vec<Segment> {
    let mut kept = vec![Kept::default(); scores.len() + 1];
    for (index, &label) in map.labels.iter().enumerate() {
        let (x, y) = (index as u32 % map.width, index as u32 / map.width);
        if let Some(kept) = kept.get_mut(usize::from(label)) {
            kept.add(x, y);
        }
    }
    let segment = |(index, (&(predicted_iou, stability_score), kept)): (usize, (&(f32, f32), &Kept))| Segment {
        id: index as u16 + 1,
        area: kept.area,
        bbox: [kept.x0, kept.y0, kept.x1 - kept.x0, kept.y1 - kept.y0],
        predicted_iou,
        stability_score,
        level,
        parent: 0,
    };
    scores.iter().zip(&kept[1..]).enumerate().map(segment).collect()
}

/// Area and bounds of the pixels seen so far; the bounds are meaningless before the first.
#[derive(Debug, Clone, Copy, Default)]
struct Kept {
    area: u32,
    x0: u32,
    y0: u32,
    x1: u32,
    y1: u32,
}

impl Kept {
    fn add(&mut self, x: u32, y: u32) {
        if self.area == 0 {
            *self = Self { area: 1, x0: x, y0: y, x1: x + 1, y1: y + 1 };
            return;
        }
        self.area += 1;
        self.x0 = self.x0.min(x);
        self.x1 = self.x1.max(x + 1);
        // Pixels come row by row.
        self.y1 = y + 1;
    }
}

#[cfg(test)]
mod tests {
    use super::super::mask::Rect;
    use super::*;

    fn candidate(mask: Mask, predicted_iou: f32) -> Candidate {
        let bounds = mask.bounds().unwrap();
        Candidate {
            bounds,
            predicted_iou,
            stability: 1.0,
            level: Level::Middle,
            crop: Rect::of_size(mask.width(), mask.height()),
            mask,
        }
    }

    /// Columns `start..end` of a picture 100 x 10; 300 pixels are 30 columns.
    fn columns(start: u32, end: u32) -> Mask {
        Mask::from_fn(100, 10, |x, _| (start..end).contains(&x))
    }

    fn columns_of(map: &LabelMap) -> Vec<u16> {
        map.labels[..100].to_vec()
    }

    fn runs(map: &LabelMap) -> Vec<(u16, usize)> {
        columns_of(map).chunk_by(|a, b| a == b).map(|run| (run[0], run.len())).collect()
    }

    #[test]
    fn small_segments_lie_over_large_ones_and_the_whole_is_none() {
        let masks = [columns(40, 80), columns(0, 100), columns(10, 60)];
        let candidates: Vec<_> = masks.into_iter().map(|mask| candidate(mask, 0.95)).collect();
        let (map, segments) = paint(&candidates, &columns(0, 100), &Options::default());
        // Ten columns at the left and twenty at the right are covered by no segment but the whole: one rest.
        assert_eq!(runs(&map), [(0, 10), (1, 30), (2, 40), (0, 20)]);
        assert_eq!(segments.iter().map(|segment| (segment.id, segment.area)).collect::<Vec<_>>(), [(1, 300), (2, 400)]);
        assert_eq!(segments[1].bbox, [40, 0, 40, 10]);
    }

    #[test]
    fn a_large_rest_is_a_segment_without_scores() {
        let (map, segments) = paint(&[candidate(columns(0, 40), 0.95)], &columns(0, 100), &Options::default());
        assert_eq!(runs(&map), [(1, 40), (2, 60)]);
        assert_eq!((segments[1].predicted_iou, segments[1].stability_score), (0.0, 0.0));
    }

    #[test]
    fn an_object_without_masks_or_too_small_for_segments_is_one_segment() {
        for foreground in [columns(0, 100), columns(3, 4)] {
            let (map, segments) = paint(&[], &foreground, &Options::default());
            assert_eq!(segments.iter().map(|segment| u64::from(segment.area)).collect::<Vec<_>>(), [foreground.area()]);
            assert!(segments[0].is_rest() && map.at(3, 9) == 1);
        }
    }

    #[test]
    fn nothing_is_painted_off_the_foreground() {
        // The second mask is of the background: 35 of its 80 columns are foreground.
        let candidates = [candidate(columns(10, 50), 0.95), candidate(columns(20, 100), 0.95)];
        let (map, segments) = paint(&candidates, &columns(15, 55), &Options::default());
        assert_eq!(runs(&map), [(0, 15), (1, 35), (0, 50)]);
        assert_eq!(segments.len(), 1);
    }

    #[test]
    fn scraps_of_a_covered_segment_go_to_what_lies_below() {
        // The second segment keeps only columns 45..60 after the third: too few.
        let masks = [columns(0, 60), columns(45, 95), columns(60, 95)];
        let candidates: Vec<_> = masks.into_iter().map(|mask| candidate(mask, 0.95)).collect();
        let (map, segments) = paint(&candidates, &columns(0, 95), &Options::default());
        assert_eq!(runs(&map), [(1, 60), (2, 35), (0, 5)]);
        assert_eq!(segments.len(), 2);
    }
}
