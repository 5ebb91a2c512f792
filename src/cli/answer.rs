//! `gprop answer`: asks a person, on a page that it serves on this machine, one question after another. Each answer is
//! recorded as it is given; then the object is weighed on the answers so far, and the questions that follow are shown.

use std::collections::BTreeMap;

use serde::Serialize;
use tracing::subscriber::{NoSubscriber, with_default};

use crate::consensus::AskAbout;
use crate::error::{ErrorKind, Result, UsageError};
use crate::local_server::{Event, LocalServer, Post, Site};
use crate::materials::MaterialLibrary;
use crate::pipeline::stages::questions::session_of;
use crate::pipeline::stages::subjects::FoundSubjects;
use crate::pipeline::{Options, Pipeline, Stage};
use crate::query::AnswerSource;
use crate::query::exchange::{Form, Served};
use crate::query::session::{ForPerson, QuerySession};
use crate::scene::ScaleChoice;
use crate::units::Estimate;
use crate::words::output::{agreeing, counted, one_line, tell};
use crate::words::progress::{CancelToken, ShowProgress};
use crate::words::readable::{Figures, mass};

use super::{AnswerArgs, Global, is_picture, print, scene};

/// The result of a sitting.
#[derive(Serialize)]
struct Sitting {
    answered: usize,
    questions: usize,
    mass_kg: Option<Estimate>,
}

/// The mass of the object, or why there is none.
type Weighed = std::result::Result<Estimate, String>;

/// An answer that waits for the page to be told what follows from it.
struct Pending {
    post: Post,
    /// The problem with the answer, if it could not be recorded.
    problem: Option<String>,
}

/// What happened while the page showed its questions.
enum Next {
    Answers(Vec<Pending>),
    Ended,
}

/// Runs the command.
pub fn answer(global: &Global, args: &AnswerArgs) -> Result<()> {
    let (folder, work) = (&args.scene.scene, &args.scene.work);
    if is_picture(folder) {
        let problem = "gprop answer takes a scene; for a single picture, use gprop query PICTURE --export DIR";
        return Err(UsageError(problem.to_owned()).into());
    }
    if work.dry_run {
        return scene::run(global, folder, work, Stage::Query);
    }
    scene::open(global, folder, work, Stage::Consensus, true)?.run()?;
    let cancel = CancelToken::default();
    let builder = scene::builder(global, folder, work, Stage::Consensus)?;
    let builder = builder.options(by_person(&work.options)).progress(ShowProgress::Hidden).cancel_with(&cancel);
    let mut pipeline = builder.open()?;
    pipeline.run()?;
    let server = LocalServer::start(args.port, Site::default(), cancel)
        .map_err(|error| UsageError(format!("cannot serve on port {} of 127.0.0.1: {error}", args.port)))?;
    let mut page = Page { server, form: Form::default(), is_told: false, is_over: false };
    let mut pending = Vec::new();
    loop {
        let weighed = weigh(&mut pipeline);
        let weighed = weighed.map_err(|problem| if lacks_size(&pipeline) { NO_SIZE.to_owned() } else { problem });
        let (sitting, next) = page.round(&pipeline, &weighed, pending)?;
        match next {
            Next::Answers(answers) => pending = answers,
            Next::Ended => {
                drop(page.server);
                return print(global, &sitting, || sitting.text(&weighed, &scene::as_typed(global, folder)));
            }
        }
    }
}

/// Without the size of the object, no answer leads to a mass.
const NO_SIZE: &str = "There is no mass, because the size of the object is unknown: start `gprop answer` again with a length that you \
                       measured, such as --scale bbox:z=0.12 for the height in metres, or with the weight of the object, such as \
                       --known-mass 0.35 in kilograms. Answers are kept.";

/// Whether nothing tells how large the object is.
fn lacks_size(pipeline: &Pipeline) -> bool {
    let open = pipeline.opened();
    let Options { scene, parts, .. } = &open.options;
    open.scene.scale.is_none() && scene.scale != ScaleChoice::Estimate && parts.known_mass.is_none()
}

/// The options if a person answers: no model is asked, and what is not answered yet is left open.
fn by_person(options: &Options) -> Options {
    let mut options = options.clone();
    options.query.answers = AnswerSource::Partial;
    options.query.lmm_url = None;
    options
}

/// Weighs the object on the answers so far. Its warnings are those of an unfinished run, and are not shown.
fn weigh(pipeline: &mut Pipeline) -> Weighed {
    let parts = with_default(NoSubscriber::default(), || pipeline.weigh_anew());
    parts.map(|parts| parts.object.mass_kg).map_err(|error| match error.kind() {
        ErrorKind::Answer => "There is no mass yet: more answers are needed.".to_owned(),
        ErrorKind::Cancelled => "The object was not weighed again.".to_owned(),
        _ => format!("There is no mass: {}", one_line(&error.to_string())),
    })
}

/// The page, and what it knows.
struct Page {
    server: LocalServer,
    form: Form,
    /// Whether the user was told the address.
    is_told: bool,
    /// Whether the user pressed Ctrl-C.
    is_over: bool,
}

