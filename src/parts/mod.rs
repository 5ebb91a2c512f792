//! 3D parts: volume, thickness, mass, centre of mass, inertia.
//!
//! In order:
//! 1. [`clean`] removes floaters;
//! 2. [`mod@inside`] finds the object's inside on a [`grid`], from what the views see;
//! 3. [`grid::surface`] measures the depth of each cell, [`assign`] assigns the cell to a part;
//! 4. [`thickness`] measures the thickness of each part;
//! 5. [`compose`] fills the cells with material;
//! 6. [`mass`] computes the mass of each part and its bodies;
//! 7. [`belief`] weighs shapes and materials against what else is known of the object.
//!
//! Of a mesh, steps 1 and 2 are not needed: it says itself what is inside, and what its parts fill, see [`parts_of_mesh`].
//!
//! Steps 1 to 5 are in scene units and need no metric scale except for the walls of shells. In this room a *label* is the index
//! of a part in the field, which Gaussians and cells carry.

mod assign;
mod belief;
mod clean;
mod compose;
mod error;
mod forms;
mod grid;
mod inside;
mod mass;
mod options;
mod result;
pub(crate) mod samples;
mod scale;
mod thin;

use image::GrayImage;
use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::query::Form;
use crate::scene::mesh::solid::Measured;
use crate::units::{Estimate, MetricScale, ScaleSource};
use crate::vote::{Contents, FieldPart, MaterialField};
use crate::words::output::{agreeing, counted};
use crate::words::progress::Progress;
use crate::words::readable::significant;
use assign::{Labelled, Labels};
use belief::Believed;
pub use belief::spread::together as belief_together;
pub use belief::{Possibilities, Possible};
pub(crate) use clean::without_floaters;
use compose::of_mesh::OfMesh;
use compose::sheet;
use compose::thickness::{self, Chord};
use compose::wire::{self, Wire};
use compose::{Composed, Construction, Evidence};
pub use error::PartsError;
use forms::Forms;
pub(crate) use grid::surface::blur;
use grid::surface::{NONE, Surface};
pub use grid::{FILLING, Grid, Interior, OUTSIDE, VOID};
pub use inside::carving_views;
pub use inside::depth_view::DepthView;
use inside::{grid_around, inside};
use mass::bodies::Bodies;
use mass::moments::Moments;
pub use mass::unknowns::Source;
use mass::unknowns::Unknowns;
use mass::weights::{self, Weighing, Weight, Weights};
use mass::{Body, Weighable};
pub use options::{BodiesAs, MassReading, Options, SCENE_KEYS, VolumeMethod};
pub use result::{
    AskedPart, BelievedChoice, BelievedHypothesis, BelievedPart, BelievedThing, Filling, KnownMass, NoVolume, Object,
    ObjectBelief, Part, PartBody, Parts, Width,
};
pub use thin::folded;

/// The result of the parts stage.
#[derive(Debug, Clone, PartialEq)]
pub struct PartsResult {
    /// The object's inside, for the simulation to fill. World frame, scene units.
    pub interior: Interior,
    /// By label of the field, including labels that fill nothing.
    pub shapes: Vec<Shape>,
    /// Messages about what the user should check because masses may be wrong, with counts.
    pub warnings: Vec<String>,
    /// Messages about what the user may want to know, with counts.
    pub notes: Vec<String>,
    parts: Option<Parts>,
}

/// The properties of a part that need no metric scale, in scene units and scene units cubed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shape {
    /// The part id.
    pub id: u32,
    /// Number of Gaussians with its label.
    pub gaussians: usize,
    /// `None` if it fills nothing.
    pub volume: Option<Estimate>,
    /// Why it fills nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_volume: Option<NoVolume>,
    /// Thickness at the surface that a gripper can grasp; `None` if it has no such surface.
    pub thickness: Option<Estimate>,
    /// Distance from the nearest point on its outer surface to the object's centre of mass; `None` if it has no outer
    /// surface.
    pub surface_to_center_of_mass: Option<f64>,
}

impl PartsResult {
    /// Adds warnings.
    fn warn(&mut self, warnings: impl Iterator<Item = String>) {
        let warnings: Vec<String> = warnings.collect();
        if let Some(parts) = &mut self.parts {
            parts.warnings.extend(warnings.iter().cloned());
        }
        self.warnings.extend(warnings);
    }

