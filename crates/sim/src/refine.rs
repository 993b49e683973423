//! [`Physics::refined`]: the same material at a finer time step.
//!
//! The behaviour of a material follows from its constants together with the time step h. In a
//! substep a spring of stiffness k and gain g, of length d₀ at its start, pulls with k·(d − d₀) +
//! k·g·(d₀ − goal):
//! - the second term is, substep after substep, a spring of stiffness **k·g** towards the goal;
//! - the first forgets its length at every substep. Ends that part with speed v are d − d₀ = v·t
//!   apart after t, a mean pull of k·v·h/2 over the substep: a dashpot of **k·h/2**.
//!
//! So the modelled material is a Kelvin–Voigt solid, and h/n with k·n and g/n keeps both. (With g/n
//! alone, stiffness and viscosity would fall with n, and the robot would change with the time
//! step.) The length limits remove a fraction s of an excess per substep; 1 − (1 − s)^(1/n) removes
//! as much in n substeps. Drag, gravity, contacts and the floor are already forces per time and
//! stay. Displacements converge as n grows (`docs/analysing.md`).

use crate::physics::Physics;

/// Returns the fraction to remove in each of `by` passes so that together they remove `share`.
fn spread_out(share: f64, by: f64) -> f64 {
    if share < 1.0 {
        1.0 - libm::pow(1.0 - share, 1.0 / by)
    } else {
        share
    }
}

impl Physics {
    /// Divides every substep into `by` shorter ones and keeps the material and the world.
    #[must_use]
    pub fn refined(&self, by: u32) -> Self {
        let n = f64::from(by.max(1));
        Physics {
            time_step: self.time_step / n,
            substeps: self.substeps.saturating_mul(by.max(1)),
            servo_gain: self.servo_gain / n,
            ..self.with_stiffness(n).with_slower_limits(n)
        }
    }

    /// Makes all springs `by` times as stiff.
    #[must_use]
    pub fn with_stiffness(&self, by: f64) -> Self {
        Physics {
            rigid_stiffness: self.rigid_stiffness * by,
            soft_stiffness: self.soft_stiffness * by,
            active_stiffness: self.active_stiffness * by,
            ..self.clone()
        }
    }

    /// Makes the length limits take `by` times as long to remove an excess.
    #[must_use]
    pub fn with_slower_limits(&self, by: f64) -> Self {
        Physics {
            limit_share: spread_out(self.limit_share, by),
            rigid_limit_share: spread_out(self.rigid_limit_share, by),
            ..self.clone()
        }
    }

    /// Moves the length limits of soft and active voxels beyond every goal, so that no spring is
    /// held at a limit against its goal and gains energy there.
    #[must_use]
    pub fn without_limits(&self) -> Self {
        Physics {
            limit_low: self.limit_low.min(self.target_min),
            limit_high: self.limit_high.max(self.target_max),
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Start, System, World};

    #[test]
    fn a_refined_material_has_the_same_stiffness_viscosity_and_limits() {
        let coarse = Physics::default();
        for n in [2, 4, 8] {
            let fine = coarse.refined(n);
            fine.validate().unwrap();
            let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
            near(
                fine.active_stiffness * fine.servo_gain,
                coarse.active_stiffness * coarse.servo_gain,
            );
            near(
                fine.soft_stiffness * fine.time_step,
                coarse.soft_stiffness * coarse.time_step,
            );
            near(
                fine.time_step * f64::from(fine.substeps),
                coarse.time_step * f64::from(coarse.substeps),
            );
            near(
                libm::pow(1.0 - fine.limit_share, f64::from(n)),
                1.0 - coarse.limit_share,
            );
        }
        assert_eq!(coarse.refined(1), coarse);
    }

    #[test]
    fn the_walk_of_a_plain_walker_converges_with_the_time_step() {
        let body = "444422/444422/333311/330011".parse().unwrap();
        let walk = |physics: &Physics| {
            let mut world = World::new(
                System::new(&body, physics.clone()),
                Start { column: 0, row: 2 },
            );
            let start = world.centre_of_mass()[0];
            (0..250).for_each(|_| world.step().unwrap());
            10.0 * (world.centre_of_mass()[0] - start)
        };
        let coarse = Physics::default();
        let walks = [1, 2, 4, 8].map(|n| walk(&coarse.refined(n)));
        assert!(
            walks.iter().all(|d| (d / walks[3] - 1.0).abs() < 0.05),
            "{walks:?}"
        );
        // Dividing only the gain is not enough: the material then softens with the time step.
        let softened = Physics {
            rigid_stiffness: coarse.rigid_stiffness,
            soft_stiffness: coarse.soft_stiffness,
            active_stiffness: coarse.active_stiffness,
            ..coarse.refined(4)
        };
        let softened = walk(&softened);
        assert!(
            (softened / walks[3] - 1.0).abs() > 0.2,
            "{softened} beside {walks:?}"
        );
    }
}
