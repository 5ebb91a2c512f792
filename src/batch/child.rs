//! Runs one scene in its own process: `gprop run` on the scene, without progress output.
//!
//! The process's stdin is a pipe that the batch never writes to. When the batch ends, in whatever way, the pipe closes
//! and the scene's process [ends too](end_with_the_batch): a batch that is started again finds the scene unlocked.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::pipeline::Stage;

use super::BatchError;
use super::outcome::Ended;
use super::select::Selected;
use super::status::Status;

/// The hidden flag that makes gprop end with its batch.
const FLAG: &str = "--end-with-stdin";

/// Most bytes, from the end of a process's stderr, that are searched for its error.
const MAX_STDERR_BYTES: u64 = 1 << 20;

/// The task of every scene's process.
#[derive(Debug, Clone)]
pub struct Task {
    pub to: Stage,
    pub from: Option<Stage>,
    /// The options of the run.
    pub flags: Vec<OsString>,
    /// Threads per process.
    pub threads: usize,
}

/// A scene's process.
pub struct Running {
    process: Child,
    /// Its stderr, in an unnamed temporary file.
    stderr: File,
    status: Status,
    since: Instant,
}

impl Running {
    /// Starts a scene.
    pub fn start(scene: &Selected, task: &Task) -> Result<Self, BatchError> {
        let start = || -> io::Result<Self> {
            let (stderr, stdout) = (tempfile::tempfile()?, tempfile::tempfile()?);
            let mut command = Command::new(std::env::current_exe()?);
            command.arg("run").arg(&scene.folder).args(["--quiet", FLAG]);
            if let Some(work) = scene.named_work() {
                command.arg("--out").arg(work);
            }
            command.args(["--to", &task.to.name(), "--threads", &task.threads.to_string()]);
            if let Some(from) = task.from {
                command.args(["--from", &from.name()]);
            }
            command.args(&task.flags).stdin(Stdio::piped()).stdout(stdout.try_clone()?).stderr(stderr.try_clone()?);
            // In its own process group, so that it can be killed together with the processes that it starts.
            command.process_group(0);
            Ok(Self { process: command.spawn()?, stderr, status: Status::new(stdout), since: Instant::now() })
        };
        start().map_err(BatchError::Start)
    }

    /// How long it has been running.
    pub fn age(&self) -> Duration {
        self.since.elapsed()
    }

    /// The process's number.
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// How far it is.
    pub fn status(&mut self) -> &Status {
        // If this cannot be read, only what is shown while it runs is incomplete.
        let _ = self.status.update();
        &self.status
    }

    /// The result of the process if it has ended.
    pub fn ended(&mut self, peak_memory_bytes: u64) -> Result<Option<Ended>, BatchError> {
        // `wait` would close its stdin; `try_wait` does not.
        match self.process.try_wait().map_err(BatchError::Process)? {
            Some(status) => Ok(Some(self.left(status, peak_memory_bytes))),
            None => Ok(None),
        }
    }

    /// Kills it with all the processes that it started. Finished work stays, and the scene continues from there when it
    /// is started again.
    pub fn kill(&mut self, peak_memory_bytes: u64) -> Result<Ended, BatchError> {
        kill_group(rustix::process::Pid::from_child(&self.process));
        let killed = self.process.kill().and_then(|()| self.process.wait()).map_err(BatchError::Process)?;
        Ok(self.left(killed, peak_memory_bytes))
    }

    fn left(&mut self, status: ExitStatus, peak_memory_bytes: u64) -> Ended {
        let mut words = Vec::new();
        // If this cannot be read back, only the message is incomplete.
        let _ = self.stderr.seek(SeekFrom::End(0)).and_then(|bytes| {
            self.stderr.seek(SeekFrom::Start(bytes.saturating_sub(MAX_STDERR_BYTES)))?;
            (&mut self.stderr).take(MAX_STDERR_BYTES).read_to_end(&mut words)
        });
        let stderr = String::from_utf8_lossy(&words).into_owned();
        let seconds = self.since.elapsed().as_secs_f64();
        Ended { status, stderr, seconds, peak_memory_bytes, asked: self.status().asked }
    }
}

/// Ends this process, and those that it started, as soon as its stdin closes. This happens at once, like a kill: every
/// file of a work folder is complete at any time.
pub fn end_with_the_batch() {
    std::thread::spawn(|| {
        let _ = io::copy(&mut io::stdin(), &mut io::sink());
        if rustix::process::getpgrp() == rustix::process::getpid() {
            kill_group(rustix::process::getpid());
        }
        std::process::abort();
    });
}

/// Kills a process and those that it started, which form its group. A process that has already ended is not an error.
fn kill_group(leader: rustix::process::Pid) {
    let _ = rustix::process::kill_process_group(leader, rustix::process::Signal::KILL);
}
