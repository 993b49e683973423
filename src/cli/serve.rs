//! `morphcog serve`: parses its arguments and runs it.

use crate::base::error::Error;
use crate::base::signals;
use crate::cli::choice;
use crate::cli::choice::Archives;
use crate::cli::output::console::Console;
use crate::cli::values::whole;
use crate::serve::hosts::{HostName, Hosts};
use crate::serve::server::Server;
use crate::serve::{ServeOptions, Service};
use crate::store::folder;
use clap::Args;
use std::path::PathBuf;

pub(super) const EXAMPLES: &str = "\
Examples:
  # trained and published robots, and the newest run, if any
  morphcog serve
  morphcog serve --archive runs/zero_one-seed1 runs/pairs/*/
  # then open http://127.0.0.1:8080/
  morphcog serve --port 8080 --no-open
  # from another machine; then open http://localhost:9000/
  ssh -t -L 9000:localhost:8080 HOST \\
    morphcog serve --port 8080 --no-open

Runs under runs/ that begin or go on meanwhile appear by themselves. Only this machine can reach \
the page. Ctrl-C ends it.";

const ADVICE: &str = "if you reach the page by this name: morphcog serve --allow-host NAME";

#[derive(Debug, Args)]
pub(super) struct ServeArgs {
    #[command(flatten)]
    archives: Archives,
    /// Folder with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Port (default: one that is free).
    #[arg(short, long, default_value_t = 0, hide_default_value = true, value_parser = whole::<u16>(0..=65535))]
    port: u16,
    /// Do not open the browser.
    #[arg(long)]
    no_open: bool,
    /// A further host name that may reach the page, besides this machine's, such as a proxy's.
    #[arg(long, value_name = "NAME")]
    allow_host: Vec<HostName>,
}

pub(super) fn run(args: ServeArgs, console: &Console) -> Result<(), Error> {
    let archives = args.archives.paths();
    // Without a run, the page still has the published robots.
    let newest = if archives.is_empty() {
        folder::newest_run().ok()
    } else {
        None
    };
    let stop = signals::stop_flag()?;
    let shown: Vec<_> = archives.iter().chain(&newest).cloned().collect();
    let hosts = Hosts::new(args.allow_host, ADVICE);
    let options = ServeOptions {
        archives,
        newest,
        data: args.data,
        runs: folder::RUNS.into(),
    };
    let (service, notes) = Service::open(&options)?;
    let server = Server::bind(service, hosts, args.port)?;
    choice::warn_of_versions(&shown, console);
    for note in notes {
        console.info(&format!("note: {note}"));
    }
    let url = server.url();
    console.line(&url);
    console.info("Ctrl-C ends it");
    // The reason would name programs that the user never chose.
    if !args.no_open && open::that_detached(&url).is_err() {
        console.warning(&format!("no browser could be opened; open {url} yourself"));
    }
    server.run(&stop)
}
