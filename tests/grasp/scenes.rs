//! Grasps on the scenes with ground truth, with flawless segmentation and answers.

use std::path::Path;
use std::sync::OnceLock;

use gprop::camera::Camera;
use gprop::grasp::gripper::GripperProfile;
use gprop::grasp::surface::Surface;
use gprop::grasp::{GraspReport, Options, grasp, picture};
use gprop::parts::{self, Parts, PartsResult};
use gprop::scene::Scene;
use gprop::vote::MaterialField;
use gprop::words::progress::Progress;

use crate::inspect::thinned_by;
use crate::parts::truth::{self, Known};
use crate::support::{Shared, changed};

/// A scene processed up to its parts.
pub struct Measured {
    pub scene: &'static Scene,
    pub field: &'static MaterialField,
    pub result: PartsResult,
    pub cameras: Vec<Camera>,
    with_paper: OnceLock<GraspReport>,
}

impl Measured {
    pub fn of(folder: &Path) -> &'static Self {
        static MEASURED: Shared<Measured> = Shared::new();
        MEASURED.of(folder, || Self::new(folder))
    }

    fn new(folder: &Path) -> Self {
        let Known { scene, field, .. } = truth::known(folder);
        Self::of_field(scene, field, 500_000)
    }

    fn of_field(scene: &'static Scene, field: &'static MaterialField, volume_cells: usize) -> Self {
        let cameras: Vec<_> = scene.views.iter().map(|v| v.camera.clone()).collect();
        let options = parts::Options { volume_cells, ..Default::default() };
        let scale = scene.scale.as_ref();
        let result = parts::parts(&scene.gaussians, field, &cameras, scale, &options, Progress::HIDDEN).unwrap();
        Self { scene, field, result, cameras, with_paper: OnceLock::new() }
    }

    /// The hammer in few Gaussians and cells, for what does not depend on its shape.
    pub fn small() -> &'static Self {
        static SMALL: OnceLock<Measured> = OnceLock::new();
        static KNOWN: OnceLock<(Scene, MaterialField)> = OnceLock::new();
        SMALL.get_or_init(|| {
            let (scene, field) = KNOWN.get_or_init(|| {
                const STEP: usize = 8;
                let Known { scene, field, .. } = truth::known(&truth::hammer());
                let part_index = field.part_index.iter().copied().step_by(STEP).collect();
                let scene = changed(scene.clone(), |scene| scene.gaussians = thinned_by(&scene.gaussians, STEP));
                (scene, MaterialField::known(field.parts.clone(), part_index))
            });
            Self::of_field(scene, field, 20_000)
        })
    }

    pub fn parts(&self) -> &Parts {
        self.result.metric().unwrap()
    }

    /// The places at which the paper's gripper can grasp the scene, found once for all tests.
    pub fn with_paper(&self) -> &GraspReport {
        self.with_paper.get_or_init(|| {
            let surface = Surface::of(&self.scene.gaussians, &self.field.part_index, &self.cameras, 1.0);
            let (gripper, options) =
                (GripperProfile::load("paper").unwrap(), Options { auto: true, ..Options::default() });
            grasp(self.parts(), &self.field.parts, Some(&surface), 1.0, &gripper, &options).unwrap()
        })
    }
}

/// The hammer, and the other scenes as they are beside the crate or among the fixtures.
pub fn folders() -> Vec<std::path::PathBuf> {
    let beside = ["mug", "table_lamp", "chair"].into_iter().map(truth::beside);
    std::iter::once(truth::hammer()).chain(beside).collect()
}

#[test]
fn every_scene_has_places_to_grasp_at() {
    for folder in folders() {
        let measured = Measured::of(&folder);
        let report = measured.with_paper();
        println!("{}", measured.scene.name);
        for p in &report.candidates {
            println!(
                "  {:10} width {:5.1} mm, thickness {:5.1}, off {:4.1} deg, lever {:5.1} mm, force {:5.2} F_hold {:5.2} F_min {:5.2} F* {:5.2} F_max {:8.1} N, torque {:6.1} N mm",
                p.part,
                p.width_m * 1e3,
                p.thickness_m.mid * 1e3,
                p.misalignment_rad.to_degrees(),
                p.lever_m * 1e3,
                p.force_n,
                p.f_hold_n,
                p.f_min_n,
                p.f_star_n,
                p.f_max_n,
                p.torque_margin_n_m * 1e3
            );
        }
        assert_eq!(report.candidates.len(), 5);
        for place in &report.candidates {
            assert!(place.width_m <= 0.09 && place.misalignment_rad < 1.0f64.atan(), "{place:?}");
        }
        let side_m = GripperProfile::load("paper").unwrap().finger_side_m();
        let drawn = picture::picture(&measured.scene.gaussians, &measured.cameras, report, side_m, 1.0);
        let drawn = drawn.unwrap();
        if let Some(folder) = std::env::var_os("GPROP_KEEP_PICTURES") {
            drawn.save(Path::new(&folder).join(format!("{}.png", measured.scene.name))).unwrap();
        }
        // Magenta in any light; no scene has a magenta as strong as this.
        let is_hand = |p: &image::Rgb<u8>| {
            let [red, green, blue] = p.0.map(i32::from);
            red - green > 100 && blue - green > 20
        };
        let hand: Vec<(u32, u32)> =
            drawn.enumerate_pixels().filter(|(_, _, p)| is_hand(p)).map(|(x, y, _)| (x, y)).collect();
        let share = hand.len() as f64 / f64::from(drawn.width() * drawn.height());
        assert!(share > 0.01, "the hand fills {share} of the picture");
        // The whole object with the hand is on the left, the hand close by on the right.
        let half = drawn.width() / 2;
        assert!(hand.iter().any(|(x, _)| *x < half - 50) && hand.iter().any(|(x, _)| *x > half + 50));
        let is_paper = |x: u32, y: u32| drawn.get_pixel(x, y).0.iter().all(|channel| *channel > 245);
        // A margin around everything, within the left panel: nothing of the object touches its left edge.
        assert!((60..drawn.height() - 250).all(|y| is_paper(26, y)), "{}: the object is cut", measured.scene.name);
    }
}
