//! Progress on stderr: bars at a terminal, lines elsewhere, nothing if the user wants none. A stage is given a
//! [`Progress`] and never prints itself.

use std::fmt::Write;
use std::io;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use indicatif::style::ProgressTracker;
use indicatif::{MultiProgress, ProgressBar, ProgressState, ProgressStyle};

use crate::words::output;

/// All bars of the process, one line each: several stages or threads may show one at the same time.
static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// Interval between log lines about a wait that has not ended.
const REMINDER: Duration = Duration::from_secs(30);

/// How progress is shown, and to which stage of a run it belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Bars and lines, for a terminal.
    Shown(Option<StageNumber>),
    /// Lines only, for a log.
    Lines(Option<StageNumber>),
    Hidden,
}

/// A stage's place among those of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StageNumber {
    /// Counted from 1.
    pub number: usize,
    pub of: usize,
}

impl Progress {
    /// The same, about the given stage.
    pub fn of_stage(self, stage: StageNumber) -> Self {
        match self {
            Self::Shown(_) => Self::Shown(Some(stage)),
            Self::Lines(_) => Self::Lines(Some(stage)),
            Self::Hidden => Self::Hidden,
        }
    }

    /// A bar of `length` steps with the title `what`; its message, if it gets one, is the name of the steps. It is
    /// drawn only if progress is [`Shown`](Self::Shown) and there are steps.
    pub fn bar(self, what: &'static str, length: u64) -> ProgressBar {
        self.bar_with(what, length, "{pos} of {len} {msg}")
    }

    /// A bar of length [`WHOLE`], for work whose steps are not of one kind; its message says how much is done.
    pub fn share_bar(self, what: &'static str) -> ProgressBar {
        self.bar_with(what, WHOLE, "{msg}")
    }

    fn bar_with(self, what: &'static str, length: u64, done: &'static str) -> ProgressBar {
        let Self::Shown(stage) = self else { return ProgressBar::hidden() };
        if length == 0 {
            return ProgressBar::hidden();
        }
        let style = ProgressStyle::with_template(&format!("{{prefix}} [{{bar:30}}] {done}{{left}}"))
            .expect("the template is a constant")
            .with_key("left", TimeLeft::default())
            .progress_chars("=> ");
        let bar = BARS.add(ProgressBar::new(length)).with_prefix(title(stage, what)).with_style(style);
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
    }

    /// One line about something that takes a while or is done.
    pub fn line(self, text: &str) {
        if self != Self::Hidden {
            show(text);
        }
    }

    /// The line for a stage that is done.
    pub fn stage_done(self, name: &str, seconds: f64) {
        if let Self::Shown(stage) | Self::Lines(stage) = self {
            show(&format!("{} {seconds:6.1} s", title(stage, name)));
        }
    }

    /// Shows the remaining time of a wait for `reason`, such as "as the server asks".
    pub fn countdown(self, reason: &'static str) -> Countdown {
        let bar = match self {
            Self::Lines(_) | Self::Hidden => ProgressBar::hidden(),
            Self::Shown(_) => {
                let style = ProgressStyle::with_template("{msg}").expect("the template is a constant");
                BARS.add(ProgressBar::new_spinner()).with_style(style)
            }
        };
        Countdown { progress: self, reason, bar, told: None }
    }
}

/// The length of a [`Progress::share_bar`].
pub const WHOLE: u64 = 1000;

/// The name of a stage or a piece of work, with the stage's number if it has one.
fn title(stage: Option<StageNumber>, what: &str) -> String {
    match stage {
        Some(StageNumber { number, of }) => format!("stage {number} of {of}  {what:<9}"),
        None => format!("{what:<9}"),
    }
}

/// The time that is left, from the time that the steps so far took. It is estimated when a step is done, and counted
/// down until the next one is.
#[derive(Debug, Clone, Default)]
struct TimeLeft {
    /// The steps done at the last estimate.
    steps: u64,
    /// When everything should be done.
    end: Option<Instant>,
}

/// Before this time, and before this share of the steps, a few steps say little about the others: the first ones wait
/// for what is done once, such as loading a network.
const FIRST_ESTIMATE: Duration = Duration::from_secs(2);
const FIRST_SHARE: f64 = 0.15;

