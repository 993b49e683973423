//! Many rollouts at once.

use crate::arrays::bodies_and_images;
use crate::config::{ConfigData, setting};
use crate::errors::{entered, raised, room};
use crate::watch::watched;
use morphcog::base::session::Session;
use morphcog::base::stop::Stopped;
use morphcog::base::threads::pool;
use morphcog::body::Body;
use morphcog::sim::Physics;
use morphcog::task::evaluation::fresh_rollouts;
use morphcog::task::protocol::{Protocol, RolloutMode};
use morphcog::task::trace::{Moment, Trace, moments, traces};
use numpy::ndarray::{Array2, Array4};
use numpy::{PyArray2, PyArray4, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;

/// Returns the physics and the protocol of fresh rollouts.
fn fresh(config: Option<&ConfigData>, control_steps: Option<u32>) -> (Physics, Protocol) {
    let (physics, protocol) = setting(config);
    let protocol = Protocol {
        rollout: RolloutMode::Fresh,
        control_steps: control_steps.unwrap_or(protocol.control_steps),
        ..protocol
    };
    (physics, protocol)
}

/// Returns displacements; see `morphcog.displacements`.
#[pyfunction]
#[pyo3(signature = (bodies, stimuli, control_steps, config, threads))]
pub(crate) fn displacements<'py>(
    py: Python<'py>,
    bodies: Vec<PyReadonlyArray2<u8>>,
    stimuli: PyReadonlyArray3<f64>,
    control_steps: Option<u32>,
    config: Option<&ConfigData>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let _environment = entered()?;
    let (bodies, images) = bodies_and_images(py, &bodies, &stimuli)?;
    let (physics, protocol) = fresh(config, control_steps);
    let pool = pool(threads).map_err(|error| raised(&error))?;
    let walked = watched(py, |stop| {
        let walk = |body: &Body| -> Result<Vec<f64>, Stopped> {
            let (found, _) = fresh_rollouts(
                body,
                &images,
                &[],
                (&physics, &protocol),
                &|_| (),
                &Session::new(stop, &()),
            )?;
            Ok(found
                .into_iter()
                .map(|walk| walk.unwrap_or(f64::NAN))
                .collect())
        };
        pool.install(|| {
            bodies
                .par_iter()
                .with_max_len(1)
                .map(walk)
                .collect::<Result<Vec<_>, Stopped>>()
        })
    })?;
    let all: Vec<f64> = walked
        .expect("only Ctrl-C stops it, which is raised above")
        .into_iter()
        .flatten()
        .collect();
    let shape = (bodies.len(), stimuli.shape()[0]);
    let array = Array2::from_shape_vec(shape, all).expect("as many as said");
    Ok(PyArray2::from_owned_array(py, array))
}

/// Numbers of a moment, in the order of `morphcog.Rollouts`.
const NUMBERS: usize = 9;

fn numbers(moment: &Moment) -> [f64; NUMBERS] {
    let Moment {
        centre: [x, y],
        width,
        height,
        ground,
        energy,
    } = *moment;
    let [kinetic, elastic] = [energy.kinetic, energy.elastic];
    let [gravitational, drive] = [energy.gravitational, energy.drive];
    [
        x,
        y,
        width,
        height,
        ground,
        kinetic,
        elastic,
        gravitational,
        drive,
    ]
}

/// Displacements (bodies, images), and the numbers of moments (bodies, images, moments, numbers).
type Traced<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray4<f64>>);

/// Returns displacements and moments; see `morphcog.rollouts`.
#[pyfunction]
#[pyo3(signature = (bodies, stimuli, control_steps, every, config, threads))]
pub(crate) fn rollouts<'py>(
    py: Python<'py>,
    bodies: Vec<PyReadonlyArray2<u8>>,
    stimuli: PyReadonlyArray3<f64>,
    control_steps: Option<u32>,
    every: u32,
    config: Option<&ConfigData>,
    threads: Option<usize>,
) -> PyResult<Traced<'py>> {
    let _environment = entered()?;
    let (bodies, images) = bodies_and_images(py, &bodies, &stimuli)?;
    let (physics, protocol) = fresh(config, control_steps);
    let moments = moments(protocol.control_steps, every);
    let shape = [bodies.len(), stimuli.shape()[0], moments, NUMBERS];
    let count = shape
        .iter()
        .try_fold(1_usize, |all, side| all.checked_mul(*side));
    let mut all = room(count, "the rollouts")?;
    // The moments are kept twice for a while.
    drop(room::<f64>(count, "the rollouts")?);
    let pool = pool(threads).map_err(|error| raised(&error))?;
    let traced = watched(py, |stop| {
        let session = Session::new(stop, &());
        pool.install(|| traces(&bodies, &images, (&physics, &protocol), every, &session))
    })?;
    let traced = traced.expect("only Ctrl-C stops it, which is raised above");
    let rollouts = || traced.iter().flatten();
    let displacement = |trace: &Trace| trace.displacement.unwrap_or(f64::NAN);
    let walked: Vec<f64> = rollouts().map(|trace| displacement(trace)).collect();
    for trace in rollouts() {
        let missing = moments - trace.moments.len();
        all.extend(trace.moments.iter().flat_map(numbers));
        all.extend(std::iter::repeat_n(f64::NAN, missing * NUMBERS));
    }
    let walked = Array2::from_shape_vec((shape[0], shape[1]), walked).expect("as many as said");
    let all = Array4::from_shape_vec(shape, all).expect("as many as said");
    Ok((
        PyArray2::from_owned_array(py, walked),
        PyArray4::from_owned_array(py, all),
    ))
}
