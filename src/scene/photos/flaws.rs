//! Photos that should not be worked with, compared with the others of their capture.

use serde::Serialize;

use super::sharpness::sharpness;
use crate::numeric::upper_median;
use crate::parallel;
use crate::scene::{Photo, Scene, SceneError, View};

/// A photo with less than this share of the median sharpness is blurred: on a fixture, a Gaussian blur with a
/// standard deviation of one pixel leaves a fifth of the sharpness, while sharp views differ by a twentieth.
const LEAST_SHARPNESS: f64 = 0.5;

/// A photo is over-exposed if it is burnt out in this much more of its area than the median photo: a white thing, a lamp or a window is
/// white in all of them.
const MOST_BURNT_OUT: f64 = 0.3;
/// All channels of a pixel that is burnt out have at least this value.
const BURNT_OUT: u8 = 254;
/// Of fewer photos nothing is usual.
const FEWEST_COMPARED: usize = 5;

/// What is wrong with a photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Flaw {
    /// The object is outside of the picture.
    ShowsNothing,
    /// It has less than half of the usual sharpness.
    Blurred,
    /// Much more of it is burnt out than is usual.
    OverExposed,
}

impl Flaw {
    pub fn in_words(self) -> &'static str {
        match self {
            Self::ShowsNothing => "shows nothing of the object",
            Self::Blurred => "blurred",
            Self::OverExposed => "over-exposed",
        }
    }
}

/// What a photo is compared by.
struct Look {
    /// `None` if there is no detail to judge by.
    sharpness: Option<f64>,
    /// Share of the foreground.
    burnt_out: f64,
}

impl Scene {
    /// What is wrong with each of these views' photos.
    ///
    /// # Errors
    /// If a photo cannot be decoded.
    pub fn flaws(&self, views: &[View]) -> Result<Vec<Option<Flaw>>, SceneError> {
        let looks = parallel::try_map(views, |view| view.photo().map(|photo| Look::of(&photo)))?;
        let coverages = self.coverages(views);
        let flaw =
            |(look, coverage): (&Option<Flaw>, &f64)| if *coverage > 0.0 { *look } else { Some(Flaw::ShowsNothing) };
        Ok(of_looks(&looks).iter().zip(&coverages).map(flaw).collect())
    }
}

impl Look {
    fn of(photo: &Photo) -> Self {
        let foreground = || photo.rgb.pixels().zip(photo.foreground.as_raw()).filter(|(_, inside)| **inside > 0);
        let burnt_out = foreground().filter(|(pixel, _)| pixel.0.iter().all(|channel| *channel >= BURNT_OUT)).count();
        Self { sharpness: sharpness(photo), burnt_out: burnt_out as f64 / foreground().count().max(1) as f64 }
    }
}

fn of_looks(looks: &[Look]) -> Vec<Option<Flaw>> {
    let usual = |values: Vec<f64>| (values.len() >= FEWEST_COMPARED).then(|| upper_median(values)).flatten();
    let sharpness = usual(looks.iter().filter_map(|look| look.sharpness).collect());
    let burnt_out = usual(looks.iter().map(|look| look.burnt_out).collect());
    let flaw = |look: &Look| {
        let is_burnt_out = burnt_out.is_some_and(|usual| look.burnt_out > usual + MOST_BURNT_OUT);
        let is_blurred = look.sharpness.zip(sharpness).is_some_and(|(own, usual)| own < LEAST_SHARPNESS * usual);
        match (is_burnt_out, is_blurred) {
            (true, _) => Some(Flaw::OverExposed),
            (false, true) => Some(Flaw::Blurred),
            (false, false) => None,
        }
    };
    looks.iter().map(flaw).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_are_compared_with_the_others() {
        let look = |sharpness: f64, burnt_out: f64| Look { sharpness: Some(sharpness), burnt_out };
        // A white thing: a third of every photo is burnt out.
        let mut looks: Vec<Look> = (0..6).map(|n| look(1.0 + 0.05 * f64::from(n), 0.3)).collect();
        looks.extend([look(0.4, 0.3), look(0.2, 0.9), Look { sharpness: None, burnt_out: 0.0 }]);
        let found = of_looks(&looks);
        assert_eq!(found[..6], [None; 6]);
        assert_eq!(found[6..], [Some(Flaw::Blurred), Some(Flaw::OverExposed), None]);
        assert_eq!(of_looks(&looks[4..8]), [None; 4], "of four photos nothing is usual");
    }
}
