//! The queries of some views, of a scene or of a single picture: estimates them, answers them, exports questions,
//! imports answers and prunes recordings. Sending them through the Batch API is in `batch_api.rs`.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::consensus::AskAbout;
use crate::error::{Context, Result, UsageError};
use crate::files;
use crate::files::read_scope::ReadScope;
use crate::materials::MaterialLibrary;
use crate::query::ask::asker::Asker;
use crate::query::ask::budget::Budget;
use crate::query::ask::cost::{Price, PriceTable, UsdPerMtok};
use crate::query::ask::follow_up::{self, FollowUp};
use crate::query::ask::rounds::{Outcomes, Subject, SubjectInView};
use crate::query::ask::{direct, recognition, size};
use crate::query::client::{self, ApiKey, Client, ClientError};
use crate::query::exchange::{self, Form, Imported};
use crate::query::recorded::{Answerer, Recordings};
use crate::query::{
    Alternative, Answer, Answers, AnyWholeQuestion, DirectGuess, ObjectAnswers, Options, Outcome, PartQuestion, Piece,
    Preview, Prompts, Purpose, Queries, QueryError, Recognition, Region, ShownSubject, Side, Size, SubjectAnswer,
    SubjectId, ViewSubjects, WHOLE, WholeAnswer, WholeOutcome, WholeQuestion,
};
use crate::scene::{Photo, Reference, SceneError};
use crate::segment::LabelMap;
use crate::setup::Offline;
use crate::words::progress::{self, Progress};
use crate::workdir::{self, Artifact, WorkDir, WorkDirError};

/// Recordings are stored beside their scene or picture, so that they are copied together with it.
const RECORDINGS: &str = "recorded";

/// The folder in the work folder for recordings that could not be written to their own.
const SPARE_RECORDINGS: &str = "unrecorded";

/// Views, with the options for asking about them.
pub struct QuerySession<'a> {
    pub(super) options: &'a Options,
    views: Vec<QueryView<'a>>,
    subjects: Vec<Subject>,
    /// Number of views in which each subject is asked about first.
    ask_views: usize,
    about: AskAbout,
    whole: AboutWhole,
    regions: Vec<Region>,
    prompts: Prompts,
    /// The materials to choose from.
    pub(super) library: Cow<'a, MaterialLibrary>,
    /// The price of the model, if known.
    price: Option<Price>,
    own_recordings: PathBuf,
    pub(super) recordings: Recordings,
    pub(super) client: Option<Client>,
    pub(super) work: &'a WorkDir,
    progress: Progress<'a>,
}

/// The subjects that a session asks about.
pub struct Subjects<'a> {
    pub views: Vec<QueryView<'a>>,
    pub subjects: Vec<Subject>,
    /// Number of views in which each subject is asked about first.
    pub ask_views: usize,
    pub about: AskAbout,
    pub whole: WholeViews,
    /// Every part and piece, if it is asked what the object is.
    pub regions: Vec<Region>,
}

/// The views, by index, in which questions about the whole object are asked; none where a question is not to be asked.
#[derive(Default)]
pub struct WholeViews {
    /// How long it is.
    pub size: Option<usize>,
    /// What it is: the regions to number are those of the last label map of each view.
    pub recognition: Vec<usize>,
    /// How heavy it is.
    pub direct: Vec<usize>,
    /// The outer size of the object in words, if it is known.
    pub outer_size: Option<String>,
    /// What else the question about what it is tells, in words.
    pub hints: Option<String>,
}

/// The questions about the whole object that are to be asked.
struct AboutWhole {
    size: Option<WholeQuestion<Size>>,
    recognition: Option<WholeQuestion<Recognition>>,
    direct: Option<WholeQuestion<DirectGuess>>,
}

/// The parts to ask about by themselves, the most worthwhile first, each with the view in which to ask.
struct FollowUps(Vec<(FollowUp, SubjectInView)>);

impl FollowUps {
    /// Sorted.
    fn places(&self) -> Vec<SubjectInView> {
        let mut places: Vec<SubjectInView> = self.0.iter().map(|(_, place)| *place).collect();
        places.sort_unstable();
        places
    }
}

