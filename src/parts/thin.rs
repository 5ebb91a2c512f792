//! Parts that lie flat on others, too thin to be measured: what was found where the answer about the object names something without a
//! number. The volume below them is that of the parts on which they lie, and they weigh what the answer says.

use nalgebra::Vector3;

use super::{NoVolume, Part, PartsResult};
use crate::gaussians::Gaussians;
use crate::units::MetricScale;
use crate::vote::{FieldPart, MaterialField};

/// The field as it is measured. `below` has, for every Gaussian of a thin part, the label of the part on which it lies.
pub fn folded(field: &MaterialField, below: &[Option<u32>]) -> MaterialField {
    let part_index = field.part_index.iter().zip(below).map(|(label, below)| below.unwrap_or(*label)).collect();
    MaterialField { part_index, ..field.clone() }
}

impl PartsResult {
    /// The result of a field that was [`folded`], with the thin parts.
    pub fn with_thin(
        mut self,
        gaussians: &Gaussians,
        field: &MaterialField,
        below: &[Option<u32>],
        scale: Option<&MetricScale>,
    ) -> Self {
        let of_weighing = self.parts.as_ref().and_then(|parts| parts.meters_per_unit).map(|scale| scale.mid);
        let meters = of_weighing.or(scale.map(|scale| scale.meters_per_unit)).unwrap_or(1.0);
        for (label, part) in field.parts.iter().enumerate() {
            let is_its = |i: &usize| below[*i].is_some() && field.part_index[*i] as usize == label;
            let own: Vec<Vector3<f64>> = (0..below.len()).filter(is_its).map(|i| gaussians.center(i).coords).collect();
            if !own.is_empty() {
                let center = own.iter().sum::<Vector3<f64>>() / own.len() as f64;
                self.add_thin(label, part, own.len(), center * meters);
            }
        }
        self
    }

    fn add_thin(&mut self, label: usize, of: &FieldPart, count: usize, center_m: Vector3<f64>) {
        let shape = &mut self.shapes[label];
        shape.gaussians = count;
        shape.no_volume = Some(NoVolume::TooThin);
        let Some(parts) = &mut self.parts else { return };
        let mut things = parts.belief.iter().flat_map(|belief| &belief.unnumbered);
        let thing = things.find(|thing| thing.part == Some(of.id));
        let part = Part {
            id: of.id,
            caption: of.caption.clone(),
            material: of.material.clone(),
            family: of.family.clone(),
            corrected: of.corrected.clone(),
            gaussians: count,
            volume_m3: None,
            no_volume: Some(NoVolume::TooThin),
            thickness_m: None,
            is_wall: false,
            density_kg_m3: of.density_kg_m3,
            mass_kg: thing.map(|thing| thing.mass_kg.geometric_estimate()),
            width: Vec::new(),
            center_of_mass_m: Some(center_m.into()),
            inertia_kg_m2: None,
            bodies: Vec::new(),
            surface_to_center_of_mass_m: None,
        };
        let place = parts.parts.partition_point(|other| other.id < part.id);
        parts.parts.insert(place, part);
    }
}
