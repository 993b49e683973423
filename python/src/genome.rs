//! Genomes.

use crate::arrays::array;
use crate::config::ConfigData;
use crate::errors::{entered, raised, refused};
use crate::watch::watched;
use morphcog::base::error::Error;
use morphcog::base::session::Session;
use morphcog::body::Body;
use morphcog::genome::Genome;
use morphcog::search::evolve::Mutations;
use numpy::PyArray2;
use pyo3::prelude::*;

/// A genome and the body that it describes; see `morphcog.Genome`.
#[pyclass(frozen, module = "morphcog._morphcog")]
pub(crate) struct GenomeData {
    genome: Genome,
    body: Body,
}

#[pymethods]
impl GenomeData {
    /// Makes the random individual of a run's generation.
    #[staticmethod]
    fn random(
        py: Python,
        config: &ConfigData,
        seed: u64,
        generation: u64,
        child: u64,
    ) -> PyResult<Self> {
        GenomeData::made(py, config, seed, |mutations| {
            mutations.random(generation, child)
        })
    }

    /// Makes the offspring of a run's generation.
    fn mutate(
        &self,
        py: Python,
        config: &ConfigData,
        seed: u64,
        generation: u64,
        child: u64,
    ) -> PyResult<Self> {
        GenomeData::made(py, config, seed, |mutations| {
            mutations.mutated(&self.genome, generation, child)
        })
    }

    /// Parses the JSON of `to_json`; the config says how large the body is.
    #[staticmethod]
    fn parsed(json: &str, config: &ConfigData) -> PyResult<Self> {
        let _environment = entered()?;
        let genome: Genome = serde_json::from_str(json)
            .map_err(|error| refused(format!("genome: expected the JSON of a genome: {error}")))?;
        GenomeData::new(genome, config)
    }

    fn to_json(&self) -> String {
        serde_json::to_string(&self.genome).expect("every field is a number, text, list or table")
    }

    #[getter]
    fn id(&self) -> String {
        self.genome.id()
    }

    fn body<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u8>> {
        array(py, &self.body)
    }
}

impl GenomeData {
    pub(crate) fn new(genome: Genome, config: &ConfigData) -> PyResult<Self> {
        let size = &config.inner.body;
        let body = genome.body(size.height, size.width);
        let body = body.map_err(|error| refused(format!("genome: {error}")))?;
        Ok(GenomeData { genome, body })
    }

    pub(crate) fn describes(&self, body: &Body) -> bool {
        self.body == *body
    }

    fn made(
        py: Python,
        config: &ConfigData,
        seed: u64,
        make: impl Fn(&Mutations) -> Result<(Genome, Body), Error> + Sync,
    ) -> PyResult<Self> {
        let _environment = entered()?;
        let made = watched(py, |stop| {
            let session = Session::new(stop, &());
            make(&Mutations::new(&config.inner, seed, &session))
        })?;
        let (genome, body) = made.map_err(|error| raised(&error))?;
        Ok(GenomeData { genome, body })
    }
}
