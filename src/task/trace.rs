//! Traces: many rollouts at once, with the path, the shape, the contacts and the energies of the
//! body at moments of each.

use crate::base::Grid;
use crate::base::session::Session;
use crate::base::stop::Stopped;
use crate::body::Body;
use crate::sim::{EnergyGauge, EnergyNow, Physics, Start, System, World, Worlds};
use crate::task::protocol::Protocol;
use crate::task::rollout::{place, same_to_sensors, voxel_lengths};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Height above the ground up to which a point touches it \[voxel lengths\]; smaller values miss
/// points that bounce by a hair.
const CONTACT: f64 = 0.01;

/// A body at one moment. Lengths are voxel lengths, x from the left edge of the starting box, y
/// from the ground; energies are mass·wu²/s².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// The centre of mass.
    pub centre: [f64; 2],
    /// The width of the body.
    pub width: f64,
    /// The height of the body, from its lowest point.
    pub height: f64,
    /// The share of points that touch the ground, from 0 to 1.
    pub ground: f64,
    /// The energies.
    pub energy: EnergyNow,
}

/// A rollout.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// The displacement \[voxel lengths\], right positive; `None` if the rollout became unstable.
    pub displacement: Option<f64>,
    /// The moments, the start first; fewer if the rollout became unstable.
    pub moments: Vec<Moment>,
}

/// Returns the number of moments of a stable rollout: the start, and every `every`-th control step.
pub fn moments(control_steps: u32, every: u32) -> usize {
    control_steps as usize / every.max(1) as usize + 1
}

/// Simulates fresh rollouts of all bodies under all images in parallel, and looks at each after
/// every `every`-th control step. Returns for each body the traces under all images.
/// Displacements have the bits of [`fresh_rollouts`](crate::task::evaluation::fresh_rollouts).
///
/// # Errors
/// Returns [`Stopped`] if the session was stopped in the meantime.
pub fn traces(
    bodies: &[Body],
    images: &[Grid<f64>],
    (physics, protocol): (&Physics, &Protocol),
    every: u32,
    session: &Session,
) -> Result<Vec<Vec<Arc<Trace>>>, Stopped> {
    let views: Vec<&Grid<f64>> = images.iter().collect();
    let of_body = |body: &Body| -> Result<Vec<Arc<Trace>>, Stopped> {
        let system = Arc::new(System::new(body, physics.clone()));
        // Images that look the same to the sensors share a rollout.
        let same_as = same_to_sensors(body, &views);
        let distinct: Vec<usize> = same_as
            .iter()
            .copied()
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect();
        let most = if Worlds::gain(&system) {
            Worlds::MOST
        } else {
            1
        };
        let traced: Vec<Vec<Arc<Trace>>> = distinct
            .par_chunks(most)
            .with_max_len(1)
            .map(|part| {
                let stimuli: Vec<&Grid<f64>> = part.iter().map(|image| views[*image]).collect();
                side_by_side(&system, protocol, &stimuli, every, session)
            })
            .collect::<Result<_, Stopped>>()?;
        let traced: Vec<Arc<Trace>> = traced.into_iter().flatten().collect();
        let trace = |first: &usize| {
            let place = distinct
                .binary_search(first)
                .expect("every image is among the distinct ones");
            Arc::clone(&traced[place])
        };
        Ok(same_as.iter().map(trace).collect())
    };
    bodies
        .par_iter()
        .with_max_len(1)
        .map(of_body)
        .collect::<Result<Vec<_>, Stopped>>()
}

/// Simulates at most [`Worlds::MOST`] images.
fn side_by_side(
    system: &Arc<System>,
    protocol: &Protocol,
    stimuli: &[&Grid<f64>],
    every: u32,
    session: &Session,
) -> Result<Vec<Arc<Trace>>, Stopped> {
    let start = Start {
        column: protocol.start_column,
        row: protocol.start_row,
    };
    let mut worlds = Worlds::new(Arc::clone(system), start, stimuli.len());
    for (number, stimulus) in stimuli.iter().enumerate() {
        worlds.set_stimulus(number, stimulus);
    }
    let gauge = EnergyGauge::new(&worlds.all()[0]);
    let begin = worlds.all()[0].centre_of_mass()[0];
    let first = moment(&worlds.all()[0], gauge.now());
    let mut moments: Vec<Vec<Moment>> = vec![vec![first]; stimuli.len()];
    let mut gauges = vec![gauge; stimuli.len()];
    for step in 1..=protocol.control_steps {
        worlds.step_unless(session.stop)?;
        let living = worlds.all().iter().zip(worlds.ended());
        for (((world, ended), gauge), moments) in living.zip(&mut gauges).zip(&mut moments) {
            if ended.is_none() {
                let energy = gauge.observe(world);
                if step.is_multiple_of(every.max(1)) {
                    moments.push(moment(world, energy));
                }
            }
        }
    }
    let living = worlds.all().iter().zip(worlds.ended());
    let trace = |((world, ended), moments): ((&World, &Option<_>), Vec<Moment>)| {
        let moved = world.centre_of_mass()[0] - begin;
        Arc::new(Trace {
            displacement: ended
                .is_none()
                .then(|| voxel_lengths(moved, system.physics())),
            moments,
        })
    };
    Ok(living.zip(moments).map(trace).collect())
}

