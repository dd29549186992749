//! The groundcal program: floor photographs in, camera out.

#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(groundcal_cli::run(std::env::args_os()))
}
