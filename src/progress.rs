//! Progress on stderr: bars at a terminal, lines elsewhere, nothing where the user wants quiet. A stage is handed a
//! [`Progress`] and never prints.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Who may be told how far a stage is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Bars and lines: somebody is looking.
    Shown,
    /// Lines only: a log.
    Lines,
    Hidden,
}

impl Progress {
    /// A bar of `length` steps headed by `what`; one that draws nothing where progress is hidden.
    pub fn bar(self, what: &'static str, length: u64) -> ProgressBar {
        match self {
            Self::Lines | Self::Hidden => ProgressBar::hidden(),
            Self::Shown => {
                let style =
                    ProgressStyle::with_template("{prefix:>10} [{bar:30}] {pos}/{len} {msg} ({per_sec}, {eta} left)")
                        .expect("the template is a constant");
                let bar = ProgressBar::new(length).with_prefix(what).with_style(style.progress_chars("=> "));
                bar.enable_steady_tick(Duration::from_millis(200));
                bar
            }
        }
    }

    /// One line for what takes a while or is done.
    pub fn line(self, text: &str) {
        if self != Self::Hidden {
            eprintln!("{text}");
        }
    }
}
