//! `gprop mcp`: the client of the official SDK, and clients that send anything else.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use serde_json::{Value, json};

use crate::batch::ball::Balls;
use crate::query::{a, good_answer};
use crate::run::gprop;
use crate::support::{python, python_has};

/// A server with a client that has begun.
struct Server {
    process: Child,
    stdin: Option<ChildStdin>,
    lines: Receiver<String>,
    last_id: u64,
}

impl Server {
    fn start(root: &Path, more: &[&str]) -> Self {
        Self::of(gprop().arg("mcp").arg("--root").arg(root).args(more))
    }

    fn of(command: &mut Command) -> Self {
        let mut server = Self::silent(command);
        let begun = server.request("initialize", &json!({ "protocolVersion": "2025-06-18", "capabilities": {} }));
        assert_eq!(begun["result"]["protocolVersion"], "2025-06-18", "{begun}");
        server.send(&json!({ "jsonrpc": "2.0", "method": "notifications/initialized" }));
        server
    }

    /// A server to which nothing was said yet.
    fn silent(command: &mut Command) -> Self {
        command.env_remove("OPENAI_API_KEY").stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut process = command.spawn().unwrap();
        let (stdin, stdout) = (process.stdin.take(), BufReader::new(process.stdout.take().unwrap()));
        let (send, lines) = channel();
        std::thread::spawn(move || stdout.lines().map_while(Result::ok).try_for_each(|line| send.send(line)));
        Self { process, stdin, lines, last_id: 0 }
    }

    fn send_line(&mut self, line: &[u8]) {
        let stdin = self.stdin.as_mut().unwrap();
        stdin.write_all(line).and_then(|()| stdin.write_all(b"\n")).unwrap();
    }

    fn send(&mut self, message: &Value) {
        self.send_line(message.to_string().as_bytes());
    }

    fn next(&self) -> Value {
        let line = self.lines.recv_timeout(Duration::from_secs(300)).expect("the server says something");
        let message: Value = serde_json::from_str(&line).unwrap_or_else(|_| panic!("stdout has only messages: {line}"));
        assert_eq!(message["jsonrpc"], "2.0");
        message
    }

    fn ask(&mut self, method: &str, params: &Value) -> u64 {
        self.last_id += 1;
        self.send(&json!({ "jsonrpc": "2.0", "id": self.last_id, "method": method, "params": params }));
        self.last_id
    }

    fn request(&mut self, method: &str, params: &Value) -> Value {
        let id = self.ask(method, params);
        let response = self.next();
        assert_eq!(response["id"], id, "{response}");
        response
    }

    fn call(&mut self, name: &str, arguments: &Value) -> Value {
        self.request("tools/call", &json!({ "name": name, "arguments": arguments }))
    }

    /// The text of a result that is no error.
    fn done(&mut self, name: &str, arguments: &Value) -> String {
        let response = self.call(name, arguments);
        assert_eq!(response["result"]["isError"], false, "{response:#}");
        response["result"]["content"][0]["text"].as_str().unwrap().to_owned()
    }

    /// The text of a result that is an error.
    fn failed(&mut self, name: &str, arguments: &Value) -> String {
        let response = self.call(name, arguments);
        assert_eq!(response["result"]["isError"], true, "{response:#}");
        response["result"]["content"][0]["text"].as_str().unwrap().to_owned()
    }

    /// The code and the text of the protocol's error.
    fn refused(&mut self, name: &str, arguments: &Value) -> (i64, String) {
        error_of(&self.call(name, arguments))
    }

    /// Closes its stdin and waits for it.
    fn end(mut self) -> Option<i32> {
        drop(self.stdin.take());
        self.process.wait().unwrap().code()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        drop(self.stdin.take());
        let _ = self.process.wait();
    }
}

fn error_of(response: &Value) -> (i64, String) {
    let error = &response["error"];
    let code = error["code"].as_i64().unwrap_or_else(|| panic!("no error: {response:#}"));
    (code, error["message"].as_str().unwrap().to_owned())
}