fn moment(world: &World, energy: EnergyNow) -> Moment {
    let physics = world.system().physics();
    let lengths = |at: [f64; 2]| place(at, physics);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let (mut points, mut touching) = (0_u32, 0_u32);
    for point in world.points().map(lengths) {
        for axis in [0, 1] {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
        points += 1;
        touching += u32::from(point[1] <= CONTACT);
    }
    Moment {
        centre: lengths(world.centre_of_mass()),
        width: high[0] - low[0],
        height: high[1] - low[1],
        ground: f64::from(touching) / f64::from(points.max(1)),
        energy,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::evaluation::fresh_rollouts;

    fn image(brightness: f64) -> Grid<f64> {
        Grid::from_fn(3, 4, |_, _| brightness)
    }

    fn protocol(control_steps: u32) -> Protocol {
        Protocol {
            control_steps,
            ..Protocol::default()
        }
    }

    #[test]
    fn displacements_have_the_bits_of_rollouts_and_the_path_ends_there() {
        // The second is mostly rigid: its images are simulated side by side.
        let bodies: Vec<Body> = ["4663/4005/3305", "1111/1611/1113"]
            .map(|body| body.parse().unwrap())
            .to_vec();
        let images = [image(0.0), image(1.0), image(0.0)];
        let (physics, protocol) = (Physics::default(), protocol(60));
        let session = Session::default();
        let traced = traces(&bodies, &images, (&physics, &protocol), 25, &session).unwrap();
        for (body, traces) in bodies.iter().zip(&traced) {
            let setting = (&physics, &protocol);
            let (walked, simulated) =
                fresh_rollouts(body, &images, &[], setting, &|_| (), &session).unwrap();
            let walked: Vec<Option<f64>> = walked.into_iter().map(Result::ok).collect();
            let displacements: Vec<_> = traces.iter().map(|trace| trace.displacement).collect();
            assert_eq!((displacements, simulated), (walked, 2));
            assert!(Arc::ptr_eq(&traces[0], &traces[2]));
            let moments = &traces[1].moments;
            assert_eq!(moments.len(), super::moments(60, 25));
            assert_eq!(moments[0].height.round(), 3.0);
            assert!(moments[0].ground > 0.1 && moments[0].energy.kinetic == 0.0);
        }
        assert!(traced[0][1].moments[2].energy.drive > 0.0);
        let every = traces_of(&bodies[0], &images[1], 60);
        let way = every.moments[60].centre[0] - every.moments[0].centre[0];
        assert!((every.displacement.unwrap() - way).abs() < 1e-9);
        assert_eq!(every.moments[50], traced[0][1].moments[2]);
    }

    fn traces_of(body: &Body, image: &Grid<f64>, control_steps: u32) -> Arc<Trace> {
        let setting = (&Physics::default(), &protocol(control_steps));
        let images = std::slice::from_ref(image);
        let session = Session::default();
        let traced = traces(std::slice::from_ref(body), images, setting, 1, &session).unwrap();
        Arc::clone(&traced[0][0])
    }

    #[test]
    fn an_unstable_rollout_ends_early_and_a_stop_ends_all() {
        let physics = Physics {
            blow_up_extent: 0.12,
            ..Physics::default()
        };
        let (bodies, images) = (["4663/4005/3305".parse().unwrap()], [image(1.0)]);
        let setting = (&physics, &protocol(60));
        let session = Session::default();
        let traced = traces(&bodies, &images, setting, 1, &session).unwrap();
        let trace = &traced[0][0];
        assert!(trace.displacement.is_none() && (1..61).contains(&trace.moments.len()));
        let stop = std::sync::atomic::AtomicBool::new(true);
        let stopped = traces(&bodies, &images, setting, 1, &Session::new(&stop, &()));
        assert_eq!(stopped, Err(Stopped));
    }
}
