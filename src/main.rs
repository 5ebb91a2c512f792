//! The program; all of its code is in the library.

use std::process::ExitCode;

use gprop::setup::{NO_TELEMETRY, confine_this_thread};

fn main() -> ExitCode {
    let (variable, value) = NO_TELEMETRY;
    // SAFETY: this is the process's only thread, so no other one reads or writes the environment.
    unsafe { std::env::set_var(variable, value) };
    let code = gprop::main();
    // A library that was loaded ends on this thread.
    confine_this_thread();
    code
}
