//! The questions about one object or picture, from its views to the answers: what is due, what it would cost, asking, and what
//! people and other programs answer.
//!
//! 1. [`set_up`]: recordings, prompts, materials and the price of the model, by the options.
//! 2. [`questions`]: those that are due, with their sheets.
//! 3. [`answers`]: asks them round by round; [`batch_api`] submits them instead and collects the answers later.

mod answers;
mod batch_api;
mod questions;
mod set_up;

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::consensus::{AskAbout, FoundThing};
use crate::error::{Result, UsageError};
use crate::materials::MaterialLibrary;
use crate::query::ask::budget::Budget;
use crate::query::ask::cost::Price;
use crate::query::ask::rounds::{Subject, SubjectInView};
use crate::query::ask::{direct, recognition, size};
use crate::query::client::{ApiKey, Client, ClientError};
use crate::query::exchange::{self, Form, Imported};
use crate::query::recorded::Recordings;
use crate::query::{
    Answers, AnyWholeQuestion, Bare, DirectGuess, Layout, ObjectAnswers, Options, Prompts, Purpose, Queries,
    Recognition, Region, Side, Size, Unnumbered, WHOLE, WholeAnswer, WholeQuestion,
};
use crate::scene::Photo;
use crate::segment::LabelMap;
use crate::setup::Offline;
use crate::words::progress::Progress;
use crate::workdir::{self, Artifact, WorkDir, WorkDirError};

use set_up::{RECORDINGS, SPARE_RECORDINGS};
pub use set_up::{candidates, check_recordings, price, prompts, recording_folders, schemas_about_whole};

/// Views, with the options for asking about them.
pub struct QuerySession<'a> {
    options: &'a Options,
    views: Vec<QueryView<'a>>,
    subjects: Vec<Subject>,
    /// Number of views in which each subject is asked about first.
    ask_views: usize,
    about: AskAbout,
    whole: AboutWhole,
    whole_views: WholeViews<'a>,
    regions: Vec<Region>,
    found: Vec<FoundThing>,
    budget: Budget,
    prompts: Prompts,
    /// The materials to choose from.
    library: Cow<'a, MaterialLibrary>,
    /// The price of the model, if known.
    price: Option<Price>,
    own_recordings: PathBuf,
    recordings: Recordings,
    client: Option<Client>,
    work: &'a WorkDir,
    progress: Progress<'a>,
}

/// The subjects that a session asks about.
pub struct Subjects<'a> {
    pub views: Vec<QueryView<'a>>,
    pub subjects: Vec<Subject>,
    /// Number of views in which each subject is asked about first.
    pub ask_views: usize,
    pub about: AskAbout,
    pub whole: WholeViews<'a>,
    /// Every part and piece, if it is asked what the object is.
    pub regions: Vec<Region>,
    /// Those that were found where the answer what the object is names something without a number.
    pub found: Vec<FoundThing>,
    /// That of earlier questions of the same run.
    pub budget: Option<Budget>,
}

/// The views, by index, in which questions about the whole object are asked; none where a question is not to be asked.
#[derive(Default)]
pub struct WholeViews<'a> {
    /// How long it is.
    pub size: Option<usize>,
    /// What it is.
    pub recognition: Vec<NumberedView<'a>>,
    /// How heavy it is.
    pub direct: Vec<usize>,
    /// The outer size of the object in words, if it is known.
    pub outer_size: Option<String>,
    /// Whether the question about what it is shows photos without lines, too.
    pub bare: Bare,
    /// What else the question about what it is tells, in words.
    pub hints: Option<String>,
}

/// A view, by index, with the regions to number in it, which may be fewer than those that are asked about later.
pub struct NumberedView<'a> {
    pub view: usize,
    /// Of the photo's size.
    pub map: Cow<'a, LabelMap>,
}

/// The questions about the whole object that are to be asked.
struct AboutWhole {
    size: Option<WholeQuestion<Size>>,
    recognition: Option<WholeQuestion<Recognition>>,
    direct: Option<WholeQuestion<DirectGuess>>,
}

/// What was answered about the object as a whole.
pub struct AnsweredWhole<T> {
    /// What follows from the size of the object, if that was to be asked.
    pub size: Option<T>,
    /// What the object is, if that was to be asked.
    pub recognition: Option<WholeAnswer<Recognition>>,
}

/// What was answered about its parts.
pub struct Answered {
    pub answers: Answers,
    /// What the object is, if that was to be asked.
    pub recognition: Option<WholeAnswer<ObjectAnswers>>,
}