    /// The parts in metres and kilograms.
    ///
    /// # Errors
    /// [`PartsError::ScaleUnknown`], which says how to give the scale.
    pub fn metric(&self) -> Result<&Parts, PartsError> {
        self.parts.as_ref().ok_or(PartsError::ScaleUnknown)
    }
}

/// What is known of the object besides its shape.
#[derive(Debug, Clone, Copy, Default)]
pub struct Known<'a> {
    pub scale: Option<&'a MetricScale>,
    /// What it and its parts may be, if more is known than the labels of the field say. Without a scale, it is not used.
    pub possible: Option<&'a Possibilities>,
}

impl<'a> From<Option<&'a MetricScale>> for Known<'a> {
    fn from(scale: Option<&'a MetricScale>) -> Self {
        Self { scale, possible: None }
    }
}

/// The views of an object: all of them, not only those that were segmented.
#[derive(Debug, Clone, Copy)]
pub struct Views<'a> {
    pub cameras: &'a [Camera],
    /// For each of them, the share of each pixel of its photo that the object covers (0 to 255), if known: the widths of
    /// wires are measured there.
    pub coverage: &'a [Option<GrayImage>],
}

impl<'a> From<&'a [Camera]> for Views<'a> {
    fn from(cameras: &'a [Camera]) -> Self {
        Self { cameras, coverage: &[] }
    }
}

impl<'a> From<&'a Vec<Camera>> for Views<'a> {
    fn from(cameras: &'a Vec<Camera>) -> Self {
        cameras.as_slice().into()
    }
}

/// Measures the parts of the object that `gaussians` represent, labelled by `field`. Without a scale there are shapes but
/// no masses, and shells count as solid, since the thickness of their walls is known in metres only.
///
/// # Errors
/// If an option is outside its domain, the cloud is empty, not finite or does not match the field, there are no cameras
/// to carve with, nothing is inside, or no part owns any of the inside.
pub fn parts<'a>(
    gaussians: &Gaussians,
    field: &MaterialField,
    views: impl Into<Views<'a>>,
    known: impl Into<Known<'a>>,
    options: &Options,
    progress: Progress,
) -> Result<PartsResult, PartsError> {
    options.check()?;
    check(gaussians, field)?;
    let Views { cameras, coverage } = views.into();
    let kept = without_floaters(gaussians, options.min_body_share);
    let grid = grid_around(gaussians, &kept, options.volume_cells);

    let inside = inside(gaussians, &kept, &grid, cameras, options, progress)?;
    let surface = Surface::of(&grid, &inside.cells);
    let in_view = inside.in_view(&surface);
    let labels = Labels { of_gaussian: &field.part_index, kept: &kept, count: field.parts.len() };
    let cells = assign::assign(gaussians, labels, grid, surface, &in_view);
    let chords = thickness::chords(&cells);
    let silhouettes = inside.silhouettes(cameras, coverage, options);
    // At any scale.
    let is_solid = |label| construction(label, Some(1.0), options, false) == Construction::Solid;
    let is_solid: Vec<bool> = field.parts.iter().map(is_solid).collect();
    let wires = wire::wires(&cells, &is_solid, &chords, &silhouettes, inside.uncertainty);
    let thickness = thickness::thickness(&chords, labels.count);
    let sheets = sheet::Measured::nothing(cells.label.len());
    let evidence = Evidence { uncertainty: inside.uncertainty, wires, sheets, mesh: None };
    weigh(gaussians, field, Found { kept, cells, chords, thickness, evidence }, known.into(), options)
}

