//! Progress on stderr: bars at a terminal, lines elsewhere, nothing if the user wants none. A stage is given a
//! [`Progress`] and never prints itself.

use std::borrow::Cow;
use std::cell::RefCell;
use std::fmt::{self, Write};
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use indicatif::style::ProgressTracker;
use indicatif::{MultiProgress, ProgressBar, ProgressState, ProgressStyle};

use crate::words::output;

/// All bars of the process, one line each: several stages or threads may show one at the same time.
static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

thread_local! {
    /// What the lines and bars of this thread are about, if that has to be said.
    static SUBJECT: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Interval between log lines about a wait that has not ended.
const REMINDER: Duration = Duration::from_secs(30);

/// How progress is shown on stderr.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ShowProgress {
    /// Bars and lines, for a terminal.
    Bars,
    /// Lines only, for a log.
    Lines,
    #[default]
    Hidden,
}

/// How the progress of some work is shown, to which stage of a run it belongs, and who watches the run.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    pub shown: ShowProgress,
    stage: Option<StageNumber>,
    watcher: Option<&'a Watcher>,
}

/// A stage's place among those of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StageNumber {
    /// Counted from 1.
    pub number: usize,
    pub of: usize,
}

/// A step of a run, for a program that follows it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Event<'a> {
    /// Part of a piece of work is done, such as some of a stage's views. May come from any thread.
    Steps { stage: Option<StageNumber>, what: &'a str, done: u64, of: u64 },
    /// A stage begins. Stages whose stored results are used again are not told.
    StageBegins { stage: Option<StageNumber>, name: &'a str },
    /// A stage is done.
    StageDone { stage: Option<StageNumber>, name: &'a str, seconds: f64 },
    /// What a run has asked a model so far, after each request. The price in US dollars is `None` if it is unknown.
    Asked { requests: usize, input_tokens: u64, output_tokens: u64, usd: Option<f64> },
}

/// Cancels runs: all clones of a token are one. A run looks at it before each stage and between its views, questions and
/// frames, ends with [`Cancelled`], and keeps what is done.
#[derive(Debug, Clone, Default)]
pub struct CancelToken(Arc<AtomicBool>);

impl CancelToken {
    /// Cancels every run that was given this token.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// True once it was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// The run was cancelled with its [`CancelToken`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the run was cancelled; what is done is kept, and the next run goes on from there")]
pub struct Cancelled;

/// Gets the steps of a run.
pub type Listener = Arc<dyn Fn(&Event) + Send + Sync>;

/// Follows a run: shows its progress, passes it to a listener, and can cancel it.
#[derive(Clone, Default)]
pub struct Watcher {
    pub shown: ShowProgress,
    pub listener: Option<Listener>,
    pub cancel: CancelToken,
}

impl fmt::Debug for Watcher {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { shown, listener, cancel } = self;
        let listens = listener.is_some();
        f.debug_struct("Watcher").field("shown", shown).field("listens", &listens).field("cancel", cancel).finish()
    }
}

impl Watcher {
    /// The progress of a stage of the run, or of other work for it.
    pub fn progress(&self, stage: Option<StageNumber>) -> Progress<'_> {
        Progress { shown: self.shown, stage, watcher: Some(self) }
    }

    fn tell(&self, event: &Event) {
        if let Some(listener) = &self.listener {
            listener(event);
        }
    }
}

/// A progress bar, which is drawn only if [bars are shown](ShowProgress::Bars).
pub struct Bar<'a> {
    bar: ProgressBar,
    watched: Option<Watched<'a>>,
}

/// The work whose steps a watcher is told.
struct Watched<'a> {
    by: &'a Watcher,
    stage: Option<StageNumber>,
    what: &'static str,
    of: u64,
}

impl Bar<'_> {
    pub fn with_message(self, message: &'static str) -> Self {
        Self { bar: self.bar.with_message(message), ..self }
    }

    pub fn set_message(&self, message: String) {
        self.bar.set_message(message);
    }

    pub fn inc(&self, steps: u64) {
        self.bar.inc(steps);
        self.tell();
    }

    pub fn set_position(&self, steps: u64) {
        self.bar.set_position(steps);
        self.tell();
    }

    pub fn position(&self) -> u64 {
        self.bar.position()
    }

    pub fn finish_and_clear(&self) {
        self.bar.finish_and_clear();
    }

    fn tell(&self) {
        if let Some(Watched { by, stage, what, of }) = self.watched {
            by.tell(&Event::Steps { stage, what, done: self.bar.position(), of });
        }
    }
}

impl From<ShowProgress> for Progress<'static> {
    /// Of work that belongs to no run.
    fn from(shown: ShowProgress) -> Self {
        Self { shown, stage: None, watcher: None }
    }
}

impl<'a> Progress<'a> {
    /// Shown to nobody.
    pub const HIDDEN: Progress<'static> = Progress { shown: ShowProgress::Hidden, stage: None, watcher: None };