impl TimeLeft {
    /// Takes note that `steps` of `all` are done at the time `now`, `elapsed` after the beginning.
    fn note(&mut self, steps: u64, all: u64, elapsed: Duration, now: Instant) {
        let enough = elapsed >= FIRST_ESTIMATE && steps as f64 >= FIRST_SHARE * all as f64;
        if steps != self.steps && steps > 0 && enough {
            self.steps = steps;
            self.end = Some(now + elapsed.mul_f64(all.saturating_sub(steps) as f64 / steps as f64));
        }
    }

    /// The text to show after the steps at the time `now`.
    fn text(&self, now: Instant) -> String {
        let left = self.end.map(|end| end.saturating_duration_since(now).as_secs_f64());
        match left {
            None => String::new(),
            Some(s) if s >= 90.0 => format!(" (about {:.0} min left)", s / 60.0),
            Some(s) if s >= 5.0 => format!(" (about {:.0} s left)", (s / 5.0).round() * 5.0),
            Some(_) => " (a few seconds left)".to_owned(),
        }
    }
}

impl ProgressTracker for TimeLeft {
    fn clone_box(&self) -> Box<dyn ProgressTracker> {
        Box::new(self.clone())
    }

    fn tick(&mut self, state: &ProgressState, now: Instant) {
        self.note(state.pos(), state.len().unwrap_or(0), state.elapsed(), now);
    }

    fn reset(&mut self, _: &ProgressState, _: Instant) {
        *self = Self::default();
    }

    fn write(&self, _: &ProgressState, out: &mut dyn Write) {
        // If formatting fails, the bar has no estimate.
        let _ = out.write_str(&self.text(Instant::now()));
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
            Progress::Shown(_) => self.bar.set_message(text),
            Progress::Lines(_) if self.told.is_none_or(|told| told.saturating_sub(left) >= REMINDER) => {
                show(&text);
                self.told = Some(left);
            }
            Progress::Lines(_) | Progress::Hidden => {}
        }
    }
}

impl Drop for Countdown {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// A line that the user must not miss, even if progress is hidden: what is sent, and what it cost. It goes to `tracing`, as
/// warnings do, since a library does not write to the stderr of its program; the program shows it as it is.
pub fn notice(text: &str) {
    tracing::warn!(target: NOTICE, "{text}");
}

/// The target of the events that are [notices](notice).
pub const NOTICE: &str = "gprop::notice";

/// Prints one line on stderr, above the bars.
fn show(text: &str) {
    BARS.suspend(|| output::tell(&output::one_line(text)));
}

/// The log: one line on stderr per event, above the bars.
#[derive(Debug, Clone, Copy)]
pub struct Log;

impl io::Write for Log {
    fn write(&mut self, event: &[u8]) -> io::Result<usize> {
        show(String::from_utf8_lossy(event).trim_end_matches('\n'));
        Ok(event.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_title_says_which_stage_of_how_many() {
        assert_eq!(title(Some(StageNumber { number: 3, of: 9 }), "consensus"), "stage 3 of 9  consensus");
        assert_eq!(title(None, "inspect"), "inspect  ");
    }

    #[test]
    fn the_time_left_is_counted_down_between_steps_and_never_jumps_up_at_an_even_pace() {
        let begin = Instant::now();
        let at = |seconds: f64| begin + Duration::from_secs_f64(seconds);
        let mut left = TimeLeft::default();
        left.note(1, 10, Duration::from_secs(1), at(1.0));
        assert_eq!(left.text(at(1.0)), "", "too early to say");
        left.note(2, 10, Duration::from_secs(20), at(20.0));
        assert_eq!(left.text(at(20.0)), " (about 80 s left)");
        left.note(2, 10, Duration::from_secs(29), at(29.0));
        assert_eq!(left.text(at(29.0)), " (about 70 s left)", "time passes also while a step lasts");
        left.note(3, 10, Duration::from_secs(30), at(30.0));
        assert_eq!(left.text(at(30.0)), " (about 70 s left)");
        assert_eq!(left.text(at(99.0)), " (a few seconds left)");
        left.note(20, 100, Duration::from_secs(200), at(200.0));
        assert_eq!(left.text(at(200.0)), " (about 13 min left)");
    }

    #[test]
    fn nothing_to_do_has_no_bar() {
        assert!(Progress::Shown(None).bar("query", 0).is_hidden());
        assert!(Progress::Lines(None).bar("query", 3).is_hidden() && Progress::Hidden.share_bar("segment").is_hidden());
    }
}
