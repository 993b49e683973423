//! [`Physics`]: every constant of the simulator, with unit, default and section of physics.md.

/// Most substeps in a control step. With this many, a control step of a body of 64 × 64 voxels
/// takes about a quarter of a second.
pub const MOST_SUBSTEPS: u32 = 1000;

/// Most control steps in an actuation cycle.
pub const MOST_CYCLE_STEPS: u32 = 100_000;

/// Highest row of the ground \[grid rows\].
pub const MOST_ROWS: u32 = 1_000_000;

/// Greatest `Physics::blow_up_extent` \[voxel lengths\]: contacts search all cells under a voxel.
pub const MOST_CELLS: u32 = 1000;

/// The constants of the physics, each with the title of its section of physics.md. Defaults are
/// those of EvoGym's simulator v2.2.5.
///
/// Units: a *world unit* (wu) is ten voxel lengths; masses are in units of a point's mass; a
/// *second* is 10⁴ default substeps.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
pub struct Physics {
    /// Side of a voxel at rest \[wu\]. (Units)
    pub cell_size: f64,
    /// Mass of every point \[mass\]. (Units)
    pub mass: f64,
    /// Duration of a substep \[s\]. Much above 1e-4 the stiffest springs make RK4 unstable. (Units)
    pub time_step: f64,
    /// Substeps in a control step. (Units)
    pub substeps: u32,
    /// Control steps in an actuation cycle; the sine's period is one less. (Units; Actuation)
    pub cycle_steps: u32,

    /// Stiffness of a rigid voxel's sides \[mass/s²\]. (Points and springs)
    pub rigid_stiffness: f64,
    /// Stiffness of a soft voxel's sides \[mass/s²\]. (Points and springs)
    pub soft_stiffness: f64,
    /// Stiffness of a muscle's or sensor's sides \[mass/s²\]. (Points and springs)
    pub active_stiffness: f64,
    /// Stiffness of a rigid voxel's diagonals, relative to its sides. (Points and springs)
    pub rigid_diagonal_ratio: f64,
    /// Stiffness of a soft voxel's diagonals, relative to its sides. (Points and springs)
    pub soft_diagonal_ratio: f64,
    /// Stiffness of a muscle's or sensor's diagonals, relative to its sides. (Points and springs)
    pub active_diagonal_ratio: f64,

    /// Least target width of an active voxel \[rest widths\]; clips smaller ones. (Actuation)
    pub target_min: f64,
    /// Greatest target width of an active voxel \[rest widths\]; clips larger ones. (Actuation)
    pub target_max: f64,
    /// Muscle's target at the trough of its sine \[rest widths\]. (Actuation)
    pub muscle_low: f64,
    /// Muscle's target at the sine's crest minus that at its trough \[rest widths\]. (Actuation)
    pub muscle_swing: f64,
    /// Phase of the antiphase muscles \[rad\]. (Actuation)
    pub antiphase: f64,
    /// Target of a shrinking sensor on a dark pixel \[rest widths\]. (Actuation)
    pub sensor_shrink_dark: f64,
    /// Target of an expanding sensor on a dark pixel \[rest widths\]. (Actuation)
    pub sensor_expand_dark: f64,
    /// Change of a sensor's target from a dark to a bright pixel \[rest widths\]. (Actuation)
    pub sensor_swing: f64,
    /// Fraction of the distance from its current length to its goal that a spring's rest length
    /// moves in a substep. (One substep, 2)
    pub servo_gain: f64,

    /// Drag on a point \[mass/s\]. (One substep, 3)
    pub drag: f64,
    /// Downward acceleration \[wu/s²\]. (One substep, 3)
    pub gravity: f64,

    /// Greatest length of a spring \[rest lengths\]; longer ones are shortened. (One substep, 4a)
    pub limit_high: f64,
    /// Least length of a spring \[rest lengths\]; shorter ones are lengthened. (One substep, 4a)
    pub limit_low: f64,
    /// Fraction of the excess that the pass removes. (One substep, 4a)
    pub limit_share: f64,
    /// Greatest length of a rigid voxel's sides \[rest lengths\]. (One substep, 4b)
    pub rigid_limit_high: f64,
    /// Least length of a rigid voxel's sides \[rest lengths\]. (One substep, 4b)
    pub rigid_limit_low: f64,
    /// Fraction of the excess that one visit removes. (One substep, 4b)
    pub rigid_limit_share: f64,

