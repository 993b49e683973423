//! One substep (physics.md, "One substep"), compiled per instruction set.

pub(crate) mod actuation;
pub(crate) mod broad_phase;
mod contact;
pub(crate) mod geometry;
pub(crate) mod limits;
pub(crate) mod off_lattice;
mod rk4;
mod series;
pub(crate) mod springs;

use crate::energy::Meter;
use crate::scratch::Scratch;
use crate::simd::{Kernel, Lanes};
use crate::state::State;
use crate::stop::{Stopped, check};
use crate::system::System;
use crate::terrain::Ground;
use crate::unstable::UnstableReason;
use std::sync::atomic::AtomicBool;

/// The substeps of a control step.
pub(crate) struct ControlStep<'a> {
    pub system: &'a System,
    pub ground: Ground<'a>,
    pub state: &'a mut State,
    pub scratch: &'a mut Scratch,
    pub meter: Option<&'a mut Meter>,
    pub stop: &'a AtomicBool,
}

/// The reason why a control step ended early.
pub(crate) enum Ended {
    Unstable(UnstableReason),
    Stopped,
}

impl Kernel for ControlStep<'_> {
    type Output = Result<(), Ended>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let ControlStep {
            system,
            ground,
            state,
            scratch,
            mut meter,
            stop,
        } = self;
        for _ in 0..system.physics.substeps {
            check(stop).map_err(|Stopped| Ended::Stopped)?;
            substep::<L>(system, ground, state, scratch, meter.as_deref_mut())
                .map_err(Ended::Unstable)?;
        }
        Ok(())
    }
}

#[inline(always)]
fn substep<L: Lanes>(
    system: &System,
    ground: Ground,
    state: &mut State,
    scratch: &mut Scratch,
    mut meter: Option<&mut Meter>,
) -> Result<(), UnstableReason> {
    before_rigid::<L>(system, ground, state, scratch, meter.as_deref_mut())?;
    limits::limit_rigid(system, &mut state.position);
    meter
        .iter_mut()
        .for_each(|meter| meter.after_limits(&state.position));
    Ok(())
}

/// Runs a substep up to the rigid pass.
#[inline(always)]
pub(crate) fn before_rigid<L: Lanes>(
    system: &System,
    ground: Ground,
    state: &mut State,
    scratch: &mut Scratch,
    mut meter: Option<&mut Meter>,
) -> Result<(), UnstableReason> {
    scratch.broad_phase.refresh::<L>(system, ground, state)?;
    if scratch.broad_phase.too_many_overlaps(system, state) {
        return Err(UnstableReason::Overlaps);
    }
    scratch.contact.iter_mut().for_each(|axis| axis.fill(0.0));
    contact::add_contacts(
        system,
        ground,
        state,
        &scratch.broad_phase,
        &mut scratch.contact,
    );
    // Contacts use true velocities: position now minus position then. The integrator uses its own.
    rk4::integrate::<L>(system, ground.terrain.is_some(), state, scratch);
    meter
        .iter_mut()
        .for_each(|meter| meter.before_limits(&scratch.position));
    rk4::limit::<L>(system, state, scratch);
    Ok(())
}