    /// As it is shown on stderr; the watcher is told nothing.
    pub fn on_stderr(self) -> Progress<'static> {
        Progress { shown: self.shown, stage: self.stage, watcher: None }
    }

    /// Checks whether the run goes on.
    ///
    /// # Errors
    /// [`Cancelled`] if it was cancelled.
    pub fn check(self) -> Result<(), Cancelled> {
        if self.watcher.is_some_and(|watcher| watcher.cancel.is_cancelled()) { Err(Cancelled) } else { Ok(()) }
    }

    /// A bar of `length` steps with the title `what`; its message, if it gets one, is the name of the steps. It is
    /// drawn only if [bars are shown](ShowProgress::Bars) and there are steps.
    pub fn bar(self, what: &'static str, length: u64) -> Bar<'a> {
        self.watched_bar(what, length, "{pos} of {len} {msg}")
    }

    /// A bar of length [`WHOLE`], for work whose steps are not of one kind; its message says how much is done.
    pub fn share_bar(self, what: &'static str) -> Bar<'a> {
        self.watched_bar(what, WHOLE, "{msg}")
    }

    fn watched_bar(self, what: &'static str, length: u64, done: &'static str) -> Bar<'a> {
        let watched = self.watcher.map(|by| Watched { by, stage: self.stage, what, of: length });
        Bar { bar: self.drawn_bar(what, length, done), watched }
    }

    fn drawn_bar(self, what: &'static str, length: u64, done: &'static str) -> ProgressBar {
        if self.shown != ShowProgress::Bars || length == 0 {
            return ProgressBar::hidden();
        }
        let style = ProgressStyle::with_template(&format!("{{prefix}} [{{bar:30}}] {done}{{left}}"))
            .expect("the template is a constant")
            .with_key("left", TimeLeft::default())
            .progress_chars("=> ");
        let bar = BARS
            .add(ProgressBar::new(length))
            .with_prefix(marked(&title(self.stage, what)).into_owned())
            .with_style(style);
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
    }

    /// One line about something that takes a while or is done.
    pub fn line(self, text: &str) {
        if self.shown != ShowProgress::Hidden {
            show(text);
        }
    }

    /// Tells the watcher that a stage begins.
    pub fn stage_begins(self, name: &str) {
        if let Some(watcher) = self.watcher {
            watcher.tell(&Event::StageBegins { stage: self.stage, name });
        }
    }

    /// Tells the watcher what was asked so far.
    pub fn asked(self, requests: usize, input_tokens: u64, output_tokens: u64, usd: Option<f64>) {
        if let Some(watcher) = self.watcher {
            watcher.tell(&Event::Asked { requests, input_tokens, output_tokens, usd });
        }
    }

    /// The line for a stage that is done.
    pub fn stage_done(self, name: &str, seconds: f64) {
        let Self { stage, watcher, .. } = self;
        self.line(&format!("{} {seconds:6.1} s", title(stage, name)));
        if let Some(watcher) = watcher {
            watcher.tell(&Event::StageDone { stage, name, seconds });
        }
    }

    /// Shows the remaining time of a wait for `reason`, such as "as the server asks".
    pub fn countdown(self, reason: &'static str) -> Countdown {
        Countdown { shown: self.shown, reason, bar: self.text_bar(), told: None }
    }

    /// A line that says how a long piece of work stands.
    pub fn status_line(self) -> StatusLine {
        StatusLine { shown: self.shown, bar: self.text_bar(), told: Instant::now() }
    }

    /// A line of text that is drawn anew as often as it changes, at a terminal.
    fn text_bar(self) -> ProgressBar {
        if self.shown != ShowProgress::Bars {
            return ProgressBar::hidden();
        }
        let style = ProgressStyle::with_template("{wide_msg}").expect("the template is a constant");
        BARS.add(ProgressBar::new_spinner()).with_style(style)
    }
}

/// The length of a [`Progress::share_bar`].
pub const WHOLE: u64 = 1000;

/// Does some work of which every line and bar, the warnings included, says that it is about `subject`: for pieces of work
/// that are done side by side. Only what this thread shows is marked, not what others do for it.
pub fn about<T>(subject: &str, work: impl FnOnce() -> T) -> T {
    /// Puts back what was there, also after a panic.
    struct Before(Option<String>);
    impl Drop for Before {
        fn drop(&mut self) {
            SUBJECT.set(self.0.take());
        }
    }
    let _before = Before(SUBJECT.replace(Some(subject.to_owned())));
    work()
}

/// `text` with what it is about.
fn marked(text: &str) -> Cow<'_, str> {
    SUBJECT.with_borrow(|subject| match subject {
        Some(subject) => Cow::Owned(format!("{subject}: {}", text.trim_start())),
        None => Cow::Borrowed(text),
    })
}

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
    shown: ShowProgress,
    reason: &'static str,
    bar: ProgressBar,
    /// The remaining time in the last log line.
    told: Option<Duration>,
}