/// Everything that was answered.
pub struct Answered<T> {
    pub answers: Answers,
    /// What follows from the size of the object, if that was to be asked.
    pub size: Option<T>,
    /// What the object is, if that was to be asked.
    pub recognition: Option<WholeAnswer<ObjectAnswers>>,
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
    /// A session about the subjects, with recordings in `home` and in the folder that the options name.
    pub fn new(
        options: &'a Options,
        Subjects { views, subjects, ask_views, about, whole, regions }: Subjects<'a>,
        library: &'a MaterialLibrary,
        home: &Path,
        work: &'a WorkDir,
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
        let whole = AboutWhole::new(&whole, &views, &prompts, &library, options)?;
        Ok(Self {
            options,
            whole,
            views,
            subjects,
            ask_views,
            about,
            regions,
            prompts,
            library,
            price: price(options)?,
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

    /// The questions whose answers are recorded and those that are then due, with all sheets drawn. Answers that are not
    /// recorded yet may lead to more questions.
    pub fn queries(&self) -> Result<Queries<'_>> {
        self.queries_for(self.client.as_ref().map(Asker::answerer))
    }

    /// As [`Self::queries`], if `answerer` is the one that would be asked.
    fn queries_for(&self, answerer: Option<&Answerer>) -> Result<Queries<'_>> {
        let mut answers = BTreeMap::new();
        let mut queries = self.about_whole()?;
        if let Some(what) = &self.whole.recognition {
            // Its answer says what is left to ask.
            if let Ok(recognition) = queries.recorded_whole(what, &self.recordings, answerer) {
                queries.subjects = self.prepare(&self.follow_ups(&recognition).places())?.subjects;
            }
            return Ok(queries);
        }
        loop {
            let due = self.due(&answers);
            let round = self.prepare(&due)?;
            let recorded = round.recorded(&self.recordings, answerer);
            let is_open = due.is_empty() || recorded.iter().any(Option::is_none);
            answers.extend(due.into_iter().zip(recorded).filter_map(|(subject, outcome)| Some((subject, outcome?))));
            queries.subjects.extend(round.subjects);
            if is_open {
                queries.subjects.sort_by_key(|subject| self.place(&subject.view, subject.id));
                return Ok(queries);
            }
        }
    }

    /// The questions to ask next, by view and id.
    fn due(&self, answers: &BTreeMap<SubjectInView, Outcome>) -> Vec<SubjectInView> {
        let outcomes: Outcomes = answers.iter().map(|(&subject, outcome)| (subject, outcome)).collect();
        let mut due: Vec<SubjectInView> =
            self.subjects.iter().flat_map(|subject| subject.due(self.ask_views, &outcomes)).collect();
        due.sort_unstable();
        due
    }

    /// The questions about `subjects`, which are sorted, with their sheets.
    fn prepare(&self, subjects: &[SubjectInView]) -> Result<Queries<'_>> {
        let ids_of = |view: usize, map: usize| -> Vec<u16> {
            let ids = subjects.iter().filter(|subject| subject.view == view).map(|subject| subject.id);
            let maps = &self.views[view].maps;
            // An id that is in no map is counted among those of the last map, which are then refused.
            let map_of = |id: u16| maps.iter().position(|map| map.labels.contains(&id)).unwrap_or(maps.len() - 1);
            ids.filter(|id| map_of(*id) == map).collect()
        };
        let mut inputs = Vec::new();
        for (number, view) in self.views.iter().enumerate() {
            inputs.extend(view.maps.iter().enumerate().map(|(map, labels)| (view, labels, ids_of(number, map))));
        }
        let inputs: Vec<ViewSubjects> = inputs
            .iter()
            .filter(|(.., ids)| !ids.is_empty())
            .map(|(view, map, ids)| ViewSubjects { name: view.name, photo: &view.photo, map, ids })
            .collect();
        Ok(Queries::prepare(&inputs, &self.library, &self.prompts, self.options, self.about)?)
    }

