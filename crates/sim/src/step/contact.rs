//! Contacts of surface voxels with the ground and with each other (physics.md, "Contacts").
//!
//! The ground never moves, so it is not simulated: flat ground's cells are computed where a voxel
//! meets it, those of a terrain looked up.

use crate::lattice::{Lattice, SIDES, SurfaceVoxel};
use crate::physics::{MOST_CELLS, Physics};
use crate::state::{Pair, State, X, Y};
use crate::step::broad_phase::{BroadPhase, Candidate, place, quad};
use crate::step::geometry::{Bounds, Vector, cross, inside};
use crate::system::System;
use crate::terrain::{Ground, Terrain};

/// For each corner (clockwise from the top left), the far ends of the two sides that meet there.
const FAR_ENDS: [[usize; 2]; 4] = [[1, 3], [0, 2], [3, 1], [2, 0]];

/// A point this far out of a voxel's box \[wu\] is not inside, despite the exact test's rounding.
const CLEAR: f64 = 1e-9;

/// Most columns that a voxel spans: the widest's, and room for motion since the last check.
const MOST_COLUMNS: i64 = MOST_CELLS as i64 + 8;

/// The edge of a voxel that pushes a point out.
struct Edge {
    /// Its ends as indices of the host's corners.
    ends: (usize, usize),
    /// Outward unit normal.
    normal: Vector,
    /// Distance of the point from the edge's line \[wu\].
    depth: f64,
}

/// Returns the exposed edge of `host` nearest to `p` among those that cross a side of the mover at
/// `p`; the first wins a tie.
fn nearest_edge(
    p: Vector,
    far_ends: [Vector; 2],
    host: &[Vector; 4],
    exposed: &[bool; 4],
    physics: &Physics,
) -> Option<Edge> {
    let mut nearest: Option<Edge> = None;
    for (side, &ends) in SIDES.iter().enumerate() {
        let (a, b) = (host[ends.0], host[ends.1]);
        let crossed = |far: Vector| cross(a, b, p, far, physics.crossing_epsilon);
        if !exposed[side] || !(crossed(far_ends[0]) || crossed(far_ends[1])) {
            continue;
        }
        let along = b - a;
        let length = along.norm();
        let depth = along.perp(p - a).abs() / length;
        if nearest.as_ref().is_none_or(|edge| depth < edge.depth) {
            let unit = along / length;
            nearest = Some(Edge {
                ends,
                normal: Vector::new(-unit.y, unit.x),
                depth,
            });
        }
    }
    nearest
}

/// The force on a point that an edge pushes out, without damping; its parts act on the edge's ends.
struct Push {
    on_point: Vector,
    normal_force: f64,
    friction: Vector,
}

fn push(edge: &Edge, velocity: Vector, physics: &Physics) -> Push {
    let n = edge.normal;
    let force = physics.contact_stiffness * (physics.contact_offset + edge.depth);
    // The sign of the tangent does not matter: flipping it flips the slip, and tanh is odd.
    let tangent = Vector::new(-n.y, n.x);
    let slip = tangent.dot(velocity);
    // No force, no friction, although 0/0 is NaN.
    let grip = if force > 0.0 {
        physics.friction * force * libm::tanh(slip / (physics.friction_slip * force))
    } else {
        0.0
    };
    let friction = tangent * grip;
    let on_point = n * (force - physics.contact_damping * n.dot(velocity)) - friction;
    Push {
        on_point,
        normal_force: force,
        friction,
    }
}

/// Returns the force on an end of the edge: half of the reaction, and damping of its own motion.
fn reaction(edge: &Edge, push: &Push, velocity: Vector, physics: &Physics) -> Vector {
    let n = edge.normal;
    let along = -push.normal_force / 2.0 - physics.contact_damping / 2.0 * n.dot(velocity);
    n * along + push.friction / 2.0
}

