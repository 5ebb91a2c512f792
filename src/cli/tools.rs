//! The commands that run no stages.

use std::path::Path;

use crate::config::{self, in_json};
use crate::error::{Result, UsageError};
use crate::files::write;
use crate::grasp::CalibrationReport;
use crate::grasp::gripper::GripperProfile;
use crate::materials::{MaterialLibrary, check, cli as library, stats};
use crate::scene;
use crate::setup::{self, SetupError};
use crate::{audit, inspect};

use super::{Global, Grasp, Materials, Scale, print, shown};

/// `gprop inspect`.
pub fn inspect(global: &Global, args: &inspect::Args) -> Result<()> {
    let only_chosen = global.flags.typed.iter().any(|flag| config::name_of(flag) == "views");
    let (inspection, text) = inspect::command(args, only_chosen, global.progress())?;
    print(global, &inspection, || text)?;
    inspection.require_aligned()?;
    Ok(inspection.require_up()?)
}

/// `gprop audit`.
pub fn audit(global: &Global, args: &audit::Args) -> Result<()> {
    let report = audit::audit(args)?;
    print(global, &report, || report.text())?;
    Ok(report.require_sound()?)
}

/// `gprop setup`.
pub fn set_up(global: &Global, options: &setup::Options) -> Result<()> {
    setup::obtain(options, global.progress())?;
    doctor(global, options)
}

/// `gprop doctor`.
pub fn doctor(global: &Global, options: &setup::Options) -> Result<()> {
    let found = crate::segment::sam::doctor(options);
    print(global, &found, || found.to_string())?;
    if found.ok { Ok(()) } else { Err(SetupError::Unfit { problems: found.problems.len() }.into()) }
}

/// `gprop grasp calibrate`.
pub fn grasp(global: &Global, what: &Grasp) -> Result<()> {
    let Grasp::Calibrate { points, gripper, plot, profile } = what;
    let mut gripper = GripperProfile::load(gripper)?;
    let report = CalibrationReport::of_file(points, &mut gripper)?;
    if let Some(path) = plot {
        write_text(path, &report.plot())?;
    }
    if let Some(path) = profile {
        write_text(path, &toml::to_string(&gripper)?)?;
    }
    print(global, &report, || report.text())
}

/// `gprop scale`.
pub fn scale(global: &Global, what: &Scale) -> Result<()> {
    let Scale::Board { out, marker } = what;
    write_text(out, &scene::marker_board(&marker.marker, marker.meters))?;
    let drawn = serde_json::json!({ "path": in_json(out), "scale": marker.to_string() });
    print(global, &drawn, || {
        format!(
            "{}: print it at 100 %, measure the black square, and give --scale {marker}, with your measurement after the `=`\n",
            shown(out)
        )
    })
}

fn write_text(path: &Path, text: &str) -> Result<()> {
    let written = write::file(path, |out| out.write_all(text.as_bytes()));
    Ok(written.map_err(|error| UsageError(format!("cannot write {path:?}: {error}")))?)
}

/// `gprop materials`.
pub fn materials(global: &Global, what: &Materials) -> Result<()> {
    match what {
        Materials::Show { name, library: options } => {
            let all = options.library()?;
            let card =
                library::show(&all, name).ok_or_else(|| UsageError(format!("no material has a name like {name:?}")))?;
            print(global, &card, || library::show_text(&all, name).unwrap_or_default())
        }
        Materials::List { family, library: options } => {
            let all = options.library()?;
            let family = family.as_deref();
            let listed = library::list(&all, family).ok_or_else(|| unknown_family(&all, family))?;
            print(global, &listed, || library::list_text(&listed))
        }
        Materials::Check { stats: with_stats, library: options } => {
            let all = options.library()?;
            let (text, fit) = library::check_text(&all, *with_stats);
            let value = serde_json::json!({ "findings": check::check(&all), "stats": stats::stats(&all) });
            print(global, &value, || text)?;
            if fit { Ok(()) } else { Err(UsageError("the library does not pass its checks".to_owned()).into()) }
        }
    }
}

fn unknown_family(library: &MaterialLibrary, family: Option<&str>) -> UsageError {
    let names: Vec<&str> = library.families().iter().map(|family| family.name.as_str()).collect();
    UsageError(format!("there is no family {:?}; the families are {}", family.unwrap_or_default(), names.join(", ")))
}
