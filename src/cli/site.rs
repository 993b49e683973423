//! `morphcog site`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::base::number;
use crate::base::shell::in_shell;
use crate::cli::output::console::Console;
use crate::serve::site;
use clap::Args;
use std::path::PathBuf;

pub(super) const EXAMPLES: &str = "\
Examples:
  morphcog site public/
  # try it
  python3 -m http.server -d public/ 8000

Any server of files will do, in any folder of it: the addresses are relative, and nothing is loaded \
from elsewhere. Visitors need a browser with WebAssembly and SIMD (since 2023 all have them).";

#[derive(Debug, Args)]
pub(super) struct SiteArgs {
    /// Folder to write; files of an earlier site there are replaced. If it has docs/index.html, the
    /// page links to it.
    #[arg(value_name = "DIR")]
    out: PathBuf,
}

pub(super) fn run(args: &SiteArgs, console: &Console) -> Result<(), Error> {
    let files = site::write(&args.out)?;
    let bytes: u64 = files
        .iter()
        .filter_map(|file| file.metadata().ok())
        .map(|about| about.len())
        .sum();
    let text = format!(
        "wrote {} ({} files, {} MB)",
        args.out.display(),
        files.len(),
        number::fixed(bytes as f64 / 1e6, 1)
    );
    console.line_about(&args.out, &text);
    let command = format!("python3 -m http.server -d {} 8000", in_shell(&args.out));
    console.suggest("try it:", &command);
    Ok(())
}
