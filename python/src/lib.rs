//! The Python module `morphcog._morphcog`; `morphcog/__init__.py` has what users import.

mod arrays;
mod commands;
mod config;
mod datasets;
mod errors;
mod genome;
mod pictures;
mod remedies;
mod rollouts;
mod run;
mod tasks;
mod watch;
mod world;

use morphcog::base::threads::MOST_THREADS;
use morphcog::task::protocol::{MAX_ROW, MAX_STEPS};
use pyo3::prelude::*;

/// Runs the command line with these arguments, the program's name first, and returns its exit code.
/// `program` has the words that call it in a shell.
#[pyfunction]
fn command(py: Python, arguments: Vec<std::ffi::OsString>, program: String) -> u8 {
    morphcog::cli::called(program);
    py.detach(|| morphcog::cli::main(arguments))
}

#[pymodule]
fn _morphcog(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("MOST_THREADS", MOST_THREADS)?;
    module.add("MAX_STEPS", MAX_STEPS)?;
    module.add("MAX_ROW", MAX_ROW)?;
    module.add("Error", py.get_type::<errors::MorphcogError>())?;
    module.add("Stopped", py.get_type::<errors::Stopped>())?;
    module.add("Unstable", py.get_type::<errors::Unstable>())?;
    module.add_class::<config::ConfigData>()?;
    module.add_class::<genome::GenomeData>()?;
    module.add_class::<pictures::FigureData>()?;
    module.add_class::<pictures::RecordingData>()?;
    module.add_class::<run::RunData>()?;
    module.add_class::<tasks::TasksData>()?;
    module.add_class::<world::WorldData>()?;
    module.add_function(wrap_pyfunction!(commands::evolve_run, module)?)?;
    module.add_function(wrap_pyfunction!(commands::train_run, module)?)?;
    module.add_function(wrap_pyfunction!(commands::train_pairs, module)?)?;
    module.add_function(wrap_pyfunction!(commands::team_test, module)?)?;
    module.add_function(wrap_pyfunction!(datasets::images, module)?)?;
    module.add_function(wrap_pyfunction!(datasets::import_dataset, module)?)?;
    module.add_function(wrap_pyfunction!(datasets::stimuli, module)?)?;
    module.add_function(wrap_pyfunction!(rollouts::displacements, module)?)?;
    module.add_function(wrap_pyfunction!(rollouts::rollouts, module)?)?;
    module.add_function(wrap_pyfunction!(run::runs, module)?)?;
    module.add_function(wrap_pyfunction!(tasks::tasks, module)?)?;
    module.add_function(wrap_pyfunction!(tasks::task_steps, module)?)?;
    module.add_function(wrap_pyfunction!(tasks::returns, module)?)?;
    module.add_function(wrap_pyfunction!(command, module)?)?;
    Ok(())
}
