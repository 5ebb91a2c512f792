//! Progress on stderr: bars at a terminal, lines elsewhere, nothing if the user wants none. A stage is given a
//! [`Progress`] and never prints itself.

use std::fmt::Write;
use std::sync::LazyLock;
use std::time::Duration;

use indicatif::{MultiProgress, ProgressBar, ProgressState, ProgressStyle};

use crate::output;

/// All bars of the process, one line each: several stages or threads may show one at the same time.
static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// Interval between log lines about a wait that has not ended.
const REMINDER: Duration = Duration::from_secs(30);

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Bars and lines, for a terminal.
    Shown,
    /// Lines only, for a log.
    Lines,
    Hidden,
}

impl Progress {
    /// A bar of `length` steps with the title `what`; it draws nothing if progress is hidden.
    pub fn bar(self, what: &'static str, length: u64) -> ProgressBar {
        match self {
            Self::Lines | Self::Hidden => ProgressBar::hidden(),
            Self::Shown => {
                let style =
                    ProgressStyle::with_template("{prefix:>10} [{bar:30}] {pos}/{len} {msg} ({rate}, {eta} left)")
                        .expect("the template is a constant")
                        .with_key("rate", |state: &ProgressState, out: &mut dyn Write| {
                            // If formatting fails, the bar has no rate.
                            let _ = out.write_str(&rate(state.per_sec()));
                        })
                        .progress_chars("=> ");
                let bar = BARS.add(ProgressBar::new(length)).with_prefix(what).with_style(style);
                bar.enable_steady_tick(Duration::from_millis(200));
                bar
            }
        }
    }

    /// One line about something that takes a while or is done.
    pub fn line(self, text: &str) {
        if self != Self::Hidden {
            notice(text);
        }
    }

    /// Shows the remaining time of a wait for `reason`, such as "as the server asks".
    pub fn countdown(self, reason: &'static str) -> Countdown {
        let bar = match self {
            Self::Lines | Self::Hidden => ProgressBar::hidden(),
            Self::Shown => {
                let style = ProgressStyle::with_template("{msg}").expect("the template is a constant");
                BARS.add(ProgressBar::new_spinner()).with_style(style)
            }
        };
        Countdown { progress: self, reason, bar, told: None }
    }
}

/// A wait whose remaining time is shown; the line is removed when this is dropped.
pub struct Countdown {
    progress: Progress,
    reason: &'static str,
    bar: ProgressBar,
    /// The remaining time in the last log line.
    told: Option<Duration>,
}

impl Countdown {
    /// Shows the remaining time.
    pub fn show(&mut self, left: Duration) {
        let text = format!("waiting {} s, {}", left.as_secs_f64().round().max(1.0), self.reason);
        match self.progress {
            Progress::Shown => self.bar.set_message(text),
            Progress::Lines if self.told.is_none_or(|told| told.saturating_sub(left) >= REMINDER) => {
                notice(&text);
                self.told = Some(left);
            }
            Progress::Lines | Progress::Hidden => {}
        }
    }
}

impl Drop for Countdown {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// One line that the user must not miss: also shown if progress is hidden.
pub fn notice(text: &str) {
    BARS.suspend(|| output::tell(&output::one_line(text)));
}

/// Steps per second in readable form: if a step takes longer than a second, seconds per step.
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
