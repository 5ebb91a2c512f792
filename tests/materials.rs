use std::fs;
use std::path::Path;

use gprop::evaluate::vocabulary::Vocabulary;
use gprop::materials::check::{check, gent_modulus_pa, qi_modulus_pa};
use gprop::materials::stats::{LEAST_CITED, WELL_MEASURED, stats};
use gprop::materials::{Law, LibraryError, MaterialLibrary, cli};
use gprop::units::ShoreScale;

#[test]
fn the_builtin_library_passes_its_check() {
    let (text, passes) = cli::check_text(MaterialLibrary::builtin(), true);
    assert!(passes, "{text}");
    for needed in ["well measured", "density", "friction_rubber"] {
        assert!(text.contains(needed), "the statistics lack {needed:?}:\n{text}");
    }
}

#[test]
fn it_has_fifteen_families_and_more_than_640_materials() {
    let library = MaterialLibrary::builtin();
    assert_eq!(library.families().len(), 15);
    assert!(library.materials().len() >= 640, "{} materials", library.materials().len());
    for family in library.families() {
        assert!(library.of_family(&family.name).count() >= 20, "{}", family.name);
    }
}

#[test]
fn densities_and_moduli_of_hard_goods_are_cited() {
    let shares = stats(MaterialLibrary::builtin());
    for family in WELL_MEASURED {
        let share = shares.iter().find(|one| one.of == family).expect(family);
        for (property, least) in LEAST_CITED {
            let cited = share.cited(property).expect(property);
            assert!(cited >= least, "{family}: {:.1}% of {property} cited", 100.0 * cited);
        }
    }
}

/// The least share of the values of each property that must be cited, over the whole library.
const LEAST_CITED_OF_ALL: [(&str, f64); 6] = [
    ("density", 0.84),
    ("youngs_modulus", 0.63),
    ("poisson_ratio", 0.74),
    ("strength", 0.61),
    ("friction_rubber", 1.0),
    ("hardness", 0.61),
];

#[test]
fn most_numbers_of_the_whole_library_are_cited() {
    let shares = stats(MaterialLibrary::builtin());
    let all = shares.iter().find(|one| one.of == "all").expect("all");
    for (property, least) in LEAST_CITED_OF_ALL {
        let cited = all.cited(property).expect(property);
        assert!(cited >= least, "{:.1}% of {property} cited", 100.0 * cited);
    }
    for ((property, cited), (_, by_rule)) in all.cited.iter().zip(&all.by_rule) {
        assert!(by_rule <= cited, "{property}: {by_rule} by a rule, {cited} cited");
    }
}