#[test]
fn the_client_of_the_sdk_inspects_answers_runs_and_exports() {
    let test = "the_client_of_the_sdk_inspects_answers_runs_and_exports";
    if !python_has(test, "mcp", "mcp") {
        return;
    }
    let balls = Balls::new(1);
    let root = balls.folder().canonicalize().unwrap();
    let answer = good_answer(a("wood")).to_string();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mcp/client.py");
    let program = Path::new(env!("CARGO_BIN_EXE_gprop"));
    let found = python(&script, &[program, &root, Path::new(&answer)]);
    assert_eq!(found["version"], "2025-11-25", "{found:#}");
    let tools = ["answers", "audit", "export", "grasp", "inspect", "materials", "objects", "questions", "run"];
    assert_eq!(found["tools"], json!(tools));
    assert_eq!(found["gaussians"], 200);
    let early = found["early"]["text"].as_str().unwrap();
    assert!(found["early"]["is_error"] == true && early.contains("`questions` and `answers`"), "{early}");
    let rounds = found["rounds"].as_array().unwrap();
    assert_eq!(rounds.iter().map(|round| round["open"].as_u64().unwrap()).collect::<Vec<_>>(), [6, 2]);
    assert_eq!(rounds[0]["pictures"], json!(vec!["ffd8ff"; 4]), "JPEG");
    assert_eq!((&rounds[0]["mime_types"], &rounds[0]["schemas"][0]), (&json!(["image/jpeg"]), &json!("object")));
    let standing = |round: usize| &rounds[round]["standing"];
    assert_eq!(
        (&standing(0)["recorded"], &standing(0)["open"], &standing(1)["open"]),
        (&json!(4), &json!(2), &json!(0))
    );
    assert!(standing(0)["mass_kg"]["mid"].as_f64().unwrap() > 0.0, "{found:#}");
    assert_eq!(standing(1)["mass_kg"], found["mass_kg"]);
    let told = found["run"]["told"].as_array().unwrap();
    assert!(found["run"]["is_error"] == false && !told.is_empty(), "{found:#}");
    assert!(told.iter().any(|one| one[1].as_str().unwrap().contains("grasp")), "{told:?}");
    assert!(found["grasp"].as_f64().unwrap() > 0.0);
    assert!(told.windows(2).all(|two| two[0][0].as_f64() < two[1][0].as_f64()), "{told:?}");
    let files = found["files"].as_array().unwrap();
    assert!(
        files.len() >= 2 && files.iter().all(|file| Path::new(file.as_str().unwrap()).starts_with(root.join("model")))
    );
    assert!(files.iter().all(|file| Path::new(file.as_str().unwrap()).is_file()));
    assert_eq!(found["wood"], "wood");
    assert_eq!(
        (&found["outside"], &found["narrowed"], &found["narrowed_out"]),
        (&json!(-32602), &json!(true), &json!(-32602))
    );
    // As a person's, under the name.
    let recorded: Vec<String> = fs::read_dir(balls.scene(0).join("recorded"))
        .unwrap()
        .map(|entry| fs::read_to_string(entry.unwrap().path()).unwrap())
        .collect();
    assert!(recorded.len() == 6 && recorded.iter().all(|one| one.contains("an agent") && one.contains("by_hand")));
}

#[test]
fn a_result_is_what_the_command_prints() {
    let balls = Balls::new(1);
    let mut server = Server::start(&balls.folder(), &[]);
    let printed = |arguments: &[&str]| {
        let output = gprop().args(arguments).current_dir(balls.folder()).arg("--json").output().unwrap();
        String::from_utf8(output.stdout).unwrap().trim_end().to_owned()
    };
    assert_eq!(server.done("materials", &json!({ "name": "white oak" })), printed(&["materials", "show", "white oak"]));
    assert_eq!(
        server.done("materials", &json!({ "family": "wood" })),
        printed(&["materials", "list", "--family", "wood"])
    );
    assert!(gprop().arg("query").arg(balls.scene(0)).args(balls.answers()).output().unwrap().status.success());
    let parts = server.done("run", &json!({ "scene": "ball-0", "to": "parts" }));
    assert_eq!(parts, printed(&["run", "ball-0", "--to", "parts"]));
    assert_eq!(server.end(), Some(0));
}

