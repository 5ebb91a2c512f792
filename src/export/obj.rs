//! Wavefront OBJ, which most simulators read: meshes without colours, and the skin with its picture.

use std::fmt::Write;

use nalgebra::Point3;

use super::shape::Skin;
use super::{ExportError, Files, Rigid};

/// A mesh of triangles.
fn mesh(vertices: &[Point3<f64>], triangles: &[[u32; 3]]) -> String {
    let mut text = String::new();
    write_vertices(&mut text, vertices);
    for [a, b, c] in triangles {
        let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
    }
    text
}

/// The skin, whose material is in the file `materials` beside it.
fn skin(skin: &Skin, materials: &str) -> String {
    let mut text = format!("mtllib {materials}\nusemtl skin\n");
    write_vertices(&mut text, &skin.mesh.vertices);
    for [u, v] in skin.uv.iter().flatten() {
        let _ = writeln!(text, "vt {u:.6} {v:.6}");
    }
    for normal in skin.mesh.shading_normals() {
        let _ = writeln!(text, "vn {:.4} {:.4} {:.4}", normal.x, normal.y, normal.z);
    }
    for (t, triangle) in skin.mesh.triangles.iter().enumerate() {
        let corner = |k: usize| format!("{v}/{}/{v}", 3 * t + k + 1, v = triangle[k] + 1);
        let _ = writeln!(text, "f {} {} {}", corner(0), corner(1), corner(2));
    }
    text
}

/// The material of [`skin`], with its picture in the file `picture` beside it.
fn skin_material(picture: &str) -> String {
    format!("newmtl skin\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\nmap_Kd {picture}\n")
}

fn write_vertices(text: &mut String, vertices: &[Point3<f64>]) {
    // A micrometre.
    for v in vertices {
        let _ = writeln!(text, "v {:.6} {:.6} {:.6}", v.x, v.y, v.z);
    }
}

/// Writes the convex colliders and the skin into `meshes/`, all under names that begin with the object's.
pub fn write_meshes(rigid: &Rigid, files: &mut Files) -> Result<(), ExportError> {
    for collider in rigid.colliders {
        let text = || mesh(&collider.vertices, &collider.triangles);
        files.share(format!("meshes/{}.obj", rigid.collider_name(collider)), |out| out.write_all(text().as_bytes()))?;
    }
    for (name, shown) in rigid.skins() {
        let [text, materials, picture] = ["obj", "mtl", "png"].map(|ending| format!("{name}_skin.{ending}"));
        files.share(format!("meshes/{text}"), |out| out.write_all(skin(shown, &materials).as_bytes()))?;
        files.share(format!("meshes/{materials}"), |out| out.write_all(skin_material(&picture).as_bytes()))?;
        files.share(format!("meshes/{picture}"), |out| out.write_all(&shown.picture))?;
    }
    Ok(())
}