/// Names that people or vision models use, and the row that each must find.
const EVERYDAY_NAMES: [(&str, &str); 84] = [
    ("oak", "oak, white"),
    ("pine", "pine, scots"),
    ("Beech wood", "beech, european"),
    ("hickory", "hickory, shagbark"),
    ("plywood", "plywood, softwood"),
    ("MDF", "mdf"),
    ("particle board", "particleboard"),
    ("bamboo", "bamboo"),
    ("wicker", "rattan"),
    ("cork", "cork, natural stopper"),
    ("carbon steel", "steel, mild"),
    ("Stainless Steel 304", "stainless steel 304"),
    ("stainless steel", "stainless steel 304"),
    ("18/8 stainless", "stainless steel 304"),
    ("cast iron", "cast iron, grey"),
    ("gray iron", "cast iron, grey"),
    ("aluminum 6061", "aluminium 6061-t6"),
    ("aluminium", "aluminium 6061-t6"),
    ("brass", "brass, cartridge 70/30"),
    ("bronze", "bronze, tin"),
    ("copper", "copper, pure"),
    ("chrome-plated steel", "steel, chrome plated"),
    ("Zinc alloy", "zamak 3"),
    ("titanium", "titanium, grade 2"),
    ("ABS", "abs"),
    ("ABS plastic", "abs"),
    ("PP", "polypropylene homopolymer"),
    ("polypropylene", "polypropylene homopolymer"),
    ("PE", "hdpe"),
    ("PVC", "pvc, rigid"),
    ("PET", "pet, amorphous"),
    ("nylon", "pa66"),
    ("PC", "pc"),
    ("polycarbonate", "pc"),
    ("PMMA", "pmma"),
    ("acrylic", "pmma"),
    ("POM", "pom copolymer"),
    ("melamine", "melamine formaldehyde"),
    ("carbon fiber", "cfrp, quasi-isotropic"),
    ("natural rubber", "natural rubber, filled"),
    ("nitrile rubber", "nitrile rubber"),
    ("neoprene", "neoprene, solid"),
    ("silicone rubber", "silicone rubber 40a"),
    ("EPDM", "epdm"),
    ("TPE", "tpe, sebs 40a"),
    ("TPU", "tpu 85a"),
    ("stoneware", "stoneware"),
    ("porcelain", "porcelain, hard"),
    ("earthenware", "earthenware, glazed"),
    ("terracotta", "terracotta"),
    ("soda-lime glass", "soda-lime glass, float"),
    ("borosilicate glass", "borosilicate glass"),
    ("opal glass", "opal glass"),
    ("granite", "granite, grey"),
    ("marble", "marble, carrara"),
    ("concrete", "concrete, normal c25/30"),
    ("cotton", "cotton, plain weave"),
    ("linen", "linen, plain"),
    ("polyester woven", "polyester, woven"),
    ("woven polyester", "polyester, woven"),
    ("wool", "wool, worsted"),
    ("felt", "wool, felt"),
    ("leather", "leather, full grain cow"),
    ("faux leather", "faux leather, pu"),
    ("PU foam", "pu foam, flexible 35 kg/m3"),
    ("EPS", "eps 25 kg/m3"),
    ("styrofoam", "eps 15 kg/m3"),
    ("EVA foam", "eva foam, firm"),
    ("paper", "paper, copy"),
    ("cardboard", "cardboard, corrugated single wall"),
    ("bread", "bread crumb, white"),
    ("apple", "apple"),
    ("plant", "stem, green plant"),
    ("soil", "soil, topsoil"),
    ("wax", "wax, paraffin"),
    ("clay", "potters clay, plastic"),
    ("white oak", "oak, white"),
    ("Galvanised Steel", "steel, galvanized sheet"),
    ("fibreglass", "gfrp, chopped strand"),
    ("fiberglass", "gfrp, chopped strand"),
    ("sand", "sand, dry loose"),
    ("snow", "snow, packed"),
    ("ice", "ice"),
    ("ceramic", "stoneware"),
];

#[test]
fn everyday_names_are_found() {
    let library = MaterialLibrary::builtin();
    for (name, expected) in EVERYDAY_NAMES {
        let found = library.get(name).map(|material| material.name.as_str());
        assert_eq!(found, Some(expected), "{name:?}");
    }
}

#[test]
fn the_nearest_name_has_most_words_in_common() {
    let library = MaterialLibrary::builtin();
    for (name, expected) in [
        ("stainles steel 304", "stainless steel 304"),
        ("304 steel stainless", "stainless steel 304"),
        ("oak plank", "oak, white"),
        ("solid brass hardware", "brass, cartridge 70/30"),
        ("natural cotton canvas", "cotton, canvas"),
        ("glazed stoneware ceramic", "stoneware"),
        ("hard maple lumber", "maple, hard"),
        ("expanded polystyrene foam", "eps 15 kg/m3"),
    ] {
        let (material, score) = library.nearest(name).expect(name);
        assert_eq!(material.name, expected, "{name:?} with score {score:.2}");
        assert!(score > 0.3 && score <= 1.0, "{name:?}: {score}");
    }
    assert!(library.nearest("qwzx").is_none());
    assert!(library.nearest("").is_none());
    let exact = library.nearest("White Oak").map(|(_, score)| score);
    assert_eq!(exact, Some(1.0));
}

