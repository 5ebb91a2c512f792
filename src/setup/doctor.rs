//! `gprop doctor`: checks what is installed, without fetching anything.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use super::environment::Environment;
use super::error::SetupError;
use super::locate::{self, LOOKUP_ORDER, Source};
use super::{ModelFiles, Options};
use crate::config::serialize_path;

/// The state of everything that gprop needs besides itself. Printed by `gprop doctor`, also as JSON.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Doctor {
    /// True if everything is present and valid.
    pub ok: bool,
    pub onnxruntime: RuntimeState,
    pub sam: SamState,
    /// ffmpeg on the search path, which encodes films as MP4; everything else works without it.
    #[serde(serialize_with = "serialize_path")]
    pub ffmpeg: Option<PathBuf>,
    /// Folder of fetched files; `null` if the environment names no home.
    #[serde(serialize_with = "serialize_path")]
    pub cache: Option<PathBuf>,
    /// The problems, each with its remedy.
    pub problems: Vec<String>,
}

/// ONNX Runtime; `null` if it is missing or unusable.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct RuntimeState {
    #[serde(serialize_with = "serialize_path")]
    pub path: Option<PathBuf>,
    pub version: Option<String>,
    pub source: Option<Source>,
}

/// Paths of the two networks; `null` if one is missing or damaged.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct SamState {
    #[serde(serialize_with = "serialize_path")]
    pub encoder: Option<PathBuf>,
    #[serde(serialize_with = "serialize_path")]
    pub decoder: Option<PathBuf>,
}

impl Doctor {
    /// The files that [`crate::segment`] needs, if all of them are there.
    pub fn files(&self) -> Option<ModelFiles> {
        let (runtime, sam) = (&self.onnxruntime, &self.sam);
        Some(ModelFiles {
            onnxruntime: runtime.path.clone()?,
            encoder: sam.encoder.clone()?,
            decoder: sam.decoder.clone()?,
        })
    }

    /// Adds a problem that was found with these files.
    pub fn with_problem(mut self, problem: String) -> Self {
        self.ok = false;
        self.problems.push(problem);
        self
    }
}

pub fn examine(options: &Options, environment: &Environment) -> Doctor {
    let mut problems = Vec::new();
    // Without a cache folder, the same is wrong with all three.
    let mut note = |error: SetupError| {
        let problem = error.to_string();
        if !problems.contains(&problem) {
            problems.push(problem);
        }
    };
    let runtime = locate::onnxruntime(options, environment).map_err(&mut note).ok();
    let encoder = locate::encoder(options, environment).map_err(&mut note).ok();
    let decoder = locate::decoder(options, environment).map_err(&mut note).ok();
    let onnxruntime = runtime.map_or_else(RuntimeState::default, |runtime| RuntimeState {
        path: Some(runtime.path),
        version: Some(runtime.version),
        source: Some(runtime.source),
    });
    Doctor {
        ok: problems.is_empty(),
        onnxruntime,
        sam: SamState { encoder, decoder },
        ffmpeg: on_path("ffmpeg", environment),
        cache: environment.cache.clone(),
        problems,
    }
}

fn on_path(program: &str, environment: &Environment) -> Option<PathBuf> {
    let folders = std::env::split_paths(environment.path.as_ref()?);
    let file = format!("{program}{}", std::env::consts::EXE_SUFFIX);
    folders.map(|folder| folder.join(&file)).find(|path| path.is_file())
}

impl fmt::Display for Doctor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = |path: &Option<PathBuf>| path.as_ref().map_or("missing".to_owned(), |p| p.display().to_string());
        let version = self.onnxruntime.version.as_ref().map_or(String::new(), |version| format!(" ({version})"));
        writeln!(f, "ONNX Runtime  {}{version}", shown(&self.onnxruntime.path))?;
        writeln!(f, "SAM encoder   {}", shown(&self.sam.encoder))?;
        writeln!(f, "SAM decoder   {}", shown(&self.sam.decoder))?;
        match &self.ffmpeg {
            Some(path) => writeln!(f, "ffmpeg        {}", path.display())?,
            None => {
                writeln!(f, "ffmpeg        missing: films are written as GIF, not MP4; install ffmpeg to get MP4")?;
            }
        }
        for problem in &self.problems {
            writeln!(f, "problem: {problem}")?;
        }
        write!(f, "\nLooked for in this order:\n{LOOKUP_ORDER}")
    }
}
