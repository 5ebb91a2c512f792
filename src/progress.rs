//! Progress on stderr: bars at a terminal, lines elsewhere, nothing where the user wants quiet. A stage is handed a
//! [`Progress`] and never prints.

use std::fmt::Write;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressState, ProgressStyle};

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
                    ProgressStyle::with_template("{prefix:>10} [{bar:30}] {pos}/{len} {msg} ({rate}, {eta} left)")
                        .expect("the template is a constant")
                        .with_key("rate", |state: &ProgressState, out: &mut dyn Write| {
                            // A formatter that fails leaves the bar without its rate.
                            let _ = out.write_str(&rate(state.per_sec()));
                        })
                        .progress_chars("=> ");
                let bar = ProgressBar::new(length).with_prefix(what).with_style(style);
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

/// Steps a second as a person reads them: where a step takes longer than a second, the seconds that it takes.
fn rate(steps_per_second: f64) -> String {
    if steps_per_second >= 1.0 {
        format!("{steps_per_second:.1}/s")
    } else if steps_per_second > 0.0 {
        format!("{:.1} s each", 1.0 / steps_per_second)
    } else {
        "starting".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_steps_are_told_by_their_length() {
        assert_eq!([24.9624, 1.0, 0.25, 0.0].map(rate), ["25.0/s", "1.0/s", "4.0 s each", "starting"]);
    }
}