#[test]
fn a_card_has_the_keys_of_the_contract() {
    let library = MaterialLibrary::builtin();
    let card = cli::show(library, "stainless steel 304").expect("the material");
    let json = serde_json::to_value(card).expect("serialisable");
    for key in ["name", "family", "strength_kind", "hardness", "sources"] {
        assert!(json.get(key).is_some(), "{key}");
    }
    for key in ["density_kg_m3", "youngs_modulus_pa", "poisson_ratio", "strength_pa", "friction_rubber"] {
        let [low, high] = json[key].as_array().expect(key).as_slice() else { panic!("{key} is not a pair") };
        assert!(low.as_f64() <= high.as_f64(), "{key}");
    }
    assert_eq!(json["strength_kind"], "yield");
    assert!(json["sources"]["density"][0]["title"].is_string());
    let text = cli::show_text(library, "stainless steel 304").expect("the material");
    assert!(text.starts_with("stainless steel 304\n") && text.contains("GPa"), "{text}");
    for part in ["by a rule for its class: ", "engineering judgement: ", "rule:poisson-"] {
        let text = cli::show_text(library, "leather, suede").expect("the material")
            + &cli::show_text(library, "pine, scots").expect("the material");
        assert!(text.contains(part), "{part:?} is not in {text}");
    }
    let wood = cli::list_text(&cli::list(library, Some("Wood")).expect("the family"));
    assert!(wood.contains("oak, white") && !wood.contains("brass"), "{wood}");
    assert!(cli::list(library, Some("plasma")).is_none());
}

const HEADER: &str = "family,name,aliases,density_kg_m3_low,density_kg_m3_high,youngs_modulus_pa_low,\
youngs_modulus_pa_high,poisson_ratio_low,poisson_ratio_high,strength_pa_low,strength_pa_high,strength_kind,\
friction_rubber_low,friction_rubber_high,friction_steel_low,friction_steel_high,hardness_scale,hardness_low,\
hardness_high,law,law_parameters";
const GOOD: &str =
    "wood,our oak,shop oak,690,720,1.1e10,1.3e10,0.35,0.4,9e7,1.1e8,flexural,0.6,0.9,0.3,0.5,D,55,65,elastic,";

fn load(rows: &[&str]) -> Result<MaterialLibrary, LibraryError> {
    load_text(&format!("{HEADER}\n{}\n", rows.join("\n")))
}

fn load_text(text: &str) -> Result<MaterialLibrary, LibraryError> {
    load_as("mine.csv", text)
}

fn load_as(name: &str, text: &str) -> Result<MaterialLibrary, LibraryError> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join(name);
    fs::write(&file, text).expect("a written file");
    MaterialLibrary::load(&file)
}

#[test]
fn a_users_table_adds_and_overrides() {
    let builtin = MaterialLibrary::builtin().materials().len();
    let own_abs = GOOD.replace("wood,our oak,shop oak", "thermoplastic,ABS,oak");
    let library = load(&[GOOD, &own_abs]).expect("a good table");
    assert_eq!(library.materials().len(), builtin + 1);
    assert_eq!(library.get("Shop Oak").map(|one| one.name.as_str()), Some("our oak"));
    assert_eq!(library.get("our oak").map(|one| one.sources.density.clone()), Some(vec!["user".to_owned()]));
    assert_eq!(library.get("abs").map(|one| one.density_kg_m3.low), Some(690.0));
    assert_eq!(library.get("oak").map(|one| one.name.as_str()), Some("ABS"), "a user's alias comes first");
    assert_eq!(library.get("white oak").map(|one| one.name.as_str()), Some("oak, white"));
}

#[test]
fn a_users_material_without_a_label_has_that_of_its_family() {
    let library = load(&[GOOD]).expect("a good table");
    for set in [Vocabulary::Abo, Vocabulary::Mvimgnet] {
        assert_eq!(set.label("our oak", &library), Some("wood"));
        assert_eq!(set.label("", &library), None, "a missing label has no name");
    }
}

