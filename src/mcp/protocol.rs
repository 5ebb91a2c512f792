//! JSON-RPC 2.0 as the Model Context Protocol has it on stdio: one message in each line. What comes in is from outside: lines
//! are bounded, and whatever is no message is refused with an error that says so.

use std::io::{self, BufRead};

use serde_json::{Map, Value, json};

use crate::files::json;

/// The longest line: a hundred times the answers about an object of 28 pieces.
pub const MOST_BYTES: usize = 4 << 20;

/// The revisions of the protocol that begin with `initialize`, oldest first. Later ones have no handshake; their clients ask for
/// `server/discover` first, and begin with `initialize` where there is no such method. Revision 2025-03-26 is left out: it alone
/// has batches of messages.
const VERSIONS: [&str; 3] = ["2024-11-05", "2025-06-18", "2025-11-25"];

/// The error codes of JSON-RPC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum Code {
    NotJson = -32700,
    InvalidRequest = -32600,
    NoSuchMethod = -32601,
    InvalidParams = -32602,
}

/// A request that is not carried out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    pub code: Code,
    pub message: String,
}

impl Refused {
    pub fn new(code: Code, message: impl Into<String>) -> Self {
        Self { code, message: message.into() }
    }

    /// The arguments are not what the method or the tool takes.
    pub fn params(message: impl Into<String>) -> Self {
        Self::new(Code::InvalidParams, message)
    }
}

/// The id of a request: a text or a number.
#[derive(Debug, Clone, PartialEq)]
pub struct Id(Value);

impl Id {
    /// The id, if that is what the value is.
    pub fn of(value: &Value) -> Option<Self> {
        let is_id = value.is_string() || value.is_i64() || value.is_u64();
        is_id.then(|| Self(value.clone()))
    }

    /// By which it is found: `1` and `"1"` differ.
    pub fn key(&self) -> String {
        self.0.to_string()
    }
}

/// What a client sends.
#[derive(Debug, PartialEq)]
pub enum Message {
    Request {
        id: Id,
        method: String,
        params: Map<String, Value>,
    },
    Notification {
        method: String,
        params: Map<String, Value>,
    },
    /// The result of a request of the server; `None` if the client could not carry it out.
    Response {
        id: Value,
        result: Option<Value>,
    },
}

/// The message in a line; or why it is none, with the id to answer to.
pub fn parse(line: &[u8]) -> Result<Message, (Value, Refused)> {
    let refused = |id: &Value, code, message: &str| (id.clone(), Refused::new(code, message));
    let parsed: Value = json::read(line)
        .map_err(|error| (Value::Null, Refused::new(Code::NotJson, format!("the line is not JSON: {error}"))))?;
    let Value::Object(mut message) = parsed else {
        return Err(refused(&Value::Null, Code::InvalidRequest, "a message is a JSON object; batches are not taken"));
    };
    let given = message.remove("id");
    let id = given.as_ref().and_then(Id::of);
    let reply_to = id.as_ref().map_or(Value::Null, |id| id.0.clone());
    if message.get("jsonrpc").and_then(Value::as_str) != Some("2.0") {
        return Err(refused(&reply_to, Code::InvalidRequest, "a message has \"jsonrpc\": \"2.0\""));
    }
    let Some(method) = message.remove("method") else {
        if message.contains_key("result") || message.contains_key("error") {
            return Ok(Message::Response { id: reply_to, result: message.remove("result") });
        }
        return Err(refused(&reply_to, Code::InvalidRequest, "a message has a method, a result or an error"));
    };
    let Value::String(method) = method else {
        return Err(refused(&reply_to, Code::InvalidRequest, "the method is a text"));
    };
    let params = match message.remove("params") {
        None => Map::new(),
        Some(Value::Object(params)) => params,
        Some(_) => return Err(refused(&reply_to, Code::InvalidParams, "params are a JSON object")),
    };
    match (given, id) {
        (None, _) => Ok(Message::Notification { method, params }),
        (Some(_), Some(id)) => Ok(Message::Request { id, method, params }),
        (Some(_), None) => Err(refused(&Value::Null, Code::InvalidRequest, "an id is a text or an integer")),
    }
}

/// The revision of the protocol to speak with a client that asks for one: that, or else the latest.
pub fn version_for(asked: Option<&str>) -> &'static str {
    let [.., latest] = VERSIONS;
    VERSIONS.into_iter().find(|version| Some(*version) == asked).unwrap_or(latest)
}

