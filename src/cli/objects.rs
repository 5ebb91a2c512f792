//! `gprop objects`, and runs of captures that show several objects, each as a scene of its own: two at a time if the machine allows it.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use crate::batch;
use crate::config;
use crate::error::{Context, Error, ErrorKind, Result, UsageError};
use crate::exit;
use crate::export::{self, Body, ExportError, Exported, Links, Origin, Table, compose};
use crate::objects::{self, Objects, SomeFailed};
use crate::parallel;
use crate::parts::MassReading;
use crate::pipeline::{OBJECT, Options, Stage, corrections_file, work_folder_of};
use crate::scene::{ObjectChoice, ObjectNumber, Plane, ScaleChoice, SceneError, StandingObjects};
use crate::words::output::counted;
use crate::words::progress::about;
use crate::workdir::{Artifact, WorkDir};

use super::arguments::ForPython;
use super::scene::OfScene;
use super::{ExportArgs, Global, WorkArgs, last_run, print, print_works, scene, shown};

/// The stages of a run.
#[derive(Debug, Clone, Copy)]
pub struct Run {
    /// The last one.
    pub to: Stage,
    pub simulates: bool,
    /// Set if the Python module runs it.
    pub for_python: Option<ForPython>,
}

/// `gprop objects`.
pub fn list(global: &Global, args: &objects::Args) -> Result<()> {
    let root = work_folder_of(&args.scene, args.out.as_deref(), ObjectChoice::All)?;
    let found = objects::command(args, &root, global.progress())?;
    found.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
    print(global, &found, || found.text() + &shown(&root.join(Artifact::ObjectsPage.path())))
}

/// Runs a scene: all objects that stand on its table if there are several and the user chose none, or asked for all.
pub fn run(global: &Global, folder: &Path, work: &WorkArgs, run: Run) -> Result<()> {
    let options = &work.options.scene;
    let several = match options.object {
        ObjectChoice::One(_) => None,
        ObjectChoice::All => Some(StandingObjects::find(folder, options)?),
        // What is wrong with the scene is reported by the run itself.
        ObjectChoice::Auto => StandingObjects::find_several(folder, options).ok().flatten(),
    };
    match several {
        Some(found) if run.for_python == Some(ForPython::One) => {
            let problem = format!(
                "{folder:?} shows {}; name one with object=N, as gprop.call(\"objects\", ...) numbers them, or run each with \
                 gprop.run_all",
                counted(found.count, "object")
            );
            Err(UsageError(problem).into())
        }
        Some(found) => run_all(global, folder, work, run, &found),
        None => run_one(global, folder, work, run),
    }
}

/// Runs a scene as one object.
pub fn run_one(global: &Global, folder: &Path, work: &WorkArgs, run: Run) -> Result<()> {
    if run.for_python.is_some() {
        if !run.simulates {
            scene::check_without_simulation(run.to)?;
        }
        let mut pipeline = scene::open(global, folder, work, run.to, run.simulates)?;
        pipeline.run()?;
        let opened = pipeline.opened();
        return print_works([(opened.scene.name.as_str(), opened.work.root().to_owned())].into_iter());
    }
    let run_scene = if run.simulates { scene::run } else { scene::run_without_simulation };
    run_scene(global, folder, work, run.to)
}

/// What is true of one object is not taken for true of all.
fn refuse_options_of_one_object(folder: &Path, options: &Options, count: usize) -> Result<()> {
    let file_of = |object: ObjectChoice| corrections_file(folder, object);
    match options.parts.known_mass {
        Some(MassReading { object: None, kg }) => Err(UsageError(format!(
            "--known-mass is the mass of one object; say of which, such as --known-mass 2={kg}"
        ))
        .into()),
        Some(MassReading { object: Some(given), .. }) if given.get() as usize > count => {
            Err(SceneError::NoSuchObject { given, count }.into())
        }
        _ if !options.vote.correct.is_empty() => Err(UsageError(format!(
            "corrections (--correct, [part.NAME] in gprop.toml, or {:?}) are about the parts of one object; say of which with \
             --object N, or write them into {:?} and the like",
            file_of(ObjectChoice::All),
            file_of(ObjectNumber::first(1).next().map_or(ObjectChoice::All, ObjectChoice::One))
        ))
        .into()),
        _ => Ok(()),
    }
}