/// Chromium has a deviation, because waves run faster in it than in most metals; the first row is slower.
#[test]
fn what_is_known_about_a_material_holds_for_the_row_that_replaces_it() {
    let chromium = |youngs: &str| {
        let row = format!(
            "metal,Chromium,,7100,7220,{youngs},0.2,0.23,2e8,4e8,yield,0.5,0.9,0.3,0.74,D,97,100,von_mises,\
             yield_stress_pa=3e8"
        );
        check(&load(&[&row]).expect("a good table"))
    };
    let slower = chromium("2e11,2.2e11");
    assert!(slower.iter().all(|one| one.check != "stale_deviation"), "{slower:#?}");
    assert!(!slower.iter().any(|one| one.subject == "Chromium" && one.check == "bar_speed"), "{slower:#?}");
    let as_fast = chromium("2.7e11,2.9e11");
    let speed = as_fast.iter().find(|one| one.subject == "Chromium" && one.check == "bar_speed").expect("a finding");
    assert!(speed.excuse.is_some(), "{speed:?}");
    let foam = "foam,EPS 25 kg/m3,,23,27,3e6,8e6,0.05,0.2,1e5,2e5,plateau,0.5,0.9,0.3,0.5,A,40,60,elastic,";
    let findings = check(&load(&[foam]).expect("a good table"));
    assert!(findings.iter().all(|one| one.check != "constituent"), "{findings:#?}");
}

const FILLING_HEADER: &str = "kind,name,density_kg_m3_low,density_kg_m3_high,basis,youngs_modulus_pa_low,\
youngs_modulus_pa_high,poisson_ratio_low,poisson_ratio_high,law,law_parameters";

#[test]
fn a_filling_stands_only_once_in_a_table_and_replaces_that_of_the_library() {
    let row = |name: &str, density: u32| format!("liquid,{name},{density},{density},,6e6,6e6,0.4995,0.4995,fluid,");
    let builtin = MaterialLibrary::builtin().fillings();
    let name = builtin[0].name.to_uppercase();
    let library = load_as("fillings.csv", &format!("{FILLING_HEADER}\n{}\n", row(&name, 1234))).expect("a good table");
    assert_eq!(library.fillings().len(), builtin.len());
    assert_eq!(library.filling(&name).map(|filling| filling.density_kg_m3.low), Some(1234.0));
    let twice = format!("{FILLING_HEADER}\n{}\n{}\n", row("our tea", 990), row("Our-Tea", 1010));
    let error = load_as("fillings.csv", &twice).expect_err("a double").to_string();
    assert!(error.contains("line 3") && error.contains("our tea"), "{error}");
}

#[test]
fn a_library_has_a_bounded_number_of_rows() {
    let rows = "steel wool,bar_speed,a mat\n".repeat(10_001);
    let error = load_as("deviations.csv", &format!("subject,check,reason\n{rows}")).expect_err("too many").to_string();
    assert!(error.contains("deviations.csv line 10002") && error.contains("10000 rows"), "{error}");
}

#[test]
fn a_folder_is_read_file_by_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("a.csv"), format!("{HEADER}\n{GOOD}\n")).expect("a written file");
    fs::write(folder.path().join("b.csv"), format!("{HEADER}\n{}\n", GOOD.replace("our oak,shop oak", "our ash,")))
        .expect("a written file");
    let library = MaterialLibrary::load(folder.path()).expect("a good folder");
    assert!(library.get("our oak").is_some() && library.get("our ash").is_some());
    let empty = tempfile::tempdir().expect("a temporary folder");
    assert!(matches!(MaterialLibrary::load(empty.path()), Err(LibraryError::Empty { .. })));
    assert!(matches!(MaterialLibrary::load(Path::new("/no/such")), Err(LibraryError::Unreadable { .. })));
}

