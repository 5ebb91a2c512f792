//! `--deformable`: soft parts as tetrahedra in MJCF and USD, in the programs that simulate them.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use gprop::export::{Format, Formats, GlbLook, Links, Model, Origin, export, export_body};
use gprop::gaussians::Gaussians;
use gprop::materials::MaterialLibrary;
use gprop::parts::{Options, PartsResult, parts_of_mesh};
use gprop::scene::mesh::solid::Measured;
use gprop::scene::mesh::{Face, Material, Mesh, PaintedMesh, Triangles, sample};
use gprop::units::{MetricScale, ScaleSource};
use gprop::vote::{FieldPart, MaterialField};
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;

use super::{CREDITS, listed, python};
use crate::scene::shapes::{cuboid, joined, revolved};
use crate::support::{python_has, shared_folder};

/// Scene units are decimetres, so that a confusion of the two is noticed.
static SCALE: MetricScale =
    MetricScale { meters_per_unit: 0.1, source: ScaleSource::Factor, provenance: String::new(), range: None };

/// An object of parts whose materials are known.
struct Soft {
    name: &'static str,
    gaussians: Gaussians,
    field: MaterialField,
    result: PartsResult,
}

impl Soft {
    /// Of a mesh in decimetres, whose parts are divided by place.
    fn of(name: &'static str, mesh: &Triangles, materials: &[&str], part_of: impl Fn([f32; 3]) -> u32) -> Self {
        let face = Face { material: 0, shape: 0, texture_coordinates: None };
        let faces = vec![face; mesh.triangles.len()];
        let whole =
            Mesh { surface: mesh.clone(), faces, materials: vec![Material::default()], shapes: 1, ..Mesh::default() };
        let gaussians = sample(&PaintedMesh::new(whole).unwrap()).unwrap().gaussians;
        let library = MaterialLibrary::builtin();
        let label = |(id, material): (u32, &&str)| FieldPart::of(id, library.get(material).unwrap());
        let parts = gaussians.positions.iter().copied().map(part_of).collect();
        let field = MaterialField::known((1..).zip(materials).map(label).collect(), parts);
        let options = Options { volume_cells: 10_000, ..Options::default() };
        let measured = Measured::of(mesh).unwrap();
        let result = parts_of_mesh(&gaussians, &field, &measured, Some(&SCALE), &options).unwrap();
        Self { name, gaussians, field, result }
    }

    fn cushion() -> Self {
        Self::of("cushion", &cuboid([0.0; 3], [4.0, 4.0, 1.0]), &["pu foam, flexible 35 kg/m3"], |_| 0)
    }

    fn sponge() -> Self {
        Self::of("sponge", &cuboid([0.0; 3], [1.1, 0.7, 0.45]), &["natural sea sponge"], |_| 0)
    }

    /// A handle of ash along x, which ends in the middle of the head: a box of rubber of 7 cm x 6 cm x 12 cm.
    fn mallet() -> Self {
        let head = cuboid([-0.35, -0.3, -0.6], [0.35, 0.3, 0.6]);
        let mut handle = revolved(&[[0.0, 0.35], [0.12, 0.35], [0.12, 2.6], [0.0, 2.6]], 32);
        handle.vertices.iter_mut().for_each(|[x, _, z]| (*x, *z) = (*z, -*x));
        let part_of = |[x, y, z]: [f32; 3]| u32::from(x > 0.351 || (x > 0.349 && y.hypot(z) < 0.12));
        Self::of("mallet", &joined(&[head, handle]), &["natural rubber, filled", "ash, white"], part_of)
    }

    fn model(&self) -> Model<'_> {
        Model {
            name: self.name,
            gaussians: &self.gaussians,
            as_read: &self.gaussians,
            world_from_input: UnitQuaternion::identity(),
            field: &self.field,
            interior: &self.result.interior,
            scale: Some(&SCALE),
            parts: Some(self.result.metric().unwrap()),
            support: None,
            samples: &[],
            cameras: &[],
            grasps: &[],
            on_steel: None,
            origin: Origin::Base,
            at: Vector3::zeros(),
            floating: false,
            links: Links::One,
            deformable: true,
            glb_look: GlbLook::Meshes,
            mjcf_splats: false,
            pad_geoms: &[],
            credits: &CREDITS,
            source: "mesh.obj",
            answered_by: &[],
            inputs: &[],
            asset: None,
        }
    }

    fn mass_kg(&self) -> f64 {
        self.result.metric().unwrap().object.mass_kg.mid
    }
}

