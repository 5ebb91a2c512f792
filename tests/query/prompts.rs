use std::path::Path;

use gprop::consensus::AskAbout;
use gprop::materials::MaterialLibrary;
use gprop::query::question::{Question, Questions};
use gprop::query::{Context, Guidance, PromptError, Prompts};
use serde_json::Value;

#[test]
fn the_single_prompt_lists_every_material_of_the_library() {
    let library = MaterialLibrary::builtin();
    let questions =
        Questions::new(&Prompts::builtin(), library, Guidance::OneQuestion, Context::GlobalLocal, AskAbout::Parts)
            .unwrap();
    let prompt = &questions.first().prompt;
    for family in library.families() {
        for material in library.of_family(&family.name) {
            assert!(prompt.contains(&material.name), "{} is not in the prompt", material.name);
            assert!(!material.name.contains(';'), "{} holds the separator", material.name);
        }
    }
    for filling in library.fillings() {
        assert!(prompt.contains(&filling.name), "{} is not in the prompt", filling.name);
    }
    assert!(prompt.contains("JSON"), "DashScope wants the word");
    assert!(!prompt.contains("{{"));
}

#[test]
fn family_first_asks_for_the_family_and_then_for_its_materials() {
    let library = MaterialLibrary::builtin();
    let questions =
        Questions::new(&Prompts::builtin(), library, Guidance::FamilyFirst, Context::GlobalLocal, AskAbout::Parts)
            .unwrap();
    let single =
        Questions::new(&Prompts::builtin(), library, Guidance::OneQuestion, Context::GlobalLocal, AskAbout::Parts)
            .unwrap();
    let chain = questions.longest_chain();
    assert_eq!(chain.len(), 2);
    assert!(!chain[0].prompt.contains("youngs_modulus_mpa"));
    let tokens: usize = chain.iter().map(|question| question.prompt.len()).sum();
    assert!(tokens < single.first().prompt.len() || library.materials().len() < 100, "two prompts should be shorter");
}

#[test]
fn the_context_changes_what_the_prompt_says_of_the_picture() {
    let prompts = Prompts::builtin();
    let (both, local) =
        (prompts.part(Context::GlobalLocal, "", "").unwrap(), prompts.part(Context::Local, "", "").unwrap());
    assert!(both.contains("three panels") && !local.contains("three panels"));
}

#[test]
fn a_folder_replaces_single_prompts() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("part.txt"), "Mine: {{ candidates }}").unwrap();
    let prompts = Prompts::from_folder(folder.path()).unwrap();
    assert_eq!(prompts.part(Context::Local, "wood: oak", "").unwrap(), "Mine: wood: oak");
    assert_eq!(prompts.family(Context::Local, "x").unwrap(), Prompts::builtin().family(Context::Local, "x").unwrap());
    assert_ne!(prompts.sha256(), Prompts::builtin().sha256());
}

#[test]
fn a_misspelt_placeholder_and_a_broken_schema_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("part.txt"), "{{ canditates }}").unwrap();
    assert!(matches!(Prompts::from_folder(folder.path()), Err(PromptError::Template { .. })));
    std::fs::write(folder.path().join("part.txt"), "fine").unwrap();
    for without in ["size.txt", "picture_local.txt", "picture_global_local.txt"] {
        for text in ["{{ candidates }}", "How long {# the longest side #} is it?"] {
            std::fs::write(folder.path().join(without), text).unwrap();
            assert!(matches!(Prompts::from_folder(folder.path()), Err(PromptError::Template { .. })), "{without}");
        }
        std::fs::remove_file(folder.path().join(without)).unwrap();
    }
    std::fs::write(folder.path().join("answer.schema.json"), "{").unwrap();
    assert!(matches!(Prompts::from_folder(folder.path()), Err(PromptError::Schema { .. })));
    for (schema, is_good) in [("[]", false), ("true", false), ("null", false), ("\"answer\"", false), ("{}", true)] {
        std::fs::write(folder.path().join("answer.schema.json"), schema).unwrap();
        let prompts = Prompts::from_folder(folder.path()).unwrap();
        match Questions::new(
            &prompts,
            MaterialLibrary::builtin(),
            Guidance::OneQuestion,
            Context::Local,
            AskAbout::Parts,
        ) {
            Ok(questions) => assert!(is_good && *questions.first().schema.value() == serde_json::json!({}), "{schema}"),
            Err(error) => assert!(!is_good && matches!(error, PromptError::Schema { .. }), "{schema}"),
        }
    }
    assert!(matches!(Prompts::from_folder(&folder.path().join("none")), Err(PromptError::NoFolder(_))));
    let other = tempfile::tempdir().unwrap();
    std::fs::write(other.path().join("parts.txt"), "misspelt").unwrap();
    assert!(matches!(Prompts::from_folder(other.path()), Err(PromptError::NoFile(_))));
}

