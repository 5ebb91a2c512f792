//! Shell completions and manual pages, generated from the definitions of the flags.

use std::io;
use std::path::Path;

use crate::error::{Result, UsageError};
use crate::files::write::Folder;

use super::{Global, command, print, print_path};

/// `gprop completions SHELL`.
pub fn completions(global: &Global, shell: clap_complete::Shell) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command(), "gprop", &mut script);
    print_text(global, script)
}

/// `gprop man`.
pub fn page(global: &Global) -> Result<()> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command()).render(&mut page)?;
    print_text(global, page)
}

/// `gprop man --out DIR`: one page per command.
pub fn pages(global: &Global, folder: &Path) -> Result<()> {
    let cannot = |error| UsageError(format!("cannot write manual pages into {folder:?}: {error}"));
    let write_to = Folder::open(folder).map_err(cannot)?;
    let mut command = command().disable_help_subcommand(true);
    command.build();
    write_pages(&command, &write_to).map_err(cannot)?;
    print_path(global, folder)
}

/// Writes the pages of a command and of those below it.
fn write_pages(command: &clap::Command, folder: &Folder) -> io::Result<()> {
    for below in command.get_subcommands().filter(|below| !below.is_hide_set()) {
        write_pages(below, folder)?;
    }
    let page = clap_mangen::Man::new(command.clone());
    folder.write(Path::new(&page.get_filename()), |mut out| page.render(&mut out))
}

fn print_text(global: &Global, text: Vec<u8>) -> Result<()> {
    let text = String::from_utf8(text)?;
    print(global, &text, || text.clone())
}