    /// Contact force per depth \[mass/s²\]. (Contacts)
    pub contact_stiffness: f64,
    /// Depth added to that of every contact \[wu\]. (Contacts)
    pub contact_offset: f64,
    /// Damping of a contact along its normal \[mass/s\]; the edge's two ends share it. (Contacts)
    pub contact_damping: f64,
    /// Friction coefficient of contacts \[1\]. (Contacts, G)
    pub friction: f64,
    /// Slip at which friction saturates, per normal force \[s/mass\]. (Contacts, G)
    pub friction_slip: f64,
    /// Cross product below which two segments count as parallel \[wu²\]. (Contacts, crossing)
    pub crossing_epsilon: f64,
    /// Weight of a contact of the robot with itself; 2 as EvoGym visits ordered pairs. (Contacts)
    pub self_contact_weight: f64,

    /// Top of the ground \[grid rows\]; the ground is one cell thick. (World)
    pub ground_row: u32,
    /// Columns between pegs below the ground; a peg covers the underside of a cell. (World)
    pub peg_spacing: u32,
    /// Stiffness of the floor plane at y = 0 \[mass/s²\]. (World)
    pub floor_stiffness: f64,
    /// Friction coefficient of the floor plane \[1\]. (World)
    pub floor_friction: f64,
    /// Slope of the floor's friction over velocity, per normal force \[s³/(mass·wu²)\]. (World)
    pub floor_slip: f64,

    /// Threshold of instability: a simulation is unstable if more ordered pairs of distant surface
    /// voxels overlap than this times the number of surface voxels. (Instability)
    pub unstable_ratio: f64,
    /// Greatest width or height of a voxel \[wu\]; beyond it the simulation is unstable. Ours:
    /// EvoGym continues, but no body that still hangs together comes near. (Instability)
    pub blow_up_extent: f64,
}

impl Default for Physics {
    fn default() -> Self {
        Physics {
            cell_size: 0.1,
            mass: 1.0,
            time_step: 1e-4,
            substeps: 30,
            cycle_steps: 50,
            rigid_stiffness: 3e8 / 3.5,
            soft_stiffness: 3e8 / 6.0,
            active_stiffness: 3e8 / 5.0,
            rigid_diagonal_ratio: 0.5,
            soft_diagonal_ratio: 0.25,
            active_diagonal_ratio: 0.5,
            target_min: 0.6,
            target_max: 1.6,
            muscle_low: 0.6,
            muscle_swing: 1.0,
            antiphase: std::f64::consts::PI,
            sensor_shrink_dark: 1.6,
            sensor_expand_dark: 0.6,
            sensor_swing: 1.0,
            servo_gain: 0.006,
            drag: 0.1,
            gravity: 110.0,
            limit_high: 1.25,
            limit_low: 0.75,
            limit_share: 0.8,
            rigid_limit_high: 1.03,
            rigid_limit_low: 0.97,
            rigid_limit_share: 0.5,
            contact_stiffness: 2.1e6,
            contact_offset: 0.005,
            contact_damping: 140.0,
            friction: 240.0,
            friction_slip: 0.2,
            crossing_epsilon: 1e-4,
            self_contact_weight: 2.0,
            ground_row: 2,
            peg_spacing: 6,
            floor_stiffness: 1.4e7,
            floor_friction: 2.0,
            floor_slip: 0.2,
            unstable_ratio: 1.0,
            blow_up_extent: 10.0,
        }
    }
}

/// A constant for which the physics is not defined.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name} = {value}: expected {expected}")]
pub struct PhysicsError {
    /// Name of the constant.
    pub name: &'static str,
    /// Value found.
    pub value: f64,
    /// Values that are possible.
    pub expected: &'static str,
}

