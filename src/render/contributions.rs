//! The contribution of each Gaussian to the pixels of each label: alpha times transmittance, summed.

use super::blend::{LANES, Sink, TRANSMITTANCE_MIN, TileRect};
use super::project::Splat;
use super::tiles::TILE;
use super::{Projected, pixels};
use crate::parallel;

/// A view sees a Gaussian if what is in front lets at least this share of its light through, over the pixels that at
/// least [`TRANSMITTANCE_MIN`] of the light still reaches; at the others, blending has ended. A closed surface of
/// trained Gaussians lets a few hundredths through; all the light of an unobstructed Gaussian arrives.
const VISIBLE_SHARE: f32 = 0.1;

/// The contributions of the Gaussians that the view sees to the pixels of each label, sorted by Gaussian, then by
/// label. `gaussians` is the number of Gaussians in the cloud; `labels` has a label for every pixel, row by row; `kept`
/// maps it to the label under which it is counted, or to `None` if it is not counted.
pub fn contributions<L: Copy + Ord + Send>(
    gaussians: usize,
    projected: Projected,
    labels: &[u16],
    kept: impl Fn(u16) -> Option<L> + Sync,
) -> Vec<(u32, L, f32)> {
    // By Gaussian: light that arrives, and light that is emitted, both over the pixels that were not finished.
    let mut light = vec![[0.0f32; 2]; gaussians];
    // Capacity for four tiles or labels per Gaussian: a growing list would leave the memory fragmented.
    let mut found: Vec<(u32, L, f32)> = Vec::with_capacity(4 * gaussians);
    of_tiles(&projected, labels, &mut |contributions| {
        for &Contribution { gaussian, label, arrived, sent } in contributions {
            let of_gaussian = &mut light[gaussian as usize];
            of_gaussian[0] += arrived;
            of_gaussian[1] += sent;
            found.extend(kept(label).map(|label| (gaussian, label, arrived)));
        }
    });
    drop(projected);
    found.retain(|&(gaussian, ..)| {
        let [arrived, sent] = light[gaussian as usize];
        arrived >= VISIBLE_SHARE * sent
    });
    // A stable sort: contributions that a tile border has split are added up in the order of the tiles.
    parallel::sort_by(&mut found, |a, b| (a.0, a.1).cmp(&(b.0, b.1)));
    found.dedup_by(|next, kept| {
        let same = (next.0, next.1) == (kept.0, kept.1);
        kept.2 += if same { next.2 } else { 0.0 };
        same
    });
    found.shrink_to_fit();
    found
}

/// Passes the contributions of each tile to `take`. Not generic, so that blending is compiled here.
fn of_tiles(projected: &Projected, labels: &[u16], take: &mut dyn FnMut(&[Contribution])) {
    let width = projected.size().0;
    projected.visit_in_bands(|rect| LightSink::new(rect, labels, width), |tile| take(&tile.contributions));
}

/// The contribution of one Gaussian to the pixels of one label within one tile, in pixels.
#[derive(Debug, Clone, Copy)]
struct Contribution {
    gaussian: u32,
    label: u16,
    /// Sum of alpha times transmittance.
    arrived: f32,
    /// Sum of alpha over the pixels that were not finished.
    sent: f32,
}

/// The contributions of one tile.
struct LightSink {
    /// Label of every pixel of the tile; background outside the picture.
    labels: [u16; TILE * TILE],
    contributions: Vec<Contribution>,
    /// Index of the first contribution of the Gaussian being blended, which rarely has more than two labels in a tile.
    current: usize,
}

impl LightSink {
    fn new(rect: TileRect, of_picture: &[u16], width: usize) -> Self {
        let mut labels = [0; TILE * TILE];
        for (inside, outside) in pixels(rect, width) {
            labels[inside] = of_picture[outside];
        }
        Self { labels, contributions: Vec::new(), current: 0 }
    }

    fn count(&mut self, gaussian: u32, label: u16, arrived: f32, sent: f32) {
        match self.contributions[self.current..].iter_mut().find(|contribution| contribution.label == label) {
            Some(contribution) => {
                contribution.arrived += arrived;
                contribution.sent += sent;
            }
            None => self.contributions.push(Contribution { gaussian, label, arrived, sent }),
        }
    }
}

impl Sink for LightSink {
    fn add(&mut self, splat: &Splat, first: usize, weights: &[f32; LANES], transmittance: &[f32; LANES]) {
        let gaussian = splat.gaussian;
        if self.contributions.last().is_none_or(|last| last.gaussian != gaussian) {
            self.current = self.contributions.len();
        }
        // The light before the splat is the sum of what it takes and what it leaves. Of a finished pixel it takes
        // nothing, so that pixel does not count as light sent.
        let sent: [f32; LANES] =
            std::array::from_fn(|lane| weights[lane] / (weights[lane] + transmittance[lane]).max(TRANSMITTANCE_MIN));
        let labels: [u16; LANES] = std::array::from_fn(|lane| self.labels[first + lane]);
        if labels.iter().all(|label| *label == labels[0]) {
            self.count(gaussian, labels[0], weights.iter().sum(), sent.iter().sum());
            return;
        }
        for lane in (0..LANES).filter(|&lane| weights[lane] > 0.0) {
            self.count(gaussian, labels[lane], weights[lane], sent[lane]);
        }
    }
}