/// The folders of a session.
#[derive(Clone, Copy)]
pub struct Folders<'a> {
    /// Its recordings are used beside those of the folder that the options name.
    pub home: &'a Path,
    pub work: &'a WorkDir,
}

/// The questions for a person.
pub struct ForPerson<'a> {
    /// Those whose answers are recorded and those that are then due.
    pub queries: Queries<'a>,
    /// Number of those without a recorded answer.
    pub open: usize,
    /// The form's questions that have a recorded answer, by name.
    pub recorded: Vec<String>,
    /// Number of parts that are asked about.
    pub parts: usize,
    /// Number of these that have no answer in any view.
    pub without_answer: usize,
}

/// A view of a session.
pub struct QueryView<'a> {
    pub name: &'a str,
    pub photo: Photo,
    /// Label maps of the photo's size: one of segments, or one of parts and one of their pieces. Each question is about an
    /// id, in the first map that contains it.
    pub maps: Vec<Cow<'a, LabelMap>>,
}

/// The result of `--prune`.
#[derive(Debug, Serialize)]
pub struct Pruned {
    pub kept: usize,
    pub removed: usize,
}

impl<'a> QuerySession<'a> {
    /// A session about the subjects.
    pub fn new(
        options: &'a Options,
        Subjects { views, subjects, ask_views, about, whole, regions, found, budget }: Subjects<'a>,
        library: &'a MaterialLibrary,
        Folders { home, work }: Folders<'a>,
        network: Result<(), Offline>,
        progress: Progress<'a>,
    ) -> Result<Self> {
        let folders = recording_folders(options, home);
        let (write_to, read_from) = folders.split_last().expect("the home's folder is always among them");
        if options.recordings.is_none() {
            workdir::refuse_link(write_to, "--recordings")?;
        }
        let spare = work.root().join(SPARE_RECORDINGS);
        workdir::refuse_link(&spare, "--out")?;
        let read_from: Vec<&Path> = read_from.iter().map(PathBuf::as_path).collect();
        let prompts = prompts(options)?;
        let library = candidates(options, library)?;
        let price = price(options)?;
        Ok(Self {
            options,
            whole: AboutWhole::new(&whole, &views, &prompts, &library, options)?,
            whole_views: whole,
            views,
            subjects,
            ask_views,
            about,
            regions,
            found,
            budget: budget.unwrap_or_else(|| Budget::new(price.clone(), options.max_usd)),
            prompts,
            library,
            price,
            own_recordings: home.join(RECORDINGS),
            recordings: Recordings::open(&read_from, write_to)?.with_spare(&spare)?,
            client: Client::new(
                options,
                ApiKey::from_environment(options).map_err(ClientError::from)?,
                network,
                progress.on_stderr(),
            )?,
            work,
            progress,
        })
    }

    /// Writes the questions that have no recorded answer, with everything needed to answer them, into a new folder;
    /// returns their number.
    pub fn export(&self, folder: &Path) -> Result<usize> {
        // Whoever will answer, it is not the server.
        let queries = self.queries_for(None)?;
        let open = queries.unanswered(&self.recordings, None);
        Ok(exchange::export(folder, &open, &self.library, &|shown| self.part_of(shown))?)
    }

    /// Checks a person's answer to a question of the form, and records it.
    ///
    /// # Returns
    /// The problem with the answer, if it cannot be recorded.
    pub fn record(&self, line: &[u8], form: &Form, queries: &Queries) -> Result<Result<(), String>> {
        Ok(exchange::record(line, form, queries, &self.recordings)?)
    }

    /// The materials that an answer may name.
    pub fn library(&self) -> &MaterialLibrary {
        &self.library
    }

    /// Checks the answers in a folder that [`Self::export`] wrote, and records the valid ones.
    pub fn import(&self, folder: &Path) -> Result<Imported> {
        let model = self.options.lmm_model.as_deref();
        Ok(exchange::import(folder, model, &self.queries()?, &self.recordings)?)
    }

