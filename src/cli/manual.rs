//! Shell completions and manual pages, generated from the definitions of the flags.

use std::path::Path;

use crate::error::UsageError;

use super::{Global, command, print, print_path};

/// `gprop completions SHELL`.
pub fn completions(global: &Global, shell: clap_complete::Shell) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command(), "gprop", &mut script);
    print_text(global, script)
}

/// `gprop man`.
pub fn page(global: &Global) -> anyhow::Result<()> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command()).render(&mut page)?;
    print_text(global, page)
}

/// `gprop man --out DIR`: one page per command.
pub fn pages(global: &Global, folder: &Path) -> anyhow::Result<()> {
    let cannot = |error| UsageError(format!("cannot write manual pages into {folder:?}: {error}"));
    std::fs::create_dir_all(folder).map_err(cannot)?;
    clap_mangen::generate_to(command(), folder).map_err(cannot)?;
    print_path(global, folder)
}

fn print_text(global: &Global, text: Vec<u8>) -> anyhow::Result<()> {
    let text = String::from_utf8(text)?;
    print(global, &text, || text.clone())
}