    /// The questions about the whole object, and no others.
    fn about_whole(&self) -> Result<Queries<'_>> {
        Ok(Queries { whole: self.whole.all().collect(), ..self.prepare(&[])? })
    }

    fn place(&self, view: &str, id: u16) -> SubjectInView {
        let view = self.views.iter().position(|other| other.name == view);
        SubjectInView { view: view.expect("questions are about the session's views"), id }
    }

    /// Estimates what would be sent, and its cost.
    pub fn preview(&self, queries: &Queries) -> Preview {
        let answerer = self.client.as_ref().map(Asker::answerer);
        let preview = queries.preview(&self.recordings, answerer, self.price());
        let of_parts = match &self.whole.recognition {
            Some(what) => match queries.recorded_whole(what, &self.recordings, answerer) {
                Ok(_) => queries.subjects.len(),
                Err(_) => self.options.max_questions.min(self.subjects.len()),
            },
            None => self.subjects.iter().map(|subject| subject.all().len()).sum(),
        };
        Preview { at_most: of_parts + self.whole.all().count(), ..preview }
    }

    /// Asks everything that has to be asked, round by round; `begin` gets the questions of each round before they are
    /// asked. Each answer is recorded as it arrives. Reports the cost before and after.
    pub fn answer_all(&self, begin: &dyn Fn(&Queries) -> Result<()>) -> Result<Answered<WholeAnswer<Size>>> {
        self.answer_with_size(begin, Ok)
    }

    /// As [`Self::answer_all`]. If the size of the object is to be asked, that question comes first, and `of_size` converts
    /// its answer; if it fails, the run ends before it costs more. If it is to be asked what the object is, that question
    /// follows, and those about parts that narrow its answer. If it has no answer, parts are asked about instead; where nobody can be
    /// asked, answers about parts that are recorded serve.
    pub fn answer_with_size<T>(
        &self,
        begin: &dyn Fn(&Queries) -> Result<()>,
        of_size: impl FnOnce(WholeAnswer<Size>) -> Result<T>,
    ) -> Result<Answered<T>> {
        let asker = self.client.as_ref().map(|client| client as &dyn Asker);
        let budget = Budget::new(self.price.clone(), self.options.max_usd);
        let object = self.about_whole()?;
        begin(&object)?;
        let size = self.whole.size.as_ref();
        let size = size.map(|size| object.ask_whole(size, &self.recordings, asker, &budget, self.progress));
        let size = size.transpose()?.map(of_size).transpose().inspect_err(|_| {
            if budget.spent().requests > 0 {
                progress::notice(&format!("asked: {}", budget.spent()));
            }
        })?;
        let recognition = self.whole.recognition.as_ref();
        let recognition =
            recognition.map(|what| object.ask_whole(what, &self.recordings, asker, &budget, self.progress));
        let recognition = match recognition.transpose() {
            Err(QueryError::MissingWhole { .. }) if self.parts_are_recorded()? => None,
            recognition => recognition?,
        };
        let recognition = recognition.map(|answer| self.with_follow_ups(answer, begin, asker, &budget)).transpose()?;
        let recognized = recognition.as_ref().and_then(|answer| answer.outcome.answered());
        let answers = match recognized {
            Some(recognized) => self.of_pieces(recognized),
            None => self.of_subjects(begin, asker, &budget)?,
        };
        let spent = budget.spent();
        if spent.requests > 0 {
            let (failed, all) = (answers.failed().count(), answers.all.len());
            let about =
                if recognized.is_some() { String::new() } else { format!("; {failed} of {all} questions failed") };
            progress::notice(&format!("asked: {spent}{about}"));
        }
        Ok(Answered { answers, size, recognition })
    }

    /// The answer about the object with those about the parts that are worth a question. One that is not recorded and cannot be
    /// asked is left open: what is known serves without it.
    fn with_follow_ups(
        &self,
        WholeAnswer { view, outcome }: WholeAnswer<Recognition>,
        begin: &dyn Fn(&Queries) -> Result<()>,
        asker: Option<&dyn Asker>,
        budget: &Budget,
    ) -> Result<WholeAnswer<ObjectAnswers>> {
        let recognition = match outcome {
            WholeOutcome::Answered(recognition) => recognition,
            WholeOutcome::Failed(failure) => return Ok(WholeAnswer { view, outcome: WholeOutcome::Failed(failure) }),
        };
        let due = self.follow_ups(&recognition);
        let places = due.places();
        let round = self.prepare(&places)?;
        begin(&round)?;
        let outcomes: Vec<Option<Outcome>> = match asker.filter(|_| self.options.answers.may_ask()) {
            Some(_) => {
                let run = round.run(&self.recordings, asker, budget, self.progress)?;
                run.answers.all.into_iter().map(|answer| Some(answer.outcome)).collect()
            }
            None => round.recorded(&self.recordings, None),
        };
        let by_place: BTreeMap<SubjectInView, Option<Outcome>> = places.into_iter().zip(outcomes).collect();
        let questions = due.0.into_iter().map(|(FollowUp { piece, why }, place)| PartQuestion {
            piece,
            view: self.views[place.view].name.to_owned(),
            subject: SubjectId::of(self.about, place.id),
            why,
            outcome: by_place[&place].clone(),
        });
        let questions = questions.collect();
        Ok(WholeAnswer { view, outcome: WholeOutcome::Answered(ObjectAnswers { recognition, questions }) })
    }

    /// The parts to ask about by themselves, the most worthwhile first.
    fn follow_ups(&self, recognition: &Recognition) -> FollowUps {
        let follow_ups = follow_up::follow_ups(recognition, &self.regions, &self.library);
        let placed = follow_ups.into_iter().filter_map(|of| {
            let place = self.largest_place(&recognition.pieces[of.piece])?;
            Some((of, place))
        });
        FollowUps(placed.take(self.options.max_questions).collect())
    }

    /// The largest part or piece of one that belongs to a piece of the object, in the view that shows it best; `None` if no view
    /// shows any.
    fn largest_place(&self, piece: &Piece) -> Option<SubjectInView> {
        let belongs = |id: u16| piece.numbers.contains(&id);
        let is_its = |region: &&Subject| match region.pieces.as_slice() {
            _ if region.views.is_empty() => false,
            [] => belongs(region.id),
            pieces => pieces.iter().all(|piece| belongs(piece.id)),
        };
        let area = |of: &Subject| {
            let region = self.regions.iter().find(|region| region.id == of.id);
            region.map_or(0.0, |region| region.area_share)
        };
        // Among equals, the first.
        let largest = self.regions_asked().filter(is_its).reduce(|a, b| if area(b) > area(a) { b } else { a })?;
        Some(SubjectInView { view: largest.views[0], id: largest.id })
    }

    /// Every part and piece of one.
    fn regions_asked(&self) -> impl Iterator<Item = &Subject> {
        self.subjects.iter().flat_map(|subject| std::iter::once(subject).chain(&subject.pieces))
    }

    /// Whether the first questions about the subjects all have a recorded answer.
    fn parts_are_recorded(&self) -> Result<bool> {
        let round = self.prepare(&self.due(&BTreeMap::new()))?;
        let recorded = round.recorded(&self.recordings, None);
        Ok(!recorded.is_empty() && recorded.iter().all(Option::is_some))
    }

    /// The answers about the subjects, round by round.
    fn of_subjects(
        &self,
        begin: &dyn Fn(&Queries) -> Result<()>,
        asker: Option<&dyn Asker>,
        budget: &Budget,
    ) -> Result<Answers> {
        let mut answers = BTreeMap::new();
        loop {
            let due = self.due(&answers);
            if due.is_empty() {
                break;
            }
            let round = self.prepare(&due)?;
            begin(&round)?;
            let run = round.run(&self.recordings, asker, budget, self.progress)?;
            let is_fruitless = run.answers.failed().count() == run.answers.all.len();
            answers.extend(due.into_iter().zip(run.answers.all.into_iter().map(|answer| answer.outcome)));
            // Answers may call for more questions. Failures do not: the next ones would fail as well.
            if is_fruitless {
                break;
            }
        }
        Ok(self.named(answers))
    }

    /// Outcomes by view and id as answers, in that order.
    fn named(&self, outcomes: BTreeMap<SubjectInView, Outcome>) -> Answers {
        let answer = |(SubjectInView { view, id }, outcome)| SubjectAnswer {
            view: self.views[view].name.to_owned(),
            subject: SubjectId::of(self.about, id),
            outcome,
        };
        Answers::new(outcomes.into_iter().map(answer).collect())
    }

    /// The most probable way in which each piece of the object may be made, as an answer about its first region in the view that
    /// shows it best; its confidence is its probability.
    fn of_pieces(&self, recognized: &ObjectAnswers) -> Answers {
        let alternatives = recognized.alternatives();
        let probabilities = recognized.probabilities(&alternatives);
        let answered = |(piece, (of, probabilities)): (&Piece, (&Vec<Alternative>, &Vec<f64>))| {
            let best = (0..of.len()).rev().max_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b]))?;
            let answer = Answer { confidence: probabilities[best], ..of[best].answer.clone() };
            Some((self.best_place(piece)?, Outcome::Answered(answer)))
        };
        let pieces = recognized.recognition.pieces.iter().zip(alternatives.iter().zip(&probabilities));
        self.named(pieces.filter_map(answered).collect())
    }

    /// The first region of a piece in the view that shows it best; `None` if no view shows it.
    fn best_place(&self, piece: &Piece) -> Option<SubjectInView> {
        let id = *piece.numbers.first()?;
        let view = *self.regions_asked().filter(|region| region.id == id).find_map(|region| region.views.first())?;
        Some(SubjectInView { view, id })
    }

    /// How heavy the object is, as a model judges it from the photos alone; `None` if that is not to be asked.
    pub fn direct_guess(&self, begin: &dyn Fn(&Queries) -> Result<()>) -> Result<Option<WholeAnswer<DirectGuess>>> {
        let Some(question) = &self.whole.direct else { return Ok(None) };
        let asker = self.client.as_ref().map(|client| client as &dyn Asker);
        let budget = Budget::new(self.price.clone(), self.options.max_usd);
        let object = self.about_whole()?;
        begin(&object)?;
        let guess = object.ask_whole(question, &self.recordings, asker, &budget, self.progress)?;
        if budget.spent().requests > 0 {
            progress::notice(&format!("asked: {}", budget.spent()));
        }
        Ok(Some(guess))
    }

    /// Writes the questions that have no recorded answer, with everything needed to answer them, into a new folder;
    /// returns their number.
    pub fn export(&self, folder: &Path) -> Result<usize> {
        // Whoever will answer, it is not the server.
        let queries = self.queries_for(None)?;
        let open = queries.unanswered(&self.recordings, None);
        Ok(exchange::export(folder, &open, &self.library, &|shown| self.part_of(shown))?)
    }

    /// The same for two questions about the same part. The number of a segment identifies it only within its view; the
    /// number of a part is the same in all views.
    fn part_of(&self, shown: &ShownSubject) -> (usize, u16) {
        let is_its = |one: &SubjectInView| self.views[one.view].name == shown.view && one.id == shown.id;
        let subject = self.subjects.iter().position(|subject| subject.all().iter().any(is_its));
        (subject.unwrap_or(self.subjects.len()), shown.id)
    }

    /// The questions for a person, with those that have no recorded answer added to the form.
    pub fn for_person(&self, form: &mut Form) -> Result<ForPerson<'_>> {
        let queries = self.queries_for(None)?;
        let open = queries.unanswered(&self.recordings, None);
        form.add(&open, &|shown| self.part_of(shown));
        let names: BTreeSet<String> =
            open.iter().map(|(shown, question)| shown.asked(question).content_sha256().short().to_owned()).collect();
        let recorded = form.questions().iter().map(|question| &question.query);
        let recorded = recorded.filter(|query| !names.contains(*query)).cloned().collect();
        let is_open = |shown: &ShownSubject| open.iter().any(|(of, _)| of.view == shown.view && of.id == shown.id);
        let (unanswered, answered): (Vec<_>, Vec<_>) = queries.subjects.iter().partition(|shown| is_open(shown));
        let ids = |shown: Vec<&ShownSubject>| shown.iter().map(|shown| shown.id).collect::<BTreeSet<u16>>();
        let (unanswered, answered) = (ids(unanswered), ids(answered));
        let (parts, without_answer) = ((&unanswered | &answered).len(), (&unanswered - &answered).len());
        let open = open.len();
        Ok(ForPerson { queries, open, recorded, parts, without_answer })
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
        let used = Queries { whole: self.whole.all().collect(), ..self.prepare(&all)? }.used(&own);
        let (kept, useless): (Vec<_>, Vec<_>) = own.keys().into_iter().partition(|key| used.contains(key));
        for key in &useless {
            own.remove(key)?;
        }
        Ok(Pruned { kept: kept.len(), removed: useless.len() })
    }

    pub(super) fn price(&self) -> Option<&Price> {
        self.price.as_ref()
    }
}