#[test]
fn only_a_question_that_follows_asks_for_alternatives() {
    let questions = |prompts: &Prompts, about: AskAbout| {
        let library = MaterialLibrary::builtin();
        Questions::new(prompts, library, Guidance::OneQuestion, Context::GlobalLocal, about).unwrap()
    };
    let builtin = Prompts::builtin();
    let follow_up = questions(&builtin, AskAbout::Object);
    let Question { prompt, schema, .. } = follow_up.first();
    assert!(prompt.contains("\n20. alternatives: what else") && prompt.contains("these twenty keys"), "{prompt}");
    assert!(!prompt.contains("{%") && !prompt.contains("nineteen"), "{prompt}");
    let families = &schema.value()["properties"]["family"]["enum"];
    assert_eq!(&schema.value()["properties"]["alternatives"]["items"]["properties"]["family"]["enum"], families);
    assert!(schema.value()["required"].as_array().unwrap().contains(&"alternatives".into()));

    // A schema of one's own may not have them: then they are not asked for.
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("answer.schema.json"), "{}").unwrap();
    let own = questions(&Prompts::from_folder(folder.path()).unwrap(), AskAbout::Object);
    assert_eq!(own.first().prompt, questions(&builtin, AskAbout::Parts).first().prompt);
}

/// Answers about parts that were recorded before there were alternatives still serve.
#[test]
fn the_question_about_a_part_is_the_recorded_one() {
    let library = MaterialLibrary::builtin();
    let questions =
        Questions::new(&Prompts::builtin(), library, Guidance::OneQuestion, Context::GlobalLocal, AskAbout::Parts)
            .unwrap();
    let Question { prompt_sha256, schema, .. } = questions.first();
    for (fixture, count) in [("hammer", 24), ("mug", 10), ("table_lamp", 25), ("chair", 27)] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(fixture).join("recorded");
        let is_it = |entry: std::io::Result<std::fs::DirEntry>| {
            let recording: Value = serde_json::from_slice(&std::fs::read(entry.unwrap().path()).unwrap()).unwrap();
            let asked = &recording["asked"];
            asked["prompt_sha256"] == prompt_sha256.as_str() && asked["schema_sha256"] == schema.sha256().as_str()
        };
        let found = std::fs::read_dir(folder).unwrap().map(is_it).filter(|is_it| *is_it).count();
        assert_eq!(found, count, "{fixture}");
    }
}

/// The paper's questions must stay word for word what they were when `recorded_paper/` was answered.
#[test]
fn the_question_about_a_segment_is_the_recorded_one() {
    let questions = Questions::new(
        &Prompts::builtin(),
        MaterialLibrary::builtin(),
        Guidance::OneQuestion,
        Context::GlobalLocal,
        AskAbout::Segments,
    )
    .unwrap();
    // As many as `gprop run --preset paper` asks about the fixture.
    for (fixture, count) in [("hammer", 25), ("mug", 33), ("table_lamp", 28), ("chair", 44)] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(fixture).join("recorded_paper");
        let mut recordings = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            let recording: Value = serde_json::from_slice(&std::fs::read(entry.unwrap().path()).unwrap()).unwrap();
            let asked = &recording["asked"];
            assert_eq!(asked["prompt_sha256"], questions.first().prompt_sha256.as_str());
            assert_eq!(asked["schema_sha256"], questions.first().schema.sha256().as_str());
            recordings += 1;
        }
        assert_eq!(recordings, count, "{fixture}");
    }
}
