//! Which files may be read for a scene: those inside its folder, after following links, and those that the user
//! allowed.
//!
//! A scene folder may come from anybody. Its files name other files (photos, masks, training data) and may be links, so
//! every file that the scene names or contains is checked here before it is opened.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The folders from which files may be read, with links resolved.
#[derive(Debug, Clone)]
pub struct ReadScope {
    folders: Vec<PathBuf>,
}

impl ReadScope {
    /// Allows only the folder of a scene.
    pub fn new(scene: &Path) -> Self {
        Self { folders: Vec::new() }.and([scene])
    }

    /// Allows more folders. One that does not exist allows nothing.
    pub fn and<'a>(mut self, folders: impl IntoIterator<Item = &'a Path>) -> Self {
        let here = |folder: &'a Path| if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        self.folders.extend(folders.into_iter().filter_map(|folder| here(folder).canonicalize().ok()));
        self
    }

    /// The target of `path` if that is outside every folder; `None` if it is inside, or if there is nothing to read.
    pub fn leads_out(&self, path: &Path) -> Option<PathBuf> {
        let real = path.canonicalize().ok()?;
        let inside = self.folders.iter().any(|folder| real.starts_with(folder));
        (!inside).then_some(real)
    }

    /// The first path that leads out, and its target: `path` itself or, if it is a folder, anything below it.
    pub fn leads_out_below(&self, path: &Path) -> Option<(PathBuf, PathBuf)> {
        let mut open = vec![path.to_owned()];
        let mut seen = HashSet::new();
        while let Some(path) = open.pop() {
            if let Some(real) = self.leads_out(&path) {
                return Some((path, real));
            }
            // A link to a folder above itself would otherwise be followed forever.
            if path.is_dir() && path.canonicalize().is_ok_and(|real| seen.insert(real)) {
                let mut below: Vec<PathBuf> =
                    fs::read_dir(&path).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
                below.retain(|path| path.is_symlink() || path.is_dir());
                below.sort();
                below.reverse();
                open.extend(below);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn links_are_followed_before_they_are_judged() {
        let (scene, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let (scene, outside) = (scene.path(), outside.path());
        for file in [scene.join("a"), outside.join("a")] {
            fs::write(file, "a").unwrap();
        }
        symlink("a", scene.join("to-a")).unwrap();
        symlink(outside.join("a"), scene.join("to-outside")).unwrap();
        symlink(outside, scene.join("folder")).unwrap();
        symlink(scene, outside.join("scene")).unwrap();
        // The scene folder itself may be a link.
        for root in [scene, &outside.join("scene")] {
            let scope = ReadScope::new(root);
            for inside in ["a", "to-a", "missing", "folder/scene/a", "../../no/such/file"] {
                assert_eq!(scope.leads_out(&root.join(inside)), None, "{inside}");
            }
            let real = outside.join("a").canonicalize().unwrap();
            for out in ["to-outside", "folder/a"] {
                assert_eq!(scope.leads_out(&root.join(out)), Some(real.clone()), "{out}");
            }
            assert_eq!(ReadScope::new(root).and([outside]).leads_out(&root.join("to-outside")), None, "allowed");
        }
    }

    #[test]
    fn a_folder_leads_out_if_anything_below_it_does() {
        let (scene, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let (scene, outside) = (scene.path(), outside.path());
        fs::create_dir_all(scene.join("photos/left")).unwrap();
        fs::create_dir(scene.join("other")).unwrap();
        fs::write(outside.join("secret"), "secret").unwrap();
        symlink(scene, scene.join("photos/round")).unwrap();
        symlink(scene.join("other"), scene.join("photos/left/other")).unwrap();
        let scope = ReadScope::new(scene);
        assert_eq!(scope.leads_out_below(&scene.join("photos")), None);
        symlink(outside.join("secret"), scene.join("other/000.png")).unwrap();
        let (_, real) = scope.leads_out_below(&scene.join("photos")).unwrap();
        assert_eq!(real, outside.join("secret").canonicalize().unwrap());
    }
}
