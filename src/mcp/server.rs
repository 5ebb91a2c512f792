//! The handshake, and calls of tools beside each other: each in a thread, until it is done or cancelled.

use std::collections::BTreeMap;
use std::io::{self, BufRead, Write};
use std::process::ChildStdin;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, Scope};
use std::time::Duration;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Map, Value, json};

use crate::files::json;

use super::protocol::{self, Code, Id, Line, Message, Refused};
use super::roots::Roots;

/// More than any client has at once; each is a process with as many threads as there are cores.
const MOST_CALLS: usize = 8;

/// How long a call waits for the client's `roots/list`.
const ROOTS_WAIT: Duration = Duration::from_secs(5);

/// The id of that request.
const ROOTS: &str = "roots";

/// What the server says of itself.
pub struct About {
    pub name: &'static str,
    pub version: &'static str,
    /// For the model that uses the tools.
    pub instructions: String,
}

/// What can be called.
pub trait Tools: Sync {
    /// Their names, descriptions and the schemas of their arguments, as `tools/list` has them.
    fn list(&self) -> Value;

    /// Does the work of a tool.
    ///
    /// # Errors
    /// If there is no such tool, or it does not take these arguments.
    fn call(&self, name: &str, arguments: &Map<String, Value>, call: &Call) -> Result<Outcome, Refused>;
}

/// What a tool returns.
#[derive(Debug)]
pub struct Outcome {
    pub content: Vec<Content>,
    /// True if the work failed; the content says why and what to do.
    pub is_error: bool,
}

/// A piece of what a tool returns.
#[derive(Debug)]
pub enum Content {
    Text(String),
    Jpeg(Vec<u8>),
}

/// A tool's work on its way.
pub struct Call<'a> {
    server: &'a Connection<'a>,
    running: Arc<Running>,
    /// By which the client knows its progress, if it wants to know.
    progress_token: Option<Value>,
    told: AtomicUsize,
}

/// What can be ended.
#[derive(Default)]
struct Running(Mutex<Process>);

#[derive(Default)]
struct Process {
    is_cancelled: bool,
    /// The process ends when this is dropped.
    stdin: Option<ChildStdin>,
}

/// A client, and what it has asked for.
struct Connection<'a> {
    about: &'a About,
    tools: &'a dyn Tools,
    /// Those of the user.
    roots: &'a Roots,
    out: Mutex<Box<dyn Write + Send>>,
    state: Mutex<State>,
    roots_are_known: Condvar,
}

#[derive(Default)]
struct State {
    is_begun: bool,
    has_roots: bool,
    /// Those of the user that the client allows; `None` while its list is on its way.
    roots: Option<Roots>,
    running: BTreeMap<String, Arc<Running>>,
}

/// Serves a client until it closes `from`. Running calls are cancelled then.
///
/// # Errors
/// If `from` cannot be read.
pub fn serve(
    about: &About,
    tools: &dyn Tools,
    roots: &Roots,
    from: &mut impl BufRead,
    to: Box<dyn Write + Send>,
) -> io::Result<()> {
    let state = Mutex::new(State { roots: Some(roots.clone()), ..State::default() });
    let server = Connection { about, tools, roots, out: Mutex::new(to), state, roots_are_known: Condvar::new() };
    thread::scope(|scope| {
        let served = server.read(from, scope);
        server.end();
        served
    })
}

