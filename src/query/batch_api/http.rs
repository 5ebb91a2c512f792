//! The HTTP requests of the Batch API: a file of requests goes up, a file of responses comes down within a day.

use std::time::Duration;

use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::json;

use crate::files::json;
use crate::query::ask::asker::AskError;
use crate::query::client::response::{self, Received};
use crate::query::client::retry::Attempt;
use crate::query::client::{Client, MAX_REPLY_BYTES};

/// The only completion window that the API offers.
const WINDOW: &str = "24h";
/// Largest file of answers: the size of the largest input file that the API takes. Every line of the input file held a
/// picture, and the answer to it is shorter.
const MAX_FILE_BYTES: usize = 200_000_000;
/// Limit for a whole transfer: files are large, and connections may be slow.
const TRANSFER_TIMEOUT: Duration = Duration::from_secs(3600);

/// The status of a job.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct JobStatus {
    pub id: String,
    #[serde(rename = "status")]
    pub state: JobState,
    /// The file with the responses; also set for a job that expired or was cancelled after some of them.
    pub output_file_id: Option<String>,
    /// The file with the requests that failed.
    pub error_file_id: Option<String>,
    #[serde(default)]
    pub request_counts: Option<RequestCounts>,
    #[serde(default)]
    errors: Option<JobErrors>,
}

/// The states as the API names them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    Validating,
    InProgress,
    Finalizing,
    Completed,
    /// The input file was not accepted; nothing was asked.
    Failed,
    /// The window closed before all requests were answered.
    Expired,
    Cancelling,
    Cancelled,
}

/// How many requests of a job are done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
pub struct RequestCounts {
    pub total: usize,
    pub completed: usize,
    pub failed: usize,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct JobErrors {
    #[serde(default)]
    data: Vec<JobError>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct JobError {
    message: Option<String>,
}

#[derive(Deserialize)]
struct UploadedFile {
    id: String,
}

impl JobState {
    /// True if nothing more will come.
    pub fn is_final(self) -> bool {
        matches!(self, Self::Completed | Self::Failed | Self::Expired | Self::Cancelled)
    }
}

impl JobStatus {
    /// The API's errors about the job as a whole.
    pub fn problems(&self) -> String {
        let errors = self.errors.iter().flat_map(|errors| &errors.data);
        errors.filter_map(|error| error.message.as_deref()).collect::<Vec<_>>().join("; ")
    }
}

impl Client {
    /// Uploads requests, one JSON line each, and starts a job for them.
    ///
    /// The upload is retried like any request. The request that starts the job is sent only once: if its response were
    /// lost and it were sent again, everything would be paid for twice.
    pub fn start_batch_api_job(&self, lines: &str) -> Result<JobStatus, AskError> {
        let files = self.url(&["files"]);
        let upload = |http: &reqwest::Client| {
            let file = Part::text(lines.to_owned()).file_name("batch.jsonl");
            let form = Form::new().text("purpose", "batch").part("file", file);
            http.post(files.clone()).multipart(form).timeout(TRANSFER_TIMEOUT)
        };
        let file: UploadedFile = self.exchange(self.retries(), MAX_REPLY_BYTES, upload, json_body)?;
        let order = json!({
            "input_file_id": file.id, "endpoint": "/v1/chat/completions", "completion_window": WINDOW,
        });
        let batches = self.url(&["batches"]);
        self.exchange(0, MAX_REPLY_BYTES, |http| http.post(batches.clone()).json(&order), json_body)
    }

    /// The status of a job.
    pub fn batch_api_job(&self, id: &str) -> Result<JobStatus, AskError> {
        let url = self.url(&["batches", id]);
        self.exchange(self.retries(), MAX_REPLY_BYTES, |http| http.get(url.clone()), json_body)
    }

    /// The text of a file that the server holds.
    pub fn file(&self, id: &str) -> Result<String, AskError> {
        let url = self.url(&["files", id, "content"]);
        let text = |received: &Received| {
            if received.status.is_success() { Ok(received.body.clone()) } else { Err(failure(received)) }
        };
        let request = |http: &reqwest::Client| http.get(url.clone()).timeout(TRANSFER_TIMEOUT);
        self.exchange(self.retries(), MAX_FILE_BYTES, request, text)
    }
}

fn json_body<T: DeserializeOwned>(received: &Received) -> Result<T, Attempt> {
    if !received.status.is_success() {
        return Err(failure(received));
    }
    json::read(received.body.as_bytes()).map_err(|error| {
        Attempt::Final(AskError::Failed(format!("the server does not answer like OpenAI's Batch API: {error}")))
    })
}

/// The failure that an unsuccessful status stands for. A job or file that the server does not have says nothing about
/// others.
fn failure(received: &Received) -> Attempt {
    match response::failure(received) {
        Attempt::Final(AskError::Fatal(message)) if received.status == StatusCode::NOT_FOUND => {
            Attempt::Final(AskError::Failed(message))
        }
        failure => failure,
    }
}