impl Countdown {
    /// Shows the remaining time.
    pub fn show(&mut self, left: Duration) {
        let text = format!("waiting {} s, {}", left.as_secs_f64().round().max(1.0), self.reason);
        match self.shown {
            ShowProgress::Bars => self.bar.set_message(text),
            ShowProgress::Lines if self.told.is_none_or(|told| told.saturating_sub(left) >= REMINDER) => {
                show(&text);
                self.told = Some(left);
            }
            ShowProgress::Lines | ShowProgress::Hidden => {}
        }
    }
}

impl Drop for Countdown {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// A line that says how a long piece of work stands: at a terminal it is always there and removed when this is dropped,
/// in a log it is printed now and then.
pub struct StatusLine {
    shown: ShowProgress,
    bar: ProgressBar,
    /// When the last line was printed.
    told: Instant,
}

impl StatusLine {
    /// Shows how the work stands now.
    pub fn show(&mut self, text: &str) {
        match self.shown {
            ShowProgress::Bars => self.bar.set_message(output::one_line(text).into_owned()),
            ShowProgress::Lines if self.told.elapsed() >= REMINDER => {
                show(text);
                self.told = Instant::now();
            }
            ShowProgress::Lines | ShowProgress::Hidden => {}
        }
    }
}

impl Drop for StatusLine {
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
    let text = marked(text);
    BARS.suspend(|| output::tell(&output::one_line(&text)));
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
    fn what_is_shown_says_what_it_is_about() {
        assert_eq!(marked(" WARN wet"), " WARN wet");
        let within =
            about("object_2", || (marked(" WARN wet").into_owned(), std::thread::spawn(|| marked("dry")).join()));
        assert_eq!((within.0.as_str(), within.1.unwrap().as_ref()), ("object_2: WARN wet", "dry"));
        assert!(std::panic::catch_unwind(|| about("object_3", || panic!("on purpose"))).is_err());
        assert_eq!(marked("dry"), "dry");
    }

    #[test]
    fn the_time_left_is_counted_down_between_steps_and_never_jumps_up_at_an_even_pace() {
        let begin = Instant::now();
        let instant_after = |seconds: f64| begin + Duration::from_secs_f64(seconds);
        let mut left = TimeLeft::default();
        left.note(1, 10, Duration::from_secs(1), instant_after(1.0));
        assert_eq!(left.text(instant_after(1.0)), "", "too early to say");
        left.note(2, 10, Duration::from_secs(20), instant_after(20.0));
        assert_eq!(left.text(instant_after(20.0)), " (about 80 s left)");
        left.note(2, 10, Duration::from_secs(29), instant_after(29.0));
        assert_eq!(left.text(instant_after(29.0)), " (about 70 s left)", "time passes also while a step lasts");
        left.note(3, 10, Duration::from_secs(30), instant_after(30.0));
        assert_eq!(left.text(instant_after(30.0)), " (about 70 s left)");
        assert_eq!(left.text(instant_after(99.0)), " (a few seconds left)");
        left.note(20, 100, Duration::from_secs(200), instant_after(200.0));
        assert_eq!(left.text(instant_after(200.0)), " (about 13 min left)");
    }

    #[test]
    fn nothing_to_do_has_no_bar() {
        assert!(Progress::from(ShowProgress::Bars).bar("query", 0).bar.is_hidden());
        assert!(Progress::from(ShowProgress::Lines).bar("query", 3).bar.is_hidden());
        assert!(Progress::HIDDEN.share_bar("segment").bar.is_hidden());
    }

    #[test]
    fn a_listener_is_told_the_steps_of_a_stage_and_its_end() {
        let told = Arc::new(std::sync::Mutex::new(Vec::new()));
        let listener = {
            let told = Arc::clone(&told);
            move |event: &Event| told.lock().unwrap().push(format!("{event:?}"))
        };
        let watcher = Watcher { listener: Some(Arc::new(listener)), ..Watcher::default() };
        let progress = watcher.progress(Some(StageNumber { number: 2, of: 9 }));
        let bar = progress.bar("vote", 3);
        bar.inc(1);
        bar.inc(2);
        progress.stage_done("vote", 0.5);
        let told = told.lock().unwrap();
        let has = |n: usize, words: &[&str]| words.iter().all(|word| told[n].contains(word));
        assert!(has(0, &["number: 2", "vote", "done: 1", "of: 3"]) && has(1, &["done: 3"]), "{told:?}");
        assert!(told.len() == 3 && has(2, &["StageDone", "0.5"]), "{told:?}");
    }

    #[test]
    fn a_token_cancels_what_was_given_it() {
        let watcher = Watcher::default();
        let (watched, token) = (watcher.progress(None), watcher.cancel.clone());
        assert_eq!((watched.check(), Progress::HIDDEN.check()), (Ok(()), Ok(())));
        token.cancel();
        assert_eq!((watched.check(), Progress::HIDDEN.check()), (Err(Cancelled), Ok(())));
    }
}
