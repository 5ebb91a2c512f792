//! Runs the code of shared libraries where it can neither reach the network nor write files.
//!
//! ONNX Runtime sends telemetry from Linux too, and by the time its interface lets a program switch that off, the first event is on its way.
//! Two measures keep gprop's promise that nothing leaves the machine unasked:
//! 1. The program sets the variable [`NO_TELEMETRY`] before its first thread starts, so that ONNX Runtime does not even try. gprop as a
//!    library does not: its caller's threads may be reading the environment.
//! 2. gprop loads a library, opens models with it and runs them on threads of their own, on which the kernel (seccomp) refuses to open
//!    sockets and to create, write, rename or remove files. The threads and processes that the library starts inherit that, and nothing can
//!    lift it. This holds for any library, and for the callers of gprop's own.
//!
//! The second measure is for libraries that mean no harm. One that does may take over gprop's other threads.

use std::panic::resume_unwind;
use std::thread;

/// The variable, with its value, that keeps ONNX Runtime from collecting telemetry. It is read when the library is loaded.
pub const NO_TELEMETRY: (&str, &str) = ("ORT_DISABLE_TELEMETRY", "1");

/// Runs `work` on a confined thread and waits for it.
pub fn confined<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    let on_own_thread = || {
        confine_this_thread();
        work()
    };
    thread::scope(|scope| scope.spawn(on_own_thread).join().unwrap_or_else(|panic| resume_unwind(panic)))
}

/// Confines the calling thread, and those that it starts, until they end. If the kernel cannot do that, a warning says so once.
pub fn confine_this_thread() {
    #[cfg(target_os = "linux")]
    filter::install();
}

#[cfg(target_os = "linux")]
mod filter {
    use std::collections::BTreeMap;
    use std::sync::{LazyLock, Once};

    use seccompiler::SeccompCmpArgLen::Dword;
    use seccompiler::SeccompCmpOp::MaskedEq;
    use seccompiler::{BpfProgram, SeccompAction, SeccompCondition, SeccompFilter, SeccompRule, apply_filter};

    /// Refused whatever their arguments: sockets, and changes to files and folders. A filter cannot see what is asked of io_uring, nor the
    /// flags of `openat2`, which lie in memory.
    const REFUSED: &[i64] = &[
        libc::SYS_socket,
        libc::SYS_io_uring_setup,
        libc::SYS_openat2,
        libc::SYS_mkdirat,
        libc::SYS_mknodat,
        libc::SYS_linkat,
        libc::SYS_symlinkat,
        libc::SYS_unlinkat,
        libc::SYS_renameat2,
        libc::SYS_truncate,
    ];
    /// Older forms of these, which later architectures do not have.
    #[cfg(target_arch = "x86_64")]
    const REFUSED_OLD: &[i64] = &[
        libc::SYS_creat,
        libc::SYS_mkdir,
        libc::SYS_mknod,
        libc::SYS_link,
        libc::SYS_symlink,
        libc::SYS_unlink,
        libc::SYS_rmdir,
        libc::SYS_rename,
        libc::SYS_renameat,
    ];
    #[cfg(not(target_arch = "x86_64"))]
    const REFUSED_OLD: &[i64] = &[];

    /// The calls that open a file, each with the position of its flags.
    #[cfg(target_arch = "x86_64")]
    const OPENING: &[(i64, u8)] = &[(libc::SYS_openat, 2), (libc::SYS_open, 1)];
    #[cfg(not(target_arch = "x86_64"))]
    const OPENING: &[(i64, u8)] = &[(libc::SYS_openat, 2)];
    /// Flags with which that changes something, or allows it.
    const CHANGING: [i32; 4] = [libc::O_WRONLY, libc::O_RDWR, libc::O_CREAT, libc::O_TRUNC];

    pub fn install() {
        static FILTER: LazyLock<Result<BpfProgram, String>> =
            LazyLock::new(|| program().map_err(|error| error.to_string()));
        static TOLD: Once = Once::new();
        let installed = FILTER
            .as_ref()
            .map_err(Clone::clone)
            .and_then(|filter| apply_filter(filter).map_err(|error| error.to_string()));
        if let Err(reason) = installed {
            TOLD.call_once(|| {
                tracing::warn!("cannot keep ONNX Runtime from the network and from writing files: {reason}");
            });
        }
    }

    fn program() -> Result<BpfProgram, seccompiler::BackendError> {
        let mut rules: BTreeMap<i64, Vec<SeccompRule>> =
            REFUSED.iter().chain(REFUSED_OLD).map(|call| (*call, Vec::new())).collect();
        for (call, flags_at) in OPENING {
            let has_flag = |flag: i32| {
                let flag = u64::from(flag.cast_unsigned());
                SeccompRule::new(vec![SeccompCondition::new(*flags_at, Dword, MaskedEq(flag), flag)?])
            };
            rules.insert(*call, CHANGING.into_iter().map(has_flag).collect::<Result<_, _>>()?);
        }
        let refuse = SeccompAction::Errno(libc::EACCES.cast_unsigned());
        let filter = SeccompFilter::new(rules, SeccompAction::Allow, refuse, std::env::consts::ARCH.try_into()?)?;
        filter.try_into()
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::fs;
    use std::io::ErrorKind::PermissionDenied;
    use std::net::{TcpListener, TcpStream, ToSocketAddrs, UdpSocket};
    use std::os::unix::net::UnixDatagram;
    use std::process::Command;

    use super::*;

    #[test]
    fn a_confined_thread_and_what_it_starts_reach_nobody_and_write_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let (kept, made) = (folder.path().join("kept"), folder.path().join("made"));
        fs::write(&kept, "kept").unwrap();
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let attempts = || {
            assert!("name.invalid:80".to_socket_addrs().is_err());
            for attempt in [
                TcpStream::connect(address).map(drop),
                UdpSocket::bind("127.0.0.1:0").map(drop),
                UnixDatagram::unbound().map(drop),
                fs::write(&made, "made"),
                fs::write(&kept, "changed"),
                fs::OpenOptions::new().append(true).open(&kept).map(drop),
                fs::create_dir(&made),
                fs::rename(&kept, &made),
                fs::hard_link(&kept, &made),
                std::os::unix::fs::symlink(&kept, &made),
                fs::remove_file(&kept),
                fs::remove_dir(folder.path()),
            ] {
                assert_eq!(attempt.unwrap_err().kind(), PermissionDenied);
            }
            assert_eq!(fs::read(&kept).unwrap(), b"kept", "reading is allowed");
            let copied = Command::new("cp").arg(&kept).arg(&made).output().unwrap();
            assert!(!copied.status.success() && !made.exists(), "{copied:?}");
        };
        confined(|| {
            attempts();
            thread::scope(|scope| scope.spawn(attempts).join().unwrap());
        });
        fs::write(&made, "made").unwrap();
        TcpStream::connect(address).unwrap();
    }
}