impl AboutWhole {
    fn new(
        asked: &WholeViews,
        views: &[QueryView],
        prompts: &Prompts,
        library: &MaterialLibrary,
        options: &Options,
    ) -> Result<Self> {
        let side = |view: &usize| -> Side<'_> {
            let QueryView { name, photo, maps } = &views[*view];
            Side { view: name, photo, map: maps.last().map(AsRef::as_ref) }
        };
        let size = asked.size.map(|view| size::question(views[view].name, &views[view].photo, prompts, options));
        let outer_size = asked.outer_size.as_deref();
        let sides: Vec<Side> = asked.recognition.iter().map(side).collect();
        let recognition = (!sides.is_empty()).then(|| {
            let mut numbers: Vec<u16> = sides.iter().filter_map(|side| side.map).flat_map(LabelMap::ids).collect();
            numbers.sort_unstable();
            numbers.dedup();
            let told = recognition::Told { outer_size, hints: asked.hints.as_deref() };
            recognition::question(&sides, numbers, told, prompts, library.clone(), options)
        });
        let sides: Vec<Side> = asked.direct.iter().map(side).collect();
        let direct = (!sides.is_empty()).then(|| direct::question(&sides, outer_size, prompts, options));
        Ok(Self { size: size.transpose()?, recognition: recognition.transpose()?, direct: direct.transpose()? })
    }

    fn all(&self) -> impl Iterator<Item = &dyn AnyWholeQuestion> {
        let size = self.size.iter().map(|question| question as &dyn AnyWholeQuestion);
        let recognition = self.recognition.iter().map(|question| question as &dyn AnyWholeQuestion);
        let direct = self.direct.iter().map(|question| question as &dyn AnyWholeQuestion);
        size.chain(recognition).chain(direct)
    }
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

