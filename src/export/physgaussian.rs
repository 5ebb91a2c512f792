//! PhysGaussian (Xie et al., 2024): the model folder `NAME/physgaussian/` as its loader expects it, with the additional
//! columns that its forks read for each Gaussian, and a configuration with the keys of its `utils/decode_param.py`.
//!
//! [`Estimated`] maps the field to PhysGaussian's numbers. PhysGaussian has one law per run: that of the label with the
//! most Gaussians. The others get boxes, which may only differ in E, nu and density. E in the configuration is reduced to a
//! value at which the explicit steps are stable; the PLY keeps the true one.

use serde_json::{Value, json};

use super::placement::Placement;
use super::{ExportError, Files, Model, identifier};
use crate::files::json;
use crate::scene::splat::ply;
use crate::simulate::compat::estimated::Estimated;
use crate::simulate::material::{SOFT_PA, Soften};
use crate::vote::field_ply;

/// The path in a model folder where 3DGS puts a trained cloud and PhysGaussian looks for it.
const CLOUD: &str = "point_cloud/iteration_30000/point_cloud.ply";
/// The columns, in the order used by the forks.
const COLUMNS: [&str; 6] = ["part_label", "density", "E", "nu", "material_id", "conf"];

pub(super) fn write(model: &Model, files: &mut Files) -> Result<(), ExportError> {
    let config = config(model);
    let folder = format!("{}/physgaussian", identifier(model.name));
    files.write(format!("{folder}/config.json"), |out| {
        out.write_all(json::pretty(&config)?.as_bytes())?;
        out.write_all(b"\n")
    })?;
    let all = field_ply::columns(model.field);
    let columns: Vec<_> = COLUMNS.iter().filter_map(|name| all.iter().find(|c| c.name == *name).cloned()).collect();
    let bare = crate::gaussians::Gaussians { extra: Vec::new(), ..model.gaussians.clone() };
    let unscaled = Placement::new(model.world_from_input, 1.0, || 0.0);
    let comments = [unscaled.comment()];
    files.write(format!("{folder}/{CLOUD}"), |out| ply::write_with_comments(out, &bare, &columns, &comments))
}

/// The configuration for the label with the most Gaussians, with a separate box for every other label. PhysGaussian drops
/// the Gaussians that are not above its threshold of opacity, so boxes leave them out.
fn config(model: &Model) -> Value {
    let (of_gaussian, labels) = (&model.field.part_index, &model.field.parts);
    let estimated = Estimated::new(of_gaussian, labels, Soften::default(), SOFT_PA);
    let main = estimated.main();
    let mut keys = estimated.configuration(main);
    let threshold = keys["opacity_threshold"].as_f64().expect("the configuration has a threshold");
    let gaussians = model.gaussians;
    let kept: Vec<usize> = (0..gaussians.len()).filter(|&i| gaussians.opacity(i) > threshold).collect();
    let is_kept = |label: usize| kept.iter().any(|&i| of_gaussian[i] as usize == label);
    let boxes = (0..labels.len()).filter(|&label| label != main && is_kept(label)).map(|label| {
        let (point, size) = box_in_unit_space(model, &kept, label as u32);
        let material = &estimated.materials[label];
        let (e, nu, density) = (material.youngs_modulus, material.poisson_ratio, material.density);
        json!({ "point": point, "size": size, "E": e, "nu": nu, "density": density })
    });
    let boxes: Vec<Value> = boxes.collect();
    keys.insert("additional_material_params".to_owned(), boxes.into());
    Value::Object(keys)
}

/// Centre and half sides of the box around a label's Gaussians in PhysGaussian's space: the cloud scaled so that its
/// longest side is 1, the middle of its box at (1, 1, 1). Only the Gaussians `kept` count.
fn box_in_unit_space(model: &Model, kept: &[usize], label: u32) -> ([f64; 3], [f64; 3]) {
    let bounds = |wanted: &dyn Fn(u32) -> bool| {
        let mut span = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for &i in kept.iter().filter(|&&i| wanted(model.field.part_index[i])) {
            let at = model.gaussians.positions[i].map(f64::from);
            span = [std::array::from_fn(|a| span[0][a].min(at[a])), std::array::from_fn(|a| span[1][a].max(at[a]))];
        }
        span
    };
    let (all, own) = (bounds(&|_| true), bounds(&|l| l == label));
    let longest = (0..3).map(|a| all[1][a] - all[0][a]).fold(f64::MIN_POSITIVE, f64::max);
    let middle = |span: &[[f64; 3]; 2], a: usize| 0.5 * (span[0][a] + span[1][a]);
    let point = std::array::from_fn(|a| 1.0 + (middle(&own, a) - middle(&all, a)) / longest);
    (point, std::array::from_fn(|a| 0.5 * (own[1][a] - own[0][a]) / longest))
}
