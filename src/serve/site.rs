//! `morphcog site`: the page as static files, with the simulator in the browser.

use crate::base::error::Error;
use crate::base::files::write_atomically;
use crate::base::remedy::Remedy;
use crate::serve::Service;
use crate::serve::assets::{ASSETS, ENGINE, PAGE};
use crate::serve::local::Local;
use crate::shipped::gallery;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The simulator and the page's service as a WebAssembly module, compressed: `crates/web/build`
/// makes it.
const SIMULATOR: &[u8] = include_bytes!("page/simulator.gz");

/// Control steps of the walk by which a browser finds out whether it gives the program's bits.
const PINNED_STEPS: u32 = 50;

/// The name of that walk's file.
const PINNED: &str = "pinned.json";

/// The documentation's first page, if there is documentation in the site's folder.
const DOCUMENTATION: &str = "docs/index.html";

/// Writes the site into a folder, which is made if it is not there, and returns its files. Files of
/// an earlier site are replaced; others stay. If the folder has documentation
/// (`docs/index.html`), the page links to it.
///
/// # Errors
/// Returns an error if a file cannot be written, or is there and not of an earlier site.
pub(crate) fn write(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    std::fs::create_dir_all(folder).map_err(|error| Error::writing(folder, &error))?;
    let engine = include_str!("page/engine_local.js");
    let documented = folder.join(DOCUMENTATION).is_file();
    let text = |(name, _, text): &(&'static str, &str, &'static str)| match *name {
        ENGINE => (ENGINE, engine.as_bytes().to_vec()),
        PAGE if documented => (PAGE, with_documentation(text).into_bytes()),
        name => (name, text.as_bytes().to_vec()),
    };
    // First what shows that the others are a site's, should it be stopped.
    let mut files = vec![(PINNED, pinned()?.to_string().into_bytes())];
    files.extend(ASSETS.iter().map(text));
    files.push(("worker.js", include_bytes!("page/worker.js").to_vec()));
    files.push(("simulator.gz", SIMULATOR.to_vec()));
    files.push(("gallery.gz", compressed(gallery::exported().as_bytes())));
    // No other page has this file.
    let is_site = folder.join(PINNED).exists();
    let mut paths = files.iter().map(|(name, _)| folder.join(name));
    if let Some(other) = paths.find(|path| !is_site && path.exists()) {
        let text = format!("{}: is there, and not of an earlier site", other.display());
        return Err(Error::occupied(text).remedy(Remedy::MoveAway));
    }
    let written = |(name, bytes): (&str, Vec<u8>)| {
        let path = folder.join(name);
        match write_atomically(&path, &bytes) {
            Ok(()) => Ok(path),
            Err(error) => Err(Error::writing(&path, &error)),
        }
    };
    files.into_iter().map(written).collect()
}

/// Returns the page with a link to the documentation at its foot.
fn with_documentation(page: &str) -> String {
    let link =
        format!(r#"<a href="{DOCUMENTATION}">About morphcog: documentation and results</a>"#);
    page.replace(
        "</footer>",
        &format!("  <p class=\"note\">{link}</p>\n</footer>"),
    )
}

fn compressed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.expect("a vector takes all bytes")
}

/// Returns the request of a walk, and how far the program's robot moves.
fn pinned() -> Result<Value, Error> {
    let service = Service::shipped()?;
    let first = service.catalogue.collection(0);
    let first = first.map_err(|refusal| Error::other(refusal.to_string()))?;
    let robot = first.robots.first().expect("the set has robots");
    let request = json!({
        "subject": { "archive": 0, "robot": robot.id },
        "shown": { "image": { "set": "builtin", "index": 0 } },
        "control_steps": PINNED_STEPS,
    });
    let mut local = Local::with(service);
    let moved = local.walk(&request.to_string())?;
    Ok(json!({ "request": request, "moved": moved }))
}