#[test]
fn bad_tables_are_refused_with_line_and_column() {
    let long = "o".repeat(201);
    let cases: [(&str, &str, &[&str]); 16] = [
        ("690", "heavy", &["line 3", "column 4", "density_kg_m3_low", "\"heavy\"", "is not a number"]),
        ("690", "-5", &["line 3", "column 4", "density_kg_m3_low", "1 to 1e5"]),
        ("690,720", "720,690", &["line 3", "column 5", "density_kg_m3_high", "less than the low end"]),
        ("0.35,0.4", "0.35,0.5", &["line 3", "column 9", "poisson_ratio_high"]),
        ("flexural", "bending", &["line 3", "column 12", "strength_kind", "flexural"]),
        (",D,55", ",C,55", &["line 3", "column 17", "hardness_scale", "A or D"]),
        (",D,55,65", ",D,55,165", &["line 3", "column 19", "hardness_high", "0 to 100"]),
        (",D,55", ",,55", &["line 3", "column 18", "hardness_low", "needs its scale"]),
        ("elastic,", "jelly,", &["line 3", "column 20", "law", "\"jelly\" is not a law", "plasticine or fluid"]),
        ("elastic,", "von_mises,", &["line 3", "column 21", "law_parameters", "lacks `yield_stress_pa`"]),
        ("elastic,", "foam,yield_stress_pa=0;viscosity_pa_s=1", &["column 21", "`yield_stress_pa` must be 0.1 to 1e9"]),
        ("elastic,", "foam,yield_stress_pa=1;yield_stress_pa=2", &["column 21", "duplicate field `yield_stress_pa`"]),
        ("elastic,", "elastic,yield_stress_pa=1e6", &["line 3", "column 21", "does not have"]),
        ("wood,our oak", "timber,our oak", &["line 3", "column 1", "family", "\"timber\"", "wood"]),
        ("our oak", "", &["line 3", "column 2", "name", "empty"]),
        ("our oak", long.as_str(), &["line 3", "column 2", "name", "at most 200 characters"]),
    ];
    let first = GOOD.replace("our oak,shop oak", "first,");
    for (from, to, expected) in cases {
        let message = load(&[&first, &GOOD.replacen(from, to, 1)]).expect_err(to).to_string();
        for part in expected {
            assert!(message.contains(part), "{to:?}: {part:?} is not in {message}");
        }
    }
    let missing = load_text(&format!("{}\n{GOOD}\n", HEADER.replace("poisson_ratio_low,", ""))).expect_err("no nu");
    assert!(missing.to_string().contains("`poisson_ratio_low` is missing"), "{missing}");
    let unknown = load_text(&format!("{},colour\n{GOOD},red\n", HEADER)).expect_err("an unknown column");
    assert!(unknown.to_string().contains("column 22 `colour`"), "{unknown}");
    let twice = load(&[GOOD, &GOOD.replace("our oak", "other").replace("shop oak", "Our-Oak")]).expect_err("a double");
    assert!(twice.to_string().contains("line 3") && twice.to_string().contains("our oak"), "{twice}");
    let ragged = load_text(&format!("{HEADER}\n{GOOD}\nwood,short\n")).expect_err("a short row");
    assert!(ragged.to_string().contains("mine.csv line 3: "), "{ragged}");
    let again = load_text(&format!("{HEADER},name\n{GOOD},ash\n")).expect_err("a column twice");
    assert!(again.to_string().contains("column 22 `name`: there is already"), "{again}");
}

#[test]
fn lines_are_counted_as_in_an_editor() {
    let first = GOOD.replace("our oak,shop oak", "first,");
    let bad = GOOD.replacen("690", "heavy", 1);
    let cases = [
        (format!("{HEADER}\r\n{first}\r\n{bad}\r\n"), "line 3, column 4"),
        (format!("{HEADER}\n{first}\n\n# heavy\n{bad}\n"), "line 5, column 4"),
        (format!("# mine\r\n{HEADER}\r\n{bad}\r\n"), "line 3, column 4"),
        (format!("# mine\n\n{HEADER},colour\n"), "line 3, column 22"),
        (format!("# mine\n{}\n", HEADER.replace("family,", "")), "line 2: the column `family`"),
        (
            format!("{HEADER}\r\n{first}\r\nwood,short\r\n"),
            "line 3: the header has 21 columns, but this row has 2 cells",
        ),
        (format!("{HEADER}\r\n{GOOD}\r\n\r\n{GOOD}\r\n"), "line 4: the name"),
    ];
    for (text, expected) in cases {
        let message = load_text(&text).expect_err(expected).to_string();
        assert!(message.contains(expected), "{expected:?} is not in {message}");
    }
}

#[test]
fn half_a_range_is_refused() {
    let evidence = "source,entry,title,density_kg_m3_low,density_kg_m3_high,youngs_modulus_pa_low,youngs_modulus_pa_high,\
                    poisson_ratio_low,poisson_ratio_high,strength_pa_low,strength_pa_high\nmine,oak,Oak,,720,,,,,,\n";
    let error = load_as("evidence.csv", evidence).expect_err("no low end").to_string();
    assert!(error.contains("line 2, column 4 `density_kg_m3_low`"), "{error}");
    let rules = "rule,property,low,high,relation,references,statement\nmine,density,,720,interval,,Oak\n";
    let error = load_as("rules.csv", rules).expect_err("no low end").to_string();
    assert!(error.contains("line 2, column 3 `low`"), "{error}");
}

