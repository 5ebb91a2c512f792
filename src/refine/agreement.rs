//! How far two masks of different views show the same Gaussians.

/// A view sees a Gaussian that has more light than this in it, in pixels, as in [`crate::consensus`].
pub(super) const SEEN_LIGHT: f32 = 0.3;

/// The light of a Gaussian, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Light {
    pub gaussian: u32,
    pub all: f32,
    /// How much of it lies in a mask.
    pub inside: f32,
}

impl Light {
    /// The light of every Gaussian once, by Gaussian.
    pub fn added_up(mut light: Vec<Self>) -> Vec<Self> {
        light.sort_by_key(|of| of.gaussian);
        light.dedup_by(|next, kept| {
            let is_same = next.gaussian == kept.gaussian;
            if is_same {
                (kept.all, kept.inside) = (kept.all + next.all, kept.inside + next.inside);
            }
            is_same
        });
        light
    }
}

/// The intersection over union of two masks, over the Gaussians that both views see: each counts as inside by the share of its
/// light, and weighs as much as its light in the view that has less of it. Both lists are by Gaussian. `None` if neither mask holds
/// any of them.
pub(super) fn agreement(a: &[Light], b: &[Light]) -> Option<f64> {
    let (mut both, mut either) = (0.0, 0.0);
    let mut rest = b;
    for one in a {
        rest = &rest[rest.partition_point(|other| other.gaussian < one.gaussian)..];
        let Some(other) = rest.first().filter(|other| other.gaussian == one.gaussian) else { continue };
        let weight = one.all.min(other.all);
        if weight > SEEN_LIGHT {
            let [p, q] = [one, other].map(|of| f64::from(of.inside / of.all));
            both += f64::from(weight) * p.min(q);
            either += f64::from(weight) * p.max(q);
        }
    }
    (either > 0.0).then(|| both / either)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(gaussian: u32, all: f32, inside: f32) -> Light {
        Light { gaussian, all, inside }
    }

    #[test]
    fn only_what_both_views_see_counts() {
        let a = [light(0, 2.0, 2.0), light(1, 4.0, 2.0), light(3, 9.0, 9.0), light(4, 0.2, 0.2)];
        let b = [light(0, 4.0, 4.0), light(1, 2.0, 0.0), light(2, 9.0, 9.0), light(4, 9.0, 0.0)];
        // Gaussian 0 is in both, half of Gaussian 1 is in one; no other is seen by both.
        let found = agreement(&a, &b).unwrap();
        assert!((found - 2.0 / 3.0).abs() < 1e-9, "{found}");
        assert_eq!(agreement(&a[2..3], &b), None);
    }

    #[test]
    fn light_of_several_views_is_added_up() {
        let light_of_views = vec![light(1, 2.0, 1.0), light(3, 1.0, 0.0), light(0, 1.0, 1.0), light(1, 4.0, 4.0)];
        assert_eq!(Light::added_up(light_of_views), [light(0, 1.0, 1.0), light(1, 6.0, 5.0), light(3, 1.0, 0.0)]);
    }
}