/// The numbers of `count` objects; that from whose weight the scale of the others follows comes first.
fn in_order(options: &Options, count: usize) -> Vec<ObjectNumber> {
    let mut numbers: Vec<ObjectNumber> = ObjectNumber::first(count).collect();
    let weighed = options.parts.known_mass.and_then(|reading| reading.object);
    numbers.sort_by_key(|number| Some(*number) != weighed);
    numbers
}

/// The most objects that are run at the same time: each has long pieces of work for all cores, and another one fills the gaps between
/// these.
const MOST_LANES: usize = 2;

/// How many objects are run at the same time up to a stage: no more than may ask a server at the same time. A program that follows the
/// stages is shown one after the other.
fn lanes(global: &Global, found: &StandingObjects, options: &Options, to: Stage) -> usize {
    let threads = rayon::current_num_threads();
    let fit = || batch::memory_holds(MOST_LANES as u64, found.gaussians.len(), to, threads);
    let at_once = threads.min(options.query.lmm_parallel);
    if at_once >= MOST_LANES && !global.for_mcp && fit() { MOST_LANES } else { 1 }
}

/// Does some work for every object, on so many lanes: at first, alone, for that from whose weight the scale of the others follows.
fn for_each(
    options: &Options,
    numbers: &[ObjectNumber],
    lanes: usize,
    work: impl Fn(&ObjectNumber) -> Result<()> + Sync,
) -> Result<()> {
    let weighed = options.parts.known_mass.map_or(0, |_| 1);
    let (weighed, others) = numbers.split_at(weighed);
    weighed.iter().try_for_each(&work)?;
    parallel::side_by_side(others, lanes, work)
}

/// Runs every object, and writes the list and the page of the capture after each.
fn run_all(global: &Global, folder: &Path, work: &WorkArgs, run: Run, found: &StandingObjects) -> Result<()> {
    if !run.simulates {
        scene::check_without_simulation(run.to)?;
    }
    found.require_any()?;
    refuse_options_of_one_object(folder, &work.options, found.count)?;
    let numbers = in_order(&work.options, found.count);
    global.progress().line(&format!(
        "{} on the surface; each is run by itself (--object N runs one, `gprop objects` shows them)",
        counted(found.count, "object")
    ));
    for &number in &numbers {
        // A folder that is not to be trusted is an error of that object's own run.
        if let Ok(own) = work_folder_of(folder, work.out.as_deref(), ObjectChoice::One(number)) {
            last_run::tell_left_out(global, number, &own, run.to);
        }
    }
    let lanes = lanes(global, found, &work.options, run.to);
    let each = |number: ObjectNumber| -> Result<Each> {
        let options = share(work.options.clone().of_object(folder, number)?, found.count, lanes);
        Ok(Each { global: for_object(global, number), work: WorkArgs { options, ..work.clone() } })
    };
    if work.dry_run {
        return dry_run_all(global, folder, run, &numbers, each);
    }
    let root = work_folder_of(folder, work.out.as_deref(), ObjectChoice::All)?;
    let of_capture = WorkDir::open(&root)?;
    let objects = Objects::look(found, &of_capture, global.progress())?;
    objects.write(&of_capture)?;
    let standing = Mutex::new((objects, vec![None; numbers.len()]));
    let standing_now = || standing.lock().unwrap_or_else(PoisonError::into_inner);
    for pass in passes(work, run) {
        let one = |number: &ObjectNumber| -> Result<()> {
            let index = number.get() as usize - 1;
            let title = match &*standing_now() {
                (_, errors) if errors[index].is_some() => return Ok(()),
                (objects, _) => objects.objects[index].title(),
            };
            let Each { global: own, work } = each(*number)?;
            own.progress().line(&title);
            let run = || run_object(&own, folder, &WorkArgs { from: pass.from, ..work }, pass.run);
            let failed = match about(&number.to_string(), run) {
                Err(error) if ends_all(&error) => return Err(error),
                ended => ended.err(),
            };
            let (objects, errors) = &mut *standing_now();
            if let Some(error) = failed {
                let text = exit::message(&error);
                text.lines().for_each(|line| tracing::warn!("{title}: {line}"));
                errors[index] = Some(text);
            }
            objects.read_results(&root, errors);
            objects.write(&of_capture)
        };
        for_each(&work.options, &numbers, lanes, one)?;
    }
    let (objects, _) = standing.into_inner().unwrap_or_else(PoisonError::into_inner);
    let page = shown(&root.join(Artifact::ObjectsPage.path()));
    if run.for_python.is_some() {
        print_works(objects.objects.iter().map(|object| (object.name.as_str(), root.join(&object.work))))?;
    } else if global.prints_summary() {
        print(global, &objects, || objects.text() + &page)?;
    }
    let failed = objects.objects.iter().filter(|object| object.error.is_some());
    let failed: Vec<String> = failed.map(objects::Object::title).collect();
    if failed.is_empty() { Ok(()) } else { Err(SomeFailed { count: numbers.len(), failed }.into()) }
}