pub fn response(id: &Id, result: &Value) -> Value {
    json!({ "jsonrpc": "2.0", "id": id.0, "result": result })
}

pub fn error(id: &Value, refused: &Refused) -> Value {
    let error = json!({ "code": refused.code as i32, "message": refused.message });
    json!({ "jsonrpc": "2.0", "id": id, "error": error })
}

pub fn error_for(id: &Id, refused: &Refused) -> Value {
    error(&id.0, refused)
}

pub fn request(id: &str, method: &str) -> Value {
    json!({ "jsonrpc": "2.0", "id": id, "method": method })
}

pub fn notification(method: &str, params: &Value) -> Value {
    json!({ "jsonrpc": "2.0", "method": method, "params": params })
}

/// What was read.
#[derive(Debug, PartialEq)]
pub enum Line {
    Whole(Vec<u8>),
    /// A line that was longer than [`MOST_BYTES`], and was skipped.
    TooLong,
    End,
}

/// The next line, without more of it in memory than is allowed.
pub fn next_line(from: &mut impl BufRead) -> io::Result<Line> {
    let (mut line, mut is_too_long) = (Vec::new(), false);
    loop {
        let read = match from.fill_buf() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            read => read?,
        };
        if read.is_empty() {
            // The client has gone in the middle of a line, or after it.
            return Ok(Line::End);
        }
        let end = read.iter().position(|byte| *byte == b'\n');
        let piece = &read[..end.unwrap_or(read.len())];
        is_too_long |= line.len() + piece.len() > MOST_BYTES;
        if is_too_long {
            line.clear();
        } else {
            line.extend_from_slice(piece);
        }
        let used = end.map_or(read.len(), |end| end + 1);
        from.consume(used);
        if end.is_some() {
            return Ok(if is_too_long { Line::TooLong } else { Line::Whole(line) });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_message_is_refused_with_its_id_if_it_has_one() {
        for (line, id, code) in [
            ("{", json!(null), Code::NotJson),
            ("\u{0}", json!(null), Code::NotJson),
            ("[]", json!(null), Code::InvalidRequest),
            ("5", json!(null), Code::InvalidRequest),
            ("{}", json!(null), Code::InvalidRequest),
            (r#"{"jsonrpc":"1.0","id":3,"method":"ping"}"#, json!(3), Code::InvalidRequest),
            (r#"{"jsonrpc":"2.0","id":3}"#, json!(3), Code::InvalidRequest),
            (r#"{"jsonrpc":"2.0","id":3,"method":5}"#, json!(3), Code::InvalidRequest),
            (r#"{"jsonrpc":"2.0","id":[3],"method":"ping"}"#, json!(null), Code::InvalidRequest),
            (r#"{"jsonrpc":"2.0","id":null,"method":"ping"}"#, json!(null), Code::InvalidRequest),
            (r#"{"jsonrpc":"2.0","id":1.5,"method":"ping"}"#, json!(null), Code::InvalidRequest),
            (r#"{"jsonrpc":"2.0","id":"a","method":"ping","params":[]}"#, json!("a"), Code::InvalidParams),
        ] {
            let (to, refused) = parse(line.as_bytes()).expect_err(line);
            assert_eq!((to, refused.code), (id, code), "{line}");
        }
        let deep = "[".repeat(100_000);
        assert_eq!(parse(deep.as_bytes()).unwrap_err().1.code, Code::NotJson);
        let ping = parse(br#"{"jsonrpc":"2.0","id":"1","method":"ping"}"#).unwrap();
        assert!(matches!(ping, Message::Request { id, .. } if id != Id(json!(1))));
    }

    #[test]
    fn a_line_that_is_too_long_is_skipped_and_the_next_one_is_read() {
        let text = format!("{}\nnext\nhalf", "x".repeat(MOST_BYTES + 1));
        let mut from = io::BufReader::with_capacity(1000, text.as_bytes());
        let mut next = || next_line(&mut from).unwrap();
        assert_eq!([next(), next(), next()], [Line::TooLong, Line::Whole(b"next".to_vec()), Line::End]);
    }

    #[test]
    fn the_version_is_that_of_the_client_or_the_latest() {
        assert_eq!(version_for(Some("2025-06-18")), "2025-06-18");
        assert_eq!(version_for(Some("2026-07-28")), "2025-11-25");
        assert_eq!(version_for(None), "2025-11-25");
    }
}