/// Measures the parts of a mesh, on whose surface the `gaussians` lie, labelled by `field`. Its volumes are its own: see
/// [`compose`]. Without a scale it is as for [`parts`].
///
/// # Errors
/// As for [`parts`].
pub fn parts_of_mesh<'a>(
    gaussians: &Gaussians,
    field: &MaterialField,
    mesh: &Measured,
    known: impl Into<Known<'a>>,
    options: &Options,
) -> Result<PartsResult, PartsError> {
    options.check()?;
    check(gaussians, field)?;
    // No Gaussian of a mesh floats.
    let kept = vec![true; gaussians.len()];
    let labels = Labels { of_gaussian: &field.part_index, kept: &kept, count: field.parts.len() };
    let grid = inside::mesh::grid_around_mesh(mesh, options.volume_cells);
    let on_grid = inside::mesh::fill(mesh, &grid);
    if !on_grid.cells.contains(&true) {
        return Err(PartsError::MeshTooThin);
    }
    let surface = Surface::of(&grid, &on_grid.cells);
    let in_view = vec![true; surface.cells.len()];
    let mut cells = assign::assign(gaussians, labels, grid, surface, &in_view);
    assign::keep_to_bodies(&mut cells, gaussians, labels, mesh);
    let chords = thickness::chords(&cells);
    let wires = on_grid.share.iter().map(|share| Wire { share: *share, error: 0.0 }).collect();
    let of_mesh = OfMesh::of(mesh, on_grid, &cells, labels.count);
    let of_cells = thickness::thickness(&chords, labels.count);
    let thickness = of_cells.into_iter().enumerate().map(|(label, of_cells)| of_mesh.thickness(label, of_cells));
    let thickness = thickness.collect();
    let sheets = sheet::Measured::nothing(cells.label.len());
    let evidence = Evidence { uncertainty: 0.0, wires, sheets, mesh: Some(of_mesh) };
    let mut result =
        weigh(gaussians, field, Found { kept, cells, chords, thickness, evidence }, known.into(), options)?;
    result.warn(mesh.solid.doubts.iter().map(|doubt| format!("the mesh: {doubt}")));
    Ok(result)
}

/// The cells of an object, divided among its parts, and what is known of them.
struct Found {
    /// Per Gaussian, whether it is of the object.
    kept: Vec<bool>,
    cells: Labelled,
    /// Per surface cell.
    chords: Vec<Option<Chord>>,
    /// Per label, scene units.
    thickness: Vec<Option<Estimate>>,
    evidence: Evidence,
}

impl Found {
    /// How to fill the volume of each label.
    fn constructions(
        &self,
        labels: &[FieldPart],
        meters_per_unit: Option<f64>,
        options: &Options,
    ) -> Vec<Construction> {
        labels.iter().enumerate().map(|(l, label)| self.construction(l, label, meters_per_unit, options)).collect()
    }

    /// How to fill the volume of the label with this index.
    fn construction(
        &self,
        l: usize,
        label: &FieldPart,
        meters_per_unit: Option<f64>,
        options: &Options,
    ) -> Construction {
        let mesh = self.evidence.mesh.as_ref();
        let answered = construction(label, meters_per_unit, options, mesh.is_some_and(OfMesh::is_sheet));
        mesh.map_or(answered, |mesh| mesh.construction(l, answered))
    }

    /// The labels filled as `constructions` say.
    fn built(&self, field: &MaterialField, labels: Vec<FieldPart>, constructions: Vec<Construction>) -> Built {
        let (composed, cells) = compose::compose(self.cells.clone(), &constructions, &self.chords, &self.evidence);
        let shapes = shapes(&labels, &field.part_index, &composed, &cells, &constructions, &self.thickness);
        Built { labels, constructions, composed, cells, shapes }
    }
}

/// The object, filled with material.
struct Built {
    labels: Vec<FieldPart>,
    /// Per label, like `shapes`.
    constructions: Vec<Construction>,
    composed: Composed,
    cells: Labelled,
    shapes: Vec<Shape>,
}

impl Built {
    /// The labels that Gaussians have, each with its `bodies`.
    fn weighables<'a>(&'a self, bodies: &'a [Vec<Body>]) -> Vec<Weighable<'a>> {
        self.used().map(|l| self.weighable(l, &self.labels[l], &bodies[l])).collect()
    }

