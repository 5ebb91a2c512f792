//! Volumes, centres and inertias of meshes against closed forms, and what broken meshes give.

use std::f64::consts::PI;

use gprop::scene::mesh::Triangles;
use gprop::scene::mesh::solid::{Doubt, Kind, Solid, SolidError, measure};

use super::shapes::{cuboid, joined, moved, reversed, revolved, shuffled, sphere, subdivided, with_tenth_flipped};

/// Issue 48: volumes within 0.5 % of closed forms.
const CLOSED_FORM: f64 = 0.005;
/// Rounding errors of sums over tens of thousands of triangles.
const ROUNDING: f64 = 1e-9;

/// Within `tolerance` as a share; false for NaN.
fn is_near(value: f64, expected: f64, tolerance: f64) -> bool {
    (value - expected).abs() <= tolerance * expected.abs()
}

/// The measured solid, after a check that it stays the same if triangles are shuffled, subdivided or a tenth of them flipped.
fn measured(mesh: &Triangles, tolerance: f64) -> Solid {
    let solid = measure(mesh).unwrap();
    println!("{:?} {:?} {:?}", solid.kind, solid.volume, solid.doubts);
    let volume = solid.volume;
    assert!(volume.low <= volume.mid && volume.mid <= volume.high, "{volume:?}");
    for (change, changed) in [
        ("shuffled", shuffled(mesh)),
        ("subdivided", subdivided(mesh)),
        ("flipped", with_tenth_flipped(mesh)),
        ("subdivided, flipped", with_tenth_flipped(&subdivided(mesh))),
    ] {
        let changed = measure(&changed).unwrap();
        assert!(is_near(changed.volume.mid, volume.mid, tolerance), "{change}: {:?}, not {volume:?}", changed.volume);
        assert!(is_near(changed.shell.area, solid.shell.area, ROUNDING), "{change}: {}", changed.shell.area);
        assert_eq!(
            std::mem::discriminant(&changed.kind),
            std::mem::discriminant(&solid.kind),
            "{change}: {:?}, not {:?}",
            changed.kind,
            solid.kind
        );
        let size = volume.mid.cbrt();
        assert!((changed.center - solid.center).norm() <= tolerance * size, "{change}: {}", changed.center);
    }
    solid
}

#[track_caller]
fn assert_exact(solid: &Solid) {
    assert_eq!(solid.doubts, [], "{:?}", solid.volume);
    assert_eq!((solid.volume.low, solid.volume.high), (solid.volume.mid, solid.volume.mid));
    assert!(solid.topology.is_watertight(), "{:?}", solid.topology);
}

#[test]
fn sphere_has_the_moments_of_a_ball() {
    let solid = measured(&sphere([3.0, -2.0, 1.0], 0.5, 100), ROUNDING);
    assert_exact(&solid);
    assert_eq!(solid.kind, Kind::Solid);
    let (volume, inertia) = (4.0 / 3.0 * PI * 0.125, 0.4 * 4.0 / 3.0 * PI * 0.5f64.powi(5));
    assert!(is_near(solid.volume.mid, volume, CLOSED_FORM), "{:?}", solid.volume);
    assert!(is_near(solid.shell.area, PI, CLOSED_FORM), "{}", solid.shell.area);
    assert!((solid.center - nalgebra::Point3::new(3.0, -2.0, 1.0)).norm() < 1e-9, "{}", solid.center);
    for axis in 0..3 {
        assert!(is_near(solid.inertia[(axis, axis)], inertia, CLOSED_FORM), "{}", solid.inertia);
        // A thin sphere: 2/3 m r^2.
        let shell = 2.0 / 3.0 * PI * 0.25;
        assert!(is_near(solid.shell.inertia[(axis, axis)], shell, CLOSED_FORM), "{}", solid.shell.inertia);
    }
}

