//! The groundcal program: floor photographs in, camera out.

#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    groundcal_cli::end_on_signals();
    ExitCode::from(groundcal_cli::run(std::env::args_os()))
}