#[test]
fn a_citation_stands_for_one_row() {
    let rules = |ids: &[&str]| {
        let rows: String = ids.iter().map(|id| format!("{id},density,690,720,interval,,Oak\n")).collect();
        format!("rule,property,low,high,relation,references,statement\n{rows}")
    };
    let evidence = |entry: &str| {
        format!(
            "source,entry,title,density_kg_m3_low,density_kg_m3_high,youngs_modulus_pa_low,youngs_modulus_pa_high,\
             poisson_ratio_low,poisson_ratio_high,strength_pa_low,strength_pa_high\nwooddb,{entry},Pine,500,520,,,,,,\n"
        )
    };
    let reference = |id: &str| format!("id,title,publisher,year,locator,licence\n{id},Mine,,,,\n");
    for (name, text, expected) in [
        ("rules.csv", rules(&["poisson-steel"]), "line 2, column 1 `rule`: \"poisson-steel\" already stands"),
        (
            "rules.csv",
            rules(&["mine", "mine"]).replacen("690", "680", 1),
            "line 3, column 1 `rule`: \"mine\" already stands",
        ),
        ("evidence.csv", evidence("scots-pine"), "line 2, column 2 `entry`: \"wooddb:scots-pine\" already stands"),
        ("bibliography.csv", reference("wooddb"), "line 2, column 1 `id`: \"wooddb\" already stands"),
    ] {
        let error = load_as(name, &text).expect_err(expected).to_string();
        assert!(error.contains(name) && error.contains(expected), "{expected:?} is not in {error}");
    }
    for (name, text) in
        [("rules.csv", rules(&["mine"])), ("evidence.csv", evidence("mine")), ("bibliography.csv", reference("mine"))]
    {
        load_as(name, &text).expect("new rows");
    }
}

#[test]
fn a_copy_of_the_built_in_tables_is_a_users_table_too() {
    let copy = MaterialLibrary::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("materials")).expect("the same rows");
    assert_eq!(cli::check_text(&copy, false), cli::check_text(MaterialLibrary::builtin(), false));
}

const FAMILY_HEADER: &str = "family,strength_meaning,hardness_low_scale,hardness_low,hardness_high_scale,hardness_high,\
law,law_parameters,density_kg_m3_low,density_kg_m3_high,youngs_modulus_pa_low,youngs_modulus_pa_high,poisson_ratio_low,\
poisson_ratio_high,strength_pa_low,strength_pa_high,friction_rubber_low,friction_rubber_high,friction_steel_low,\
friction_steel_high,label_abo,label_abo_exact,label_mvimgnet,label_mvimgnet_exact";
const BONE: &str = "bone,bending,D,50,D,95,elastic,,600,2100,5e9,3e10,0.2,0.45,1e7,3e8,0.3,1,0.2,0.8,wood,0,wood,0";

#[test]
fn a_familys_hardness_is_one_that_a_durometer_reads() {
    for (hardness, column) in [("D,50,D,900", "column 6 `hardness_high`"), ("D,-1,D,95", "column 4 `hardness_low`")] {
        let table = format!("{FAMILY_HEADER}\n{}\n", BONE.replace("D,50,D,95", hardness));
        let error = load_as("families.csv", &table).expect_err(hardness).to_string();
        assert!(error.contains(column) && error.contains("must be 0 to 100"), "{error}");
    }
}

/// Three materials of a family of their own, and enough wood without a source that most of all wood has none.
#[test]
fn a_users_tables_may_be_small_and_cite_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("families.csv"), format!("{FAMILY_HEADER}\n{BONE}\n")).expect("a written file");
    let row = |family: &str, n: usize| GOOD.replace("wood,our oak,shop oak", &format!("{family},own {family} {n},"));
    let rows = (0..3).map(|n| row("bone", n)).chain((0..200).map(|n| row("wood", n)));
    let rows = rows.collect::<Vec<_>>().join("\n");
    fs::write(folder.path().join("mine.csv"), format!("{HEADER}\n{rows}\n")).expect("a written file");
    let library = MaterialLibrary::load(folder.path()).expect("a good folder");
    assert_eq!(library.of_family("bone").count(), 3);
    let findings = check(&library);
    assert!(findings.iter().all(|one| !["count", "cited_share"].contains(&one.check)), "{findings:#?}");
}

