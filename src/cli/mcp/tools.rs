//! The tools: commands of the program, with some of their options by name and the others of a scene together. Descriptions and
//! schemas come from the definitions of the flags.

use clap::Arg;
use jsonschema::Validator;
use serde_json::{Map, Value, json};

use crate::cli::command;
use crate::cli::option_types::{self, doc_of, takes_several};
use crate::mcp::Refused;

/// The answers with which a run asks a model.
pub const PAID: &str = "record";

/// A tool.
pub struct Tool {
    pub name: &'static str,
    pub kind: Kind,
    /// The command of which it is made.
    pub command: &'static [&'static str],
    about: &'static str,
    reads_only: bool,
    schema: Value,
    validator: Validator,
    /// Its options that are flags of the command.
    pub flags: Vec<Arg>,
}

/// What it does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Runs its command on what the argument of this name names.
    Command {
        on: Option<On>,
    },
    Questions,
    Answers,
}

/// What a command works on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum On {
    Scene,
    Paths,
    Material,
}

/// The options by which an object is found and weighed.
const OBJECT: &[&str] = &["scale", "known-mass", "object", "up", "correct"];
/// The argument for all others that a scene may set.
pub const OPTIONS: &str = "options";

/// The tools, of which one may ask a model if the user `pays`.
pub fn all(pays: bool) -> Vec<Tool> {
    let scene = Kind::Command { on: Some(On::Scene) };
    let tool = |name, kind, command, flags: &[&[&str]], about| Tool::new(name, kind, command, &flags.concat(), about);
    let inspect: &[&str] = &["scale", "up", "view-list"];
    let run: &[&str] = &["to", "no-simulate", "from", "out", "answers", "fresh"];
    let grasp: &[&str] = &["out", "answers", "fresh", "part", "gripper", "object"];
    let export: &[&str] = &[
        "format",
        "out",
        "work",
        "answers",
        "fresh",
        "object",
        "colliders",
        "samples",
        "origin",
        "at",
        "floating",
        "friction",
        "license",
        "author",
        "wikidata",
        "semantic-label",
        "links",
        "deformable",
        "pad-geom",
        "glb-look",
        "mjcf-splats",
    ];
    let mut tools = vec![
        tool(
            "inspect",
            scene,
            &["inspect"],
            &[inspect],
            "What a scene holds, whether photos, cameras and Gaussians agree, its scale and which way is up.",
        ),
        tool(
            "objects",
            scene,
            &["objects"],
            &[&["out"]],
            "The objects that stand on the table of a capture, numbered as `object` in other tools.",
        ),
        tool(
            "run",
            scene,
            &["run"],
            &[run, OBJECT],
            "Runs the stages up to `to` with answers that are recorded, and returns the result of the last one: the report, or with \"to\": \"parts\" the masses alone. Minutes the first time; what is done is used again.",
        ),
        tool(
            "questions",
            Kind::Questions,
            &["query"],
            &[&["out", "fresh"], OBJECT],
            "The questions about materials that have no answer yet, each with its prompt, the schema of its answer and its picture. Look at the picture and answer with `answers`.",
        ),
        tool(
            "answers",
            Kind::Answers,
            &["query"],
            &[&["out"], OBJECT],
            "Checks and records answers under a name; returns what was refused and why, how many questions are open now, and the mass on the answers so far.",
        ),
        tool("grasp", scene, &["grasp"], &[grasp], "Where and with what force a gripper can lift the object."),
        tool(
            "export",
            scene,
            &["export"],
            &[export],
            "Writes the result in the format of another program into the folder `out`, and returns the files.",
        ),
        tool(
            "materials",
            Kind::Command { on: Some(On::Material) },
            &["materials"],
            &[&["family"]],
            "With `name`, a material with all properties, their ranges and sources; else the list of all, or of one family.",
        ),
        tool(
            "audit",
            Kind::Command { on: Some(On::Paths) },
            &["audit"],
            &[&[]],
            "Checks what URDF, MJCF, USD and glTF claim of masses, inertias, centres of mass, frictions and colliders.",
        ),
    ];
    for tool in tools.iter_mut().filter(|tool| tool.flags.iter().any(is_answers)) {
        let may_ask = pays && tool.name == "run";
        tool.restrict_answers(may_ask);
    }
    tools
}

fn is_answers(flag: &Arg) -> bool {
    flag.get_long() == Some("answers")
}

