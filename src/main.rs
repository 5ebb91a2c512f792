//! Parse, run, print the error once, exit.

use std::process::ExitCode;

fn main() -> ExitCode {
    gprop::exit::report_panics_as_bugs();
    match gprop::cli::run(std::env::args_os().collect()) {
        Ok(()) => ExitCode::from(gprop::exit::Exit::Done as u8),
        Err(error) => {
            gprop::output::tell(&format!("error: {}", gprop::exit::message(&error)));
            ExitCode::from(gprop::exit::of(&error) as u8)
        }
    }
}