impl Physics {
    /// Checks that each constant is in range and that they fit together.
    ///
    /// # Errors
    /// Returns the first constant that is out of range.
    pub fn validate(&self) -> Result<(), PhysicsError> {
        let positive = [
            ("cell_size", self.cell_size),
            ("mass", self.mass),
            ("time_step", self.time_step),
            ("servo_gain", self.servo_gain),
            ("friction_slip", self.friction_slip),
            ("blow_up_extent", self.blow_up_extent),
            ("limit_high", self.limit_high),
            ("rigid_limit_high", self.rigid_limit_high),
            ("target_min", self.target_min),
        ];
        let not_negative = [
            ("rigid_stiffness", self.rigid_stiffness),
            ("soft_stiffness", self.soft_stiffness),
            ("active_stiffness", self.active_stiffness),
            ("rigid_diagonal_ratio", self.rigid_diagonal_ratio),
            ("soft_diagonal_ratio", self.soft_diagonal_ratio),
            ("active_diagonal_ratio", self.active_diagonal_ratio),
            ("drag", self.drag),
            ("limit_low", self.limit_low),
            ("limit_share", self.limit_share),
            ("rigid_limit_low", self.rigid_limit_low),
            ("rigid_limit_share", self.rigid_limit_share),
            ("contact_stiffness", self.contact_stiffness),
            ("contact_offset", self.contact_offset),
            ("contact_damping", self.contact_damping),
            ("friction", self.friction),
            ("crossing_epsilon", self.crossing_epsilon),
            ("self_contact_weight", self.self_contact_weight),
            ("floor_stiffness", self.floor_stiffness),
            ("floor_friction", self.floor_friction),
            ("floor_slip", self.floor_slip),
            ("unstable_ratio", self.unstable_ratio),
        ];
        let finite = [
            ("gravity", self.gravity),
            ("target_max", self.target_max),
            ("muscle_low", self.muscle_low),
            ("muscle_swing", self.muscle_swing),
            ("antiphase", self.antiphase),
            ("sensor_shrink_dark", self.sensor_shrink_dark),
            ("sensor_expand_dark", self.sensor_expand_dark),
            ("sensor_swing", self.sensor_swing),
        ];
        let check = |list: &[(&'static str, f64)], good: fn(f64) -> bool, expected| {
            let bad = list.iter().find(|(_, v)| !v.is_finite() || !good(*v));
            bad.map_or(Ok(()), |&(name, value)| {
                Err(PhysicsError {
                    name,
                    value,
                    expected,
                })
            })
        };
        check(&positive, |v| v > 0.0, "a finite number above 0")?;
        check(&not_negative, |v| v >= 0.0, "a finite number, 0 or above")?;
        check(&finite, |_| true, "a finite number")?;
        let counts = [
            (
                "substeps",
                self.substeps,
                1..=MOST_SUBSTEPS,
                "a whole number from 1 to 1000",
            ),
            (
                "cycle_steps",
                self.cycle_steps,
                2..=MOST_CYCLE_STEPS,
                "a whole number from 2 to 100000",
            ),
            (
                "ground_row",
                self.ground_row,
                1..=MOST_ROWS,
                "a whole number from 1 to 1000000",
            ),
            (
                "peg_spacing",
                self.peg_spacing,
                1..=u32::MAX,
                "a whole number from 1",
            ),
        ];
        let bad = counts
            .iter()
            .find(|(_, count, range, _)| !range.contains(count));
        bad.map_or(Ok(()), |(name, count, _, expected)| {
            Err(PhysicsError {
                name,
                value: f64::from(*count),
                expected,
            })
        })?;
        if self.blow_up_extent > f64::from(MOST_CELLS) * self.cell_size {
            let expected = "at most 1000 times cell_size";
            return Err(PhysicsError {
                name: "blow_up_extent",
                value: self.blow_up_extent,
                expected,
            });
        }
        let ordered = [
            (
                "target_max",
                self.target_max,
                self.target_min,
                "a number not below target_min",
            ),
            (
                "limit_high",
                self.limit_high,
                self.limit_low,
                "a number not below limit_low",
            ),
            (
                "rigid_limit_high",
                self.rigid_limit_high,
                self.rigid_limit_low,
                "not below rigid_limit_low",
            ),
        ];
        let bad = ordered.iter().find(|(_, high, low, _)| high < low);
        bad.map_or(Ok(()), |&(name, value, _, expected)| {
            Err(PhysicsError {
                name,
                value,
                expected,
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid() {
        let physics = Physics::default();
        physics.validate().unwrap();
    }

    #[cfg(feature = "serde")]
    #[test]
    fn constants_survive_json() {
        let physics = Physics::default();
        let text = serde_json::to_string(&physics).unwrap();
        assert_eq!(serde_json::from_str::<Physics>(&text).unwrap(), physics);
    }

    #[test]
    fn senseless_constants_are_named() {
        let refused = |change: fn(&mut Physics)| {
            let mut physics = Physics::default();
            change(&mut physics);
            physics.validate().unwrap_err().name
        };
        assert_eq!(refused(|p| p.time_step = 0.0), "time_step");
        assert_eq!(refused(|p| p.gravity = f64::NAN), "gravity");
        assert_eq!(refused(|p| p.cycle_steps = 1), "cycle_steps");
        assert_eq!(refused(|p| p.target_max = 0.5), "target_max");
        // These would make a substep, or a control step, endless.
        assert_eq!(refused(|p| p.blow_up_extent = 1e10), "blow_up_extent");
        assert_eq!(refused(|p| p.cell_size = 1e-6), "blow_up_extent");
        assert_eq!(refused(|p| p.substeps = 4_000_000_000), "substeps");
        assert_eq!(refused(|p| p.cycle_steps = u32::MAX), "cycle_steps");
        assert_eq!(refused(|p| p.ground_row = u32::MAX), "ground_row");
    }
}
