//! Memory: how much is free, how much a scene is estimated to need, and how much processes use.

use sysinfo::{MemoryRefreshKind, Pid, ProcessRefreshKind, ProcessesToUpdate, System};

use crate::pipeline::Stage;

use super::BatchError;

/// Bytes per GB, as disks and clusters count them.
pub const GIGABYTE: f64 = 1e9;

/// The share of the free memory that a batch uses by default: the rest is for cached files and other programs.
const SHARE: f64 = 0.8;

/// Bytes that any run needs: the program, its materials, a view's photo, and the grids of parts and simulation at their
/// default sizes. The fixtures' scenes peak at 0.25 GB or a little more without SAM (docs/batch.md).
const BASE: u64 = 300_000_000;
/// Bytes that SAM needs per thread, because each has its own encoder: 0.69 GB in all on one thread, 1.15 GB on two.
const SAM_A_THREAD: u64 = 500_000_000;
/// Bytes that vote, parts and simulation need for each byte of the splat as plain floats: half a kilobyte for the 248
/// bytes of a Gaussian on one thread (docs/batch.md), and twice that to be safe.
const PER_SPLAT_BYTE: u64 = 4;

/// How much memory all scenes of a batch may use together.
#[derive(Debug, Clone, Copy)]
pub struct Budget {
    pub bytes: u64,
}

impl Budget {
    /// The given number of GB, or most of the free memory of the machine or of this container.
    pub fn new(gigabytes: Option<f64>) -> Result<Self, BatchError> {
        if let Some(gigabytes) = gigabytes {
            return Ok(Self { bytes: (gigabytes * GIGABYTE) as u64 });
        }
        let free = free().filter(|bytes| *bytes > 0).ok_or(BatchError::UnknownMemory)?;
        Ok(Self { bytes: (free as f64 * SHARE) as u64 })
    }
}

/// Bytes that are free on the machine, or in the control group that a container or a cluster put this process into.
fn free() -> Option<u64> {
    let mut system = System::new().ok()?;
    system.refresh_memory_specifics(MemoryRefreshKind::nothing().with_ram());
    let this = sysinfo::get_current_pid().ok()?;
    system.refresh_processes_specifics(ProcessesToUpdate::Some(&[this]), true, ProcessRefreshKind::nothing());
    let group = system.process(this).and_then(sysinfo::Process::cgroup_limits);
    let free = system.available_memory();
    Some(group.map_or(free, |group| free.min(group.free_memory)))
}

/// Bytes of a Gaussian as plain floats: 62 of 4 bytes.
pub const GAUSSIAN_BYTES: u64 = 62 * 4;

/// Estimated memory in bytes that a scene with this size of splat, as plain floats, needs up to a stage with this many
/// threads. Stages run one after the other, so the needs of SAM and of the Gaussians do not add up.
pub fn need(splat_bytes: u64, to: Stage, threads: usize) -> u64 {
    let sam = if to >= Stage::Segment { SAM_A_THREAD * threads as u64 } else { 0 };
    BASE + sam.max(PER_SPLAT_BYTE * splat_bytes)
}

/// Whether so many runs up to a stage, each of a splat of this many Gaussians, fit into the memory that is free. False if
/// the system does not say how much that is.
pub fn holds(runs: u64, gaussians: usize, to: Stage, threads: usize) -> bool {
    let need = need(gaussians as u64 * GAUSSIAN_BYTES, to, threads);
    Budget::new(None).is_ok_and(|budget| runs * need <= budget.bytes)
}

/// Measures the memory that processes use.
pub struct Gauge {
    /// `None` if the system does not report it.
    system: Option<System>,
}

impl Gauge {
    pub fn new() -> Self {
        Self { system: System::new().ok() }
    }

    /// Resident memory in bytes of each process; 0 if it has ended or the system does not report it.
    pub fn read(&mut self, ids: &[u32]) -> Vec<u64> {
        let Some(system) = &mut self.system else { return vec![0; ids.len()] };
        let ids: Vec<Pid> = ids.iter().map(|id| Pid::from_u32(*id)).collect();
        let what = ProcessRefreshKind::nothing().with_memory();
        system.refresh_processes_specifics(ProcessesToUpdate::Some(&ids), true, what);
        ids.iter().map(|id| system.process(*id).map_or(0, sysinfo::Process::memory)).collect()
    }
}
