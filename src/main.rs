//! The morphcog command.

#![forbid(unsafe_code)]
#![deny(
    clippy::panic,
    clippy::print_stderr,
    clippy::print_stdout,
    clippy::unwrap_used
)]

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(morphcog::cli::main(std::env::args_os()))
}
