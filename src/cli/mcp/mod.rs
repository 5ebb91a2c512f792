//! `gprop mcp`: the program's commands as tools of the Model Context Protocol.
//!
//! 1. [`tools`]: which commands, with which of their options.
//! 2. [`words`]: a tool's arguments as the words of a command line, once its schema, the roots and the rules for what a scene
//!    may set allow them.
//! 3. [`answering`]: the open questions with their pictures, and answers to them.
//!
//! Each call runs the program, so its result is what the command prints with `--json`.

mod answering;
mod tools;
mod words;

use std::ffi::OsString;
use std::io;
use std::sync::{Mutex, PoisonError};

use serde_json::{Map, Value};

use crate::error::{ErrorKind, Result, UsageError};
use crate::mcp::{self, About, Call, Content, Finished, Outcome, Refused, Roots};
use crate::pipeline::THREADS;
use crate::query::exchange::read_back::Origins;

use super::Global;
use super::arguments::McpArgs;
use tools::{Kind, Tool};
use words::Words;

/// For the model that uses the tools.
const INSTRUCTIONS: &str = "gprop gives a 3D Gaussian Splatting scene or a mesh materials, masses and grasps. Start with `inspect`. `run` \
                            needs answers about materials: get the open ones with `questions`, look at each picture, send answers with \
                            `answers` and repeat until none is open; then `run`, `grasp` and `export`. Masses need a scale (the options \
                            `scale` or `known-mass`). Options hold for later calls on the scene, until `fresh`. All units are SI.";

/// Serves a client on stdin and stdout.
pub fn serve(global: &Global, args: &McpArgs) -> Result<()> {
    let tools = Commands {
        tools: tools::all(args.allow_paid.is_some()),
        purse: args.allow_paid.map(Mutex::new),
        threads: global.threads,
        origins: Mutex::default(),
    };
    let about = About { name: "gprop", version: env!("CARGO_PKG_VERSION"), instructions: INSTRUCTIONS.to_owned() };
    let roots = Roots::of(&args.roots)?;
    mcp::serve(&about, &tools, &roots, &mut io::stdin().lock(), Box::new(io::stdout()))
        .map_err(|error| UsageError(format!("cannot read stdin: {error}")).into())
}

/// The commands that are tools.
struct Commands {
    tools: Vec<Tool>,
    /// The US dollars that are left; `None` if no model may be asked.
    purse: Option<Mutex<f64>>,
    threads: Option<usize>,
    /// What the questions that a client was shown are about, so that it may change an answer.
    origins: Mutex<Origins>,
}

impl mcp::Tools for Commands {
    fn list(&self) -> Value {
        self.tools.iter().map(Tool::listed).collect()
    }

    fn call(&self, name: &str, arguments: &Map<String, Value>, call: &Call) -> Result<Outcome, Refused> {
        let tool = self.tools.iter().find(|tool| tool.name == name);
        let tool = tool.ok_or_else(|| Refused::params(format!("there is no tool {name:?}; tools/list lists them")))?;
        tool.check(arguments)?;
        let words = Words::of(tool, arguments, &call.roots())?;
        Ok(match tool.kind {
            Kind::Command { .. } => self.command(words, arguments, call)?,
            Kind::Questions => self.questions(&words, arguments, call),
            Kind::Answers => self.answers(&words, arguments, call),
        })
    }
}

impl Commands {
    fn command(&self, mut words: Words, arguments: &Map<String, Value>, call: &Call) -> Result<Outcome, Refused> {
        if arguments.get("answers").and_then(Value::as_str) != Some(tools::PAID) {
            return Ok(outcome(self.run(&words, &[], call)));
        }
        if words.is_robot_file {
            let why = "a model is asked about single objects and captures; run the links of a URDF or MJCF one by one";
            return Err(Refused::params(why));
        }
        let purse = self.purse.as_ref().expect("the schema has `record` only if there is one");
        // Runs that pay come one after the other.
        let mut left = purse.lock().unwrap_or_else(PoisonError::into_inner);
        let asked = arguments.get("max-usd").and_then(Value::as_f64).unwrap_or(*left);
        let allowed = asked.clamp(0.0, *left);
        words.flags.push(format!("--max-usd={allowed}").into());
        let ended = self.run(&words, &[], call);
        // One that did not end by itself may have a request on its way.
        let spent = ended.as_ref().map_or(0.0, |ended| if ended.code.is_some() { ended.usd } else { allowed });
        *left = (*left - spent).max(0.0);
        Ok(outcome(ended))
    }

    /// Runs a command line with more flags.
    fn run(&self, words: &Words, more: &[OsString], call: &Call) -> io::Result<Finished> {
        let threads = self.threads.map(|threads| OsString::from(format!("--{THREADS}={threads}")));
        call.run(&words.line(&[more, threads.as_slice()].concat()))
    }
}

/// What a tool returns of a command that ended.
fn outcome(ended: io::Result<Finished>) -> Outcome {
    match ended {
        Ok(Finished { code: Some(code), stdout, warnings, .. }) if is_done(code) => {
            let warnings = (!warnings.is_empty()).then(|| Content::Text(format!("warnings:\n{}", warnings.join("\n"))));
            let content = [Content::Text(stdout.trim_end().to_owned())].into_iter().chain(warnings).collect();
            Outcome { content, is_error: false }
        }
        Ok(ended) => {
            let printed = ended.stdout.trim_end();
            let printed = (!printed.is_empty()).then(|| Content::Text(printed.to_owned()));
            failed([Some(Content::Text(message_of(&ended))), printed].into_iter().flatten().collect())
        }
        Err(error) => failed(vec![Content::Text(format!("cannot start gprop: {error}; is there memory left?"))]),
    }
}

/// Everything was done; a check may have found something wrong.
fn is_done(code: i32) -> bool {
    code == 0 || code == i32::from(ErrorKind::Wrong.exit_code())
}

fn failed(content: Vec<Content>) -> Outcome {
    Outcome { content, is_error: true }
}

/// What went wrong, and the remedy.
fn message_of(ended: &Finished) -> String {
    let Finished { code, error, .. } = ended;
    // Of wrong usage, clap also prints the usage.
    let error = ["\n\nUsage:", "\n\nFor more information"]
        .iter()
        .fold(error.as_str(), |text, end| text.split_once(end).map_or(text, |(message, _)| message));
    let answer = i32::from(ErrorKind::Answer.exit_code());
    match code {
        Some(code) if *code == answer => format!(
            "{error}\nThe tools `questions` and `answers` let you answer; \"answers\": \"partial\" goes on without those that are open."
        ),
        Some(code) if error.is_empty() => format!("gprop ended with exit code {code} and no message"),
        Some(_) => error.to_owned(),
        None => {
            "gprop was ended by a signal; the machine may have been short of memory. What is done is kept: call again"
                .to_owned()
        }
    }
}
