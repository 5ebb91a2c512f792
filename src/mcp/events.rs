//! What the program tells its server while it runs, as lines of JSON on stderr among those for people.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::files::json;
use crate::words::progress::{Event, StageNumber};

/// The least time between two lines about steps: faster than anyone reads.
const BETWEEN_STEPS: Duration = Duration::from_millis(200);

/// A line.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Told {
    /// How far the run is, in words. `begins` is true for a stage that begins.
    Progress { text: String, begins: bool },
    /// What the stage's questions have cost so far, in US dollars; `None` if the model's price is unknown.
    Asked { usd: Option<f64> },
}

impl Told {
    /// The line, if it is one.
    pub fn read(line: &str) -> Option<Self> {
        json::read(line.strip_prefix('{').map(|_| line.as_bytes())?).ok()
    }
}

/// Prints an event of this process for its server.
pub fn tell_the_server(event: &Event) {
    static LAST_STEP: Mutex<Option<Instant>> = Mutex::new(None);
    let told = match *event {
        Event::StageBegins { stage, name } => Told::Progress { text: title(stage, name), begins: true },
        Event::StageDone { stage, name, seconds } => {
            Told::Progress { text: format!("{}: done in {seconds:.1} s", title(stage, name)), begins: false }
        }
        Event::Steps { stage, what, done, of } => {
            let mut last = LAST_STEP.lock().expect("no holder panics");
            if last.is_some_and(|last| last.elapsed() < BETWEEN_STEPS) {
                return;
            }
            *last = Some(Instant::now());
            Told::Progress { text: format!("{}: {done} of {of}", title(stage, what)), begins: false }
        }
        Event::Asked { usd, .. } => Told::Asked { usd },
    };
    eprintln!("{}", json::compact(&told).expect("a line is plain data"));
}

fn title(stage: Option<StageNumber>, what: &str) -> String {
    stage.map_or_else(|| what.to_owned(), |StageNumber { number, of }| format!("stage {number} of {of}, {what}"))
}
