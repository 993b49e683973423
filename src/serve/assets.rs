//! The page's files, embedded in the program.

use crate::serve::http::HttpResponse;

const HTML: &str = "text/html; charset=utf-8";
const JS: &str = "text/javascript; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SVG: &str = "image/svg+xml";

/// A file of the page: its name, its type and its text.
pub(crate) type Asset = (&'static str, &'static str, &'static str);

/// The page.
pub(crate) const PAGE: &str = "index.html";

/// The file in which the page finds its engine: the server, or the simulator in the browser.
pub(crate) const ENGINE: &str = "engine.js";

/// All files of the page that `serve` serves.
pub(crate) const ASSETS: [Asset; 19] = [
    (PAGE, HTML, include_str!("page/page.html")),
    ("icon.svg", SVG, include_str!("page/icon.svg")),
    // The styles of the page that `replay` writes, and additions.
    ("replay.css", CSS, include_str!("../draw/replay.css")),
    ("stages.css", CSS, include_str!("../draw/stages.css")),
    ("cells.css", CSS, include_str!("../draw/cells.css")),
    ("page.css", CSS, include_str!("page/page.css")),
    ("drawing.js", JS, include_str!("../draw/drawing.js")),
    ("stages.js", JS, include_str!("../draw/stages.js")),
    ("main.js", JS, include_str!("page/main.js")),
    ("api.js", JS, include_str!("page/api.js")),
    (ENGINE, JS, include_str!("page/engine.js")),
    ("stage.js", JS, include_str!("page/stage.js")),
    ("simulation.js", JS, include_str!("page/simulation.js")),
    ("pad.js", JS, include_str!("page/pad.js")),
    ("images.js", JS, include_str!("page/images.js")),
    ("robots.js", JS, include_str!("page/robots.js")),
    ("team.js", JS, include_str!("page/team.js")),
    ("editor.js", JS, include_str!("page/editor.js")),
    ("links.js", JS, include_str!("page/links.js")),
];

pub(crate) fn asset(path: &str) -> Option<HttpResponse> {
    let wanted = match path.strip_prefix('/')? {
        "" => PAGE,
        name => name,
    };
    let (_, content_type, text) = ASSETS.iter().find(|(name, ..)| *name == wanted)?;
    Some(HttpResponse::file(content_type, text))
}