    /// A label of the same construction as the one with this index, in its place.
    fn weighable<'a>(&'a self, l: usize, label: &'a FieldPart, bodies: &'a [Body]) -> Weighable<'a> {
        let Self { labels, constructions, composed, shapes, .. } = self;
        Weighable {
            shape: &shapes[l],
            label,
            volume: &composed.volumes[l],
            bodies,
            is_wall: constructions[l] != Construction::Solid,
            sleeve: only((0..shapes.len()).filter(|shell| composed.cores[*shell] == Some(l as u32)))
                .map(|shell| labels[shell].id),
            hollow: composed.hollows[l].as_ref(),
        }
    }

    /// The indices of the labels that Gaussians have.
    fn used(&self) -> impl Iterator<Item = usize> {
        (0..self.shapes.len()).filter(|&l| self.is_used(l))
    }

    /// Whether Gaussians have the label with this index.
    fn is_used(&self, l: usize) -> bool {
        self.shapes[l].gaussians > 0
    }
}

/// Fills the cells and weighs the parts.
fn weigh(
    gaussians: &Gaussians,
    field: &MaterialField,
    found: Found,
    Known { scale, possible }: Known,
    options: &Options,
) -> Result<PartsResult, PartsError> {
    let (meters_per_unit, scaled) = scale_of(field, &found, scale, options);
    let possible = possible.filter(|possible| meters_per_unit.is_some() && possible.most_choices() > 0);
    let believed = possible.map(|possible| believed(field, &found, possible, scaled, options));
    let (believed, most_probable) = believed.unzip();
    let labels = possible.zip(believed.as_ref()).map(|(possible, of)| possible.parts_taken(field, &of.taken));
    let labels = labels.unwrap_or_else(|| field.parts.clone());
    let constructions = found.constructions(&labels, meters_per_unit, options);
    let mut warnings = unfilled(&found, &labels, meters_per_unit, options, &constructions);
    let mut built = match most_probable.filter(|built| built.constructions == constructions) {
        Some(built) => Built { labels, ..built },
        None => found.built(field, labels, constructions),
    };

    let connected = Bodies::of(&built.composed.interior, built.constructions.len());
    let mut bodies = bodies(&built.composed, &connected, &built.shapes, gaussians, &field.part_index);
    let mut weights = Weights::new(&built.weighables(&bodies), scaled);
    let weighing = meters_per_unit.and(options.weighing());
    let known_mass = weighing.map(|weighing| known_mass(weighing, &weights, believed.as_ref()));
    let weighing = weighing.filter(|_| known_mass.as_ref().is_some_and(|known| known.is_possible));
    weigh_together(&mut weights, believed.as_ref(), weighing);
    let whole = weights.whole(&built.weighables(&bodies));
    let whole = whole.ok_or_else(|| no_volume(&built.labels, &built.shapes))?;
    set_distances(&mut built.shapes, &mut bodies, &connected, &built.cells, whole.center);
    let floaters = (0..found.kept.len()).filter(|&i| !found.kept[i] && !gaussians.is_set_aside(i)).count();
    let is_shell = |label| construction(label, Some(1.0), options, false) != Construction::Solid;
    let lacks_walls = meters_per_unit.is_none() && built.labels.iter().any(is_shell);
    warnings.extend(self::warnings(&built, field, floaters, lacks_walls));
    let enclosed_m3 = enclosed(&built.cells) * meters_per_unit.unwrap_or(1.0).powi(3);
    warnings.extend(known_mass.as_ref().and_then(|known| known.problem(enclosed_m3)));
    let notes = notes(&built, field, floaters, options.min_part_share);
    let parts = meters_per_unit.map(|_| {
        let (parts, fillings) = weighed(&weights, &built.weighables(&bodies), options);
        let mut parts = Parts {
            object: mass::object(&weights, &whole),
            parts,
            fillings,
            known_mass,
            belief: None,
            meters_per_unit: weights.uncertain_scale(),
            estimated_scale: scale.filter(|scale| scale.source == ScaleSource::Estimated).map(|s| s.provenance.clone()),
            warnings: warnings.clone(),
            notes: notes.clone(),
        };
        match believed {
            Some(of) if weighing.is_some() => parts.belief = Some(of.object),
            Some(of) => of.give(&mut parts, &built.labels),
            None => {}
        }
        parts
    });
    Ok(PartsResult { interior: built.composed.interior, shapes: built.shapes, warnings, notes, parts })
}

