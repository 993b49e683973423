//! `morphcog report`: a page of what is known of runs.

use crate::analysis::dossier;
use crate::base::error::Error;
use crate::base::number;
use crate::base::observer::Work;
use crate::base::session::Session;
use crate::draw::error::write_whole;
use crate::draw::report::{Content, Spell, names};
use crate::store::folder;
use std::path::PathBuf;

/// Options of a page.
pub(crate) struct ReportOptions<'a> {
    /// The run.json files, one or more.
    pub(crate) archives: Vec<PathBuf>,
    /// Robots that can be watched, of all runs together.
    pub(crate) rollouts: usize,
    pub(crate) out: PathBuf,
    pub(crate) spell: Spell<'a>,
}

/// Gathers what is known of runs, draws the page and writes it. What cannot be read is left out
/// with a warning.
pub(crate) fn report(options: &ReportOptions, session: &Session) -> Result<(), Error> {
    let ReportOptions {
        archives,
        out,
        spell,
        ..
    } = options;
    folder::writable(out)?;
    let warn = |text: &str| session.observer.warning(text);
    let gathered = dossier::gather(archives, session.data_folder(), options.rollouts > 0, &warn)?;
    let rollouts = options.rollouts.div_ceil(archives.len());
    let comparison = dossier::compared(&gathered, names(&gathered.runs))
        .map_err(|error| warn(&format!("{error}; left out")))
        .ok()
        .flatten();
    let content = Content {
        gathered: &gathered,
        comparison: comparison.as_ref(),
        rollouts,
        spell: *spell,
    };
    let label = "simulating for the page:".to_string();
    session
        .observer
        .begins(&Work::new(label, content.count() as u64, "rollouts"));
    let page = content.page(&|simulated| session.observer.progress(simulated))?;
    write_whole(out, page.as_bytes())?;
    let size = number::fixed(page.len() as f64 / 1e6, 1);
    session.observer.wrote(out, &format!(" ({size} MB)"));
    Ok(())
}
