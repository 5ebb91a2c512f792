//! The folders that a server may touch. Paths are judged after links are followed, so that none leads out.

use std::path::{Component, Path, PathBuf};
use std::{fs, io};

use percent_encoding::percent_decode_str;
use serde_json::Value;

use crate::error::UsageError;

use super::protocol::Refused;

/// Folders, with links resolved.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Roots(Vec<PathBuf>);

impl Roots {
    /// The folders that the user names; the current one if there is none.
    ///
    /// # Errors
    /// If one of them is no folder.
    pub fn of(folders: &[PathBuf]) -> Result<Self, UsageError> {
        let here = [PathBuf::from(".")];
        let given = if folders.is_empty() { &here } else { folders };
        let real = |folder: &PathBuf| -> io::Result<PathBuf> {
            let real = folder.canonicalize()?;
            fs::read_dir(&real).map(|_| real)
        };
        let folders = given.iter().map(|folder| {
            real(folder)
                .map_err(|error| UsageError(format!("--root {folder:?}: {error}; name a folder that can be read")))
        });
        folders.collect::<Result<_, _>>().map(Self)
    }

    /// What these have in common with those of a client, the result of its `roots/list`. A client that names none narrows
    /// nothing.
    pub fn narrowed(&self, result: &Value) -> Self {
        let listed = result.get("roots").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
        if listed.is_empty() {
            return self.clone();
        }
        let named = listed.iter().filter_map(|root| folder_of(root.get("uri")?.as_str()?));
        let mut common = Vec::new();
        for client in named {
            let inside = self.0.iter().any(|own| client.starts_with(own)).then(|| client.clone());
            let around = self.0.iter().filter(|own| own.starts_with(&client)).cloned();
            common.extend(inside.into_iter().chain(around));
        }
        let mut roots = Vec::new();
        for root in common {
            if !roots.contains(&root) {
                roots.push(root);
            }
        }
        Self(roots)
    }

    /// A path as the program is to be given it: absolute, without links. A relative one begins at the first root. What does not
    /// exist yet is judged by the folder in which it would be made.
    ///
    /// # Errors
    /// If it leads out of every root.
    pub fn resolve(&self, given: &str) -> Result<PathBuf, Refused> {
        let [first, ..] = self.0.as_slice() else {
            let why =
                "the folders that the client names (roots/list) and those of `gprop mcp --root` have nothing in common";
            return Err(Refused::params(format!("{given:?} cannot be used: {why}")));
        };
        if given.is_empty() || given.contains('\0') {
            return Err(Refused::params(format!("{given:?} is no path")));
        }
        let path = first.join(given);
        let real = real_path(&path).map_err(|error| Refused::params(format!("{given:?}: {error}")))?;
        if self.0.iter().any(|root| real.starts_with(root)) {
            return Ok(real);
        }
        Err(Refused::params(format!(
            "{given:?} leads to {real:?}, outside of {:?}; name a path inside, or let the user start `gprop mcp` with another --root",
            self.0
        )))
    }
}

/// The path with all links followed, of which the end need not exist.
fn real_path(path: &Path) -> io::Result<PathBuf> {
    match path.canonicalize() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        real => return real,
    }
    if path.is_symlink() {
        return Err(io::Error::other("it is a link to nothing"));
    }
    match (path.parent(), path.components().next_back()) {
        (Some(folder), Some(Component::Normal(name))) => Ok(real_path(folder)?.join(name)),
        _ => Err(io::Error::other("there is no such folder")),
    }
}

/// The folder that a `file:` URI of this machine names, if it exists.
fn folder_of(uri: &str) -> Option<PathBuf> {
    let path = uri.strip_prefix("file://")?;
    let path = path.strip_prefix("localhost").unwrap_or(path);
    let path = percent_decode_str(path).decode_utf8().ok()?;
    Path::new(&*path).is_absolute().then(|| Path::new(&*path).canonicalize().ok())?
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use serde_json::json;

    use super::*;

    #[test]
    fn no_path_leads_out() {
        let home = tempfile::tempdir().unwrap();
        let (inside, outside) = (home.path().join("in"), home.path().join("out"));
        for folder in [inside.join("scene"), outside.clone(), home.path().join("in2")] {
            fs::create_dir_all(folder).unwrap();
        }
        symlink(&outside, inside.join("link")).unwrap();
        symlink(outside.join("nothing"), inside.join("dangling")).unwrap();
        symlink("scene", inside.join("good")).unwrap();
        let roots = Roots::of(std::slice::from_ref(&inside)).unwrap();
        let real = inside.canonicalize().unwrap();
        for (given, to) in
            [("scene", "scene"), ("good", "scene"), (".", ""), ("scene/../new/deep", "new/deep"), ("good/x", "scene/x")]
        {
            // What does not exist is only joined.
            let expected = if to.is_empty() { real.clone() } else { real.join(to) };
            assert_eq!(roots.resolve(given), Ok(expected), "{given}");
        }
        let absolute = outside.to_str().unwrap();
        for given in [
            "..",
            "../in2",
            "link",
            "link/new",
            "dangling",
            "scene/../../out",
            "none/../../out",
            absolute,
            "/etc/passwd",
            "",
            "a\0b",
        ] {
            assert!(roots.resolve(given).is_err(), "{given}");
        }
    }

    #[test]
    fn a_client_narrows_the_roots_and_never_widens_them() {
        let home = tempfile::tempdir().unwrap();
        let real = home.path().canonicalize().unwrap();
        for folder in ["a/b c", "z"] {
            fs::create_dir_all(real.join(folder)).unwrap();
        }
        let roots = Roots::of(&[real.join("a")]).unwrap();
        let narrowed = |paths: &[&str]| {
            let listed = paths.iter().map(|path| json!({ "uri": format!("file://{}/{path}", real.display()) }));
            roots.narrowed(&json!({ "roots": listed.collect::<Vec<_>>() }))
        };
        assert_eq!(narrowed(&["a/b%20c"]), Roots(vec![real.join("a/b c")]));
        assert_eq!(narrowed(&[""]), roots, "a wider folder allows no more");
        assert_eq!(narrowed(&["z", "none"]), Roots(Vec::new()));
        assert_eq!(narrowed(&[]), roots);
        assert!(narrowed(&["z"]).resolve("b c").is_err());
        assert_eq!(roots.narrowed(&json!({ "roots": [5, { "uri": "http://x" }] })), Roots(Vec::new()));
        assert!(Roots::of(&[real.join("none")]).is_err());
    }
}