#[test]
fn box_has_exactly_the_moments_of_a_box() {
    let mesh = cuboid([1.0, 2.0, 3.0], [2.0, 4.0, 6.0]);
    let solid = measured(&mesh, ROUNDING);
    assert_exact(&solid);
    assert!(is_near(solid.volume.mid, 6.0, 1e-12), "{:?}", solid.volume);
    assert!((solid.center - nalgebra::Point3::new(1.5, 3.0, 4.5)).norm() < 1e-12);
    // m / 12 (b^2 + c^2)
    for (axis, expected) in [6.5, 5.0, 2.5].into_iter().enumerate() {
        assert!(is_near(solid.inertia[(axis, axis)], expected, 1e-12), "{}", solid.inertia);
    }
    let turned = measure(&reversed(mesh)).unwrap();
    assert_eq!(turned.topology.inverted_components, 1);
    assert_eq!(turned.volume, solid.volume);
}

#[test]
fn box_with_a_hole() {
    // A square ring: outer sides 4, a hole of 2 through its height of 1.
    let profile = |side: f64| [[-side, -side], [side, -side], [side, side], [-side, side]];
    let mut mesh = Triangles::default();
    for z in [0.0, 1.0] {
        for corners in [profile(2.0), profile(1.0)] {
            mesh.vertices.extend(corners.map(|[x, y]| [x, y, z]));
        }
    }
    for k in 0..4 {
        let next = (k + 1) % 4;
        // Outer side, inner side, top, bottom.
        for [a, b, c, d] in [
            [k, next, 8 + next, 8 + k],
            [4 + next, 4 + k, 12 + k, 12 + next],
            [8 + k, 8 + next, 12 + next, 12 + k],
            [next, k, 4 + k, 4 + next],
        ] {
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let solid = measured(&mesh, ROUNDING);
    assert_exact(&solid);
    assert!(is_near(solid.volume.mid, 12.0, 1e-12), "{:?}", solid.volume);
}

#[test]
fn nested_spheres_that_face_each_other_hold_a_void() {
    let mesh = joined(&[sphere([0.0; 3], 1.0, 48), reversed(sphere([0.2, 0.0, 0.0], 0.5, 48))]);
    let solid = measured(&mesh, ROUNDING);
    assert_exact(&solid);
    assert_eq!(solid.kind, Kind::Solid);
    let [outer, inner] = [1.0, 0.125].map(|cube| 4.0 / 3.0 * PI * cube);
    assert!(is_near(solid.volume.mid, outer - inner, CLOSED_FORM), "{:?}", solid.volume);
    let center = -0.2 * inner / (outer - inner);
    assert!((solid.center.x - center).abs() < 1e-3, "{}", solid.center);
    // As a whole turned inside out, it is the same.
    let turned = measure(&reversed(mesh)).unwrap();
    assert!(is_near(turned.volume.mid, solid.volume.mid, ROUNDING), "{:?}", turned.volume);
    assert_eq!(turned.topology.inverted_components, 1);
}

#[test]
fn nested_spheres_that_face_alike_are_in_doubt() {
    let solid = measured(&joined(&[sphere([0.0; 3], 1.0, 48), sphere([0.2, 0.0, 0.0], 0.5, 48)]), ROUNDING);
    assert_eq!(solid.doubts, [Doubt::NestedAlike { components: 1 }]);
    let [outer, inner] = [1.0, 0.125].map(|cube| 4.0 / 3.0 * PI * cube);
    assert!(is_near(solid.volume.low, outer - inner, CLOSED_FORM), "{:?}", solid.volume);
    assert!(is_near(solid.volume.mid, outer, CLOSED_FORM), "{:?}", solid.volume);
    assert_eq!(solid.volume.high, solid.volume.mid);
}

#[test]
fn nested_spheres_close_to_each_other_are_a_wall() {
    let outer = sphere([0.0; 3], 1.0, 48);
    for inner in [sphere([0.0; 3], 0.95, 48), reversed(sphere([0.0; 3], 0.95, 48))] {
        let solid = measured(&joined(&[outer.clone(), inner]), ROUNDING);
        let Kind::Wall { thickness } = solid.kind else { panic!("{:?}", solid.kind) };
        assert!(is_near(thickness.mid, 0.05, 0.02), "{thickness:?}");
        let expected = 4.0 / 3.0 * PI * (1.0 - 0.95f64.powi(3));
        assert!(is_near(solid.volume.mid, expected, CLOSED_FORM), "{:?}", solid.volume);
    }
}

#[test]
fn cup_with_two_sides_is_a_wall() {
    // Radius 4, height 10, wall and bottom 0.3 thick, open above.
    let profile = [[0.0, 0.0], [4.0, 0.0], [4.0, 10.0], [3.7, 10.0], [3.7, 0.3], [0.0, 0.3]];
    let solid = measured(&revolved(&profile, 200), ROUNDING);
    assert_exact(&solid);
    let expected = PI * (16.0 * 10.0 - 3.7 * 3.7 * 9.7);
    assert!(is_near(solid.volume.mid, expected, CLOSED_FORM), "{:?}", solid.volume);
    let Kind::Wall { thickness } = solid.kind else { panic!("{:?}", solid.kind) };
    assert!(is_near(thickness.mid, 0.3, 0.02), "{thickness:?}");
}

#[test]
fn open_cup_encloses_what_it_holds() {
    let cup = revolved(&[[0.0, 0.0], [4.0, 0.0], [4.0, 10.0]], 100);
    for mesh in [cup.clone(), reversed(cup)] {
        let solid = measured(&mesh, CLOSED_FORM);
        assert_eq!(solid.kind, Kind::Open);
        assert!(is_near(solid.volume.mid, PI * 160.0, CLOSED_FORM), "{:?}", solid.volume);
        assert!(is_near(solid.shell.area, PI * 16.0 + 2.0 * PI * 40.0, CLOSED_FORM), "{}", solid.shell.area);
        assert!((solid.center.z - 5.0).abs() < 0.02, "{}", solid.center);
        assert!(solid.volume.low < 0.97 * solid.volume.mid, "{:?}", solid.volume);
        assert!(matches!(solid.doubts[..], [Doubt::Open { components: 1, boundary_edges: 100 }]), "{:?}", solid.doubts);
    }
}

#[test]
fn crossing_spheres_count_once() {
    // Two balls of radius 1 whose centres are 1 apart; their common lens is 5/12 pi.
    let apart = [sphere([0.0; 3], 1.0, 40), sphere([0.6, 0.8, 0.0], 1.0, 40)];
    let solid = measured(&joined(&apart), CLOSED_FORM);
    assert!(is_near(solid.volume.mid, (8.0 / 3.0 - 5.0 / 12.0) * PI, CLOSED_FORM), "{:?}", solid.volume);
    assert!((solid.center - nalgebra::Point3::new(0.3, 0.4, 0.0)).norm() < 0.005, "{}", solid.center);
    assert!(matches!(solid.doubts[..], [Doubt::Crossing { components: 2, error }] if error < CLOSED_FORM));
    // Along the line of centres each half is a ball without a cap.
    assert_eq!(solid.kind, Kind::Solid);
}

#[test]
fn boxes_that_touch_are_one() {
    let low = cuboid([0.0; 3], [1.0, 1.0, 1.0]);
    let solid = measured(&joined(&[low.clone(), moved(low, [0.0, 0.0, 1.0])]), ROUNDING);
    assert!(is_near(solid.volume.mid, 2.0, ROUNDING), "{:?}", solid.volume);
}

#[test]
fn a_scan_without_its_bottom_is_nearly_closed() {
    let mut mesh = sphere([0.0; 3], 1.0, 60);
    let vertices = mesh.vertices.clone();
    mesh.triangles.retain(|t| t.iter().any(|v| vertices[*v as usize][2] > -0.98));
    let solid = measured(&mesh, CLOSED_FORM);
    assert_eq!(solid.kind, Kind::Open);
    assert!(is_near(solid.volume.mid, 4.0 / 3.0 * PI, CLOSED_FORM), "{:?}", solid.volume);
    assert!(solid.volume.low > 0.95 * solid.volume.mid, "{:?}", solid.volume);
}

#[test]
fn sheets_enclose_nothing() {
    let sheet = revolved(&[[0.0, 0.0], [2.0, 0.1]], 100);
    let both_sides = joined(&[sheet.clone(), reversed(sheet.clone())]);
    for mesh in [sheet, both_sides] {
        let solid = measure(&mesh).unwrap();
        assert_eq!(solid.kind, Kind::Sheet, "{:?}", solid.volume);
        assert_eq!((solid.volume.low, solid.volume.mid), (0.0, 0.0));
        assert!(is_near(solid.shell.area, 4.0 * PI, CLOSED_FORM), "{}", solid.shell.area);
        // A thin disc: m r^2 / 2 about its axis.
        assert!(is_near(solid.shell.inertia[(2, 2)], 8.0 * PI, CLOSED_FORM), "{}", solid.shell.inertia);
    }
    let one = Triangles { vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], triangles: vec![[0, 1, 2]] };
    let solid = measure(&one).unwrap();
    assert_eq!(solid.kind, Kind::Sheet);
    assert!(is_near(solid.shell.area, 0.5, ROUNDING));
}

#[test]
fn vertices_need_not_be_shared() {
    let mesh = sphere([0.0; 3], 1.0, 40);
    let shared = measure(&mesh).unwrap();
    let mut soup = Triangles::default();
    for (n, t) in mesh.triangles.iter().enumerate() {
        // As if written with seven digits.
        let rounded = |x: f64| x * (1.0 + 1e-7 * f64::from(n as u32 % 3));
        soup.vertices.extend(t.map(|v| mesh.vertices[v as usize].map(rounded)));
        soup.triangles.push([0, 1, 2].map(|k| 3 * n as u32 + k));
    }
    let solid = measure(&soup).unwrap();
    assert!(solid.topology.is_watertight(), "{:?}", solid.topology);
    assert!(is_near(solid.volume.mid, shared.volume.mid, 1e-6), "{:?}", solid.volume);
}

#[test]
fn sizes_and_places_do_not_matter() {
    let unit = measure(&sphere([0.0; 3], 1.0, 20)).unwrap();
    for (size, place) in [(1e-12, 0.0), (1e12, 0.0), (1e40, 0.0), (0.01, 1000.0)] {
        let mut mesh = moved(sphere([0.0; 3], size, 20), [place, -place, 2.0 * place]);
        mesh.triangles.push([0, 0, 1]);
        let solid = measure(&mesh).unwrap();
        // The positions themselves are rounded to 1e-16 of their distance from the origin.
        let tolerance = ROUNDING + 1e-15 * place / size;
        assert!(is_near(solid.volume.mid, unit.volume.mid * size.powi(3), tolerance), "{size}: {:?}", solid.volume);
    }
}

#[test]
fn a_million_triangles_are_measured() {
    let solid = measure(&sphere([0.0; 3], 1.0, 500)).unwrap();
    assert!(is_near(solid.volume.mid, 4.0 / 3.0 * PI, 1e-4), "{:?}", solid.volume);
    assert_eq!(solid.topology.triangles, 1_000_000 - 2 * 1000);
}

#[test]
fn broken_meshes_give_one_clear_error() {
    let error =
        |vertices: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>| measure(&Triangles { vertices, triangles }).unwrap_err();
    assert_eq!(error(vec![[0.0; 3]], vec![]), SolidError::Empty);
    let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    assert_eq!(error(corners.clone(), vec![[0, 1, 3]]), SolidError::Index { triangle: 0, index: 3, vertices: 3 });
    for bad in [f64::NAN, f64::INFINITY, -1e200] {
        let mut corners = corners.clone();
        corners[1][2] = bad;
        let error = error(corners, vec![[0, 1, 2]]);
        assert!(matches!(error, SolidError::Position { vertex: 1, .. }), "{error}");
        assert!(error.to_string().contains("vertex 1"), "{error}");
    }
    assert_eq!(error(vec![[0.5; 3]; 3], vec![[0, 1, 2]]), SolidError::NoArea { triangles: 1 });
    let line = vec![[0.0; 3], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]];
    assert_eq!(error(line, vec![[0, 1, 2]; 2]), SolidError::NoArea { triangles: 2 });
}