/// A user's table and what its materials are made of.
fn load_with_constituents(row: &str, constituents: &str) -> MaterialLibrary {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("mine.csv"), format!("{HEADER}\n{row}\n")).expect("a written file");
    let header = "material,relation,constituent,density_kg_m3,youngs_modulus_pa,strength_pa,volume_fraction_low,\
                  volume_fraction_high,source";
    fs::write(folder.path().join("constituents.csv"), format!("{header}\n{constituents}\n")).expect("a written file");
    MaterialLibrary::load(folder.path()).expect("a good folder")
}

#[test]
fn a_constituent_may_spell_its_material_differently() {
    let row = "foam,our foam,,23,27,3e6,8e6,0.05,0.2,1e5,2e5,plateau,0.5,0.9,0.3,0.5,A,40,60,elastic,";
    let wall = "Our-Foam,cell_wall,polystyrene,1050,3.2e9,4.5e7,0,1,cambridge-databook";
    let findings = check(&load_with_constituents(row, wall));
    assert!(findings.iter().all(|one| one.check != "constituent"), "{findings:#?}");
}

/// Half to two thirds of it are hollow glass spheres, so the share at the low end gives the greatest density.
#[test]
fn a_reinforcement_may_be_lighter_than_its_matrix() {
    let findings = |density: &str| {
        let row = format!(
            "thermoset_composite,syntactic,,{density},4.5e9,8e9,0.3,0.35,3e7,5e7,flexural,0.5,0.9,0.3,0.5,D,70,80,\
             elastic,"
        );
        let spheres = "syntactic,reinforcement,glass spheres,350,1e10,,0.5,0.65,cambridge-databook";
        let epoxy = "syntactic,matrix,epoxy,1150,3e9,,0.35,0.5,cambridge-databook";
        let findings = check(&load_with_constituents(&row, &format!("{spheres}\n{epoxy}")));
        findings.iter().filter(|one| one.subject == "syntactic" && one.check == "composite_bounds").count()
    };
    assert_eq!(findings("620,760"), 0);
    assert_eq!(findings("900,1000"), 1, "denser than the mixture");
}

#[test]
fn a_name_passes_to_another_material_when_its_own_is_left_out() {
    let library = load(&[&GOOD.replace("shop oak", "oak")]).expect("a good table");
    assert_eq!(library.get("oak").map(|one| one.name.as_str()), Some("our oak"));
    let labelled = library.restricted_to(|one| one.labels.abo.exact);
    assert_eq!(labelled.get("oak").map(|one| one.name.as_str()), Some("oak, white"));
    assert!(labelled.get("our oak").is_none());
}

/// A row with one error, and the check that must find it.
const WRONG_ROWS: [(&str, &str, &str); 12] = [
    ("690,720", "290,720", "density_width"),
    ("1.1e10,1.3e10", "4e9,1.3e10", "youngs_width"),
    ("1.1e10,1.3e10", "4e10,5e10", "family_bounds"),
    ("9e7,1.1e8", "1e7,1.2e7", "strength_to_stiffness"),
    ("flexural", "compressive", "strength_kind"),
    ("0.6,0.9,0.3,0.5", "0.3,0.4,0.6,0.9", "friction"),
    ("1.1e10,1.3e10", "4e9,4.4e9", "wood"),
    ("1.1e10,1.3e10", "4e9,4.4e9", "bar_speed"),
    ("wood,our oak,shop oak,690,720,1.1e10,1.3e10", "rubber,our oak,,1100,1200,4e7,6e7", "shore_to_stiffness"),
    ("wood,our oak,shop oak,690,720,1.1e10,1.3e10", "foam,our oak,,100,110,1e6,2e6", "constituent"),
    ("elastic,", "von_mises,yield_stress_pa=5e8", "law"),
    ("D,55,65", "D,5,20", "hardness"),
];

