//! What the user sees while a batch runs: a line for each scene that ends, and at a terminal one that says how all stand.

use std::time::{Duration, Instant};

use crate::batch::{Asked, News, Outcome, Snapshot, State};
use crate::files::json;
use crate::words::output::counted;
use crate::words::progress::{Progress, StatusLine};

use super::super::{Global, print_text};

/// Number of running scenes that are named.
const NAMED: usize = 4;

/// Shows how a batch goes on.
pub struct Display {
    is_json: bool,
    progress: Progress<'static>,
    line: StatusLine,
    begun: Instant,
    count: Count,
    /// What the scenes that need no longer run have asked.
    asked: Asked,
}

/// The scenes of this batch that were not done before.
#[derive(Debug, Clone, Copy, Default)]
struct Count {
    due: usize,
    done: usize,
    failed: usize,
    running: usize,
}

impl Display {
    pub fn new(global: &Global) -> Self {
        let progress = global.progress();
        Self {
            is_json: global.json,
            progress,
            line: progress.status_line(),
            begun: Instant::now(),
            count: Count::default(),
            asked: Asked::default(),
        }
    }

    pub fn take(&mut self, news: &News) {
        match news {
            News::Begins { due, kept, asked } => {
                (self.count.due, self.asked, self.begun) = (*due, *asked, Instant::now());
                if *kept > 0 {
                    let kept = counted(*kept, "scene");
                    self.progress.line(&format!("{kept} ended in an earlier run; {due} to run"));
                }
            }
            News::Ended(outcome) => self.ended(outcome),
            News::Snapshot(snapshot) => {
                self.count.running = snapshot.running.len();
                let asked = snapshot.running.iter().fold(self.asked, |sum, scene| sum.plus(scene.asked));
                let time_left = self.count.time_left(self.begun.elapsed());
                self.line.show(&format!("{}{}", self.count.text(time_left, asked), running(snapshot)));
            }
        }
    }

    /// Reports an outcome as a line of JSON on stdout, or as a line for people on stderr.
    fn ended(&mut self, outcome: &Outcome) {
        self.asked = self.asked.plus(outcome.asked);
        let state = match outcome.state {
            State::Done => "done",
            State::Failed => "FAILED",
            State::Skipped => "",
        };
        self.count.done += usize::from(outcome.state == State::Done);
        self.count.failed += usize::from(outcome.state == State::Failed);
        if self.is_json {
            let line = json::compact(outcome).expect("an outcome is plain data");
            // A closed stdout must not stop the batch: everything is in its file too.
            let _ = print_text(&line);
        } else if outcome.state != State::Skipped {
            // A warning has already named one that is skipped.
            let ended = self.count.done + self.count.failed;
            let Outcome { scene, seconds, .. } = outcome;
            self.progress.line(&format!("{state:<9} {ended}/{} {scene} {seconds:.1} s", self.count.due));
        }
    }
}

impl Count {
    /// `12 of 87 scenes done, 1 failed, 74 left (about 3 h), 0.4200 USD`.
    fn text(&self, time_left: Option<Duration>, asked: Asked) -> String {
        let Self { due, done, failed, .. } = *self;
        let failed = if failed > 0 { format!(", {failed} failed") } else { String::new() };
        let left = due - done - self.failed;
        let time = time_left.map_or_else(String::new, |time| format!(" ({})", in_words(time)));
        let asked = if asked.requests > 0 { format!(", {asked}") } else { String::new() };
        format!("{done} of {} done{failed}, {left} left{time}{asked}", counted(due, "scene"))
    }

    /// The time that the scenes left will take if they go on as those so far, of which the running ones are half done on
    /// average. `None` before the first has ended.
    fn time_left(&self, elapsed: Duration) -> Option<Duration> {
        let ended = self.done + self.failed;
        let so_far = ended as f64 + 0.5 * self.running as f64;
        let left = (self.due as f64 - so_far).max(0.0);
        (ended > 0).then(|| elapsed.mul_f64(left / so_far))
    }
}

/// `; cup (segment), chair (query) and 2 more are running`.
fn running(snapshot: &Snapshot) -> String {
    let name = |scene: &crate::batch::RunningScene| {
        format!("{} ({})", scene.name, scene.stage.as_deref().unwrap_or("starting"))
    };
    let names: Vec<String> = snapshot.running.iter().take(NAMED).map(name).collect();
    let more = snapshot.running.len() - names.len();
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    if names.is_empty() { String::new() } else { format!("; running: {}{more}", names.join(", ")) }
}

fn in_words(time: Duration) -> String {
    match time.as_secs_f64() {
        ..60.0 => "less than a minute".to_owned(),
        s @ ..5400.0 => format!("about {:.0} min", s / 60.0),
        s => format!("about {:.1} h", s / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::RunningScene;

    #[test]
    fn the_line_says_what_is_done_and_left_and_what_it_has_cost() {
        let count = Count { due: 87, done: 12, failed: 1, running: 2 };
        let asked = Asked { requests: 31, input_tokens: 9, output_tokens: 1, usd: Some(0.42) };
        let left = count.time_left(Duration::from_secs(1400));
        assert_eq!(left, Some(Duration::from_secs(7300)), "14 of 87 scenes took 1400 s");
        assert_eq!(
            count.text(left, asked),
            "12 of 87 scenes done, 1 failed, 74 left (about 2.0 h), 31 requests, 0.4200 USD"
        );
        let first = Count { due: 1, running: 1, ..Count::default() };
        let unpriced = Asked { requests: 1, usd: None, ..asked };
        assert_eq!(first.time_left(Duration::from_secs(9)), None, "nothing has ended yet");
        assert_eq!(first.text(None, unpriced), "0 of 1 scene done, 1 left, 1 request, cost unknown");
    }

    #[test]
    fn running_scenes_are_named_with_their_stages() {
        let scene =
            |name, stage: Option<&str>| RunningScene { name, stage: stage.map(str::to_owned), asked: Asked::default() };
        let running_scenes = vec![scene("cup", Some("segment")), scene("chair", None)];
        assert_eq!(
            running(&Snapshot { running: running_scenes, waiting: 3 }),
            "; running: cup (segment), chair (starting)"
        );
        let many = (0..6).map(|_| scene("a", Some("vote"))).collect();
        assert!(running(&Snapshot { running: many, waiting: 0 }).ends_with("a (vote) and 2 more"));
    }
}
