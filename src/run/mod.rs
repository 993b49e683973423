//! Floor 4: what the commands do, one file per command. Reports through observers, never prints.

pub mod config;
pub mod data;
mod error;
mod toml_text;

pub use config::Config;
pub use error::{Error, ErrorKind};
