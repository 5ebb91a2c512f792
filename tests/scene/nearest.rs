//! The k-d tree against an exhaustive search.

use gprop::numeric::nearest::Nearest;
use proptest::prelude::*;

proptest! {
    // Failing cases are printed, not written beside the sources.
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn finds_what_looking_at_all_points_finds(
        // A coarse grid, so that many distances are equal.
        points in prop::collection::vec(prop::array::uniform3(-4i8..4), 0..80),
        to in prop::array::uniform3(-5i8..5),
        k in 0usize..20,
    ) {
        let float = |p: [i8; 3]| p.map(f32::from);
        let nearest = Nearest::new(points.iter().map(|&p| float(p)));
        let mut all: Vec<(f32, u32)> = points
            .iter()
            .zip(0..)
            .map(|(&p, n)| (float(p).iter().zip(float(to)).map(|(a, b)| (a - b) * (a - b)).sum(), n))
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        all.truncate(k);
        prop_assert_eq!(nearest.find(float(to), k), all);
    }
}
