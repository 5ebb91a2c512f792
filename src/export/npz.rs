//! NumPy's archive of arrays. Arrays are per Gaussian (`gaussian_*`), per label (`label_*`), per part (`part_*`) and
//! for the object (`object_*`), in the world's frame; the rotation `input_from_world` leads back to the scene's own. Names and captions are in `NAME_labels.json` beside it. An estimate is three values: low,
//! mid, high. They are NaN if a part has no volume.

use std::io::{self, Cursor, Write};

use zip::write::SimpleFileOptions;
use zip::{DateTime, ZipWriter};

use super::{ExportError, Files, Model, identifier};
use crate::files::json;
use crate::files::npy::{Number, write_npy};
use crate::units::{Estimate, ScaleSource};
use crate::vote::{FieldPart, field_ply};

pub(super) fn write(model: &Model, files: &mut Files) -> Result<(), ExportError> {
    let archive = |out: &mut dyn Write| out.write_all(&archive(model)?);
    let name = identifier(model.name);
    files.write(format!("{name}.npz"), archive)?;
    files.write(format!("{name}_labels.json"), |out| out.write_all(json::pretty(&model.field.parts)?.as_bytes()))
}

fn archive(model: &Model) -> io::Result<Vec<u8>> {
    let mut arrays = Arrays { zip: ZipWriter::new(Cursor::new(Vec::new())) };
    let gaussians = model.gaussians;
    let count = gaussians.len() as u64;
    arrays.add("gaussian_position", &[count, 3], gaussians.positions.iter().flatten().copied())?;
    for column in field_ply::columns(model.field) {
        arrays.add(&format!("gaussian_{}", column.name), &[count], column.values.iter().copied())?;
    }
    let input_from_world = model.world_from_input.inverse().to_rotation_matrix().into_inner();
    arrays.add("input_from_world", &[3, 3], input_from_world.transpose().iter().copied())?;
    if let Some(scale) = model.scale {
        arrays.add("meters_per_unit", &[], [scale.meters_per_unit])?;
        arrays.add("scale_is_estimated", &[], [i32::from(scale.source == ScaleSource::Estimated)])?;
    }
    type Property = (&'static str, fn(&FieldPart) -> Estimate);
    let of_labels: [Property; 5] = [
        ("label_density_kg_m3", |l| l.density_kg_m3),
        ("label_youngs_modulus_pa", |l| l.youngs_modulus_pa),
        ("label_poisson_ratio", |l| l.poisson_ratio),
        ("label_yield_strength_pa", |l| l.yield_strength_pa),
        ("label_friction_rubber", |l| l.friction_rubber),
    ];
    arrays.add("label_id", &[model.field.parts.len() as u64], model.field.parts.iter().map(|l| i64::from(l.id)))?;
    for (name, property) in of_labels {
        arrays.estimates(name, model.field.parts.iter().map(property))?;
    }
    if let Some(parts) = model.parts {
        let (object, all) = (&parts.object, &parts.parts);
        let count = all.len() as u64;
        arrays.add("part_id", &[count], all.iter().map(|p| i64::from(p.id)))?;
        let or_nan = |estimate: Option<Estimate>| estimate.unwrap_or(Estimate::exactly(f64::NAN));
        arrays.estimates("part_volume_m3", all.iter().map(|p| or_nan(p.volume_m3)))?;
        arrays.estimates("part_thickness_m", all.iter().map(|p| or_nan(p.thickness_m)))?;
        arrays.estimates("part_mass_kg", all.iter().map(|p| or_nan(p.mass_kg)))?;
        let centers = all.iter().flat_map(|p| p.center_of_mass_m.unwrap_or([f64::NAN; 3]));
        arrays.add("part_center_of_mass_m", &[count, 3], centers)?;
        let inertia = all.iter().flat_map(|p| p.inertia_kg_m2.unwrap_or([[f64::NAN; 3]; 3]).into_iter().flatten());
        arrays.add("part_inertia_kg_m2", &[count, 3, 3], inertia)?;
        arrays.add("object_mass_kg", &[3], values(object.mass_kg))?;
        arrays.add("object_volume_m3", &[3], values(object.volume_m3))?;
        arrays.add("object_center_of_mass_m", &[3], object.center_of_mass_m)?;
        arrays.add("object_inertia_kg_m2", &[3, 3], object.inertia_kg_m2.into_iter().flatten())?;
    }
    Ok(arrays.zip.finish()?.into_inner())
}

struct Arrays {
    zip: ZipWriter<Cursor<Vec<u8>>>,
}

impl Arrays {
    fn add<T: Number>(&mut self, name: &str, shape: &[u64], values: impl IntoIterator<Item = T>) -> io::Result<()> {
        let mut bytes = Vec::new();
        write_npy(&mut bytes, shape, values)?;
        // The bytes must not depend on the clock.
        let options = SimpleFileOptions::default().last_modified_time(DateTime::default());
        self.zip.start_file(format!("{name}.npy"), options)?;
        self.zip.write_all(&bytes)
    }

    fn estimates(&mut self, name: &str, estimates: impl ExactSizeIterator<Item = Estimate>) -> io::Result<()> {
        self.add(name, &[estimates.len() as u64, 3], estimates.flat_map(values))
    }
}

fn values(estimate: Estimate) -> [f64; 3] {
    [estimate.low, estimate.mid, estimate.high]
}
