//! One scene in a process of its own: the same gprop, `run` on the scene, quiet.
//!
//! Its stdin is a pipe that the batch never writes to. When the batch dies, however it does, the pipe closes and the scene's
//! process [ends too](end_with_the_batch): a batch that is started again finds the scene free.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Read, Seek};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::pipeline::Stage;
use crate::workdir;

use super::BatchError;
use super::outcome::Ended;
use super::select::Selected;

/// The hidden flag that makes a gprop a batch's.
const FLAG: &str = "--end-with-stdin";

/// As much of what a process said as an outcome needs.
const MAX_STDERR_BYTES: u64 = 1 << 20;

/// What every scene's process is told.
#[derive(Debug, Clone)]
pub struct Task {
    pub to: Stage,
    pub from: Option<Stage>,
    /// The stages' options.
    pub flags: Vec<OsString>,
    /// Threads of one process.
    pub threads: usize,
}

/// A scene's process.
pub struct Running {
    process: Child,
    /// What it says, kept off the disk's visible part.
    stderr: File,
    since: Instant,
}

impl Running {
    /// Starts a scene.
    pub fn start(scene: &Selected, task: &Task) -> Result<Self, BatchError> {
        let start = || -> io::Result<Self> {
            let stderr = tempfile::tempfile()?;
            let mut command = Command::new(std::env::current_exe()?);
            command.arg("run").arg(&scene.folder).args(["--quiet", FLAG]);
            if scene.work != scene.folder.join(workdir::DEFAULT_NAME) {
                command.arg("--out").arg(&scene.work);
            }
            command.args(["--to", &task.to.name(), "--threads", &task.threads.to_string()]);
            if let Some(from) = task.from {
                command.args(["--from", &from.name()]);
            }
            command.args(&task.flags).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(stderr.try_clone()?);
            // A group of its own, to be ended with the processes that it starts.
            #[cfg(unix)]
            std::os::unix::process::CommandExt::process_group(&mut command, 0);
            Ok(Self { process: command.spawn()?, stderr, since: Instant::now() })
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

    /// How it ended, if it has.
    pub fn ended(&mut self, peak_memory_bytes: u64) -> Result<Option<Ended>, BatchError> {
        // `wait` would close its stdin, `try_wait` does not.
        match self.process.try_wait().map_err(BatchError::Start)? {
            Some(status) => Ok(Some(self.left(status, peak_memory_bytes))),
            None => Ok(None),
        }
    }

    /// Kills it with all the processes that it started. What it has finished stays, and it goes on from there when it is
    /// started again.
    pub fn kill(&mut self, peak_memory_bytes: u64) -> Result<Ended, BatchError> {
        #[cfg(unix)]
        kill_group(rustix::process::Pid::from_child(&self.process));
        let killed = self.process.kill().and_then(|()| self.process.wait()).map_err(BatchError::Start)?;
        Ok(self.left(killed, peak_memory_bytes))
    }

    fn left(&mut self, status: ExitStatus, peak_memory_bytes: u64) -> Ended {
        let mut words = Vec::new();
        // What cannot be read back is missing from a message, nothing else.
        let _ = self.stderr.rewind().and_then(|()| (&mut self.stderr).take(MAX_STDERR_BYTES).read_to_end(&mut words));
        let stderr = String::from_utf8_lossy(&words).into_owned();
        Ended { status, stderr, seconds: self.since.elapsed().as_secs_f64(), peak_memory_bytes }
    }
}

/// Ends this process, and those that it started, as soon as its stdin closes. At once, like a kill: every file of a work
/// folder is whole at any time.
pub fn end_with_the_batch() {
    std::thread::spawn(|| {
        let _ = io::copy(&mut io::stdin(), &mut io::sink());
        #[cfg(unix)]
        if rustix::process::getpgrp() == rustix::process::getpid() {
            kill_group(rustix::process::getpid());
        }
        std::process::abort();
    });
}

/// Kills a process and those that it started, which are its group. One that has ended already is as good as killed.
#[cfg(unix)]
fn kill_group(leader: rustix::process::Pid) {
    let _ = rustix::process::kill_process_group(leader, rustix::process::Signal::KILL);
}
