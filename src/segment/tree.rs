//! The masks of all three levels of one view as a tree: which segment lies in which.
//!
//! SAM's masks may overlap in any way. [`tree`] makes them nested: masks are painted from large to small, so that every
//! pixel belongs to the smallest segment that covers it, and to all segments in which that one lies.

use super::LabelMap;
use super::Segment;
use super::candidate::Candidate;
use super::mask::Mask;
use super::options::Options;

/// Two masks with a larger IoU are the same segment, found at two levels or from two prompts.
const SAME_SEGMENT_IOU: f64 = 0.85;
/// A mask with a larger share of the foreground is the whole object. One with less may still tell a small part from the
/// rest.
const WHOLE_OBJECT_SHARE: f64 = 0.95;
/// A mask lies in another that covers at least this share of it.
const INSIDE_SHARE: f64 = 0.8;
/// A segment of which fewer pixels are left after painting is dropped: its pixels go to the segment that it lies in.
const LEAST_AREA: u64 = 60;

/// A mask on the foreground that is a segment.
struct Layer<'a> {
    mask: Mask,
    area: u64,
    found: &'a Candidate,
}

/// Nests the masks of all levels: the smallest segment that covers each pixel, and the segments. Masks and `foreground`
/// must have the same size. Pixels off the foreground and pixels that no mask covers have no segment; neither does the
/// object as a whole.
pub fn tree(candidates: &[Vec<Candidate>], foreground: &Mask, options: &Options) -> (LabelMap, Vec<Segment>) {
    let layers = layers(candidates, foreground, options);
    let mut parents: Vec<usize> = Vec::with_capacity(layers.len());
    for (n, layer) in layers.iter().enumerate() {
        let holds = |outer: &Layer| layer.mask.overlap(&outer.mask) as f64 >= INSIDE_SHARE * layer.area as f64;
        // The last one is the smallest.
        parents.push(layers[..n].iter().rposition(holds).map_or(0, |outer| outer + 1));
    }
    let (width, height) = (foreground.width(), foreground.height());
    let mut owner = vec![0u32; width as usize * height as usize];
    for (n, layer) in (1..).zip(&layers) {
        for y in 0..height {
            let row = &mut owner[y as usize * width as usize..][..width as usize];
            layer.mask.row(y).iter().for_each(|&(start, end)| row[start as usize..end as usize].fill(n));
        }
    }
    let mut areas = vec![0u64; layers.len() + 1];
    owner.iter().for_each(|&n| areas[n as usize] += 1);
    for n in (1..=layers.len()).rev() {
        areas[parents[n - 1]] += areas[n];
    }
    numbered(&layers, &parents, &areas, &owner, (width, height))
}

/// The tree without the segments that have too few pixels left.
fn numbered(
    layers: &[Layer],
    parents: &[usize],
    areas: &[u64],
    owner: &[u32],
    (width, height): (u32, u32),
) -> (LabelMap, Vec<Segment>) {
    let mut id = vec![0u16; layers.len() + 1];
    let mut segments: Vec<Segment> = Vec::new();
    for (n, layer) in (1..).zip(layers) {
        let parent = id[parents[n - 1]];
        if areas[n] < LEAST_AREA {
            id[n] = parent;
            continue;
        }
        id[n] = u16::try_from(segments.len() + 1).expect("SAM is not prompted often enough for 65,535 segments");
        segments.push(Segment {
            id: id[n],
            area: areas[n] as u32,
            bbox: [0; 4],
            predicted_iou: layer.found.predicted_iou,
            stability_score: layer.found.stability,
            level: layer.found.level,
            parent,
        });
    }
    let labels: Vec<u16> = owner.iter().map(|&n| id[n as usize]).collect();
    let mut corners = vec![[u32::MAX, u32::MAX, 0, 0]; segments.len() + 1];
    for (index, &label) in labels.iter().enumerate().filter(|(_, label)| **label > 0) {
        let (x, y) = (index as u32 % width, index as u32 / width);
        let of = &mut corners[usize::from(label)];
        *of = [of[0].min(x), of[1].min(y), of[2].max(x + 1), of[3].max(y + 1)];
    }
    for n in (1..=segments.len()).rev() {
        let ([x0, y0, x1, y1], of) = (corners[n], usize::from(segments[n - 1].parent));
        let outer = corners[of];
        corners[of] = [outer[0].min(x0), outer[1].min(y0), outer[2].max(x1), outer[3].max(y1)];
        segments[n - 1].bbox = [x0, y0, x1 - x0, y1 - y0];
    }
    (LabelMap { width, height, labels }, segments)
}