/// Metres per unit, by the scale or else by the known mass, and the scale for weighing.
fn scale_of(
    field: &MaterialField,
    found: &Found,
    scale: Option<&MetricScale>,
    options: &Options,
) -> (Option<f64>, weights::Scale) {
    if let Some(MetricScale { meters_per_unit, range, .. }) = scale {
        return (Some(*meters_per_unit), weights::Scale { meters_per_unit: *meters_per_unit, range: *range });
    }
    let of_mass = options.reading_kg().and_then(|kg| {
        let build = |meters| found.constructions(&field.parts, Some(meters), options);
        scale::meters_per_unit(kg, &found.cells, &found.chords, &found.evidence, &field.parts, build)
    });
    (of_mass, weights::Scale::to_be_found(of_mass.unwrap_or(1.0)))
}

/// What is believed of an object that, with its parts, may be several things, and the object built of its most probable forms.
fn believed(
    field: &MaterialField,
    found: &Found,
    possible: &Possibilities,
    scale: weights::Scale,
    options: &Options,
) -> (Believed, Built) {
    let mut unknowns = Unknowns::default();
    let states = belief::states(possible);
    let forms = Forms::of(field, found, possible, scale.meters_per_unit, options);
    let mut most_probable = None;
    let mut weighed = Vec::new();
    for of_labels in forms.to_build(&states) {
        let built = forms.built(&of_labels);
        weighed.push(forms.weighed(&built, of_labels, scale, &mut unknowns));
        most_probable.get_or_insert(built);
    }
    let evidence = belief::Evidence {
        possible,
        labels: &field.parts,
        masses_by_shape: &|choices| forms.masses(&weighed, choices),
        weighing: options.weighing(),
    };
    let believed = belief::believe(&evidence, states, &mut unknowns);
    (believed, most_probable.expect("there is a state"))
}

/// The solid parts with their masses, and the fillings.
fn weighed(weights: &Weights, weighables: &[Weighable], options: &Options) -> (Vec<Part>, Vec<Filling>) {
    let (fillings, solids): (Vec<&Weight>, Vec<&Weight>) = weights.all.iter().partition(|weight| weight.is_filling);
    let parts_of = |weight: &&Weight| weighables[weight.of].parts(weights, weight, options.bodies);
    let filling_of = |weight: &&Weight| weighables[weight.of].filling_part(weights, weight);
    (solids.iter().flat_map(parts_of).collect(), fillings.iter().filter_map(filling_of).collect())
}

/// The volume within the object's surface, in cubed scene units.
fn enclosed(cells: &Labelled) -> f64 {
    cells.label.iter().filter(|label| **label != NONE).count() as f64 * cells.grid.cell_volume()
}

/// The item, if it is the only one.
fn only<T>(mut items: impl Iterator<Item = T>) -> Option<T> {
    items.next().filter(|_| items.next().is_none())
}

/// What a kitchen scale shows, compared with what is expected.
fn known_mass(weighing: Weighing, weights: &Weights, believed: Option<&Believed>) -> KnownMass {
    let read = believed.and_then(|believed| Some((believed.mass_kg, believed.reading?.possible_kg)));
    let (expected_kg, possible_kg) = read.unwrap_or_else(|| (weights.expected(), weights.bounds()));
    KnownMass::new(weighing, expected_kg, possible_kg)
}

/// Shares out the mass of the whole among everything that is uncertain: the one that a kitchen scale shows, or else the one that is
/// believed.
fn weigh_together(weights: &mut Weights, believed: Option<&Believed>, weighing: Option<Weighing>) {
    if let Some(contents) = believed.and_then(|believed| believed.contents) {
        weights.print(contents);
    }
    match (weighing, believed) {
        (Some(weighing), _) => weights.weigh(weighing, believed.map_or(&[], |believed| &believed.unseen)),
        (None, Some(believed)) => weights.believe(believed.together_kg()),
        (None, None) => {}
    }
}

