//! The Gaussians of each body of an MJCF as a 3DGS PLY, in metres and in the body's own frame, so that a renderer can move them with it.
//! MJCF has no element for splats, so a text called like the body names the file.

use std::fmt::Write;

use nalgebra::Vector3;

use super::{ExportError, Files, Rigid, Splat};
use crate::gaussians::Gaussians;
use crate::scene::splat::ply;

/// A body and its Gaussians.
struct BodySplat<'a> {
    body: &'a str,
    /// By Gaussian of the model: whether it is the body's.
    kept: Vec<bool>,
    /// The origin of the body's frame in the object's axes, m.
    origin: Vector3<f64>,
}

/// Writes the files.
pub fn write(rigid: &Rigid, splat: &Splat, files: &mut Files) -> Result<(), ExportError> {
    for BodySplat { body, kept, origin } in of_bodies(rigid, splat) {
        let own = in_body(splat, &kept, origin);
        files.write(file(body), |out| ply::write(out, &own, &[]))?;
    }
    Ok(())
}

/// The texts that name the files.
pub fn texts(rigid: &Rigid) -> String {
    let mut texts = String::new();
    for (body, _) in rigid.skins() {
        let _ = writeln!(texts, r#"    <text name="{body}_splat" data="{}"/>"#, file(body));
    }
    format!("  <custom>\n{texts}  </custom>\n")
}

fn file(body: &str) -> String {
    format!("splats/{body}.ply")
}

fn of_bodies<'a>(rigid: &'a Rigid, splat: &Splat) -> Vec<BodySplat<'a>> {
    if rigid.is_one_body() {
        let kept = vec![true; splat.gaussians.len()];
        return vec![BodySplat { body: &rigid.name, kept, origin: Vector3::zeros() }];
    }
    let of_link = |n: usize| {
        let mut kept = vec![false; splat.gaussians.len()];
        rigid.gaussians_of(splat, n).into_iter().for_each(|i| kept[i] = true);
        BodySplat { body: &rigid.links[n].name, kept, origin: rigid.links[n].joint }
    };
    (0..rigid.links.len()).map(of_link).collect()
}

fn in_body(splat: &Splat, kept: &[bool], origin: Vector3<f64>) -> Gaussians {
    let mut own = splat.gaussians.clone();
    own.retain(kept);
    own.extra.clear();
    let origin = splat.origin + origin;
    for position in &mut own.positions {
        let moved = Vector3::from(position.map(f64::from)) * splat.meters_per_unit - origin;
        *position = moved.map(|c| c as f32).into();
    }
    let larger = splat.meters_per_unit.ln() as f32;
    own.log_scales.iter_mut().flatten().for_each(|scale| *scale += larger);
    own
}