#[test]
fn each_check_sees_what_it_is_for() {
    for (from, to, expected) in WRONG_ROWS {
        let row = GOOD.replacen(from, to, 1);
        let row = if to.starts_with("rubber") { row.replace(",D,55,65,", ",A,55,65,") } else { row };
        let library = load(&[&row]).expect(to);
        let findings = check(&library);
        let seen = findings.iter().any(|one| one.subject == "our oak" && one.check == expected && one.excuse.is_none());
        assert!(seen, "{expected} does not see {to:?}: {findings:#?}");
    }
    let copies = load(&[GOOD, &GOOD.replace("our oak,shop oak", "copied oak,")]).expect("two rows");
    assert!(check(&copies).iter().any(|one| one.check == "copied_row" && one.subject == "copied oak"));
}

#[test]
fn a_row_must_agree_with_the_rule_that_it_cites() {
    let cases = [
        ("0.35,0.4", "rule:poisson-hardwood", None),
        ("0.1,0.12", "rule:poisson-hardwood", Some("is not that of the rule `poisson-hardwood`")),
        ("0.35,0.4", "rule:no-such-rule", Some("rule:no-such-rule")),
        ("0.35,0.4", "rule:density-leather", Some("rule:density-leather")),
        ("0.35,0.4", "rule:poisson-hardwood;judgement", Some("judged")),
    ];
    for (range, source, expected) in cases {
        let row = GOOD.replacen("0.35,0.4", range, 1);
        let library = load_text(&format!("{HEADER},poisson_ratio_source\n{row},{source}\n")).expect(source);
        let findings = check(&library);
        let ours = findings.iter().filter(|one| one.subject == "our oak" && one.check == "source");
        let messages: Vec<&str> = ours.map(|one| one.message.as_str()).collect();
        match expected {
            Some(part) => assert!(messages.iter().any(|one| one.contains(part)), "{source} {range}: {messages:?}"),
            None => assert!(messages.is_empty(), "{source} {range}: {messages:?}"),
        }
    }
}

#[test]
fn a_number_computed_from_judgement_is_not_cited() {
    let columns = format!("{HEADER},density_source,hardness_source");
    for (density, refused) in [("wooddb:scots-pine", false), ("judgement", true)] {
        let text = format!("{columns}\n{},{density},rule:shore-d-wood\n", GOOD.replace("690,720", "590,620"));
        let findings = check(&load_text(&text).expect(density));
        let found = findings.iter().any(|one| one.subject == "our oak" && one.message.contains("which is judgement"));
        assert_eq!(found, refused, "{density}: {findings:#?}");
    }
}

/// The values that Gent's and Qi, Joyce and Boyce's papers give, to the digits printed there.
#[test]
fn shore_hardness_follows_the_published_relations() {
    for (shore, megapascals) in [(20.0, 0.73), (50.0, 2.46), (70.0, 5.5), (90.0, 20.8)] {
        let modulus = gent_modulus_pa(shore) / 1e6;
        assert!((modulus / megapascals - 1.0).abs() < 0.02, "Gent at {shore} A: {modulus}");
    }
    let modulus = qi_modulus_pa(ShoreScale::D, 45.0) / 1e6;
    assert!((modulus / 39.1 - 1.0).abs() < 0.01, "Qi, Joyce and Boyce at 45 D: {modulus}");
}

#[test]
fn materials_are_simulated_by_the_law_that_they_follow() {
    let library = MaterialLibrary::builtin();
    let law = |name: &str| library.get(name).expect(name).law;
    assert_eq!(law("oak"), Law::Elastic);
    assert!(matches!(law("stainless steel 304"), Law::VonMises { yield_stress_pa } if yield_stress_pa > 1.9e8));
    for dry in ["dry sand", "glass beads"] {
        assert!(matches!(law(dry), Law::DruckerPrager { cohesion_pa, .. } if cohesion_pa == 0.0), "{dry}");
    }
    assert!(matches!(law("memory foam"), Law::Foam { .. }));
    assert!(matches!(law("snowball"), Law::Snow { .. }));
    assert!(matches!(law("plasticine"), Law::Plasticine { .. }));
}
