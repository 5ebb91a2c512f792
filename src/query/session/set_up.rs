//! What a session is made of, by the options: recordings, prompts, materials, the model's price.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::error::{Context, Result, UsageError};
use crate::files;
use crate::files::read_scope::ReadScope;
use crate::materials::MaterialLibrary;
use crate::query::ask::cost::{Price, PriceTable, UsdPerMtok};
use crate::query::client;
use crate::query::question::schema::Schema;
use crate::query::{Options, PromptError, Prompts, Sha256Hex};
use crate::scene::{Reference, SceneError};
use crate::workdir::WorkDir;

/// Recordings are stored beside their scene or picture, so that they are copied together with it.
pub(super) const RECORDINGS: &str = "recorded";

/// The folder in the work folder for recordings that could not be written to their own.
pub(super) const SPARE_RECORDINGS: &str = "unrecorded";

/// Refuses recordings beside the scene or picture in `home`, or in the work folder, that lead outside `scope`. A folder
/// given with `--recordings` is not checked, and other recordings may be links into it.
pub fn check_recordings(options: &Options, home: &Path, work: &WorkDir, scope: ReadScope) -> Result<(), SceneError> {
    let scope = scope.and([work.root()]).and(options.recordings.as_deref());
    for folder in [home.join(RECORDINGS), work.root().join(SPARE_RECORDINGS)] {
        if let Some((path, _)) = scope.leads_out_below(&folder) {
            Reference { what: "recording", path: &path, named_in: None, flag: None }.check(&scope)?;
        }
    }
    Ok(())
}

/// The folders from which recordings are read; new ones go to the last.
pub fn recording_folders(options: &Options, home: &Path) -> Vec<PathBuf> {
    [home.join(RECORDINGS)].into_iter().chain(options.recordings.clone()).collect()
}

/// The built-in prompts or the user's.
pub fn prompts(options: &Options) -> Result<Prompts> {
    Ok(options.prompts.as_deref().map_or_else(|| Ok(Prompts::builtin()), Prompts::from_folder)?)
}

/// The hashes of the schemas of answers about the whole object: how long it is, and what it is.
pub fn schemas_about_whole(options: &Options) -> Result<[Sha256Hex; 2]> {
    let prompts = prompts(options)?;
    let hash = |(file, schema): (&str, &Value)| -> Result<_, PromptError> {
        Ok(Schema::new(file, schema.clone(), &[], &[])?.sha256().clone())
    };
    Ok([hash(prompts.size_schema())?, hash(prompts.object_schema())?])
}

/// The materials that a model may choose from.
pub fn candidates<'a>(options: &Options, library: &'a MaterialLibrary) -> Result<Cow<'a, MaterialLibrary>> {
    Ok(match &options.labels {
        Some(labels) => Cow::Owned(labels.restrict(library)?),
        None => Cow::Borrowed(library),
    })
}

/// The price of the model: the user's own, that of the user's price table or the built-in one, or none at all if it runs on
/// this machine. A model of these tables may be behind a gateway on this machine, and is paid for then.
pub fn price(options: &Options) -> Result<Option<Price>> {
    let table = match &options.prices {
        None => PriceTable::builtin(),
        Some(path) => {
            let text = files::read_to_string(path)
                .map_err(|error| UsageError(format!("cannot read --prices {path:?}: {error}")))?;
            PriceTable::from_csv(&text).with_context(|| format!("{path:?}"))?
        }
    };
    let Some(model) = &options.lmm_model else { return Ok(None) };
    let free = || client::is_on_this_machine(options).then(|| Price::new(model, UsdPerMtok::default()));
    let given = options.price.map(|price| Price::new(model, price));
    Ok(given.or_else(|| table.price(model).cloned()).or_else(free))
}