/// Shows what running every object would do.
fn dry_run_all(
    global: &Global,
    folder: &Path,
    run: Run,
    numbers: &[ObjectNumber],
    each: impl Fn(ObjectNumber) -> Result<Each>,
) -> Result<()> {
    let dry_run = |number: &ObjectNumber| {
        let Each { global, work } = each(*number)?;
        Ok((number.to_string(), scene::dry_run(&global, folder, &work, run.to, run.simulates)?))
    };
    let all = numbers.iter().map(dry_run).collect::<Result<Vec<_>>>()?;
    let text = || all.iter().map(|(name, dry)| format!("{name}\n{}", dry.text())).collect::<Vec<_>>().join("\n");
    let json: Vec<_> = all.iter().map(|(name, dry)| serde_json::json!({ "name": name, "run": dry })).collect();
    print(global, &json, text)
}

/// Stages that are done for every object before those of the next pass.
struct Pass {
    run: Run,
    from: Option<Stage>,
}

/// Once, or twice if the scale follows from what a model judges of the sizes of all objects: first, all are asked about.
fn passes(work: &WorkArgs, run: Run) -> Vec<Pass> {
    let asks = work.options.scene.scale == ScaleChoice::Estimate && run.to > Stage::Query;
    if !asks || work.from.is_some_and(|from| from > Stage::Query) {
        return vec![Pass { run, from: work.from }];
    }
    let asking = Pass { run: Run { to: Stage::Query, simulates: true, ..run }, from: work.from };
    vec![asking, Pass { run, from: work.from.map(|_| Stage::Vote) }]
}

/// The command as it is for one object.
struct Each {
    global: Global,
    work: WorkArgs,
}

/// Does the stages of one object. What they found is printed at the end, for all.
fn run_object(global: &Global, folder: &Path, work: &WorkArgs, run: Run) -> Result<()> {
    let mut pipeline = scene::open(global, folder, work, run.to, run.simulates)?;
    pipeline.run()
}

/// Whether an error concerns all objects: a missing model or an interrupt.
fn ends_all(error: &Error) -> bool {
    matches!(error.kind(), ErrorKind::Model | ErrorKind::Cancelled)
}

/// The options for one of `count` objects, among which the budget is shared out, as parallel requests are among the lanes.
fn share(mut options: Options, count: usize, lanes: usize) -> Options {
    options.query.max_usd = options.query.max_usd.map(|usd| usd / count as f64);
    options.query.lmm_parallel /= lanes;
    options
}

