//! Runs the program for a tool, as anyone would at a terminal: the tools have no second way to the results, a crash ends one
//! call and not the server, and whatever is done is kept if a call is cancelled.

use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};
use std::thread;

use crate::words::output::tell;

use super::events::Told;
use super::server::Call;

/// With which the program tells what it does, and ends when its stdin closes.
const FLAG: &str = "--for-mcp";

/// How the program ended.
#[derive(Debug, Default)]
pub struct Finished {
    /// `None` if a signal ended it.
    pub code: Option<i32>,
    pub stdout: String,
    /// The text of its error, and the remedy.
    pub error: String,
    pub warnings: Vec<String>,
    /// What its questions cost, in US dollars.
    pub usd: f64,
}

/// How the lines of one kind begin.
const ERROR: &str = "error: ";
const WARNING: &str = " WARN ";

impl Call<'_> {
    /// Runs the program with `--json` and these words.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn run(&self, words: &[OsString]) -> io::Result<Finished> {
        let mut command = Command::new(std::env::current_exe()?);
        command.args(["--json", "--quiet", FLAG]).args(words).env("NO_COLOR", "1");
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // In its own process group, which ends as a whole when its stdin closes.
        let mut process = command.process_group(0).spawn()?;
        let (stdout, stderr) = (process.stdout.take(), process.stderr.take());
        self.holds(process.stdin.take());
        let printed = thread::spawn(move || {
            let mut printed = Vec::new();
            // If it cannot be read, it is no JSON, which is reported.
            let _ = stdout.map(|mut stdout| stdout.read_to_end(&mut printed));
            String::from_utf8_lossy(&printed).into_owned()
        });
        let mut finished = Finished::default();
        let mut cost = Cost::default();
        for line in stderr.into_iter().flat_map(|stderr| BufReader::new(stderr).split(b'\n')).map_while(Result::ok) {
            self.take(&String::from_utf8_lossy(&line), &mut finished, &mut cost);
        }
        finished.stdout = printed.join().unwrap_or_default();
        finished.code = process.wait()?.code();
        self.holds(None);
        finished.usd = cost.before + cost.of_stage;
        Ok(finished)
    }

    fn take(&self, line: &str, finished: &mut Finished, cost: &mut Cost) {
        match Told::read(line) {
            Some(Told::Progress { text, begins }) => {
                if begins {
                    *cost = Cost { before: cost.before + cost.of_stage, of_stage: 0.0 };
                }
                self.tell(&text);
                return;
            }
            Some(Told::Asked { usd }) => {
                cost.of_stage = cost.of_stage.max(usd.unwrap_or_default());
                return;
            }
            None => tell(line),
        }
        if !finished.error.is_empty() {
            finished.error += &format!("\n{line}");
        } else if let Some(error) = line.strip_prefix(ERROR) {
            error.clone_into(&mut finished.error);
        } else if let Some(warning) = line.strip_prefix(WARNING) {
            finished.warnings.push(warning.to_owned());
        }
    }
}

/// US dollars. Each stage counts by itself.
#[derive(Default)]
struct Cost {
    before: f64,
    of_stage: f64,
}
