//! The page's files, embedded in the program.

use crate::serve::http::HttpResponse;

const JS: &str = "text/javascript; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";

pub(crate) fn asset(path: &str) -> Option<HttpResponse> {
    let (content_type, text) = match path {
        "/" => ("text/html; charset=utf-8", include_str!("page/page.html")),
        "/icon.svg" => ("image/svg+xml", include_str!("page/icon.svg")),
        // The styles of the page that `replay` writes, and additions.
        "/replay.css" => (CSS, include_str!("../draw/replay.css")),
        "/stages.css" => (CSS, include_str!("../draw/stages.css")),
        "/cells.css" => (CSS, include_str!("../draw/cells.css")),
        "/page.css" => (CSS, include_str!("page/page.css")),
        "/drawing.js" => (JS, include_str!("../draw/drawing.js")),
        "/stages.js" => (JS, include_str!("../draw/stages.js")),
        "/main.js" => (JS, include_str!("page/main.js")),
        "/api.js" => (JS, include_str!("page/api.js")),
        "/stage.js" => (JS, include_str!("page/stage.js")),
        "/simulation.js" => (JS, include_str!("page/simulation.js")),
        "/pad.js" => (JS, include_str!("page/pad.js")),
        "/images.js" => (JS, include_str!("page/images.js")),
        "/robots.js" => (JS, include_str!("page/robots.js")),
        "/team.js" => (JS, include_str!("page/team.js")),
        "/editor.js" => (JS, include_str!("page/editor.js")),
        _ => return None,
    };
    Some(HttpResponse::file(content_type, text))
}
