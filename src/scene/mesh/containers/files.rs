//! Which file a container means by a name, and whether it may be read.
//!
//! A container may come from anybody, so a name leads only to files inside the folders that the user named
//! ([`ReadScope`]), after following links.

use std::fs;
use std::path::{Component, Path, PathBuf};

use percent_encoding::percent_decode_str;
use thiserror::Error;

use crate::files;
use crate::files::read_scope::ReadScope;

/// Why the file that a container names is not read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum FileProblem {
    #[error("{named:?} lies outside of the folders that you named ({real:?}); name its folder too, if it may be read")]
    Outside { named: String, real: PathBuf },
    #[error("{named:?} does not exist ({looked:?}); mend the name, or put the file there")]
    Missing { named: String, looked: PathBuf },
    #[error("{named:?} is of a package that is in none of the folders that you named; name the package's folder too")]
    NoPackage { named: String },
    #[error("{named:?} is an address on the network, and gprop fetches nothing; put the file beside the model")]
    Remote { named: String },
}

/// The ways in which ROS and Gazebo name a file of a package.
const PACKAGE: [&str; 2] = ["package://", "model://"];

/// The file that `named` stands for in a container in `folder`.
///
/// # Errors
/// [`FileProblem`].
pub fn find(named: &str, folder: &Path, scope: &ReadScope) -> Result<PathBuf, FileProblem> {
    if let Some(rest) = PACKAGE.iter().find_map(|scheme| named.strip_prefix(scheme)) {
        return of_package(named, rest, folder, scope);
    }
    let path = match named.split_once("://") {
        Some(("file", rest)) => PathBuf::from(percent_decode_str(rest).decode_utf8_lossy().into_owned()),
        Some(_) => return Err(FileProblem::Remote { named: named.to_owned() }),
        None => folder.join(named.replace('\\', "/")),
    };
    allowed(named, path, scope)
}

/// The file of a package: in a folder above the container that has the package's name, holds a folder of that name, or says
/// in its `package.xml` that it is the package.
fn of_package(named: &str, rest: &str, folder: &Path, scope: &ReadScope) -> Result<PathBuf, FileProblem> {
    let (package, inside) = rest.split_once('/').unwrap_or((rest, ""));
    let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let places = folder.ancestors().flat_map(|above| {
        let is_package = above.file_name().is_some_and(|name| name == package) || is_named(above, package, scope);
        [is_package.then(|| above.join(inside)), Some(above.join(package).join(inside))]
    });
    let found = places.flatten().find(|path| files::is_there(path));
    found.map_or_else(|| Err(FileProblem::NoPackage { named: named.to_owned() }), |path| allowed(named, path, scope))
}

/// Whether the folder's `package.xml` gives it this name.
fn is_named(folder: &Path, package: &str, scope: &ReadScope) -> bool {
    /// More than the manifest of any package has.
    const MOST_BYTES: u64 = 1 << 20;
    let manifest = folder.join("package.xml");
    let is_small = fs::metadata(&manifest).is_ok_and(|found| found.is_file() && found.len() <= MOST_BYTES);
    is_small
        && scope.leads_out(&manifest).is_none()
        && files::read_to_string(&manifest).is_ok_and(|text| text.contains(&format!("<name>{package}</name>")))
}

/// The path, if it exists and may be read.
fn allowed(named: &str, path: PathBuf, scope: &ReadScope) -> Result<PathBuf, FileProblem> {
    let path = without_dots(&path);
    if let Some(real) = scope.leads_out(&path) {
        return Err(FileProblem::Outside { named: named.to_owned(), real });
    }
    if files::is_there(&path) { Ok(path) } else { Err(FileProblem::Missing { named: named.to_owned(), looked: path }) }
}

/// `a/./b` as `a/b`: for messages. `..` stays, since what is before it may be a link.
fn without_dots(path: &Path) -> PathBuf {
    path.components().filter(|component| *component != Component::CurDir).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_to_files_of_the_folders_that_the_user_named() {
        let home = tempfile::tempdir().unwrap();
        let root = home.path().canonicalize().unwrap();
        let robot = root.join("stack/arm_description/urdf");
        for folder in ["stack/arm_description/urdf", "stack/arm_description/meshes", "stack/other", "stack/renamed/a"] {
            fs::create_dir_all(root.join(folder)).unwrap();
        }
        for file in
            ["stack/arm_description/meshes/a b.stl", "stack/other/b.stl", "stack/renamed/a/c.stl", "outside.stl"]
        {
            fs::write(root.join(file), "solid").unwrap();
        }
        fs::write(root.join("stack/arm_description/package.xml"), "<package><name>arm</name></package>").unwrap();
        let scope = ReadScope::new(&root.join("stack"));
        let found = |named: &str| find(named, &robot, &scope);
        let mesh = Ok(root.join("stack/arm_description/meshes/a b.stl"));
        for named in [
            "package://arm_description/meshes/a b.stl",
            "package://arm/meshes/a b.stl",
            "model://arm_description/meshes/a b.stl",
        ] {
            assert_eq!(found(named), mesh, "{named}");
        }
        assert_eq!(found("package://other/b.stl"), Ok(root.join("stack/other/b.stl")));
        assert_eq!(found(r"..\meshes\a b.stl").unwrap().canonicalize().ok(), mesh.clone().ok());
        let url = format!("file://{}/stack/arm_description/meshes/a%20b.stl", root.display());
        assert_eq!(found(&url), mesh);
        assert!(matches!(found("../../../outside.stl"), Err(FileProblem::Outside { .. })));
        assert!(matches!(found("/etc/passwd"), Err(FileProblem::Outside { .. })));
        assert!(matches!(found("../meshes/none.stl"), Err(FileProblem::Missing { .. })));
        assert!(matches!(found("package://elsewhere/b.stl"), Err(FileProblem::NoPackage { .. })));
        assert!(matches!(found("https://example.com/b.stl"), Err(FileProblem::Remote { .. })));
    }
}
