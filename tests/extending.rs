//! The steps that `docs/extending.md` lists for a new law, format, export or gripper, as far as the compiler does not
//! enforce them: each is in its table, its documentation and its tests.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use gprop::export;
use gprop::grasp::gripper::GripperProfile;
use gprop::materials::MaterialLibrary;
use gprop::scene::SPLAT_FORMATS;
use serde_json::Value;

use crate::fuzz::targets;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn text(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The names of the files in `folder` that end in `.EXTENSION`, without it.
fn stems(folder: &str, extension: &str) -> BTreeSet<String> {
    let files = fs::read_dir(root().join(folder)).unwrap();
    let paths =
        files.map(|file| file.unwrap().path()).filter(|path| path.extension().is_some_and(|it| it == extension));
    paths.map(|path: PathBuf| path.file_stem().unwrap().to_str().unwrap().to_owned()).collect()
}

/// The laws of the published schema, which is made from the types: names, and names of parameters.
fn laws() -> Vec<(String, Vec<String>)> {
    let schema: Value = serde_json::from_str(&text("docs/report.schema.json")).unwrap();
    let variants = schema["$defs"]["Law"]["oneOf"].as_array().unwrap();
    let law = |variant: &Value| {
        let properties = variant["properties"].as_object().unwrap();
        let parameters = properties.keys().filter(|name| *name != "law").cloned().collect();
        (properties["law"]["const"].as_str().unwrap().to_owned(), parameters)
    };
    variants.iter().map(law).collect()
}

#[test]
fn every_law_and_its_parameters_are_in_the_readme_of_the_materials() {
    let readme = text("materials/README.md");
    let row = readme.lines().find(|line| line.starts_with("| `law`")).unwrap();
    for (law, parameters) in laws() {
        let listed: String = parameters.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        let entry = if listed.is_empty() { format!("`{law}`;") } else { format!("`{law}` ({listed});") };
        assert!(row.contains(&entry), "materials/README.md does not list {entry}");
    }
}

#[test]
fn every_law_of_the_simulation_has_a_material() {
    let materials = MaterialLibrary::builtin().materials();
    let used: BTreeSet<String> = materials
        .iter()
        .map(|material| serde_json::to_value(material.law).unwrap()["law"].as_str().unwrap().to_owned())
        .collect();
    // The library's materials are solids and heaps; fluids are for users' own materials.
    let known = laws().into_iter().map(|(law, _)| law).filter(|law| law != "fluid").collect::<BTreeSet<_>>();
    assert_eq!(used, known);
}

#[test]
fn every_splat_format_is_in_the_help_the_docs_and_the_fuzz_targets() {
    let run = gprop::command().find_subcommand("run").unwrap().clone();
    let help =
        run.get_arguments().find(|argument| argument.get_id() == "splat").unwrap().get_help().unwrap().to_string();
    let docs = text("docs/formats.md");
    let splats = docs.split("\n## ").find(|section| section.starts_with("Splats\n")).unwrap();
    for format in SPLAT_FORMATS {
        assert!(help.contains(format.ending), "the help of --splat does not name {}", format.ending);
        assert!(splats.contains(&format!("`{}`", format.ending)), "docs/formats.md does not name {}", format.ending);
        let target = format.ending.rsplit('.').next().unwrap();
        assert!(targets::TARGETS.iter().any(|(name, _)| *name == target), "fuzz/ has no target {target}");
    }
}

#[test]
fn every_fuzz_target_has_its_program_and_its_row() {
    let names: BTreeSet<String> = targets::TARGETS.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(names, stems("fuzz/fuzz_targets", "rs"));
    let (manifest, readme) = (text("fuzz/Cargo.toml"), text("fuzz/README.md"));
    for name in names {
        assert!(manifest.contains(&format!("name = \"{name}\"")), "fuzz/Cargo.toml has no {name}");
        assert!(readme.contains(&format!("\n| `{name}` |")), "fuzz/README.md has no row for {name}");
    }
}

#[test]
fn every_export_is_in_the_docs() {
    let docs = text("docs/grasp.md");
    for format in export::Format::value_variants() {
        let name = format.to_possible_value().unwrap().get_name().to_owned();
        assert!(docs.contains(&format!("\n| `{name}` |")), "docs/grasp.md has no row for {name}");
    }
}

#[test]
fn every_gripper_and_table_of_materials_is_built_in() {
    let readme = text("grippers/README.md");
    for name in stems("grippers", "toml") {
        assert!(GripperProfile::is_builtin(&name), "src/grasp/gripper.rs does not compile in {name}");
        GripperProfile::load(&name).unwrap();
        assert!(
            readme.contains(&format!("`{name}`")) || readme.contains(&format!(" {name}`")),
            "no {name} in its README"
        );
    }
    for name in stems("materials", "csv") {
        let mut table = csv::Reader::from_path(root().join(format!("materials/{name}.csv"))).unwrap();
        // Other tables have no names of materials.
        let header = table.headers().unwrap();
        if [header.get(0), header.get(1)] != [Some("family"), Some("name")] {
            continue;
        }
        let Some(first) = table.records().next() else { continue };
        let first = first.unwrap();
        assert!(MaterialLibrary::builtin().get(&first[1]).is_some(), "{name}.csv is not compiled in");
    }
}

#[test]
fn the_page_on_extending_names_files_that_exist() {
    let page = text("docs/extending.md");
    let mut named = 0;
    for span in page.split('`').skip(1).step_by(2) {
        if ["src/", "tests/", "docs/", "fuzz/", "materials/", "grippers/"].iter().any(|at| span.starts_with(at)) {
            assert!(root().join(span).exists(), "docs/extending.md names `{span}`");
            named += 1;
        }
    }
    assert!(named > 20, "only {named} files");
}
