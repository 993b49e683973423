//! `morphcog gallery`: the zero-one robots that the paper's authors published.

use super::config::BUILT_IN;
use super::{Config, Error};
use crate::body::Body;
use crate::task::direction::Direction;
use serde::Deserialize;

/// The config under which the published robots were evolved.
const CONFIG: &str = "zero_one_published.toml";

/// What all published robots are called together.
pub const ALL: &str = "gallery";

/// The list of them.
pub(super) const TEXT: &str = include_str!("../../data/gallery.json");

/// A published robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Published {
    /// Its name, as published.
    pub name: String,
    /// Its published fitness, voxel lengths.
    pub fitness: f64,
    /// The way it walks under a zero; under a one it walks the other.
    pub zero_walks: Direction,
    /// Its body.
    pub body: Body,
}

/// All published robots.
///
/// # Errors
/// If the built-in list is damaged (which a test excludes).
pub fn gallery() -> Result<Vec<Published>, Error> {
    #[derive(Deserialize)]
    struct Entry {
        name: String,
        published_fitness: f64,
        zero_walks: String,
        body: String,
    }
    let entries: Vec<Entry> = super::toml_text::read_json(TEXT, "gallery.json")?;
    let robot = |Entry { name, published_fitness, zero_walks, body }: Entry| {
        let body = body.parse().map_err(|error| Error::other(format!("gallery.json: {name}: {error}")))?;
        let zero_walks = if zero_walks == "left" { Direction::Left } else { Direction::Right };
        Ok(Published { name, fitness: published_fitness, zero_walks, body })
    };
    entries.into_iter().map(robot).collect()
}

/// The published robot of a name, in any case of letters.
///
/// # Errors
/// As [`gallery`].
pub fn find(name: &str) -> Result<Option<Published>, Error> {
    Ok(gallery()?.into_iter().find(|robot| robot.name.eq_ignore_ascii_case(name)))
}

/// How the published robots were evolved.
///
/// # Errors
/// If the built-in config is damaged (which a test excludes).
pub fn config() -> Result<Config, Error> {
    let text = BUILT_IN.iter().find(|(name, _)| *name == CONFIG).map_or("", |(_, text)| text);
    Config::parse(text, CONFIG, &[])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gallery_holds_the_five_published_zero_one_robots() {
        let robots = gallery().unwrap();
        let names: Vec<&str> = robots.iter().map(|robot| robot.name.as_str()).collect();
        assert_eq!(names, ["APUKI", "IHSUJ", "QMAXD", "XFJPI", "YJTLA"]);
        assert!(robots.iter().all(|r| (r.body.height(), r.body.width()) == (14, 14) && r.body.is_valid(3)));
        assert_eq!(find("xfjpi").unwrap().unwrap().fitness, 17.316384958834874);
        assert_eq!(find("nobody").unwrap(), None);
        assert_eq!(config().unwrap().classes(), [0, 1]);
    }
}
