//! From material, time and stimulus to goal lengths (physics.md, "Actuation").

use crate::body::Material;
use crate::physics::Physics;
use crate::system::System;

/// Returns the target width of an active voxel at a control step \[rest widths\]; `pixel` in [0, 1]
/// matters to sensors only. Of an actuator it is the target.
pub(crate) fn target(material: Material, control_step: u64, pixel: f64, physics: &Physics) -> f64 {
    let phase = match material {
        Material::MuscleInPhase => 0.0,
        Material::MuscleAntiphase => physics.antiphase,
        Material::ActuatorHorizontal | Material::ActuatorVertical => return pixel,
        _ => return width(material, pixel, physics),
    };
    let cycle = u64::from(physics.cycle_steps);
    // The period is one step less than the cycle: the sine's first and last values are equal.
    let angle = std::f64::consts::TAU * (control_step % cycle) as f64 / (cycle - 1) as f64;
    let free = physics.muscle_low + physics.muscle_swing * (libm::sin(phase + angle) + 1.0) / 2.0;
    free.clamp(physics.target_min, physics.target_max)
}

/// Returns the target width of any voxel under a pixel in [0, 1] \[rest widths\]: for a muscle
/// halfway through its swing, for a passive voxel and an actuator 1.
///
/// # Panics
/// If `target_min` exceeds `target_max` or one is NaN, which [`Physics::validate`] refuses.
pub fn width(material: Material, pixel: f64, physics: &Physics) -> f64 {
    let free = match material {
        Material::MuscleInPhase | Material::MuscleAntiphase => {
            physics.muscle_low + physics.muscle_swing / 2.0
        }
        Material::SensorShrink => physics.sensor_shrink_dark - physics.sensor_swing * pixel,
        Material::SensorExpand => physics.sensor_expand_dark + physics.sensor_swing * pixel,
        Material::Empty | Material::Rigid | Material::Soft => 1.0,
        Material::ActuatorHorizontal | Material::ActuatorVertical => 1.0,
    };
    free.clamp(physics.target_min, physics.target_max)
}

/// Writes all sides' goals. `pixels` is by active voxel; `targets` is scratch memory as long.
pub(crate) fn set_goals(
    System { lattice, physics }: &System,
    control_step: u64,
    pixels: &[f64],
    targets: &mut [f64],
    [goals, vertical]: [&mut [f64]; 2],
) {
    let muscles = [Material::MuscleInPhase, Material::MuscleAntiphase]
        .map(|material| target(material, control_step, 0.0, physics));
    for ((voxel, &pixel), slot) in lattice.active.iter().zip(pixels).zip(targets.iter_mut()) {
        *slot = match voxel.material {
            Material::MuscleInPhase => muscles[0],
            Material::MuscleAntiphase => muscles[1],
            sensor => target(sensor, control_step, pixel, physics),
        };
    }
    let goal = |[first, second]: [usize; 2]| {
        physics.cell_size * ((targets[first] + targets[second]) / 2.0)
    };
    for side in &lattice.actuated {
        goals[side.goal] = goal(side.voxels);
    }
    for side in &lattice.actuated_vertical {
        vertical[side.goal] = goal(side.voxels);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_follow_the_specification() {
        let physics = Physics::default();
        let at = |material, step, pixel| target(material, step, pixel, &physics);
        assert_eq!(at(Material::MuscleInPhase, 0, 0.0), 1.1);
        assert_eq!(at(Material::MuscleInPhase, 50, 0.0), 1.1);
        // 2π·49/49 is back at the start: the cycle has that value twice.
        assert!((at(Material::MuscleInPhase, 49, 0.0) - 1.1).abs() < 1e-15);
        let both = at(Material::MuscleInPhase, 13, 0.0) + at(Material::MuscleAntiphase, 13, 0.0);
        assert!((both - 2.2).abs() < 1e-15);
        assert_eq!(at(Material::SensorShrink, 7, 0.25), 1.35);
        assert_eq!(at(Material::SensorExpand, 7, 0.25), 0.85);
        let width = |material, pixel| width(material, pixel, &physics);
        assert_eq!(
            [Material::MuscleInPhase, Material::MuscleAntiphase].map(|m| width(m, 0.7)),
            [1.1; 2]
        );
        assert_eq!(
            [
                width(Material::SensorShrink, 0.0),
                width(Material::SensorExpand, 0.0)
            ],
            [1.6, 0.6]
        );
        assert_eq!(
            [Material::Empty, Material::Rigid, Material::Soft].map(|m| width(m, 1.0)),
            [1.0; 3]
        );
        // Values outside the range are clipped, as the published robots' raw pixels were.
        assert_eq!(at(Material::SensorExpand, 0, 255.0), 1.6);
        assert_eq!(at(Material::SensorShrink, 0, 255.0), 0.6);
    }
}
