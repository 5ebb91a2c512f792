//! What a scene's process tells its batch while it runs: which stage it does, and what it has asked a model so far.
//!
//! They are lines of JSON on its stdout. That is an unnamed file, so that the process never waits for the batch, and what
//! it has told outlives it however it ends.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

use serde::{Deserialize, Serialize};

use crate::files::json;
use crate::words::output::counted;
use crate::words::progress::Event;

/// The requests that were sent to a model, and what they cost.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Asked {
    /// Those that were billed or may have been.
    pub requests: usize,
    pub input_tokens: u64,
    pub output_tokens: u64,
    /// In US dollars; `None` if the model's price is unknown.
    pub usd: Option<f64>,
}

impl Default for Asked {
    fn default() -> Self {
        Self { requests: 0, input_tokens: 0, output_tokens: 0, usd: Some(0.0) }
    }
}

impl Asked {
    /// The sum of both.
    pub fn plus(self, other: Self) -> Self {
        Self {
            requests: self.requests + other.requests,
            input_tokens: self.input_tokens.saturating_add(other.input_tokens),
            output_tokens: self.output_tokens.saturating_add(other.output_tokens),
            usd: self.usd.zip(other.usd).map(|(a, b)| a + b),
        }
    }
}

impl std::fmt::Display for Asked {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let requests = counted(self.requests, "request");
        match self.usd {
            Some(usd) => write!(f, "{requests}, {usd:.4} USD"),
            None => write!(f, "{requests}, cost unknown"),
        }
    }
}

/// A line of a scene's process.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    Stage(String),
    Asked(Asked),
}

/// Prints an event of this process for its batch.
pub fn tell_the_batch(event: &Event) {
    let line = match *event {
        Event::StageBegins { name, .. } => Line::Stage(name.to_owned()),
        Event::Asked { requests, input_tokens, output_tokens, usd } => {
            Line::Asked(Asked { requests, input_tokens, output_tokens, usd })
        }
        _ => return,
    };
    println!("{}", json::compact(&line).expect("a line is plain data"));
}

/// How far a scene's process is.
#[derive(Debug)]
pub struct Status {
    file: File,
    read: u64,
    /// The stage that it does, by name.
    pub stage: Option<String>,
    pub asked: Asked,
}

impl Status {
    /// The status of a process that is about to start with `file` as its stdout.
    pub fn new(file: File) -> Self {
        Self { file, read: 0, stage: None, asked: Asked::default() }
    }

    /// Reads what the process has told since the last time.
    pub fn update(&mut self) -> io::Result<()> {
        let length = self.file.metadata()?.len();
        let mut news = vec![0; (length - self.read.min(length)) as usize];
        self.file.read_exact_at(&mut news, self.read)?;
        // Half a line is read again when it is whole.
        let whole = news.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
        self.read += whole as u64;
        for line in news[..whole].split(|byte| *byte == b'\n') {
            match json::read(line) {
                Ok(Line::Stage(name)) => self.stage = Some(name),
                Ok(Line::Asked(asked)) => self.asked = asked,
                // Not for the batch.
                Err(_) => {}
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    #[test]
    fn half_a_line_waits_for_its_end() {
        let mut file = tempfile::tempfile().unwrap();
        let mut status = Status::new(file.try_clone().unwrap());
        let mut after = |text: &str| {
            file.write_all(text.as_bytes()).unwrap();
            status.update().unwrap();
            (status.stage.clone(), status.asked.requests)
        };
        assert_eq!(after("{\"stage\":\"seg"), (None, 0));
        assert_eq!(after("ment\"}\nno JSON\n"), (Some("segment".to_owned()), 0));
        let asked = "{\"asked\":{\"requests\":2,\"input_tokens\":9,\"output_tokens\":1,\"usd\":null}}\n";
        assert_eq!(after(asked), (Some("segment".to_owned()), 2));
        assert_eq!(status.asked.plus(Asked::default()).usd, None, "an unknown price makes the sum unknown");
    }
}