    /// Removes recordings from the views' own folder that none of their questions uses with these options, whoever
    /// answered. A folder given with `--recordings` may be used by other scenes too and is not changed.
    pub fn prune(&self) -> Result<Pruned> {
        let folder = &self.own_recordings;
        if folder.is_symlink() {
            let problem = "is a link, and --prune deletes nothing through links; delete the recordings in its target \
                           yourself, or replace the link by the folder";
            return Err(UsageError(format!("{folder:?} {problem}")).into());
        }
        let own = Recordings::open(&[], &self.own_recordings)?;
        let mut all: Vec<SubjectInView> = self.subjects.iter().flat_map(Subject::all).collect();
        all.sort_unstable();
        let mut used = Queries { whole: self.whole.all().collect(), ..self.prepare(&all)? }.used(&own);
        if self.whole.recognition.is_some() {
            used.extend(self.prepare_follow_ups(&all)?.used(&own));
        }
        let (kept, useless): (Vec<_>, Vec<_>) = own.keys().into_iter().partition(|key| used.contains(key));
        for key in &useless {
            own.remove(key)?;
        }
        Ok(Pruned { kept: kept.len(), removed: useless.len() })
    }

    /// What was spent, for the questions that follow.
    pub fn into_budget(self) -> Budget {
        self.budget
    }

    /// By thing, the index of the view, and the place in its photo in pixels, of which the answer what the object is speaks; `None` if
    /// its sheet shows nothing there.
    pub fn places_of(&self, things: &[Unnumbered]) -> Vec<Option<(usize, [f64; 2])>> {
        if things.is_empty() {
            return Vec::new();
        }
        let WholeViews { recognition, outer_size, bare, .. } = &self.whole_views;
        let layout =
            Layout::of(&sides_of(recognition, &self.views), outer_size.is_some(), *bare, self.options.sheet_size);
        let place = |thing: &Unnumbered| {
            let (panel, at) = thing.place?;
            Some((recognition.get(panel)?.view, layout.place_in_photo(panel, at)?))
        };
        things.iter().map(place).collect()
    }

    fn price(&self) -> Option<&Price> {
        self.price.as_ref()
    }
}

impl AboutWhole {
    fn new(
        asked: &WholeViews<'_>,
        views: &[QueryView],
        prompts: &Prompts,
        library: &MaterialLibrary,
        options: &Options,
    ) -> Result<Self> {
        let size = asked.size.map(|view| size::question(views[view].name, &views[view].photo, prompts, options));
        let outer_size = asked.outer_size.as_deref();
        let sides = sides_of(&asked.recognition, views);
        let recognition = (!sides.is_empty()).then(|| {
            let mut numbers: Vec<u16> = sides.iter().filter_map(|side| side.map).flat_map(LabelMap::ids).collect();
            numbers.sort_unstable();
            numbers.dedup();
            let told = recognition::Told { outer_size, bare: asked.bare, hints: asked.hints.as_deref() };
            recognition::question(&sides, numbers, told, prompts, library.clone(), options)
        });
        let sides: Vec<Side> = asked.direct.iter().map(|view| side(&views[*view], None)).collect();
        let direct = (!sides.is_empty()).then(|| direct::question(&sides, outer_size, prompts, options));
        let (size, recognition, direct) = (size.transpose()?, recognition.transpose()?, direct.transpose()?);
        Ok(Self { size, recognition, direct })
    }

    fn all(&self) -> impl Iterator<Item = &dyn AnyWholeQuestion> {
        let size = self.size.iter().map(|question| question as &dyn AnyWholeQuestion);
        let recognition = self.recognition.iter().map(|question| question as &dyn AnyWholeQuestion);
        let direct = self.direct.iter().map(|question| question as &dyn AnyWholeQuestion);
        size.chain(recognition).chain(direct)
    }
}

/// The sides that the question what the object is shows.
fn sides_of<'a>(numbered: &'a [NumberedView], views: &'a [QueryView]) -> Vec<Side<'a>> {
    numbered.iter().map(|of| side(&views[of.view], Some(of.map.as_ref()))).collect()
}

fn side<'a>(view: &'a QueryView, map: Option<&'a LabelMap>) -> Side<'a> {
    Side { view: view.name, photo: &view.photo, map }
}

/// Writes the sheet of every question.
pub fn write_sheets(work: &WorkDir, queries: &Queries) -> Result<(), WorkDirError> {
    for subject in &queries.subjects {
        work.write(Artifact::Sheet(&subject.view, subject.id), &subject.jpeg)?;
    }
    for whole in &queries.whole {
        work.write(whole_sheet(whole.purpose(), &whole.shown().view), &whole.shown().jpeg)?;
    }
    Ok(())
}

/// The file with the sheet of a question about the whole object, which shows it first in `view`.
pub fn whole_sheet(purpose: Purpose, view: &str) -> Artifact<'_> {
    match purpose {
        Purpose::Size => Artifact::Sheet(view, WHOLE),
        Purpose::Recognition => Artifact::ObjectSheet,
        Purpose::DirectGuess => Artifact::DirectSheet,
    }
}