#[test]
fn what_is_sent_to_harm_is_refused_and_the_server_goes_on() {
    let balls = Balls::new(1);
    let outside = tempfile::tempdir().unwrap();
    symlink(outside.path(), balls.folder().join("link")).unwrap();
    symlink("/etc/passwd", balls.scene(0).join("passwd")).unwrap();
    let mut server = Server::silent(gprop().arg("mcp").arg("--root").arg(balls.folder()));
    assert_eq!(error_of(&server.request("tools/list", &json!({}))).0, -32600, "before initialize");
    assert_eq!(server.request("ping", &json!({}))["result"], json!({}));
    let begun = server.request("initialize", &json!({ "protocolVersion": 5, "capabilities": "all" }));
    assert_eq!(begun["result"]["protocolVersion"], "2025-11-25");
    let deep = "[".repeat(1_000_000);
    let long = vec![b'x'; 5 << 20];
    for (line, code) in [
        (b"{" as &[u8], -32700),
        (b"\xff\xfe{}", -32700),
        (deep.as_bytes(), -32700),
        (&long, -32600),
        (b"[]", -32600),
        (b"null", -32600),
        (br#"{"jsonrpc":"2.0","id":{},"method":"ping"}"#, -32600),
        (br#"{"jsonrpc":"2.0","id":1,"method":"ping","params":[1]}"#, -32602),
        (br#"{"jsonrpc":"2.0","id":1,"method":"tools/call","params":{"name":5}}"#, -32602),
        (br#"{"jsonrpc":"2.0","id":1,"method":"tools/call","params":{"name":"run","arguments":[]}}"#, -32602),
        (br#"{"jsonrpc":"2.0","id":1,"method":"server/discover"}"#, -32601),
        (br#"{"jsonrpc":"2.0","id":1,"method":"resources/list"}"#, -32601),
    ] {
        server.send_line(line);
        assert_eq!(error_of(&server.next()).0, code, "{}", String::from_utf8_lossy(&line[..line.len().min(80)]));
    }
    // Nothing answers these.
    for line in [
        br#"{"jsonrpc":"2.0","method":"notifications/unknown"}"# as &[u8],
        br#"{"jsonrpc":"2.0","method":"notifications/cancelled","params":{"requestId":"none"}}"#,
        br#"{"jsonrpc":"2.0","method":"tools/call","params":{"name":"run"}}"#,
        br#"{"jsonrpc":"2.0","id":"roots","result":{"roots":[{"uri":"file:///"}]}}"#,
        b"  ",
    ] {
        server.send_line(line);
    }
    let scene = "ball-0";
    for (tool, arguments, words) in [
        ("shell", json!({}), "no tool"),
        ("inspect", json!({}), "scene"),
        ("inspect", json!({ "scene": 5 }), "scene"),
        ("inspect", json!({ "scene": [scene] }), "scene"),
        ("inspect", json!({ "scene": "none" }), "none"),
        ("inspect", json!({ "scene": "/etc" }), "outside"),
        ("inspect", json!({ "scene": ".." }), "outside"),
        ("inspect", json!({ "scene": "ball-0/../../.." }), "outside"),
        ("inspect", json!({ "scene": "link" }), "outside"),
        ("inspect", json!({ "scene": "ball\u{0}" }), "path"),
        ("inspect", json!({ "scene": scene, "html": "x.html" }), "html"),
        ("run", json!({ "scene": scene, "out": outside.path() }), "outside"),
        ("run", json!({ "scene": scene, "out": "link/work" }), "outside"),
        ("run", json!({ "scene": scene, "answers": "record" }), "record"),
        ("run", json!({ "scene": scene, "max-usd": 5 }), "max-usd"),
        ("run", json!({ "scene": scene, "options": { "lmm-url": "http://127.0.0.1:9/v1" } }), "lmm-url"),
        ("run", json!({ "scene": scene, "options": { "ort_lib": "/tmp/lib.so" } }), "ort-lib"),
        ("run", json!({ "scene": scene, "options": { "answers": "live" } }), "answers"),
        ("run", json!({ "scene": scene, "options": { "scale": "estimate" } }), "only the user"),
        ("run", json!({ "scene": scene, "options": { "masks": "/etc" } }), "leads out"),
        ("run", json!({ "scene": scene, "options": { "materials": "passwd" } }), "leads out"),
        ("run", json!({ "scene": scene, "options": { "turntable": "yes" } }), "true or false"),
        ("run", json!({ "scene": scene, "options": { "views": {} } }), "views"),
        ("grasp", json!({ "scene": scene, "gripper": "/etc/passwd" }), "leads out"),
        ("export", json!({ "scene": scene, "format": ["npz"] }), "out"),
        ("export", json!({ "scene": scene, "format": ["exe"], "out": "x" }), "exe"),
        ("audit", json!({ "paths": ["ball-0", "/etc"] }), "outside"),
        ("audit", json!({ "paths": [] }), "paths"),
        ("answers", json!({ "scene": scene, "name": "", "answers": [{ "query": "a", "answer": {} }] }), "name"),
        ("answers", json!({ "scene": scene, "name": "a", "answers": [{ "query": "a", "answer": 5 }] }), "answer"),
    ] {
        let (code, message) = server.refused(tool, &arguments);
        assert!(code == -32602 && message.contains(words), "{tool} {arguments}: {message}");
    }
    // What the program itself refuses is the result of a tool.
    let wrong = server.failed("run", &json!({ "scene": scene, "scale": "big" }));
    assert!(wrong.contains("--scale") && !wrong.contains("Usage:"), "{wrong}");
    let nearest = server.done("materials", &json!({ "name": "--help" }));
    assert!(
        serde_json::from_str::<Value>(&nearest).unwrap()["density_kg_m3"].is_array(),
        "a name is no flag: {nearest}"
    );
    fs::write(balls.scene(0).join("transforms.json"), "{").unwrap();
    let broken = server.failed("run", &json!({ "scene": scene, "to": "scene" }));
    assert!(broken.contains("transforms.json"), "{broken}");
    assert!(!outside.path().join("work").exists() && fs::read_dir(outside.path()).unwrap().count() == 0);
    assert_eq!(server.end(), Some(0));
}

#[test]
fn an_answer_is_checked_like_any_other_and_may_be_changed() {
    let balls = Balls::new(1);
    let mut server = Server::start(&balls.folder(), &[]);
    let json_of = |text: String| serde_json::from_str::<Value>(&text).unwrap();
    let asked = json_of(server.done("questions", &json!({ "scene": "ball-0", "most": 1 })));
    assert_eq!((&asked["open"], asked["questions"].as_array().unwrap().len()), (&json!(6), 1));
    let query = asked["questions"][0]["query"].clone();
    let answers = |query: &Value, answer: Value| json!({ "scene": "ball-0", "name": "Ada", "answers": [{ "query": query, "answer": answer }] });
    let bad = json_of(server.failed("answers", &answers(&query, json!({ "material": "unobtainium" }))));
    assert_eq!((&bad["recorded"], &bad["open"], &bad["mass_kg"]), (&json!(0), &json!(6), &Value::Null));
    assert_eq!(bad["refused"][0]["query"], query);
    assert!(bad["refused"][0]["problem"].as_str().unwrap().contains("caption"), "{bad}");
    assert!(bad["no_mass"].as_str().unwrap().len() > 10, "{bad}");
    let unknown = json_of(server.failed("answers", &answers(&json!("0123"), good_answer(a("wood")))));
    assert!(unknown["refused"][0]["problem"].as_str().unwrap().contains("no question"), "{unknown}");
    let of_wood = json_of(server.done("answers", &answers(&query, good_answer(a("wood")))));
    assert_eq!((&of_wood["recorded"], &of_wood["open"], &of_wood["refused"]), (&json!(1), &json!(5), &json!([])));
    let of_metal = json_of(server.done("answers", &answers(&query, good_answer(a("metal")))));
    let mass = |standing: &Value| standing["mass_kg"]["mid"].as_f64().unwrap();
    assert!(of_metal["open"] == 5 && mass(&of_metal) > 2.0 * mass(&of_wood), "{of_wood} {of_metal}");
    let partial = json_of(server.done("run", &json!({ "scene": "ball-0", "to": "parts", "answers": "partial" })));
    assert_eq!(partial["object"]["mass_kg"], of_metal["mass_kg"]);
}

#[test]
fn a_call_is_cancelled_without_a_response_and_the_next_one_goes_on() {
    let balls = Balls::new(1);
    assert!(gprop().arg("query").arg(balls.scene(0)).args(balls.answers()).output().unwrap().status.success());
    let mut server = Server::start(&balls.folder(), &[]);
    // A simulation that takes minutes.
    let options = json!({ "duration": 30, "frames": 60, "grid": 128, "rigid": "off" });
    let arguments = json!({ "scene": "ball-0", "to": "simulate", "options": options });
    let params = json!({ "name": "run", "arguments": arguments, "_meta": { "progressToken": "p" } });
    let id = server.ask("tools/call", &params);
    let mut told = Vec::new();
    loop {
        let message = server.next();
        assert_eq!(
            (&message["method"], &message["params"]["progressToken"]),
            (&json!("notifications/progress"), &json!("p")),
            "{message}"
        );
        told.push(message["params"]["message"].as_str().unwrap().to_owned());
        if told.last().unwrap().contains("simulate") {
            break;
        }
    }
    server.send(&json!({ "jsonrpc": "2.0", "method": "notifications/cancelled", "params": { "requestId": id } }));
    let parts = server.ask("tools/call", &json!({ "name": "run", "arguments": { "scene": "ball-0", "to": "parts" } }));
    let response = loop {
        let message = server.next();
        if message["method"].is_null() {
            break message;
        }
    };
    assert_eq!((&response["id"], &response["result"]["isError"]), (&json!(parts), &json!(false)), "{response:#}");
    let record: Value = serde_json::from_slice(&fs::read(balls.scene(0).join("gprop/run.json")).unwrap()).unwrap();
    let reused = record["stages"].as_array().unwrap().iter().filter(|stage| stage["reused"] == true).count();
    assert!(reused >= 5, "{record:#}");
    // A client that goes away ends its calls.
    server.ask("tools/call", &params);
    while !server.next()["params"]["message"].as_str().is_some_and(|told| told.contains("simulate")) {}
    assert_eq!(server.end(), Some(0));
    assert!(gprop().arg("parts").arg(balls.scene(0)).output().unwrap().status.success(), "the work folder is unlocked");
}

#[test]
fn a_model_is_asked_only_within_what_the_user_allows() {
    let balls = Balls::new(1);
    let home = tempfile::tempdir().unwrap();
    let configuration = home.path().join("gprop");
    fs::create_dir(&configuration).unwrap();
    let [_, url, _, model] = balls.answers();
    let costs = "price = \"1,1\"\nlmm-max-tokens = 400\nlmm-parallel = 1\n";
    let text = format!("lmm-url = {url:?}\nlmm-model = {model:?}\nanswers = \"live\"\n{costs}");
    fs::write(configuration.join("config.toml"), text).unwrap();
    let server = |more: &[&str]| {
        Server::of(gprop().env("XDG_CONFIG_HOME", home.path()).args(["mcp", "--root"]).arg(balls.folder()).args(more))
    };
    let recorded = || fs::read_dir(balls.scene(0).join("recorded")).map_or(0, Iterator::count);
    let paid = json!({ "scene": "ball-0", "to": "parts", "answers": "record" });
    let mut unpaid = server(&[]);
    unpaid.failed("run", &json!({ "scene": "ball-0", "to": "parts" }));
    assert_eq!(unpaid.refused("run", &paid).0, -32602);
    let mut poor = server(&["--allow-paid", "0.000001"]);
    let said = poor.failed("run", &paid);
    assert!(said.contains("--max-usd") && recorded() == 0, "{said}");
    let mut rich = server(&["--allow-paid", "1"]);
    rich.failed("run", &json!({ "scene": "ball-0", "to": "parts" }));
    let said = rich.failed("run", &json!({ "scene": "ball-0", "to": "parts", "answers": "record", "max-usd": 0 }));
    assert!(said.contains("--max-usd") && recorded() == 0, "{said}");
    // Six requests are expected to cost 0.0304 USD, and cost 1280 tokens each, 0.0077 USD. What was spent is gone: as much as is
    // expected for the same again is not left.
    let mut once = server(&["--allow-paid", "0.034"]);
    once.done("run", &paid);
    assert_eq!(recorded(), 6);
    fs::remove_dir_all(balls.scene(0).join("recorded")).unwrap();
    fs::remove_dir_all(balls.scene(0).join("gprop")).unwrap();
    let said = once.failed("run", &paid);
    assert!(said.contains("--max-usd") && recorded() < 6, "{said}");
}