impl Connection<'_> {
    fn read<'scope>(&'scope self, from: &mut impl BufRead, scope: &'scope Scope<'scope, '_>) -> io::Result<()> {
        loop {
            match protocol::next_line(from)? {
                Line::End => return Ok(()),
                Line::TooLong => {
                    let why = format!("a line may have {} bytes; send less at once", protocol::MOST_BYTES);
                    self.send(&protocol::error(&Value::Null, &Refused::new(Code::InvalidRequest, why)));
                }
                Line::Whole(line) if line.trim_ascii().is_empty() => {}
                Line::Whole(line) => match protocol::parse(&line) {
                    Err((id, refused)) => self.send(&protocol::error(&id, &refused)),
                    Ok(Message::Request { id, method, params }) => self.request(id, &method, params, scope),
                    Ok(Message::Notification { method, params }) => self.notified(&method, &params),
                    Ok(Message::Response { id, result }) => self.responded(&id, result.as_ref()),
                },
            }
        }
    }

    fn request<'scope>(
        &'scope self,
        id: Id,
        method: &str,
        params: Map<String, Value>,
        scope: &'scope Scope<'scope, '_>,
    ) {
        let is_begun = self.state().is_begun;
        let done = match method {
            "ping" => Ok(json!({})),
            "initialize" => Ok(self.begin(&params)),
            "tools/list" | "tools/call" if !is_begun => {
                Err(Refused::new(Code::InvalidRequest, "a client begins with initialize"))
            }
            "tools/list" => Ok(json!({ "tools": self.tools.list() })),
            "tools/call" => match self.call(&id, params, scope) {
                Ok(()) => return,
                Err(refused) => Err(refused),
            },
            other => Err(Refused::new(Code::NoSuchMethod, format!("there is no method {other:?}"))),
        };
        self.send(&match done {
            Ok(result) => protocol::response(&id, &result),
            Err(refused) => protocol::error_for(&id, &refused),
        });
    }

    fn begin(&self, params: &Map<String, Value>) -> Value {
        let mut state = self.state();
        state.is_begun = true;
        state.has_roots = params.get("capabilities").is_some_and(|has| has.get("roots").is_some_and(Value::is_object));
        let About { name, version, instructions } = self.about;
        json!({
            "protocolVersion": protocol::version_for(params.get("protocolVersion").and_then(Value::as_str)),
            "capabilities": { "tools": {} },
            "serverInfo": { "name": name, "version": version },
            "instructions": instructions,
        })
    }

    fn notified(&self, method: &str, params: &Map<String, Value>) {
        match method {
            "notifications/initialized" | "notifications/roots/list_changed" => {
                let mut state = self.state();
                if state.has_roots {
                    state.roots = None;
                    drop(state);
                    self.send(&protocol::request(ROOTS, "roots/list"));
                }
            }
            "notifications/cancelled" => {
                let id = params.get("requestId").and_then(Id::of);
                let running = id.and_then(|id| self.state().running.get(&id.key()).cloned());
                running.into_iter().for_each(|running| running.cancel());
            }
            // Those that are of no use here, and those of later revisions.
            _ => {}
        }
    }

    fn responded(&self, id: &Value, result: Option<&Value>) {
        if id == ROOTS {
            let roots = result.map_or_else(|| self.roots.clone(), |result| self.roots.narrowed(result));
            self.state().roots = Some(roots);
            self.roots_are_known.notify_all();
        }
    }

    /// Starts a call.
    fn call<'scope>(
        &'scope self,
        id: &Id,
        mut params: Map<String, Value>,
        scope: &'scope Scope<'scope, '_>,
    ) -> Result<(), Refused> {
        let Some(Value::String(name)) = params.remove("name") else {
            return Err(Refused::params("the name of the tool is a text"));
        };
        let arguments = match params.remove("arguments") {
            None => Map::new(),
            Some(Value::Object(arguments)) => arguments,
            Some(_) => return Err(Refused::params("the arguments of a tool are a JSON object")),
        };
        let token = params.get("_meta").and_then(|meta| meta.get("progressToken"));
        let progress_token = token.filter(|token| token.is_string() || token.is_number()).cloned();
        let running = Arc::new(Running::default());
        let mut state = self.state();
        if state.running.contains_key(&id.key()) {
            return Err(Refused::new(Code::InvalidRequest, "a call with this id is running"));
        }
        if state.running.len() >= MOST_CALLS {
            let why = format!("{MOST_CALLS} calls are running; wait for one of them, or cancel it");
            return Err(Refused::new(Code::InvalidRequest, why));
        }
        state.running.insert(id.key(), Arc::clone(&running));
        drop(state);
        let call = Call { server: self, running, progress_token, told: AtomicUsize::new(0) };
        let id = id.clone();
        scope.spawn(move || self.work(&id, &name, &arguments, &call));
        Ok(())
    }

    /// Does the work of a call, and responds unless it was cancelled.
    fn work(&self, id: &Id, name: &str, arguments: &Map<String, Value>, call: &Call) {
        let outcome = self.tools.call(name, arguments, call);
        let response = match outcome {
            Ok(outcome) => protocol::response(id, &outcome.into_json()),
            Err(refused) => protocol::error_for(id, &refused),
        };
        self.state().running.remove(&id.key());
        if !call.is_cancelled() {
            self.send(&response);
        }
    }

    /// Ends what is running.
    fn end(&self) {
        let running: Vec<Arc<Running>> = self.state().running.values().cloned().collect();
        running.iter().for_each(|running| running.cancel());
    }

    /// If nobody reads it, the end of the input ends the server.
    fn send(&self, message: &Value) {
        let line = json::compact(message).expect("a message is plain data") + "\n";
        let mut out = self.out.lock().unwrap_or_else(PoisonError::into_inner);
        let _ = out.write_all(line.as_bytes()).and_then(|()| out.flush());
    }

    /// Whatever a thread that panicked did to it is whole: every change is one insertion or removal.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Running {
    fn process(&self) -> MutexGuard<'_, Process> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn cancel(&self) {
        *self.process() = Process { is_cancelled: true, stdin: None };
    }
}

impl Call<'_> {
    /// The folders that it may touch, once the client has said which.
    pub fn roots(&self) -> Roots {
        let state = self.server.state();
        let is_unknown = |state: &mut State| state.roots.is_none();
        let waited = self.server.roots_are_known.wait_timeout_while(state, ROOTS_WAIT, is_unknown);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        state.roots.clone().unwrap_or_else(|| self.server.roots.clone())
    }

    /// Tells the client how far it is, if it wants to know.
    pub fn tell(&self, text: &str) {
        if let Some(token) = &self.progress_token {
            let progress = self.told.fetch_add(1, Ordering::Relaxed) + 1;
            let params = json!({ "progressToken": token, "progress": progress, "message": text });
            self.server.send(&protocol::notification("notifications/progress", &params));
        }
    }

    pub fn is_cancelled(&self) -> bool {
        self.running.process().is_cancelled
    }

    /// Keeps what ends the call's process, or drops it if the call was cancelled meanwhile.
    pub(super) fn holds(&self, stdin: Option<ChildStdin>) {
        let mut process = self.running.process();
        process.stdin = stdin.filter(|_| !process.is_cancelled);
    }
}

impl Outcome {
    fn into_json(self) -> Value {
        let content = self.content.into_iter().map(|content| match content {
            Content::Text(text) => json!({ "type": "text", "text": text }),
            Content::Jpeg(bytes) => {
                json!({ "type": "image", "mimeType": "image/jpeg", "data": BASE64_STANDARD.encode(bytes) })
            }
        });
        json!({ "content": content.collect::<Vec<_>>(), "isError": self.is_error })
    }
}
