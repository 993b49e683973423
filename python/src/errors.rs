//! Errors as Python's exceptions.

use crate::remedies;
pub(crate) use exceptions::{Error as MorphcogError, Stopped, Unstable};
use morphcog::base::error::{Error, ErrorKind};
use morphcog::sim::{FloatEnvironment, InstructionSet};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use std::str::FromStr;

/// Exceptions, named as Python shows them.
mod exceptions {
    use pyo3::create_exception;
    use pyo3::exceptions::PyException;

    create_exception!(
        morphcog,
        Error,
        PyException,
        "What morphcog refuses or fails with, in its own words."
    );
    create_exception!(
        morphcog,
        Stopped,
        Error,
        "Work that a callback stopped has no result yet; what is done is saved."
    );
    create_exception!(
        morphcog,
        Unstable,
        Error,
        "A simulation became unstable and ended."
    );
}
/// Converts an error and its remedies to a Python exception.
pub(crate) fn raised(error: &Error) -> PyErr {
    let text = remedies::explained(error);
    match error.kind {
        ErrorKind::Unstable => Unstable::new_err(text),
        ErrorKind::Stopped => Stopped::new_err(text),
        _ => MorphcogError::new_err(text),
    }
}

pub(crate) fn refused(text: impl Into<String>) -> PyErr {
    MorphcogError::new_err(text.into())
}

/// Refuses a `MORPHCOG_ISA` that this machine cannot follow. While the value lives, rounding is
/// standard, whatever the host has chosen.
pub(crate) fn entered() -> PyResult<FloatEnvironment> {
    InstructionSet::asked().map_err(refused)?;
    Ok(FloatEnvironment::standard())
}

pub(crate) fn no_memory(what: &str) -> PyErr {
    PyMemoryError::new_err(format!("there is no memory for {what}"))
}

/// Returns an empty list with room for so many numbers.
pub(crate) fn room<T>(count: Option<usize>, what: &str) -> PyResult<Vec<T>> {
    let mut list = Vec::new();
    count
        .and_then(|count| list.try_reserve_exact(count).ok())
        .ok_or_else(|| no_memory(what))?;
    Ok(list)
}
/// Parses a value that Python gives as text.
pub(crate) fn parsed<T: FromStr<Err: std::fmt::Display>>(keyword: &str, text: &str) -> PyResult<T> {
    text.parse()
        .map_err(|error| refused(format!("{keyword}={text}: {error}")))
}
