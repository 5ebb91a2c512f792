use gprop::mpm::particles::{IDENTITY, Particle};
use gprop::simulate::action::Effect;
use gprop::simulate::script::{KNOWN, Script, Standing, is_name, named};
use gprop::simulate::{Options, SimulateError, script_of};

/// A column of ten particles; the lower five are a foot, the others a seat.
fn column() -> Vec<Particle> {
    (0..10)
        .map(|i| Particle {
            position_m: [1.0, 1.0, 0.05 + 0.1 * i as f32],
            compensation_m: [0.0; 3],
            velocity_m_s: [0.0; 3],
            affine: [0.0; 9],
            elastic: IDENTITY,
            deformation: IDENTITY,
            mass_kg: 0.5,
            volume_m3: 1e-3,
            mu: 1.0,
            lambda: 1.0,
            state: 0.0,
            law: 0,
        })
        .collect()
}

const LABELS: [u32; 10] = [0, 0, 0, 0, 0, 1, 1, 1, 1, 1];

fn standing<'a>(particles: &'a [Particle], names: &'a [Vec<&'a str>]) -> Standing<'a> {
    Standing {
        particles,
        is_solid: &[true; 10],
        labels: &LABELS,
        names,
        longest_m: 1.0,
        gravity_m_s2: 9.8,
        duration_s: 2.0,
    }
}

#[test]
fn every_known_scenario_plays() {
    let (particles, names) = (column(), vec![vec!["foot", "oak"], vec!["seat", "leather"]]);
    for known in &KNOWN {
        let script = named(known.name, &[]).unwrap();
        let actions = standing(&particles, &names).actions(&script.steps).unwrap();
        assert_eq!(actions.is_empty(), known.name == "drop", "{}", known.name);
        assert!(actions.iter().all(|a| a.mask.contains(&true) && a.to_s > a.from_s), "{}", known.name);
    }
}

/// A force in weights of the object, on a named part, during its share of the time.
#[test]
fn file_pushes_a_part_by_name() {
    let script = Script::from_toml(
        r#"
        drop_height = 0.25
        [[step]]
        on = "Seat"
        do = { force = { weights = [0.0, 0.0, -2.0] } }
        from = 0.25
        to = 0.5
        [[step]]
        on = "oak"
        do = "hold"
        "#,
    )
    .unwrap();
    let (particles, names) = (column(), vec![vec!["foot", "oak"], vec!["seat", "leather"]]);
    let actions = standing(&particles, &names).actions(&script.steps).unwrap();
    assert_eq!((actions[0].from_s, actions[0].to_s), (0.5, 1.0));
    assert_eq!(actions[0].mask, LABELS.map(|l| l == 1));
    // A force of two weights of the object acts on half of its mass: four times gravity.
    match actions[0].effect {
        Effect::Accelerate([x, y, z]) => assert!(x == 0.0 && y == 0.0 && (z + 4.0 * 9.8).abs() < 1e-4, "{z}"),
        other => panic!("{other:?}"),
    }
    assert_eq!((actions[1].mask.clone(), actions[1].effect), (LABELS.map(|l| l == 0).to_vec(), Effect::Move([0.0; 3])));
}

/// A caption is a sentence: one word of it is enough, unless it is the exact name of a part.
#[test]
fn parts_are_found_by_words_of_their_caption() {
    let particles = column();
    let held = |captions: [&str; 2], on: &str| {
        let names = captions.map(|caption| vec![caption]).to_vec();
        let script = Script::from_toml(&format!("[[step]]\non = \"{on}\"\ndo = \"hold\"")).unwrap();
        standing(&particles, &names).actions(&script.steps).map(|actions| actions[0].mask.clone())
    };
    let mug = ["foot of a mug; bare clay", "body and Handle of a mug, glazed"];
    assert_eq!(held(mug, "handle").unwrap(), LABELS.map(|l| l == 1));
    assert_eq!(held(mug, "bare clay").unwrap(), LABELS.map(|l| l == 0));
    assert_eq!(held(["foot", "rim above the foot"], "foot").unwrap(), LABELS.map(|l| l == 0));
    assert_eq!(held(["tapered front leg", "seat of glass"], "legs").unwrap(), LABELS.map(|l| l == 0));
    assert!(held(mug, "hand").is_err() && held(mug, ";").is_err());
    let can = ["Ölkännchen", "Deckel am Ölkännchen"];
    assert_eq!(held(can, "ÖLKÄNNCHEN").unwrap(), LABELS.map(|l| l == 0));
}

