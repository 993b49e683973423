//! Configs.

use crate::errors::{entered, raised};
use morphcog::config;
use morphcog::sim::Physics;
use morphcog::store::folder;
use morphcog::task::protocol::Protocol;
use pyo3::prelude::*;
use std::path::PathBuf;

/// A config, and the name of its runs; see `morphcog.Config`.
#[pyclass(frozen, module = "morphcog._morphcog")]
pub(crate) struct ConfigData {
    pub(crate) inner: config::Config,
    pub(crate) name: String,
}

#[pymethods]
impl ConfigData {
    /// Reads a config file, or a built-in one by its name; `set` changes keys.
    #[new]
    fn new(config: PathBuf, set: Vec<String>) -> PyResult<Self> {
        let _environment = entered()?;
        let source = config.to_string_lossy();
        let inner = config::Config::load(&source, &set).map_err(|error| raised(&error))?;
        Ok(ConfigData {
            inner,
            name: folder::name_of(&source),
        })
    }

    /// Parses a config from the text of `to_toml`.
    #[staticmethod]
    fn parsed(toml: &str, name: String, set: Vec<String>) -> PyResult<Self> {
        let _environment = entered()?;
        let inner = config::Config::parse(toml, &name, &set).map_err(|error| raised(&error))?;
        Ok(ConfigData { inner, name })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    fn to_toml(&self) -> String {
        self.inner.to_toml()
    }

    fn to_json(&self) -> String {
        serde_json::to_string(&self.inner).expect("every field is a number, text, list or table")
    }

    /// Describes the config in a few words.
    fn about(&self) -> String {
        let config::Config {
            seed,
            generations,
            body,
            data,
            ..
        } = &self.inner;
        let tasks = self
            .inner
            .grouping()
            .expect("a config's groups are checked when it is read");
        let tasks: Vec<String> = tasks.tasks().iter().map(|task| task.name()).collect();
        let task = match &tasks[..] {
            [one] => one.clone(),
            [first, ..] => format!("{first} and {} more", tasks.len() - 1),
            [] => "none".to_string(),
        };
        let (size, data) = (format!("{}×{}", body.height, body.width), &data.dataset);
        format!("task={task}, data={data}, body={size}, generations={generations}, seed={seed}")
    }
}
pub(crate) fn setting(config: Option<&ConfigData>) -> (Physics, Protocol) {
    match config {
        Some(config) => (config.inner.physics.clone(), config.inner.protocol.clone()),
        None => (Physics::default(), Protocol::default()),
    }
}
