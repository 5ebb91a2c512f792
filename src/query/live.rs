//! Answers from whoever is asked: each read, corrected once where need be, and recorded before anything else happens.

use super::answer::{Problem, Unknown};
use super::asker::{Ask, AskError, Asker, Correction, Reply, Said};
use super::cost::{Cost, Ledger};
use super::error::QueryError;
use super::queries::{PartQuery, Queries};
use super::question::{Question, Reading};
use super::recorded::{Recording, Recordings, Usage};
use super::{Failure, Match, Outcome};

/// What asking takes.
pub struct Live<'a> {
    pub queries: &'a Queries<'a>,
    pub recordings: &'a Recordings,
    pub asker: &'a dyn Asker,
    pub ledger: &'a Ledger,
}

/// Why asking stops for all parts.
#[derive(Debug)]
pub enum Stop {
    /// The next request might pass the budget.
    Budget,
    Endpoint(String),
    Error(QueryError),
}

/// A response: the last text, and the tokens of all requests that led to it.
struct Taken<'a> {
    reading: Result<Reading<'a>, Problem>,
    heard: Heard,
}

/// What a model wrote.
struct Heard {
    text: String,
    served_model: Option<String>,
    usage: Option<Usage>,
}

impl<'a> Live<'a> {
    /// Asks about a part, from `question` on.
    pub fn answer(&self, part: &PartQuery, mut question: &'a Question, so_far: Match) -> Result<Outcome, Stop> {
        loop {
            let taken = match self.take(part, question) {
                Ok(taken) => taken,
                Err(Halt::Part(failure)) => return Ok(Outcome::Failed(failure)),
                Err(Halt::All(stop)) => return Err(stop),
            };
            let reading = match taken.reading {
                Ok(reading) => reading,
                Err(problem) => return Ok(Outcome::Failed(problem.failure)),
            };
            let asked = part.asked(question);
            let answerer = self.asker.answerer();
            let Heard { text, served_model, usage } = taken.heard;
            let recording = Recording::new(answerer, asked, text, served_model, usage);
            self.recordings.insert(recording).map_err(|error| Stop::Error(error.into()))?;
            match reading {
                Reading::Next(next) => question = next,
                Reading::Answered(mut answer) => {
                    answer.matched = match so_far {
                        mask @ Match::Mask { .. } => mask,
                        Match::Exact | Match::Live => Match::Live,
                    };
                    return Ok(Outcome::Answered(*answer));
                }
            }
        }
    }

    /// Asks one question; a response that cannot be used is sent back once with the reason.
    fn take(&self, part: &PartQuery, question: &'a Question) -> Result<Taken<'a>, Halt> {
        let read = |text: &str, unknown| self.queries.questions.read(question, text, self.queries.library, unknown);
        let first = self.ask(part, question, None)?;
        let problem = match read(&first.text, Unknown::Refuse) {
            Ok(reading) => return Ok(Taken { reading: Ok(reading), heard: first }),
            Err(problem) => problem,
        };
        let prompt = self.queries.prompts.correction(&problem.reason).map_err(|e| Halt::All(Stop::Error(e.into())))?;
        let correction = Correction { response: &first.text, prompt: &prompt };
        let second = self.ask(part, question, Some(correction))?;
        let usage = first.usage.zip(second.usage).map(|(a, b)| a.plus(b)).or(first.usage).or(second.usage);
        Ok(Taken { reading: read(&second.text, Unknown::TakeNearest), heard: Heard { usage, ..second } })
    }

    fn ask(&self, part: &PartQuery, question: &Question, correction: Option<Correction>) -> Result<Heard, Halt> {
        let price = self.ledger.price();
        let (response, prompt) = correction.map_or(("", ""), |said| (said.response, said.prompt));
        let texts = [question.prompt.as_str(), response, prompt];
        let cost = Cost::of_request(&texts, part.sheet_size, self.queries.options.lmm_max_tokens, price);
        if !self.ledger.reserve(&cost) {
            return Err(Halt::All(Stop::Budget));
        }
        let reply = self.asker.ask(Ask { question, picture: &part.jpeg, correction });
        match &reply {
            Ok(reply) => self.ledger.settle(&cost, reply.usage),
            Err(_) => self.ledger.release(&cost),
        }
        let Reply { said, usage, served_model } = reply.map_err(|error| match error {
            AskError::Failed(message) => Halt::Part(Failure::Endpoint { message }),
            AskError::Hopeless(message) => Halt::All(Stop::Endpoint(message)),
        })?;
        match said {
            Said::Text(text) => Ok(Heard { text, served_model, usage }),
            Said::Refusal(message) => Err(Halt::Part(Failure::Refused { message })),
            Said::Nothing(message) => Err(Halt::Part(Failure::Invalid { message })),
        }
    }
}

/// Why a question has no reply.
enum Halt {
    Part(Failure),
    All(Stop),
}
