//! `gprop evaluate objects`: tells the objects of captures apart and compares them with the true ones.

use std::path::{Path, PathBuf};

use crate::error::{Result, UsageError};
use crate::evaluate::EvaluateError;
use crate::evaluate::objects::{FoundObject, ObjectsEvaluation, Overlaps, Truth, compare};
use crate::files;
use crate::files::json;
use crate::parallel;
use crate::scene::{ObjectNumber, Options, StandingObjects, View};

use super::super::{Global, options_of, print};
use super::{check_truth, part_map};

/// The true objects of a scene, and the folder with the map of each photo.
const TRUE_OBJECTS: &str = "ground_truth/objects.json";
const TRUE_MAPS: &str = "ground_truth/object_maps";

pub fn evaluate(global: &Global, scenes: &[PathBuf]) -> Result<()> {
    let one = |folder: &PathBuf| evaluate_one(folder, &options_of(folder, &global.flags.typed)?.scene);
    let all = scenes.iter().map(one).collect::<Result<Vec<_>>>()?;
    print(global, &all, || all.iter().map(ObjectsEvaluation::text).collect::<Vec<_>>().join("\n"))
}

fn evaluate_one(folder: &Path, options: &Options) -> Result<ObjectsEvaluation> {
    let truth = truth(folder, options)?;
    let ids: Vec<u8> = truth.objects.iter().map(|object| object.id).collect();
    let found = StandingObjects::find(folder, options)?;
    let map_of = |view: &View| folder.join(TRUE_MAPS).join(format!("{}.png", view.name));
    let views: Vec<&View> = found.views.iter().filter(|view| map_of(view).exists()).collect();
    if views.is_empty() {
        return Err(EvaluateError::NoMaps { path: folder.join(TRUE_MAPS) }.into());
    }
    let maps = parallel::try_map(&views, |view| -> Result<_> {
        let path = map_of(view);
        check_truth(&path, &options.read_scope(folder))?;
        let map = part_map(&path)?;
        let picture = (view.camera.intrinsics.width, view.camera.intrinsics.height);
        if map.dimensions() != picture {
            let (map, view) = (map.dimensions(), view.name.clone());
            return Err(EvaluateError::MapSize { path, map, view, picture }.into());
        }
        Ok((map, found.shown(&view.camera)))
    })?;
    let mut overlaps = Overlaps::default();
    for (map, labels) in maps {
        overlaps.count(map.as_raw(), &labels, &ids, found.count as u32);
    }
    let object = |number: ObjectNumber| FoundObject { name: number.to_string(), bounds: found.bounds_in_input(number) };
    let objects: Vec<FoundObject> = ObjectNumber::first(found.count).map(object).collect();
    Ok(compare(&found.name, &truth, &objects, &overlaps, found.up.direction, views.len()))
}

fn truth(folder: &Path, options: &Options) -> Result<Truth> {
    let path = folder.join(TRUE_OBJECTS);
    check_truth(&path, &options.read_scope(folder))?;
    let text = files::read(&path).map_err(|error| UsageError(format!("{path:?}: {error}")))?;
    let expected =
        "the true objects: `objects` with id, name and box_axis_aligned_colmap, `up_colmap`, `metres_per_colmap_unit`";
    Ok(json::read(&text).map_err(|source| EvaluateError::Json { path, expected, source })?)
}