/// Refuses recordings beside the scene or picture in `home`, or in the work folder, that lead outside `scope`. A folder
/// given with `--recordings` is not checked, and other recordings may be links into it.
pub fn check_recordings(options: &Options, home: &Path, work: &WorkDir, scope: ReadScope) -> Result<(), SceneError> {
    let scope = scope.and([work.root()]).and(options.recordings.as_deref());
    for folder in [home.join(RECORDINGS), work.root().join(SPARE_RECORDINGS)] {
        if let Some((path, _)) = scope.leads_out_below(&folder) {
            Reference { what: "recording", path: &path, named_in: None, flag: None }.check(&scope)?;
        }
    }
    Ok(())
}

/// The folders from which recordings are read; new ones go to the last.
pub fn recording_folders(options: &Options, home: &Path) -> Vec<PathBuf> {
    [home.join(RECORDINGS)].into_iter().chain(options.recordings.clone()).collect()
}

/// The built-in prompts or the user's.
pub fn prompts(options: &Options) -> Result<Prompts> {
    Ok(options.prompts.as_deref().map_or_else(|| Ok(Prompts::builtin()), Prompts::from_folder)?)
}

/// The materials that a model may choose from.
pub fn candidates<'a>(options: &Options, library: &'a MaterialLibrary) -> Result<Cow<'a, MaterialLibrary>> {
    Ok(match &options.labels {
        Some(labels) => Cow::Owned(labels.restrict(library)?),
        None => Cow::Borrowed(library),
    })
}

/// The price of the model: the user's own, that of the user's price table or the built-in one, or none at all if it runs on
/// this machine. A model of these tables may be behind a gateway on this machine, and is paid for then.
pub fn price(options: &Options) -> Result<Option<Price>> {
    let table = match &options.prices {
        None => PriceTable::builtin(),
        Some(path) => {
            let text = files::read_to_string(path)
                .map_err(|error| UsageError(format!("cannot read --prices {path:?}: {error}")))?;
            PriceTable::from_csv(&text).with_context(|| format!("{path:?}"))?
        }
    };
    let Some(model) = &options.lmm_model else { return Ok(None) };
    let free = || client::is_on_this_machine(options).then(|| Price::new(model, UsdPerMtok::default()));
    let given = options.price.map(|price| Price::new(model, price));
    Ok(given.or_else(|| table.price(model).cloned()).or_else(free))
}