/// The masks that are segments, clipped to the foreground, each once, from large to small.
fn layers<'a>(candidates: &'a [Vec<Candidate>], foreground: &Mask, options: &Options) -> Vec<Layer<'a>> {
    let object_area = foreground.area() as f64;
    let min_area = u64::from(options.generator.min_region_area).max(LEAST_AREA);
    let on_object = |found: &'a Candidate| {
        let mask = found.mask.intersected(foreground);
        let area = mask.area();
        let is_segment =
            area >= min_area && found.is_on_foreground(area) && (area as f64) < WHOLE_OBJECT_SHARE * object_area;
        is_segment.then_some(Layer { mask, area, found })
    };
    let mut all: Vec<Layer> = candidates.iter().flatten().filter_map(on_object).collect();
    let score = |layer: &Layer| layer.found.predicted_iou * layer.found.stability;
    all.sort_by(|a, b| score(b).total_cmp(&score(a)));
    let mut distinct: Vec<Layer> = Vec::new();
    for layer in all {
        if distinct.iter().all(|other| layer.mask.iou(&other.mask) <= SAME_SEGMENT_IOU) {
            distinct.push(layer);
        }
    }
    distinct.sort_by_key(|layer| std::cmp::Reverse(layer.area));
    distinct
}

#[cfg(test)]
mod tests {
    use super::super::Level;
    use super::super::mask::Rect;
    use super::*;

    /// Columns `start..end` of a picture 100 x 10.
    fn columns(start: u32, end: u32) -> Mask {
        Mask::from_fn(100, 10, |x, _| (start..end).contains(&x))
    }

    fn candidate((start, end): (u32, u32), level: Level) -> Candidate {
        let mask = columns(start, end);
        Candidate {
            bounds: mask.bounds().unwrap(),
            predicted_iou: 0.9,
            stability: 0.95,
            level,
            crop: Rect::of_size(100, 10),
            mask,
        }
    }

    fn nested(small: &[(u32, u32)], large: &[(u32, u32)]) -> (LabelMap, Vec<Segment>) {
        let candidates_of = |spans: &[(u32, u32)], level| spans.iter().map(|&span| candidate(span, level)).collect();
        let mut options = Options::default();
        options.generator.min_region_area = 0;
        tree(&[candidates_of(small, Level::Small), candidates_of(large, Level::Large)], &columns(0, 90), &options)
    }

    fn parents(segments: &[Segment]) -> Vec<u16> {
        segments.iter().map(|segment| segment.parent).collect()
    }

    #[test]
    fn a_segment_lies_in_the_smallest_one_around_it() {
        let (map, segments) = nested(&[(10, 30), (50, 60)], &[(0, 40), (5, 35)]);
        assert_eq!(parents(&segments), [0, 1, 2, 0]);
        let segment_at = |x: u32| map.at(x, 0);
        assert_eq!(
            [segment_at(2), segment_at(7), segment_at(20), segment_at(55), segment_at(45), segment_at(95)],
            [1, 2, 3, 4, 0, 0]
        );
        assert_eq!(segments[0].area, 400, "with what lies inside");
        assert_eq!((segments[1].bbox, segments[3].bbox), ([5, 0, 30, 10], [50, 0, 10, 10]));
        assert_eq!(segments[2].level, Level::Small);
    }

    #[test]
    fn one_segment_found_at_two_levels_is_one() {
        assert_eq!(parents(&nested(&[(10, 40)], &[(10, 41)]).1), [0]);
    }

    #[test]
    fn the_object_and_its_background_are_no_segments() {
        // The first covers nearly all of the foreground, columns 0 to 90; the second is mostly off it.
        assert!(nested(&[], &[(0, 88), (85, 100)]).1.is_empty());
    }

    #[test]
    fn a_segment_that_others_cover_goes_to_the_one_around_it() {
        // Columns 20 to 34 are all but covered by two halves, which do not lie in it.
        let (map, segments) = nested(&[(10, 28), (28, 44)], &[(5, 50), (20, 38)]);
        assert!(map.labels.iter().all(|&label| usize::from(label) <= segments.len()));
        assert!(segments.iter().all(|segment| segment.parent < segment.id));
    }
}
