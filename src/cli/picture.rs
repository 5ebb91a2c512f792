//! `gprop segment PICTURE`: the segments of one picture without a scene.

use crate::config::in_json;
use crate::error::{Result, UsageError};
use crate::pipeline::picture::Picture;
use crate::words::output::counted;
use crate::workdir::Artifact;

use super::{Global, SceneArgs, WorkArgs, print, shown};

/// Segments the picture that `args` name and writes the same files as for a view of a scene, into `--out` or a folder
/// beside it.
pub fn segment(global: &Global, args: &SceneArgs) -> Result<()> {
    check_from(&args.work)?;
    let (path, out, options) = (&args.scene, args.work.out.as_deref(), args.work.options.clone());
    if args.work.dry_run {
        let done = Picture::is_segmented(path, None, out, &options)?;
        let text = if done { "segment   done" } else { "segment   to do" };
        return print(global, &serde_json::json!({ "segmented": done }), || text.to_owned());
    }
    let picture = Picture::open(path, None, out, options, global.progress())?;
    let segments = picture.segments()?;
    if !global.prints_summary() {
        return Ok(());
    }
    let result = serde_json::json!({
        "picture": in_json(path),
        "width": segments.map.width,
        "height": segments.map.height,
        "segments": segments.segments,
    });
    print(global, &result, || {
        let map = picture.work().path(Artifact::LabelMap(&segments.view));
        format!("{} in {}", counted(segments.segments.len(), "segment"), shown(&map))
    })
}

/// Refuses `--from`, because only a scene has stages.
pub fn check_from(work: &WorkArgs) -> Result<(), UsageError> {
    match work.from {
        Some(_) => Err(UsageError("--from is for the stages of a scene; leave it out for a single picture".to_owned())),
        None => Ok(()),
    }
}
