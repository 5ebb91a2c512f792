//! The numbers of Gaussians and pixels, to which new ones are added.

use std::collections::BTreeMap;

use super::Look;
use super::sighting::Sighting;
use crate::render::{RenderOptions, render_labels};
use crate::segment::LabelMap;
use crate::segment::mask::Mask;

/// A region of which masks hold at least this share lies in them whole, but for its border.
const WHOLE: f64 = 0.5;
/// Masks show something new if at least this share of them cuts through regions: borders of segments differ by less.
const NEW_SHARE: f64 = 0.25;
/// A region that gave less than this share of the new part has lost a border to it.
const GAVE_SHARE: f64 = 0.1;
/// What is less than this share of the object's pixels is a crumb, as in [`crate::consensus`].
const LEAST_SHARE: f64 = 0.003;

/// Which part or piece every Gaussian and every pixel of the views belongs to.
#[derive(Debug, Clone, PartialEq)]
pub struct Numbering {
    /// By Gaussian of the object.
    pub id_of_gaussian: Vec<u16>,
    /// By view; 0 where it shows nothing of the object.
    pub maps: Vec<LabelMap>,
    /// The next number to give.
    pub next: u16,
    /// By view, the regions before anything was added.
    first: Vec<LabelMap>,
    /// By view and pixel, whether it is a hole: it shows nothing of the object, but all around it is object. What shines is often
    /// missing from a splat, which has its reflection far below instead.
    holes: Vec<Vec<bool>>,
}

/// A thing that got a number.
#[derive(Debug, Clone, PartialEq)]
pub struct Sighted {
    pub id: u16,
    /// The regions from which it was cut, those that were there first, the one that lost most first.
    pub cut_from: Vec<u16>,
    /// The indices of the views whose masks agree.
    pub views: Vec<usize>,
}

impl Numbering {
    /// The numbers of Gaussians and of the pixels of each view, with the next number to give.
    pub fn new(id_of_gaussian: Vec<u16>, maps: Vec<LabelMap>, next: u16) -> Self {
        let holes = maps.iter().map(holes).collect();
        Self { id_of_gaussian, first: maps.clone(), maps, next, holes }
    }

    /// Whether a mask of a view lies on the object and cuts through regions, rather than holding each of them whole or not at all.
    pub(super) fn is_new(&self, view: usize, mask: &Mask) -> bool {
        let regions = self.regions([(view, mask)]);
        2 * regions.inside() >= mask.area() && regions.are_cut()
    }

    fn regions<'a>(&self, masks: impl IntoIterator<Item = (usize, &'a Mask)>) -> Regions {
        let mut found: BTreeMap<u16, [u64; 2]> = BTreeMap::new();
        for (view, mask) in masks {
            let map = &self.maps[view];
            let on_object = |(pixel, id): &(u32, &u16)| **id > 0 || self.holes[view][*pixel as usize];
            for (pixel, id) in (0u32..).zip(&map.labels).filter(on_object) {
                let [all, inside] = found.entry(*id).or_default();
                *all += 1;
                *inside += u64::from(mask.contains(pixel % map.width, pixel / map.width));
            }
        }
        Regions(found)
    }

    /// Gives the next number to what a sighting shows and has none of its own; `None` if that is a crumb.
    pub(super) fn add(&mut self, looks: &[Look], sighting: &Sighting) -> Option<Sighted> {
        let masks = sighting.masks.iter().enumerate().filter_map(|(view, mask)| Some((view, (*mask)?)));
        let regions = self.regions(masks);
        let cut = regions.0.iter().filter(|(id, _)| !regions.holds(**id));
        let taken: u64 = cut.map(|(_, [_, inside])| inside).sum();
        if !regions.are_cut() || (taken as f64) < LEAST_SHARE * regions.all() as f64 {
            return None;
        }
        let id = self.next;
        self.next = self.next.checked_add(1)?;
        for of in sighting.light.iter().filter(|of| 2.0 * of.inside > of.all) {
            let number = &mut self.id_of_gaussian[of.gaussian as usize];
            *number = if regions.holds(*number) { *number } else { id };
        }
        for (view, look) in looks.iter().enumerate() {
            self.draw(view, look, id, sighting.masks[view], &regions);
        }
        let views: Vec<usize> = (0..looks.len()).filter(|view| sighting.masks[*view].is_some()).collect();
        Some(Sighted { id, cut_from: self.cut_from(id, &views), views })
    }

    /// The first regions from which a new one was cut in these views, the one that lost most first, without those that lost a border.
    fn cut_from(&self, id: u16, views: &[usize]) -> Vec<u16> {
        let pixels = views.iter().flat_map(|view| self.maps[*view].labels.iter().zip(&self.first[*view].labels));
        let mut lost: BTreeMap<u16, u64> = BTreeMap::new();
        pixels.filter(|(now, _)| **now == id).for_each(|(_, first)| *lost.entry(*first).or_default() += 1);
        let all: u64 = lost.values().sum();
        let gave = |(region, pixels): &(u16, u64)| *region > 0 && *pixels as f64 >= GAVE_SHARE * all as f64;
        let mut cut_from: Vec<(u16, u64)> = lost.into_iter().filter(gave).collect();
        cut_from.sort_by_key(|(_, pixels)| std::cmp::Reverse(*pixels));
        cut_from.into_iter().map(|(region, _)| region).collect()
    }

    /// Marks the pixels of a view that show the new part: those of its mask, or, without one, those that its Gaussians draw.
    fn draw(&mut self, view: usize, look: &Look, id: u16, mask: Option<&Mask>, regions: &Regions) {
        let width = self.maps[view].width;
        let shows: Box<dyn Fn(u32) -> bool> = match mask {
            Some(mask) => Box::new(move |pixel| mask.contains(pixel % width, pixel / width)),
            None => {
                let mut labels: Vec<u32> = self.id_of_gaussian.iter().map(|of| u32::from(*of == id)).collect();
                // None of the surroundings.
                labels.resize(look.cloud.len(), 0);
                let drawn = render_labels(look.cloud, look.camera, &labels, &RenderOptions::default());
                Box::new(move |pixel| drawn[pixel as usize] == Some(1))
            }
        };
        let holes = &mut self.holes[view];
        for (pixel, (label, is_hole)) in (0..).zip(self.maps[view].labels.iter_mut().zip(holes)) {
            if (*label > 0 || *is_hole) && !regions.holds(*label) && shows(pixel) {
                (*label, *is_hole) = (id, false);
            }
        }
    }
}