/// Per label, its bodies, which together have its volume.
fn bodies(
    Composed { interior, crowded_out, .. }: &Composed,
    connected: &Bodies,
    shapes: &[Shape],
    gaussians: &Gaussians,
    part_index: &[u32],
) -> Vec<Vec<Body>> {
    let shares = interior.filled().map(|(i, _, share)| (i, connected.of_cell[i] as usize, share));
    let moments = Moments::of(&interior.grid, shares, connected.label.len());
    let counts = connected.gaussians(gaussians, part_index, &interior.grid);
    let mut filled = vec![0.0; shapes.len()];
    for (label, moments) in connected.label.iter().zip(&moments) {
        filled[*label as usize] += moments.map_or(0.0, |m| m.volume);
    }
    let mut bodies: Vec<Vec<Body>> = shapes.iter().map(|_| Vec::new()).collect();
    for ((label, moments), gaussians) in connected.label.iter().zip(moments).zip(counts) {
        let label = *label as usize;
        if let Some(moments) = moments {
            let whole = shapes[label].volume.map_or(0.0, |volume| volume.mid);
            let volume = whole * moments.volume / filled[label];
            let moments = moments.with_volume(volume);
            bodies[label].push(Body { moments, gaussians, surface_to_center_of_mass: None });
        }
    }
    for (label, moments) in crowded_out.iter().enumerate() {
        if let (Some(moments), Some(volume)) = (moments, shapes[label].volume) {
            let (moments, gaussians) = (moments.with_volume(volume.mid), shapes[label].gaussians);
            bodies[label].push(Body { moments, gaussians, surface_to_center_of_mass: None });
        }
    }
    bodies
}

fn check(gaussians: &Gaussians, field: &MaterialField) -> Result<(), PartsError> {
    if gaussians.is_empty() {
        return Err(PartsError::NoGaussians);
    }
    if field.part_index.len() != gaussians.len() {
        return Err(PartsError::FieldSize { field: field.part_index.len(), gaussians: gaussians.len() });
    }
    let labels = field.parts.len();
    if let Some(gaussian) = field.part_index.iter().position(|&l| l as usize >= labels) {
        return Err(PartsError::Label { gaussian, label: field.part_index[gaussian], labels });
    }
    let is_finite = |i: usize| {
        gaussians.positions[i].iter().all(|v| v.is_finite()) && gaussians.scale(i).iter().all(|s| s.is_finite())
    };
    match (0..gaussians.len()).find(|&i| !is_finite(i)) {
        Some(gaussian) => Err(PartsError::NotFinite { gaussian }),
        None => Ok(()),
    }
}

/// How to fill a label's volume by its answer. `is_sheet`: it is part of a mesh that bounds nothing.
fn construction(label: &FieldPart, meters_per_unit: Option<f64>, options: &Options, is_sheet: bool) -> Construction {
    let wall_m = match (options.volume, label.form) {
        (VolumeMethod::Hybrid, Form::Solid | Form::Mixed) if is_sheet => Some(options.sheet_m()),
        (VolumeMethod::Fill | VolumeMethod::Carve, _) | (VolumeMethod::Hybrid, Form::Solid | Form::Mixed) => None,
        (VolumeMethod::Shell, Form::Solid | Form::Mixed) => Some(Estimate::exactly(options.wall_m)),
        (_, Form::Shell { wall_thickness_m }) => Some(Estimate::from(wall_thickness_m)),
    };
    match (wall_m, meters_per_unit) {
        (Some(wall), Some(scale)) => {
            let filled = match &label.inside {
                Some(Contents::Filled(filled)) => Some(filled.share),
                _ => None,
            };
            Construction::Wall { thickness: wall.scaled(1.0 / scale), filled }
        }
        _ => Construction::Solid,
    }
}

/// Messages about what the mesh shows otherwise than the answers say.
fn unfilled(
    found: &Found,
    labels: &[FieldPart],
    meters_per_unit: Option<f64>,
    options: &Options,
    constructions: &[Construction],
) -> Vec<String> {
    let Some(mesh) = &found.evidence.mesh else { return Vec::new() };
    let of_label = |(l, label): (usize, &FieldPart)| {
        let answered = construction(label, meters_per_unit, options, false);
        match (answered, constructions[l]) {
            (Construction::Wall { filled: Some(_), .. }, Construction::Solid) => Some(format!(
                "the mesh has both sides of the wall of {:?}, so what is in it is not weighed; if it is full, remove the inner \
                 side from the mesh, or use --volume carve",
                label.caption
            )),
            (Construction::Solid, Construction::Wall { .. }) if mesh.is_sheet() => {
                let Estimate { low, high, .. } = options.sheet_m().scaled(1e3);
                Some(format!(
                    "the mesh is a sheet without thickness, and the answer about {:?} gives none: {} to {} mm is assumed; set \
                     another one with --wall-m",
                    label.caption,
                    significant(low),
                    significant(high)
                ))
            }
            _ => None,
        }
    };
    labels.iter().enumerate().filter_map(of_label).collect()
}