impl Page {
    /// Shows the questions that are open, tells the page what followed from its last answers, and waits for the next ones,
    /// which it records.
    fn round(&mut self, pipeline: &Pipeline, weighed: &Weighed, pending: Vec<Pending>) -> Result<(Sitting, Next)> {
        let open = pipeline.opened();
        let about = FoundSubjects::of(open)?;
        let session = session_of(open, &about, &open.options.query)?;
        let due = session.for_person(&mut self.form)?;
        let questions = due.queries.subjects.len() + due.queries.whole.len();
        let sitting = Sitting { answered: questions - due.open, questions, mass_kg: weighed.as_ref().ok().copied() };
        let served = served(&sitting, &due, weighed, open.options.consensus.ask);
        self.show(&served, session.library(), pending);
        if sitting.is_done() || self.is_over {
            return Ok((sitting, Next::Ended));
        }
        if !self.is_told {
            if lacks_size(pipeline) {
                tell(NO_SIZE);
            }
            tell(&format!("Answer at {}  (on this machine only; Ctrl-C ends, answers are kept)", self.server.url()));
            self.is_told = true;
        }
        let next = self.answers(&session, &due)?;
        Ok((sitting, next))
    }

    fn show(&self, served: &Served, library: &MaterialLibrary, pending: Vec<Pending>) {
        let questions = self.form.questions().iter();
        let pictures: BTreeMap<_, _> = questions.map(|of| (of.sheet.clone(), of.jpeg.clone())).collect();
        let page = self.form.page(library, Some(served));
        self.server.show(Site { page, pictures });
        for Pending { post, problem } in pending {
            post.reply(self.form.reply(served, problem.as_deref()));
        }
    }

    /// Waits for an answer or for Ctrl-C, and records the answer together with those that wait behind it.
    fn answers(&mut self, session: &QuerySession, due: &ForPerson) -> Result<Next> {
        let mut answers = Vec::new();
        let mut event = Some(self.server.next());
        while let Some(happened) = event {
            let Event::Posted(post) = happened else {
                self.is_over = true;
                break;
            };
            let problem = session.record(&post.body, &self.form, &due.queries)?.err();
            answers.push(Pending { post, problem });
            event = self.server.next_now();
        }
        Ok(if answers.is_empty() { Next::Ended } else { Next::Answers(answers) })
    }
}

/// What the page is told of how things stand. It starts with the name of the user on this machine.
fn served(sitting: &Sitting, due: &ForPerson, weighed: &Weighed, ask: AskAbout) -> Served {
    let mut standing = vec![sitting.standing(weighed)];
    if sitting.is_done() {
        standing.push("Nothing is left to answer: close this page. The terminal says what to run next.".to_owned());
    } else if weighed.is_ok() {
        standing.push(meanwhile(due, ask));
    }
    let name = std::env::var("USER").unwrap_or_default();
    Served { recorded: due.recorded.clone(), standing, done: sitting.is_done(), name }
}

/// What the mass is based on where there is no answer yet.
fn meanwhile(due: &ForPerson, ask: AskAbout) -> String {
    let ForPerson { open, parts, without_answer, .. } = due;
    match ask {
        AskAbout::Segments => {
            let vote = agreeing(*open, "does not vote", "do not vote");
            format!("{} without an answer {vote} yet.", counted(*open, "segment"))
        }
        AskAbout::Object => {
            let (parts, have) = (counted(*without_answer, "part"), agreeing(*without_answer, "has", "have"));
            format!("{parts} in doubt {have} no answer yet; until then, the answer about the object stands.")
        }
        AskAbout::Parts if *without_answer == 0 => {
            "Every part has an answer; the open questions show parts in more views.".to_owned()
        }
        AskAbout::Parts => format!(
            "{} of {} answered; until the others are, they count like the parts beside them.",
            parts - without_answer,
            counted(*parts, "part")
        ),
    }
}

impl Sitting {
    fn is_done(&self) -> bool {
        self.answered == self.questions
    }

    fn standing(&self, weighed: &Weighed) -> String {
        let Self { answered, questions, .. } = self;
        let mass = match weighed {
            Ok(mass_kg) => {
                let Figures { mid, interval } = mass(*mass_kg);
                format!("{} {mid} ({interval}).", if self.is_done() { "Mass:" } else { "Mass so far:" })
            }
            Err(problem) => problem.clone(),
        };
        format!("{answered} of {} answered. {mass}", counted(*questions, "question"))
    }

    fn text(&self, weighed: &Weighed, scene: &str) -> String {
        let next = if self.is_done() {
            format!("Go on with `gprop run {scene}`, and the same --out if you gave one.")
        } else {
            format!(
                "`gprop answer {scene}` goes on with the others; `gprop run {scene} --answers partial` reports on the \
                 answers so far; `gprop run {scene} --lmm-url URL --lmm-model NAME` lets a model answer the rest; all with the same --out if you \
                 gave one."
            )
        };
        format!("{}\n{next}", self.standing(weighed))
    }
}
