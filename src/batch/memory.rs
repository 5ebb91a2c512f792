//! Memory: what is there, what a scene is taken to need, what processes hold.

use sysinfo::{MemoryRefreshKind, Pid, ProcessRefreshKind, ProcessesToUpdate, System};

use crate::pipeline::Stage;

use super::BatchError;
use super::select::Selected;

/// Bytes in a GB as disks and clusters count it.
pub const GIGABYTE: f64 = 1e9;

/// Of what is free, the share that a batch takes by itself: the rest is for files' pages and for others.
const SHARE: f64 = 0.8;

/// Bytes that any run takes: the program, its materials, a view's photo, the grids of parts and simulation at their default
/// sizes. The fixtures' scenes peak at 0.25 GB or a little more without SAM (docs/batch.md).
const BASE: u64 = 300_000_000;
/// Bytes that SAM takes for each thread, which has an encoder of its own: 0.69 GB in all on one thread, 1.27 GB on two.
const SAM_A_THREAD: u64 = 500_000_000;
/// Bytes that vote, parts and simulation take for each byte of the splat as plain floats: half a kilobyte for the 248 bytes
/// of a Gaussian on one thread (docs/batch.md), and twice that to be safe.
const PER_SPLAT_BYTE: u64 = 4;

/// How much memory all scenes of a batch may hold together.
#[derive(Debug, Clone, Copy)]
pub struct Budget {
    pub bytes: u64,
}

impl Budget {
    /// What was typed in GB, else most of what is free on the machine or in this container.
    pub fn new(gigabytes: Option<f64>) -> Result<Self, BatchError> {
        if let Some(gigabytes) = gigabytes {
            return Ok(Self { bytes: (gigabytes * GIGABYTE) as u64 });
        }
        let free = free().filter(|bytes| *bytes > 0).ok_or(BatchError::UnknownMemory)?;
        Ok(Self { bytes: (free as f64 * SHARE) as u64 })
    }
}

/// Bytes that are free on the machine, or in the control group that this process was put into by a container or a cluster.
fn free() -> Option<u64> {
    let mut system = System::new().ok()?;
    system.refresh_memory_specifics(MemoryRefreshKind::nothing().with_ram());
    let this = sysinfo::get_current_pid().ok()?;
    system.refresh_processes_specifics(ProcessesToUpdate::Some(&[this]), true, ProcessRefreshKind::nothing());
    let group = system.process(this).and_then(sysinfo::Process::cgroup_limits);
    let free = system.available_memory();
    Some(group.map_or(free, |group| free.min(group.free_memory)))
}

/// Memory in bytes that a scene is taken to need up to a stage on so many threads. Stages run one after the other, so SAM's
/// need and that of the Gaussians do not add up.
pub fn need(scene: &Selected, to: Stage, threads: usize) -> u64 {
    let sam = if to >= Stage::Segment { SAM_A_THREAD * threads as u64 } else { 0 };
    BASE + sam.max(PER_SPLAT_BYTE * scene.splat_bytes)
}

/// Reads what processes hold.
pub struct Gauge {
    /// None where the system does not tell.
    system: Option<System>,
}

impl Gauge {
    pub fn new() -> Self {
        Self { system: System::new().ok() }
    }

    /// Resident memory in bytes of each process; 0 of one that has ended, or where the system does not tell.
    pub fn read(&mut self, ids: &[u32]) -> Vec<u64> {
        let Some(system) = &mut self.system else { return vec![0; ids.len()] };
        let ids: Vec<Pid> = ids.iter().map(|id| Pid::from_u32(*id)).collect();
        let what = ProcessRefreshKind::nothing().with_memory();
        system.refresh_processes_specifics(ProcessesToUpdate::Some(&ids), true, what);
        ids.iter().map(|id| system.process(*id).map_or(0, sysinfo::Process::memory)).collect()
    }
}