pub(crate) fn add_contacts(
    System { lattice, physics }: &System,
    ground: Ground,
    state: &State,
    broad_phase: &BroadPhase,
    contact: &mut Pair,
) {
    let mut contacts = Contacts {
        lattice,
        physics,
        state,
        contact,
    };
    match ground.terrain {
        None => {
            for &voxel in &broad_phase.low {
                contacts.with_ground(&lattice.surface[voxel], ground.start_column);
            }
        }
        Some(terrain) => {
            for &voxel in &broad_phase.low {
                contacts.with_terrain(&lattice.surface[voxel], terrain, ground.start_column);
            }
        }
    }
    for candidate in &broad_phase.candidates {
        contacts.with_self(*candidate);
    }
}

struct Contacts<'a> {
    lattice: &'a Lattice,
    physics: &'a Physics,
    state: &'a State,
    contact: &'a mut Pair,
}

impl Contacts<'_> {
    /// Returns the true velocity of a point \[wu/s\], which includes what the limits moved.
    fn velocity(&self, point: usize) -> Vector {
        let moved =
            |axis: usize| self.state.position[axis][point] - self.state.previous[axis][point];
        Vector::new(moved(X), moved(Y)) / self.physics.time_step
    }

    fn add(&mut self, point: usize, force: Vector) {
        self.contact[X][point] += force.x;
        self.contact[Y][point] += force.y;
    }

    fn with_self(&mut self, candidate: Candidate) {
        let (mover, host) = (
            &self.lattice.surface[candidate.mover],
            &self.lattice.surface[candidate.host],
        );
        let host_quad = quad(host, self.state);
        let point = mover.corners[candidate.corner];
        let p = place(point, self.state);
        let host_bounds = Bounds::of(&host_quad);
        if !host_bounds.holds(p, CLEAR) || !inside(p, &host_quad) {
            return;
        }
        let mover_quad = quad(mover, self.state);
        if !Bounds::of(&mover_quad).near(&host_bounds, 0.0) {
            return;
        }
        let far_ends = FAR_ENDS[candidate.corner].map(|far| mover_quad[far]);
        if let Some(edge) = nearest_edge(p, far_ends, &host_quad, &host.exposed, self.physics) {
            let push = push(&edge, self.velocity(point), self.physics);
            let weight = self.physics.self_contact_weight;
            self.add(point, push.on_point * weight);
            self.react(host, &edge, &push, weight);
        }
    }

    fn react(&mut self, host: &SurfaceVoxel, edge: &Edge, push: &Push, weight: f64) {
        for end in [edge.ends.0, edge.ends.1] {
            let point = host.corners[end];
            let force = reaction(edge, push, self.velocity(point), self.physics);
            self.add(point, force * weight);
        }
    }

    /// Adds a surface voxel's contacts with every ground cell whose box meets its own, both ways.
    fn with_ground(&mut self, voxel: &SurfaceVoxel, start_column: i64) {
        let (physics, cell) = (self.physics, self.physics.cell_size);
        let (top, bottom) = (
            f64::from(physics.ground_row) * cell,
            f64::from(physics.ground_row - 1) * cell,
        );
        let robot = quad(voxel, self.state);
        let bounds = Bounds::of(&robot);
        if bounds.low.y > top || bounds.high.y < bottom {
            return;
        }
        let vertex = |column: i64| column as f64 * cell;
        let first = ((bounds.low.x / cell).floor() as i64).saturating_sub(1);
        let last = ((bounds.high.x / cell).floor() as i64).saturating_add(1);
        // With valid physics a wider voxel has blown up; the bound ends the loop for any physics.
        for column in first..=last.min(first.saturating_add(MOST_COLUMNS)) {
            let (left, right) = (vertex(column), vertex(column.saturating_add(1)));
            if left > bounds.high.x || right < bounds.low.x {
                continue;
            }
            let ground = [(left, top), (right, top), (right, bottom), (left, bottom)];
            let ground = ground.map(|(x, y)| Vector::new(x, y));
            let has_peg = start_column
                .wrapping_add(column)
                .rem_euclid(i64::from(physics.peg_spacing))
                == 0;
            self.with_cell(
                voxel,
                (&robot, &bounds),
                &ground,
                &[true, false, !has_peg, false],
            );
        }
    }

    /// Adds a surface voxel's contacts with every surface cell of a terrain whose box meets its
    /// own, both ways.
    fn with_terrain(&mut self, voxel: &SurfaceVoxel, terrain: &Terrain, start_column: i64) {
        let cell_size = self.physics.cell_size;
        let origin = start_column as f64 * cell_size;
        let robot = quad(voxel, self.state);
        let bounds = Bounds::of(&robot);
        terrain.near(&bounds, start_column, (cell_size, 0.0), |cell| {
            let (left, right) = (cell.left - origin, cell.right - origin);
            let (top, bottom) = (cell.top, cell.bottom);
            if left > bounds.high.x
                || right < bounds.low.x
                || bottom > bounds.high.y
                || top < bounds.low.y
            {
                return;
            }
            let ground = [(left, top), (right, top), (right, bottom), (left, bottom)];
            let ground = ground.map(|(x, y)| Vector::new(x, y));
            self.with_cell(voxel, (&robot, &bounds), &ground, &cell.exposed);
        });
    }

    /// Adds a surface voxel's contacts with a cell of the ground, both ways.
    #[inline(always)]
    fn with_cell(
        &mut self,
        voxel: &SurfaceVoxel,
        (robot, bounds): (&[Vector; 4], &Bounds),
        ground: &[Vector; 4],
        exposed: &[bool; 4],
    ) {
        let physics = self.physics;
        let ground_bounds = Bounds {
            low: ground[3],
            high: ground[1],
        };
        for corner in 0..4 {
            let far = |quad: &[Vector; 4]| FAR_ENDS[corner].map(|end| quad[end]);
            let (p, g) = (robot[corner], ground[corner]);
            if ground_bounds.holds(p, CLEAR)
                && inside(p, ground)
                && let Some(edge) = nearest_edge(p, far(robot), ground, exposed, physics)
            {
                let point = voxel.corners[corner];
                let push = push(&edge, self.velocity(point), physics);
                self.add(point, push.on_point);
            }
            if bounds.holds(g, CLEAR)
                && inside(g, robot)
                && let Some(edge) = nearest_edge(g, far(ground), robot, &voxel.exposed, physics)
            {
                let push = push(&edge, Vector::ZERO, physics);
                self.react(voxel, &edge, &push, 1.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Start, UnstableReason, World};

    #[test]
    fn a_voxel_that_reaches_over_any_number_of_cells_is_soon_done_with() {
        // Not valid: in these physics nothing blows up.
        let physics = Physics {
            blow_up_extent: 1e10,
            time_step: 0.5,
            ..Physics::default()
        };
        let system = System::new(&"3".parse().unwrap(), physics);
        let mut world = World::new(
            system,
            Start {
                column: 493,
                row: 2,
            },
        );
        let begin = std::time::Instant::now();
        let ended = (0..2).try_for_each(|_| world.step());
        assert!(
            begin.elapsed().as_secs() < 5,
            "{ended:?} after {:?}",
            begin.elapsed()
        );
    }

    #[test]
    fn a_heap_of_voxels_within_each_other_is_unstable_whatever_the_ratio() {
        // Springs as long as their goals, up to 90 voxel lengths.
        let physics = Physics {
            unstable_ratio: 1e9,
            limit_low: 0.01,
            limit_high: 90.0,
            target_max: 90.0,
            muscle_swing: 90.0,
            servo_gain: 0.1,
            ..Physics::default()
        };
        physics.validate().unwrap();
        let comb: Vec<String> = (0..64)
            .map(|row| {
                if row == 0 {
                    "34".repeat(32)
                } else {
                    "30".repeat(32)
                }
            })
            .collect();
        let system = System::new(&comb.join("/").parse().unwrap(), physics);
        let mut world = World::new(
            system,
            Start {
                column: 493,
                row: 2,
            },
        );
        let ended = (0..5).find_map(|_| world.step().err());
        assert_eq!(
            ended.map(|unstable| unstable.reason),
            Some(UnstableReason::Overlaps)
        );
    }
}
