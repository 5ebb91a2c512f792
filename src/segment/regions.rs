//! Connected regions of a mask, and the removal of small holes and islands: the same as `remove_small_regions` of the
//! public SAM generator, which uses OpenCV's 8-connected components, but computed on runs.

use super::mask::{Mask, MaskBuilder};

/// The regions of a mask: the region of each run, and their areas.
struct Regions {
    /// Region of each run of the mask.
    region_of_run: Vec<usize>,
    /// Number of pixels in each region.
    areas: Vec<u64>,
}

/// `mask` without holes and islands of fewer than `min_area` pixels, holes filled first; and whether that changed the
/// mask. Holes are 8-connected regions of unset pixels, including those at the picture's edge. If every island is
/// small, the largest is kept.
pub fn remove_small_regions(mask: Mask, min_area: u64) -> (Mask, bool) {
    let (mask, filled) = fill_small_holes(mask, min_area);
    let (mask, dropped) = drop_small_islands(mask, min_area);
    (mask, filled || dropped)
}

fn fill_small_holes(mask: Mask, min_area: u64) -> (Mask, bool) {
    let gaps = mask.complement();
    let regions = Regions::of(&gaps);
    if regions.areas.iter().all(|&area| area >= min_area) {
        return (mask, false);
    }
    let kept_gaps = regions.filtered(&gaps, |area| area >= min_area);
    (kept_gaps.complement(), true)
}

/// `mask` without its islands of fewer than `min_area` pixels; if all are smaller, the largest is kept. Also returns
/// whether any was removed.
pub fn drop_small_islands(mask: Mask, min_area: u64) -> (Mask, bool) {
    let regions = Regions::of(&mask);
    if regions.areas.iter().all(|&area| area >= min_area) {
        return (mask, false);
    }
    if regions.areas.iter().any(|&area| area >= min_area) {
        return (regions.filtered(&mask, |area| area >= min_area), true);
    }
    let largest = regions.areas.iter().copied().max().unwrap_or(0);
    let first_largest = regions.areas.iter().position(|&area| area == largest);
    (regions.selected(&mask, |region| Some(region) == first_largest), true)
}

impl Regions {
    /// The 8-connected regions of `mask`, numbered in reading order of their first pixels.
    fn of(mask: &Mask) -> Self {
        let mut parent: Vec<usize> = (0..mask.runs().len()).collect();
        for y in 1..mask.height() {
            let (above, here) = (mask.row_range(y - 1), mask.row_range(y));
            let (mut a, mut b) = (above.start, here.start);
            while a < above.end && b < here.end {
                let (upper, lower) = (mask.runs()[a], mask.runs()[b]);
                // Half-open runs that touch at a corner share an end; 8-connectivity joins those as well.
                if upper.0 <= lower.1 && lower.0 <= upper.1 {
                    join(&mut parent, a, b);
                }
                if upper.1 < lower.1 {
                    a += 1;
                } else {
                    b += 1;
                }
            }
        }
        let mut number_of_root = vec![usize::MAX; parent.len()];
        let mut regions = Self { region_of_run: Vec::with_capacity(parent.len()), areas: Vec::new() };
        for (run, &(start, end)) in mask.runs().iter().enumerate() {
            let root = root_of(&mut parent, run);
            if number_of_root[root] == usize::MAX {
                number_of_root[root] = regions.areas.len();
                regions.areas.push(0);
            }
            let region = number_of_root[root];
            regions.region_of_run.push(region);
            regions.areas[region] += u64::from(end - start);
        }
        regions
    }

    fn filtered(&self, mask: &Mask, keep_area: impl Fn(u64) -> bool) -> Mask {
        self.selected(mask, |region| keep_area(self.areas[region]))
    }

    fn selected(&self, mask: &Mask, keep_region: impl Fn(usize) -> bool) -> Mask {
        let mut builder = MaskBuilder::new(mask.width());
        for y in 0..mask.height() {
            for run in mask.row_range(y).filter(|&run| keep_region(self.region_of_run[run])) {
                let (start, end) = mask.runs()[run];
                builder.push(start, end);
            }
            builder.end_row();
        }
        builder.finish()
    }
}

fn root_of(parent: &mut [usize], mut node: usize) -> usize {
    while parent[node] != node {
        parent[node] = parent[parent[node]];
        node = parent[node];
    }
    node
}

/// Merges two sets under the root that comes first in reading order.
fn join(parent: &mut [usize], a: usize, b: usize) {
    let (a, b) = (root_of(parent, a), root_of(parent, b));
    parent[a.max(b)] = a.min(b);
}

#[cfg(test)]
mod tests {
    use super::super::mask::tests::drawn;
    use super::*;

    #[test]
    fn small_holes_are_filled_and_small_islands_dropped() {
        let mask = drawn(&["####...", "#.##..#", "####...", "......."]);
        let (cleaned, changed) = remove_small_regions(mask, 3);
        assert!(changed);
        assert_eq!(cleaned, drawn(&["####...", "####...", "####...", "......."]));
    }

    #[test]
    fn corners_connect() {
        let diagonal = drawn(&["#...", ".#..", "..#.", "...#"]);
        let (same, changed) = drop_small_islands(diagonal.clone(), 4);
        assert!(!changed);
        assert_eq!(same, diagonal);
        let other_diagonal = drawn(&["...#", "..#.", ".#..", "#..."]);
        assert!(!drop_small_islands(other_diagonal, 4).1);
    }

    #[test]
    fn the_largest_island_stays_where_all_are_small() {
        let mask = drawn(&["#..##", ".....", "##.##"]);
        let (cleaned, _) = remove_small_regions(mask, 4);
        // The gaps are one region of eight pixels; of the two-pixel islands the first in reading order stays.
        assert_eq!(cleaned, drawn(&["...##", ".....", "....."]));
    }

    #[test]
    fn a_gap_at_the_edge_is_a_hole_as_well() {
        let (cleaned, changed) = remove_small_regions(drawn(&[".###", "####"]), 2);
        assert!(changed);
        assert_eq!(cleaned.area(), 8);
    }

    #[test]
    fn nothing_and_everything_stay() {
        for mask in [drawn(&["...", "..."]), drawn(&["###", "###"])] {
            let (same, changed) = remove_small_regions(mask.clone(), 3);
            assert!(!changed);
            assert_eq!(same, mask);
        }
    }

    #[test]
    fn branches_that_meet_below_are_one_region() {
        let mask = drawn(&["#.#.#", "#.#.#", "#####"]);
        assert!(!drop_small_islands(mask, 11).1, "all eleven pixels are one region");
    }
}
