//! PhysGaussian (Xie et al., 2024): a model folder as its loader expects it, with the additional columns that its forks
//! read for each Gaussian, and a configuration with the keys of its `utils/decode_param.py`.
//!
//! Numbers are SI. PhysGaussian scales the simulated object to a box of side 1 and uses E, density and g unchanged: the
//! object then moves like one that is 1 m long. E in the configuration is reduced to a value at which its explicit
//! steps are stable; the PLY keeps the true one.

use serde_json::{Value, json};

use super::{ExportError, Files, Model};
use crate::materials::Law;
use crate::scene::ply;
use crate::simulate;
use crate::vote::{FieldLabel, field_ply};

/// The path where 3DGS puts a trained cloud and PhysGaussian looks for it.
const CLOUD: &str = "point_cloud/iteration_30000/point_cloud.ply";
/// The columns, in the order used by the forks.
const COLUMNS: [&str; 6] = ["part_label", "density", "E", "nu", "material_id", "conf"];
/// Number of cells along each side of its grid, which has side 2.
const GRID: u32 = 50;
/// Length of a step as a share of the time in which the fastest wave crosses a cell.
const CFL: f64 = 0.4;
const FRAME_S: f64 = 1e-2;

pub(super) fn write(model: &Model, files: &mut Files) -> Result<(), ExportError> {
    let config = config(model);
    files.write("config.json", |out| {
        serde_json::to_writer_pretty(&mut *out, &config)?;
        out.write_all(b"\n")
    })?;
    let all = field_ply::columns(model.field);
    let columns: Vec<_> = COLUMNS.iter().filter_map(|name| all.iter().find(|c| c.name == *name).cloned()).collect();
    let bare = crate::scene::gaussians::Gaussians { extra: Vec::new(), ..model.gaussians.clone() };
    files.write(CLOUD, |out| ply::write(out, &bare, &columns))
}

/// The configuration for the label with the most Gaussians, with a separate box for every other label.
fn config(model: &Model) -> Value {
    let labels = &model.field.labels;
    let mut count = vec![0usize; labels.len()];
    model.field.part_label.iter().for_each(|&l| count[l as usize] += 1);
    let main = (0..labels.len()).rev().max_by_key(|&l| count[l]).unwrap_or(0);
    let boxes = (0..labels.len()).filter(|&l| l != main && count[l] > 0).map(|l| {
        let (point, size) = box_in_unit_space(model, l as u32);
        let label = &labels[l];
        json!({ "point": point, "size": size, "E": softened(label), "nu": nu(label), "density": label.density_kg_m3.mid })
    });
    let boxes: Vec<Value> = boxes.collect();
    let step = labels.iter().map(step_s).fold(FRAME_S, f64::min);
    json!({
        "material": material(labels[main].law),
        "E": softened(&labels[main]),
        "nu": nu(&labels[main]),
        "density": labels[main].density_kg_m3.mid,
        "g": [0.0, 0.0, -crate::units::GRAVITY_M_S2],
        "n_grid": GRID,
        "grid_lim": 2.0,
        "substep_dt": FRAME_S / (FRAME_S / step).ceil(),
        "frame_dt": FRAME_S,
        "frame_num": 100,
        "opacity_threshold": 0.02,
        "rotation_degree": [],
        "rotation_axis": [],
        "additional_material_params": boxes,
        "boundary_conditions": [{ "type": "bounding_box" }],
        "mpm_space_vertical_upward_axis": [0, 0, 1],
        "mpm_space_viewpoint_center": [1, 1, 1],
        "default_camera_index": 0,
    })
}

fn softened(label: &FieldLabel) -> f64 {
    label.youngs_modulus_pa.mid.min(simulate::material::SOFT_PA)
}

fn nu(label: &FieldLabel) -> f64 {
    label.poisson_ratio.mid.min(simulate::material::POISSON_CAP)
}

/// The longest step that the pressure wave, c^2 = E (1 - nu) / ((1 + nu) (1 - 2 nu) rho), allows.
fn step_s(label: &FieldLabel) -> f64 {
    let (e, nu) = (softened(label), nu(label));
    let modulus = e * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu));
    CFL * 2.0 / f64::from(GRID) / (modulus / label.density_kg_m3.mid).sqrt()
}

/// Centre and half sides of the box around a label's Gaussians in PhysGaussian's space: the cloud scaled so that its
/// longest side is 1, the middle of its box at (1, 1, 1).
fn box_in_unit_space(model: &Model, label: u32) -> ([f64; 3], [f64; 3]) {
    let bounds = |wanted: &dyn Fn(u32) -> bool| {
        let mut span = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let positions = model.gaussians.positions.iter().zip(&model.field.part_label);
        for (position, _) in positions.filter(|(_, label)| wanted(**label)) {
            for axis in 0..3 {
                let at = f64::from(position[axis]);
                (span[0][axis], span[1][axis]) = (span[0][axis].min(at), span[1][axis].max(at));
            }
        }
        span
    };
    let (all, own) = (bounds(&|_| true), bounds(&|l| l == label));
    let longest = (0..3).map(|a| all[1][a] - all[0][a]).fold(f64::MIN_POSITIVE, f64::max);
    let middle = |span: &[[f64; 3]; 2], a: usize| 0.5 * (span[0][a] + span[1][a]);
    let point = std::array::from_fn(|a| 1.0 + (middle(&own, a) - middle(&all, a)) / longest);
    (point, std::array::from_fn(|a| 0.5 * (own[1][a] - own[0][a]) / longest))
}

/// The name of the law that is nearest to gprop's.
fn material(law: Law) -> &'static str {
    match law {
        Law::Elastic | Law::Fluid => "jelly",
        Law::VonMises { .. } => "metal",
        Law::DruckerPrager { .. } => "sand",
        Law::Foam { .. } => "foam",
        Law::Snow { .. } => "snow",
        Law::Plasticine { .. } => "plasticine",
    }
}