fn shapes(
    labels: &[FieldPart],
    part_index: &[u32],
    composed: &Composed,
    cells: &assign::Labelled,
    constructions: &[Construction],
    thickness: &[Option<Estimate>],
) -> Vec<Shape> {
    let mut gaussians = vec![0; constructions.len()];
    part_index.iter().for_each(|&l| gaussians[l as usize] += 1);
    let mut owns_places = vec![false; constructions.len()];
    cells.label.iter().filter(|&&l| l != NONE).for_each(|&l| owns_places[l as usize] = true);
    let shape = |l: usize| {
        let volume = Some(composed.volumes[l].interval()).filter(|volume| volume.mid > 0.0);
        let why = if owns_places[l] { NoVolume::NoMaterial } else { NoVolume::OwnsNoPlace };
        Shape {
            id: labels[l].id,
            gaussians: gaussians[l],
            volume,
            no_volume: volume.is_none().then_some(why),
            thickness: match constructions[l] {
                Construction::Wall { thickness, .. } => volume.and(Some(thickness)),
                Construction::Solid => thickness[l],
            },
            surface_to_center_of_mass: None,
        }
    };
    (0..constructions.len()).map(shape).collect()
}

/// Sets the distance from each part's and each body's surface to the object's centre of mass.
fn set_distances(
    shapes: &mut [Shape],
    bodies: &mut [Vec<Body>],
    connected: &Bodies,
    cells: &assign::Labelled,
    center: Point3<f64>,
) {
    let places = connected.places(shapes.len());
    let lower = |known: &mut Option<f64>, distance: f64| *known = Some(known.map_or(distance, |d| d.min(distance)));
    for s in (0..cells.surface.cells.len()).filter(|&s| cells.seen[s]) {
        let (cell, distance) = (cells.surface.cells[s] as usize, (cells.surface.points[s] - center).norm());
        lower(&mut shapes[cells.label[cell] as usize].surface_to_center_of_mass, distance);
        // A cell of a sleeve may be filled by the solid inside it, whose surface this is not.
        let body = places.get(connected.of_cell[cell] as usize);
        if let Some((label, place)) = body.filter(|(label, _)| *label == cells.label[cell] as usize) {
            lower(&mut bodies[*label][*place].surface_to_center_of_mass, distance);
        }
    }
}

fn caption<'a>(labels: &'a [FieldPart], shape: &Shape) -> &'a str {
    labels.iter().find(|label| label.id == shape.id).map_or("", |label| &label.caption)
}

/// The error that no part has a volume, with the reason for each.
fn no_volume(labels: &[FieldPart], shapes: &[Shape]) -> PartsError {
    let used: Vec<&Shape> = shapes.iter().filter(|shape| shape.gaussians > 0).collect();
    let why = used.iter().filter_map(|shape| {
        let (name, count) = (caption(labels, shape), shape.gaussians);
        shape.no_volume.map(|why| format!("{name:?} ({}) {why}", counted(count, "Gaussian")))
    });
    PartsError::NoVolume { parts: used.len(), why: why.collect::<Vec<_>>().join("; ") }
}

/// Up to this share of an object's Gaussians may have no volume without changing a mass that matters.
const FEW: f64 = 0.001;
/// Clouds have floaters; up to this share of the Gaussians, they are not a sign of a second object.
const USUAL_FLOATERS: f64 = 0.01;

fn is_few(gaussians: usize, field: &MaterialField) -> bool {
    gaussians as f64 <= FEW * field.part_index.len() as f64
}

fn are_usual(floaters: usize, field: &MaterialField) -> bool {
    floaters as f64 <= USUAL_FLOATERS * field.part_index.len() as f64
}