/// The flags as if the user had chosen this object: later commands on its work folder go on from them.
fn for_object(global: &Global, number: ObjectNumber) -> Global {
    let mut global = global.clone();
    let chosen = format!("--{OBJECT}={number}");
    let flags = &mut global.flags;
    for list in [&mut flags.typed, &mut flags.effective] {
        list.retain(|flag| config::name_of(flag) != OBJECT);
        list.push(OsString::from(&chosen));
    }
    let of_scene = flags.recorded.entry("scene".to_owned()).or_default();
    of_scene.retain(|flag| config::name_of(flag.as_ref()) != OBJECT);
    of_scene.push(chosen);
    global
}

/// Exports every object into one folder, and all of them as one scene in each format that can hold one.
pub fn export_all(global: &Global, args: &ExportArgs) -> Result<()> {
    let formats = scene::formats(args)?;
    if args.origin != Origin::Input || args.at != [0.0; 3] {
        let why = "--origin and --at are for one object: a scene of all objects keeps the places that they have in the capture";
        return Err(UsageError(why.to_owned()).into());
    }
    if args.links == Links::Parts {
        let why = "--links parts is for one object; name it with --object N";
        return Err(UsageError(why.to_owned()).into());
    }
    let found = StandingObjects::find(args.scene(), &args.options.scene)?;
    found.require_any()?;
    refuse_options_of_one_object(args.scene(), &args.options, found.count)?;
    let objects = Mutex::new(BTreeMap::new());
    let lanes = lanes(global, &found, &args.options, Stage::Parts);
    let one = |number: &ObjectNumber| -> Result<()> {
        let options = share(args.options.clone().of_object(args.scene(), *number)?, found.count, lanes);
        let own = for_object(global, *number);
        let export = || scene::export_one(&own, args, &options);
        let exported = about(&number.to_string(), export).with_context(|| number.to_string())?;
        objects.lock().unwrap_or_else(PoisonError::into_inner).insert(*number, exported);
        Ok(())
    };
    let numbers = in_order(&args.options, found.count);
    for_each(&args.options, &numbers, lanes, one)?;
    let objects = objects.into_inner().unwrap_or_else(PoisonError::into_inner);
    let objects: Vec<OfScene> = objects.into_values().collect();
    let inputs = objects.first().map_or_else(Vec::new, |object| object.inputs.clone());
    let mut exported = compose_all(&found, objects, formats.is_none(), args.out())?;
    export::write_summary(&mut exported, &inputs, args.out())?;
    scene::print_exported(global, &exported)
}

/// Writes the scene of all objects, and returns its files before those of the objects.
fn compose_all(found: &StandingObjects, mut objects: Vec<OfScene>, leaves_out: bool, out: &Path) -> Result<Exported> {
    let names: Vec<String> = objects.iter().map(|object| object.name.clone()).collect();
    let bodies: Vec<Body> = objects.iter_mut().filter_map(|object| object.exported.body.take()).collect();
    let scale = objects.first().and_then(|object| object.scale.clone());
    let inputs = objects.first().map_or_else(Vec::new, |object| object.inputs.clone());
    let all = objects.into_iter().map(|object| object.exported).reduce(|mut all, next| {
        all.add(next);
        all
    });
    let mut all = all.expect("there is an object");
    let mut formats = all.formats.clone();
    if bodies.len() < names.len() && formats.iter().any(|format| format.has_bodies()) {
        if !leaves_out {
            return Err(ExportError::NoMass.into());
        }
        formats.retain(|format| !format.has_bodies());
    }
    let turn = found.up.world_from_input();
    let table = Table {
        name: &found.name,
        objects: &names,
        bodies: &bodies,
        world_from_input: turn,
        scale: scale.as_ref(),
        support: Plane { normal: turn * found.support.normal, ..found.support },
        surroundings: &found.surroundings(),
        surroundings_as_read: &found.surroundings_as_read(),
        inputs: &inputs,
    };
    all.lead(compose(&table, &formats, out)?);
    Ok(all)
}