/// The topmost particle is a stray, far above the others: the upper third is that of the others, and the stray belongs to
/// it. The axis of a turn goes through the middle of the others as well.
#[test]
fn strays_do_not_define_the_regions() {
    let (mut particles, names) = (column(), vec![vec!["foot"], vec!["seat"]]);
    particles[9].position_m = [9.0, 1.0, 30.0];
    let is_solid: [bool; 10] = std::array::from_fn(|i| i != 9);
    let standing = |is_solid| Standing { is_solid, ..standing(&particles, &names) };
    let step = |what: &str| Script::from_toml(&format!("[[step]]\non = \"top\"\ndo = {what}")).unwrap().steps;
    let held = |is_solid| standing(is_solid).actions(&step("\"hold\"")).unwrap()[0].mask.clone();
    // Solid heights are 0.05 to 0.85 m: the upper third begins at 0.58 m.
    assert_eq!(held(&is_solid), [false, false, false, false, false, false, true, true, true, true]);
    let all: [bool; 10] = std::array::from_fn(|i| i == 9);
    assert_eq!((held(&[true; 10]), held(&[false; 10])), (all.to_vec(), all.to_vec()));
    let turn = standing(&is_solid).actions(&step("{ turn = { rate_rad_s = 1.0 } }")).unwrap()[0].effect;
    let Effect::Turn { center, .. } = turn else { panic!("{turn:?}") };
    assert!((center[0] - 1.0).abs() < 1e-6 && (center[2] - 0.45).abs() < 1e-6, "{center:?}");
}

#[test]
fn wrong_names_are_refused_with_what_there_is() {
    let why = |result: Result<Script, SimulateError>| result.unwrap_err().to_string();
    assert!(why(named("dorp", &[])).contains("drop, push"));
    assert!(why(named("push", &["fierce=2".to_owned()])).contains("`fierce`"));
    assert!(why(named("push", &["force=much".to_owned()])).contains("give a finite number"));
    assert!(why(Script::from_toml("height = 1")).contains("height"));
    for height in ["-0.5", "1001"] {
        assert!(why(named("drop", &[format!("height={height}")])).contains(&format!("height is {height}")));
    }
    assert!(why(named("drop", &["tilt=361".to_owned()])).contains("tilt is 361"));
    let of_part = why(named("drop", &["head.material=steel".to_owned()]));
    assert!(of_part.contains("`--correct head.material=steel`"), "{of_part}");
    assert!(why(Script::from_toml("drop_height = nan")).contains("height is NaN"));
    for wrong in
        ["to = inf\ndo = \"hold\"", "do = { draw = { speed = nan } }", "do = { force = { weights = [0, 0, inf] } }"]
    {
        assert!(why(Script::from_toml(&format!("[[step]]\non = \"all\"\n{wrong}"))).contains("step 1"), "{wrong}");
    }
    let never = [["0.5", "0.2"], ["0.5", "0.5"], ["1.0", "2.0"], ["2.0", "3.0"], ["-2.0", "-1.0"], ["-1.0", "0.0"]];
    for [from, to] in never {
        let text = format!("[[step]]\non = \"all\"\ndo = \"hold\"\nfrom = {from}\nto = {to}");
        assert!(why(Script::from_toml(&text)).contains("step 1 never acts"), "{from} to {to}");
    }
    assert!(why(named("poke", &["lasts=-1".to_owned()])).contains("never acts"));
    for (name, nothing) in [("release", "after=0"), ("poke", "lasts=0")] {
        assert!(named(name, &[nothing.to_owned()]).unwrap().steps.is_empty(), "{name}");
    }
    assert!(!is_name("Push.TOML") && is_name("push"));
    let (scenario, set) = ("examples/push.toml".to_owned(), vec!["force=2".to_owned()]);
    let of_file = script_of(&Options { scenario, set, ..Options::default() }).unwrap_err().to_string();
    assert!(of_file.contains("--set") && of_file.contains("`examples/push.toml` is a file"), "{of_file}");
    let low = named("drop", &["height=0.1".to_owned()]).unwrap();
    assert_eq!((low.drop_height, low.tilt_deg), (0.1, 25.0));
    let (particles, names) = (column(), vec![vec!["foot"], vec!["seat"]]);
    let script = Script::from_toml("[[step]]\non = \"lid\"\ndo = \"hold\"").unwrap();
    let error = standing(&particles, &names).actions(&script.steps).unwrap_err().to_string();
    assert!(error.contains("`lid`") && error.contains("`foot`, `seat`"), "{error}");
    assert_eq!(Options::default().scenario, "drop");
}