/// The three objects, written once for all tests.
fn written() -> &'static (std::path::PathBuf, [Soft; 3]) {
    static WRITTEN: OnceLock<(std::path::PathBuf, [Soft; 3])> = OnceLock::new();
    WRITTEN.get_or_init(|| {
        let (out, objects) = (shared_folder("export/deformable"), [Soft::cushion(), Soft::sponge(), Soft::mallet()]);
        for soft in &objects {
            export(&soft.model(), &[Format::Mjcf, Format::Usda], &out.join(soft.name)).unwrap();
        }
        (out, objects)
    })
}

/// What a simulator finds of a file of each of the objects.
fn found(simulator: &str, file: impl Fn(&str) -> String) -> Vec<Value> {
    let (out, objects) = written();
    let files: Vec<_> = objects.iter().map(|soft| out.join(soft.name).join(file(soft.name))).collect();
    let mut arguments = vec![Path::new(simulator)];
    arguments.extend(files.iter().map(std::path::PathBuf::as_path));
    let found = python("deformable_check.py", &arguments);
    println!("{found:?}");
    found
}

/// All mass is there, the tetrahedra are few and none is inside out, and the mallet's head hangs on its handle.
#[track_caller]
fn assert_is_whole(found: &[Value]) {
    for (soft, found) in written().1.iter().zip(found) {
        assert!(
            (found["mass_kg"].as_f64().unwrap() / soft.mass_kg() - 1.0).abs() < 1e-5,
            "{found}: {}",
            soft.mass_kg()
        );
        let elements = found["elements"].as_u64().unwrap();
        assert!((1000..=4000).contains(&elements), "{found}");
        assert!(found["least_volume_m3"].as_f64().unwrap() > 0.0, "{found}");
        let is_mallet = soft.name == "mallet";
        assert_eq!(found["rigid_bodies"], u64::from(is_mallet), "{found}");
        assert_eq!(found["attached"].as_u64().unwrap() > 0, is_mallet, "{found}");
    }
}

#[test]
fn mujoco_simulates_soft_parts() {
    if !python_has("mujoco_simulates_soft_parts", "mujoco", "mujoco") {
        return;
    }
    let found = found("mujoco", |name| format!("{name}.xml"));
    assert_is_whole(&found);
    for found in &found {
        // It comes to rest, and stays in one piece.
        assert!(found["speed_m_s"].as_f64().unwrap() < 0.01, "{found}");
        assert!(found["stretched"].as_f64().unwrap() < 0.2, "{found}");
    }
}

#[test]
fn newton_imports_soft_parts() {
    if !python_has("newton_imports_soft_parts", "newton", "newton") {
        return;
    }
    assert_is_whole(&found("newton", |name| format!("{name}/usd/{name}.usda")));
}

#[test]
fn formats_without_deformable_bodies_say_that_parts_are_rigid_there() {
    let (mallet, out) = (&written().1[2], shared_folder("export/deformable_notes"));
    let formats = [Format::Mjcf, Format::Urdf, Format::Sdf];
    let exported = export_body(&mallet.model(), Formats::Each(&formats), &out).unwrap();
    let [note] = exported.notes.as_slice() else { panic!("{:?}", exported.notes) };
    assert!(note.contains("urdf, sdf") && note.contains("natural_rubber"), "{note}");
    // The same bytes as without.
    let rigid = shared_folder("export/deformable_rigid");
    let model = Model { deformable: false, ..mallet.model() };
    export(&model, &formats, &rigid).unwrap();
    let same = |file: &str| fs::read(out.join(file)).unwrap() == fs::read(rigid.join(file)).unwrap();
    assert!(same("mallet.urdf") && same("mallet.sdf") && same("meshes/mallet_skin.obj") && !same("mallet.xml"));
    // Nothing of the hammer but a thin sleeve is soft.
    let hammer = crate::grasp::scenes::Measured::small();
    let model = Model { deformable: true, ..super::model(hammer) };
    let exported =
        export_body(&model, Formats::Each(&[Format::Mjcf]), &shared_folder("export/deformable_hammer")).unwrap();
    assert!(exported.notes.iter().any(|note| note.contains("too thin")), "{:?}", exported.notes);
}

#[test]
fn each_part_may_be_a_link_beside_them() {
    if !python_has("each_part_may_be_a_link_beside_them", "mujoco", "mujoco") {
        return;
    }
    let (mallet, out) = (&written().1[2], shared_folder("export/deformable_links"));
    let model = Model { links: Links::Parts, mjcf_splats: true, ..mallet.model() };
    export(&model, &[Format::Mjcf], &out).unwrap();
    let found = listed(super::mujoco("whole", &[&out.join("mallet.xml")])).remove(0);
    assert!((found["mass_kg"].as_f64().unwrap() / mallet.mass_kg() - 1.0).abs() < 1e-6, "{found}");
    assert!(found["bodies"].as_array().unwrap().iter().any(|name| name == "mallet__ash"), "{found}");
    let of_handle = fs::read_dir(out.join("splats")).unwrap().count();
    assert_eq!(of_handle, 1);
}
