use std::collections::BTreeSet;
use std::path::PathBuf;

use gprop::consensus::AskAbout;
use gprop::materials::MaterialLibrary;
use gprop::query::question::Questions;
use gprop::query::{Context, Guidance, LabelSet, LabelsError, Prompts};

fn of_file(text: &str) -> Result<MaterialLibrary, LabelsError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("labels.txt");
    std::fs::write(&path, text).unwrap();
    LabelSet::File(path).restrict(MaterialLibrary::builtin())
}

#[test]
fn an_evaluations_labels_leave_what_means_one_of_them_and_only_that() {
    let library = MaterialLibrary::builtin();
    let abo = LabelSet::Abo.restrict(library).unwrap();
    let expected = library.materials().iter().filter(|material| material.labels.abo.exact);
    assert!(abo.materials().iter().eq(expected));
    let families: BTreeSet<&str> = abo.families().iter().map(|family| family.name.as_str()).collect();
    assert!(families.contains("wood") && !families.contains("food"), "ABO has no label for food: {families:?}");
    let mvimgnet = LabelSet::Mvimgnet.restrict(library).unwrap();
    assert!(mvimgnet.family("food").is_some(), "MVImgNet has one");
    assert!(abo.materials().len() < library.materials().len());
}

#[test]
fn the_prompt_and_the_reading_know_the_chosen_materials_only() {
    let library = of_file("\u{feff}# two families and a material\nwood\n\nfoam\nstainless steel 304\n").unwrap();
    let questions =
        Questions::new(&Prompts::builtin(), &library, Guidance::OneQuestion, Context::GlobalLocal, AskAbout::Parts)
            .unwrap();
    let prompt = &questions.first().prompt;
    let metals: Vec<_> = library.of_family("metal").map(|material| material.name.as_str()).collect();
    assert_eq!(metals.len(), 1);
    assert!(prompt.contains(&format!("\nmetal: {}", metals[0])) && !prompt.contains("\nglass:"));
    assert!(library.get("soda-lime glass").is_none() && library.get("white oak").is_some());
    let full = MaterialLibrary::builtin();
    assert_eq!(library.get("white oak"), full.get("white oak"), "aliases still find their row");
    assert!(library.nearest("oak").is_some());
}

#[test]
fn a_label_of_either_evaluation_may_stand_in_a_file() {
    let library = of_file("marble").unwrap();
    assert!(
        library.materials().iter().any(|material| material.labels.abo.name == "marble" && material.labels.abo.exact)
    );
}

#[test]
fn what_is_wrong_with_a_file_is_said_with_its_line() {
    let error = of_file("wood\nunobtainium 7\n").unwrap_err();
    assert!(matches!(&error, LabelsError::Unknown { line: 2, .. }), "{error}");
    assert!(matches!(of_file("# nothing\n").unwrap_err(), LabelsError::Empty { .. }));
    let none = LabelSet::File(PathBuf::from("/no/such/file")).restrict(MaterialLibrary::builtin()).unwrap_err();
    assert!(none.to_string().contains("abo, mvimgnet or a text file"), "{none}");
}
