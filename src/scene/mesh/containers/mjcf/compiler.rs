//! The compiler's settings, as far as they change what a body is.

use nalgebra::UnitQuaternion;

use super::super::Problem;
use super::super::numbers::{about, exactly, of_euler, of_wxyz, of_xy_axes, of_z_axis};
use super::ORIENTATIONS;
use super::defaults::Settings;
use super::documents::Documents;

/// When geoms decide the mass of a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FromGeoms {
    Never,
    /// If the body states nothing.
    Auto,
    /// Whatever the body states.
    Always,
}

/// The settings of all `<compiler>` elements; later ones override.
#[derive(Debug)]
pub struct Compiler {
    angles_are_degrees: bool,
    euler_sequence: String,
    pub mesh_folder: Option<String>,
    pub strips_paths: bool,
    pub inertia_from_geoms: FromGeoms,
    /// The groups of geoms that have mass, from the first to the last.
    pub mass_groups: [f64; 2],
    pub total_mass_kg: Option<f64>,
}

impl Compiler {
    pub fn read(documents: &Documents, problems: &mut Vec<Problem>) -> Self {
        // MuJoCo's defaults.
        let mut all = Self {
            angles_are_degrees: true,
            euler_sequence: "xyz".to_owned(),
            mesh_folder: None,
            strips_paths: false,
            inertia_from_geoms: FromGeoms::Auto,
            mass_groups: [0.0, 5.0],
            total_mass_kg: None,
        };
        let mut asset_folder = None;
        for item in documents.sections("compiler") {
            for attribute in item.node.attributes() {
                let value = attribute.value.as_str();
                let mut problem = |text: String| problems.push(Problem { place: item.place(), text });
                match attribute.name.as_str() {
                    "angle" => all.angles_are_degrees = value != "radian",
                    "eulerseq" if of_euler(value, [0.0; 3]).is_some() => value.clone_into(&mut all.euler_sequence),
                    "eulerseq" => problem(format!("<compiler>: eulerseq {value:?} is not three of xyzXYZ")),
                    "meshdir" => all.mesh_folder = Some(value.to_owned()),
                    "assetdir" => asset_folder = Some(value.to_owned()),
                    "strippath" => all.strips_paths = value == "true",
                    "inertiafromgeom" => {
                        all.inertia_from_geoms = match value {
                            "true" => FromGeoms::Always,
                            "false" => FromGeoms::Never,
                            _ => FromGeoms::Auto,
                        }
                    }
                    "inertiagrouprange" => match exactly(value) {
                        Ok(range) => all.mass_groups = range,
                        Err(error) => problem(format!("<compiler>: inertiagrouprange {error}")),
                    },
                    "settotalmass" => match exactly(value) {
                        Ok([mass]) => all.total_mass_kg = (mass > 0.0).then_some(mass),
                        Err(error) => problem(format!("<compiler>: settotalmass {error}")),
                    },
                    _ => {}
                }
            }
        }
        all.mesh_folder = all.mesh_folder.or(asset_folder);
        all
    }

    /// The orientation that an element states, in any of MuJoCo's forms.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn rotation(&self, settings: &Settings) -> Result<UnitQuaternion<f64>, String> {
        let Some(item) = settings.with_any(&ORIENTATIONS) else { return Ok(UnitQuaternion::identity()) };
        let unit = if self.angles_are_degrees { 1f64.to_radians() } else { 1.0 };
        let stated = ORIENTATIONS.iter().find_map(|name| Some((*name, item.node.value(name)?)));
        let Some((name, text)) = stated else { return Ok(UnitQuaternion::identity()) };
        let rotation = match name {
            "quat" => exactly(text).map(of_wxyz),
            "axisangle" => exactly(text).map(|[x, y, z, angle]| about([x, y, z], angle * unit)),
            "xyaxes" => exactly(text).map(of_xy_axes),
            "zaxis" => exactly(text).map(of_z_axis),
            _ => exactly(text).map(|angles: [f64; 3]| of_euler(&self.euler_sequence, angles.map(|angle| angle * unit))),
        };
        let rotation = rotation.map_err(|error| format!("{name} {error}"))?;
        rotation.ok_or_else(|| format!("{name} {text:?} is no rotation"))
    }
}