/// Messages about what may make the masses wrong, and what to do. `lacks_walls`: some parts would be walls, but have none
/// because the scale is unknown.
fn warnings(built: &Built, field: &MaterialField, floaters: usize, lacks_walls: bool) -> Vec<String> {
    let Built { labels, shapes, .. } = built;
    let mut warnings = Vec::new();
    if !are_usual(floaters, field) {
        let all = field.part_index.len();
        warnings.push(format!(
            "{floaters} of {all} Gaussians ({:.1} %) float off the object and are not counted in any volume; if they \
             belong to it, lower --min-body-share",
            100.0 * floaters as f64 / all as f64
        ));
    }
    for (shape, why) in without_volume(shapes).filter(|(shape, _)| !is_few(shape.gaussians, field)) {
        let (name, count) = (caption(labels, shape), shape.gaussians);
        warnings.push(format!(
            "part {name:?} ({}) {why}, so it has no volume and no mass; if it belongs to the object, check whether its \
             pictures in the report show it",
            counted(count, "Gaussian")
        ));
    }
    if lacks_walls {
        warnings.push(
            "wall thicknesses are known only in metres, so shells count as solid; give --scale or --known-mass"
                .to_owned(),
        );
    }
    warnings
}

/// The parts with Gaussians but without a volume, and why.
fn without_volume(shapes: &[Shape]) -> impl Iterator<Item = (&Shape, NoVolume)> {
    shapes.iter().filter(|shape| shape.gaussians > 0).filter_map(|shape| Some((shape, shape.no_volume?)))
}

/// Messages about assumptions, and about specks that change no mass that matters.
fn notes(built: &Built, field: &MaterialField, floaters: usize, min_part_share: f64) -> Vec<String> {
    let Built { labels, constructions, composed, shapes, .. } = built;
    let caption_of = |label: u32| &labels[label as usize].caption;
    let mut notes = Vec::new();
    if floaters > 0 && are_usual(floaters, field) {
        let count = field.part_index.len();
        let float = agreeing(floaters, "floats off the object and is", "float off the object and are");
        notes.push(format!("{floaters} of {count} Gaussians {float} not counted in any volume"));
    }
    for (shape, why) in without_volume(shapes).filter(|(shape, _)| is_few(shape.gaussians, field)) {
        let (name, count) = (caption(labels, shape), shape.gaussians);
        notes.push(format!(
            "part {name:?} ({count} of {} Gaussians) {why}, so it has no volume and no mass",
            field.part_index.len()
        ));
    }
    let volumes = || shapes.iter().filter_map(|shape| Some((shape, shape.volume?.mid)));
    let whole: f64 = volumes().map(|(_, volume)| volume).sum();
    for (shape, volume) in volumes().filter(|(_, volume)| *volume < min_part_share * whole) {
        let (name, percent) = (caption(labels, shape), 100.0 * volume / whole);
        notes.push(format!(
            "part {name:?} is {} % of the object's volume: a small detail, or a speck left by a wrong answer",
            significant(percent)
        ));
    }
    if composed.is_mirrored {
        notes.push("the side that no view shows is assumed to be like the opposite one".to_owned());
    }
    let is_hollow =
        |l: usize| constructions[l] != Construction::Solid && shapes[l].volume.is_some() && composed.cores[l].is_none();
    let unknown = labels.iter().enumerate().filter(|(_, label)| label.inside == Some(Contents::Unknown));
    for (_, label) in unknown.filter(|(l, _)| is_hollow(*l)) {
        notes.push(format!("the inside of {:?} is unknown, so the part is weighed as empty", label.caption));
    }
    for (shell, core) in composed.cores.iter().enumerate() {
        if let Some(core) = core {
            let (shell, core) = (caption_of(shell as u32), caption_of(*core));
            notes.push(format!("{core:?} is assumed to continue inside {shell:?}, where no view sees it"));
        }
    }
    for (peg, through) in &composed.passages {
        notes.push(format!(
            "{:?} is assumed to go through {:?}, where no view sees it",
            caption_of(*peg),
            caption_of(*through)
        ));
    }
    notes
}