/// By pixel, whether it has no number, but every way from it to the edge of the picture crosses one that has.
fn holes(map: &LabelMap) -> Vec<bool> {
    let (width, height) = (map.width as usize, map.height as usize);
    let mut is_hole: Vec<bool> = map.labels.iter().map(|id| *id == 0).collect();
    let is_edge = |pixel: &usize| {
        let (x, y) = (pixel % width, pixel / width);
        x == 0 || y == 0 || x + 1 == width || y + 1 == height
    };
    let mut open: Vec<usize> = (0..is_hole.len()).filter(is_edge).filter(|pixel| is_hole[*pixel]).collect();
    open.iter().for_each(|pixel| is_hole[*pixel] = false);
    while let Some(pixel) = open.pop() {
        for other in map.beside(pixel) {
            if std::mem::take(&mut is_hole[other]) {
                open.push(other);
            }
        }
    }
    is_hole
}

/// By region, the number of its pixels in some views, and of those that lie in masks; 0 stands for holes.
struct Regions(BTreeMap<u16, [u64; 2]>);

impl Regions {
    /// Whether a region lies in the masks whole.
    fn holds(&self, id: u16) -> bool {
        id > 0 && self.0.get(&id).is_some_and(|[all, inside]| *inside as f64 >= WHOLE * *all as f64)
    }

    fn all(&self) -> u64 {
        self.0.values().map(|[all, _]| all).sum()
    }

    fn inside(&self) -> u64 {
        self.0.values().map(|[_, inside]| inside).sum()
    }

    /// Whether enough of the masks is cut off from regions: of each region, the smaller of what lies in them and what does not; of
    /// holes, all of it.
    fn are_cut(&self) -> bool {
        let cut_off =
            |(id, [all, inside]): (&u16, &[u64; 2])| if *id > 0 { (*inside).min(all - inside) } else { *inside };
        let cut: u64 = self.0.iter().map(cut_off).sum();
        self.inside() > 0 && cut as f64 >= NEW_SHARE * self.inside() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Region 1 is the left half of a picture of 40 x 10, region 2 the right one, but for its last 10 columns.
    fn numbering() -> Numbering {
        let region = |x: u16| if x < 20 { 1 } else { 2 * u16::from(x < 30) };
        let labels = (0..400).map(|pixel| region(pixel % 40)).collect();
        Numbering::new(Vec::new(), vec![LabelMap { width: 40, height: 10, labels }], 3)
    }

    fn columns(first: u32, end: u32) -> Mask {
        Mask::from_fn(40, 10, |x, _| (first..end).contains(&x))
    }

    #[test]
    fn a_mask_is_new_if_it_cuts_through_a_region() {
        let numbering = numbering();
        let is_new = |first, end| numbering.is_new(0, &columns(first, end));
        assert!(is_new(5, 10) && is_new(5, 25), "within one region, and across a border");
        assert!(!is_new(0, 20) && !is_new(1, 21), "a region, with borders that differ a little");
        assert!(!is_new(0, 30), "both regions");
        assert!(!is_new(25, 40), "mostly beside the object");
    }

    #[test]
    fn what_is_new_is_cut_from_the_regions_that_were_there_first() {
        let mut numbering = numbering();
        let mut mark = |columns: std::ops::Range<usize>, id: u16| {
            let labels = &mut numbering.maps[0].labels;
            (0..400).filter(|pixel| columns.contains(&(pixel % 40))).for_each(|pixel| labels[pixel] = id);
            numbering.cut_from(id, &[0])
        };
        assert_eq!(mark(5..25, 3), [1, 2]);
        assert_eq!(mark(22..29, 4), [2], "some of it was cut before");
        assert_eq!(mark(1..21, 5), [1], "of the other, it has a border");
    }

    #[test]
    fn a_hole_is_what_the_object_surrounds() {
        // A ring around two pixels, open to the right in its lower half.
        let labels = vec![1, 1, 1, 1, 1, 0, 0, 1, 1, 1, 1, 1, 1, 0, 0, 0, 1, 1, 1, 1];
        let map = LabelMap { width: 4, height: 5, labels };
        let found: Vec<usize> = holes(&map).iter().enumerate().filter(|(_, hole)| **hole).map(|(n, _)| n).collect();
        assert_eq!(found, [5, 6]);
    }
}