impl Tool {
    fn new(
        name: &'static str,
        kind: Kind,
        words: &'static [&'static str],
        flags: &[&str],
        about: &'static str,
    ) -> Self {
        let mut command = command();
        command.build();
        for word in words {
            command = command.find_subcommand(word).expect("it is a command").clone();
        }
        // Those of `materials` are options of what lists them.
        let list = command.find_subcommand("list").cloned();
        let all: Vec<&Arg> =
            command.get_arguments().chain(list.iter().flat_map(clap::Command::get_arguments)).collect();
        let of_name = |name: &&str| {
            let found = all.iter().find(|flag| flag.get_long() == Some(*name));
            (*found.unwrap_or_else(|| panic!("{words:?} has no --{name}"))).clone()
        };
        let flags: Vec<Arg> = flags.iter().map(of_name).collect();
        let (mut properties, mut required) = (Map::new(), Vec::new());
        let mut add = |name: &str, schema: Value, is_required: bool| {
            properties.insert(name.to_owned(), schema);
            required.extend(is_required.then(|| name.to_owned()));
        };
        for (name, schema, is_required) in own_arguments(kind) {
            add(name, schema, is_required);
        }
        for flag in &flags {
            let option = flag.get_long().unwrap_or_default();
            // Only `gprop export --list` goes without, and no tool has it.
            let is_required = flag.is_required_set() || (name, option) == ("export", "out");
            add(option, schema_of(flag), is_required);
        }
        let schema = json!({
            "type": "object", "properties": properties, "required": required, "additionalProperties": false,
        });
        let reads_only = ["inspect", "materials", "audit"].contains(&name);
        let validator = jsonschema::validator_for(&schema).expect("it is a schema");
        Self { name, kind, command: words, about, reads_only, schema, validator, flags }
    }

    /// Leaves the answers that ask a model out, unless this tool may ask.
    fn restrict_answers(&mut self, may_ask: bool) {
        let paid = may_ask.then_some(PAID);
        let sources: Vec<&str> = ["replay", "partial"].into_iter().chain(paid).collect();
        let asks =
            "; `record` asks the model that the user's configuration names for those that are missing, and pays for it";
        let asks = if may_ask { asks } else { "" };
        let about =
            format!("`replay` (default) takes recorded answers only; `partial` goes on without missing ones{asks}");
        let properties = &mut self.schema["properties"];
        properties["answers"] = json!({ "type": "string", "enum": sources, "description": about });
        if may_ask {
            let about = "The most that this run may cost, in US dollars, within what the user allows";
            properties["max-usd"] = json!({ "type": "number", "minimum": 0, "description": about });
        }
        self.validator = jsonschema::validator_for(&self.schema).expect("it is a schema");
    }

    /// As `tools/list` has it.
    pub fn listed(&self) -> Value {
        json!({
            "name": self.name,
            "description": self.about,
            "inputSchema": self.schema,
            "annotations": { "readOnlyHint": self.reads_only, "destructiveHint": false, "idempotentHint": true },
        })
    }

    /// Checks arguments by the schema.
    pub fn check(&self, arguments: &Map<String, Value>) -> Result<(), Refused> {
        let arguments = Value::Object(arguments.clone());
        let wrong = |error: jsonschema::ValidationError| {
            let place = error.instance_path().as_str().trim_start_matches('/').to_owned();
            let place = if place.is_empty() { String::new() } else { format!(" {place}:") };
            // It quotes the value, which may be long.
            let problem: String = error.to_string().chars().take(300).collect();
            Refused::params(format!("{}:{place} {problem}", self.name))
        };
        self.validator.validate(&arguments).map_err(wrong)
    }
}

/// The arguments that are no flags: name, schema, and whether they are required.
fn own_arguments(kind: Kind) -> Vec<(&'static str, Value, bool)> {
    let text = |about: &str| json!({ "type": "string", "minLength": 1, "description": about });
    let scene = (
        "scene",
        text("Folder with a splat, cameras and photos, or a mesh (.glb, .gltf, .obj, .stl, .ply), or a URDF or MJCF"),
        true,
    );
    let scalar = json!({ "type": ["string", "number", "boolean"] });
    let options = (
        OPTIONS,
        json!({
            "type": "object",
            "description": "Other options by the names that gprop.toml has, such as {\"views\": 12, \"grid\": 64}; `gprop run --help-all` explains them",
            "additionalProperties": { "anyOf": [scalar, { "type": "array", "items": scalar }] },
        }),
        false,
    );
    let answers = json!({
        "type": "array",
        "minItems": 1,
        "maxItems": 1000,
        "items": {
            "type": "object",
            "properties": {
                "query": text("The question's name"),
                "answer": { "type": "object", "description": "What the question's schema asks for" },
            },
            "required": ["query", "answer"],
            "additionalProperties": false,
        },
    });
    let most = json!({ "type": "integer", "minimum": 1, "maximum": 100, "description": "The most questions to return [default: 6]" });
    match kind {
        Kind::Command { on: Some(On::Scene) } => vec![scene, options],
        Kind::Command { on: Some(On::Paths) } => {
            let paths = json!({ "type": "array", "minItems": 1, "items": text("File or folder") });
            vec![("paths", paths, true)]
        }
        Kind::Command { on: Some(On::Material) } => vec![("name", text("Name or alias of a material"), false)],
        Kind::Command { on: None } => Vec::new(),
        Kind::Questions => vec![scene, options, ("most", most, false)],
        Kind::Answers => vec![
            scene,
            options,
            ("name", text("Who answers: your name, under which the answers are recorded"), true),
            ("answers", answers, true),
        ],
    }
}

/// The schema of an option.
fn schema_of(flag: &Arg) -> Value {
    let one = match option_types::Kind::of(flag) {
        option_types::Kind::Switch | option_types::Kind::Bool => json!({ "type": "boolean" }),
        option_types::Kind::Choice(words) => json!({ "type": "string", "enum": words }),
        option_types::Kind::Float => json!({ "type": "number" }),
        option_types::Kind::Int => json!({ "type": "integer" }),
        option_types::Kind::Path | option_types::Kind::Text => json!({ "type": "string" }),
        option_types::Kind::TextOrNumber => json!({ "type": ["string", "number"] }),
    };
    let mut schema =
        if takes_several(flag) { json!({ "anyOf": [one, { "type": "array", "items": one }] }) } else { one };
    schema["description"] = doc_of(flag).into();
    schema
}
