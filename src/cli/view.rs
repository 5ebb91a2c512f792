//! `gprop report` and `gprop view`: the report in the browser.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::batch;
use crate::error::{Result, UsageError};
use crate::pipeline::{Stage, work_folder, work_folder_of};
use crate::words::shell;
use crate::workdir::{self, Artifact};

use super::objects::{self, Run};
use super::{Global, ReportArgs, ViewArgs, print_path};

/// The program that opens a file with the user's default application for its type.
const OPENER: &str = if cfg!(target_os = "macos") { "open" } else { "xdg-open" };

/// `gprop report`: every stage, then the report in the browser if the user wants it there.
pub fn report(global: &Global, args: &ReportArgs) -> Result<()> {
    let (folder, work) = (&args.scene.scene, &args.scene.work);
    objects::run(global, folder, work, Run { to: Stage::Report, simulates: !args.no_simulate, for_python: None })?;
    if args.open && !work.dry_run {
        let root = work_folder_of(folder, work.out.as_deref(), work.options.scene.object)?;
        let pages = [Artifact::ReportHtml, Artifact::ObjectsPage].map(|page| root.join(page.path()));
        pages.iter().find(|page| page.is_file()).into_iter().for_each(|page| open(page));
    }
    Ok(())
}

/// `gprop view`: the page that an earlier run or batch left.
pub fn view(global: &Global, args: &ViewArgs) -> Result<()> {
    let page = page_of(&args.folder)?;
    let mut below_folder = page.ancestors().take_while(|path| *path != args.folder);
    below_folder.try_for_each(|path| workdir::refuse_link(path, "`gprop view`"))?;
    open(&page);
    print_path(global, &page)
}

/// The page in a scene, a work folder, a folder of scenes or the folder that a batch was given by `--out`.
fn page_of(folder: &Path) -> Result<PathBuf, UsageError> {
    let of_work = [Artifact::ReportHtml, Artifact::ObjectsPage].map(|page| page.path());
    let roots = [work_folder(folder, None), folder.to_owned()];
    let in_work = roots.iter().flat_map(|root| of_work.iter().map(move |page| root.join(page)));
    let mut places = in_work.chain([batch::page(folder), batch::page_in(folder)]);
    let found = places.find(|page| page.is_file());
    found.ok_or_else(|| {
        UsageError(format!(
            "{folder:?} has no report yet; make one with `gprop report {0} --open` (for a data set with \
             `gprop batch`; after several shards, add --merge), or compare photos and splat without a report with \
             `gprop inspect {0} --html FILE`",
            shell::path(folder)
        ))
    })
}

/// Opens a page in the browser. Without a browser the page is complete all the same: a warning says where it is.
fn open(page: &Path) {
    if let Err(why) = browser(page) {
        tracing::warn!("cannot open a browser ({OPENER} {why}); the page is {page:?}");
    }
}

/// Why no browser was opened.
#[derive(Debug, thiserror::Error)]
enum NoBrowser {
    #[error("is not installed")]
    NotInstalled,
    #[error("cannot be started: {0}")]
    Start(std::io::Error),
    #[error("failed")]
    Failed,
}

fn browser(page: &Path) -> Result<(), NoBrowser> {
    let absolute = std::path::absolute(page).map_err(NoBrowser::Start)?;
    let mut opener = Command::new(OPENER);
    opener.arg(absolute).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let status = opener.status().map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => NoBrowser::NotInstalled,
        _ => NoBrowser::Start(error),
    })?;
    if status.success() { Ok(()) } else { Err(NoBrowser::Failed) }
}
