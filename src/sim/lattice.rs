//! [`Lattice`]: a body as points, springs and surface; fixed for a life.
//!
//! Points lie on a dense lattice, one per grid vertex of the body's bounding box, row-major from the top left with
//! a row pitch of width + 1; where two voxels touch only at a corner, the later voxel's point is an *extra* behind
//! the lattice. So each of the four spring families (sides and diagonals) joins points a fixed offset apart and
//! is a plain sweep over arrays; the few springs that end in an extra are kept in a list.

use super::params::Physics;
use crate::base::Grid;
use crate::body::{Body, Material};

/// Sides of a voxel in the order in which they are visited: top, right, bottom, left. Each runs clockwise, so
/// that its outward normal is its direction turned left.
pub(super) const SIDES: [(usize, usize); 4] = [(0, 1), (1, 2), (2, 3), (3, 0)];

/// Neighbouring cell across each side, in the order of [`SIDES`].
const ACROSS: [(isize, isize); 4] = [(-1, 0), (0, 1), (1, 0), (0, -1)];

/// Springs between points `from` and `to` places behind each slot; one slot per lattice point.
#[derive(Clone, Debug)]
pub(super) struct Family {
    /// Offset of the spring's first point from its slot.
    pub from: usize,
    /// Offset of its second point.
    pub to: usize,
    /// Length at rest [wu].
    pub length: f64,
    /// Stiffness per slot, 0 where there is no spring.
    pub stiffness: Vec<f64>,
    /// Least and greatest length before the limits act [wu]; 0 and ∞ where there is no spring.
    pub limits: (Vec<f64>, Vec<f64>),
}

/// A spring with an end at an extra point.
#[derive(Clone, Copy, Debug)]
pub(super) struct ExtraSpring {
    pub ends: [usize; 2],
    pub length: f64,
    pub stiffness: f64,
}

/// A horizontal side that active voxels actuate.
#[derive(Clone, Copy, Debug)]
pub(super) struct ActuatedSide {
    /// Index into the goals: a slot of the horizontal family, or (number of slots + index of the extra spring).
    pub goal: usize,
    /// The one or two active voxels that share it, as indices into [`Lattice::active`].
    pub voxels: [usize; 2],
}

/// A voxel that actuates.
#[derive(Clone, Copy, Debug)]
pub(super) struct ActiveVoxel {
    pub material: Material,
    /// Its place in the body, and so its pixel.
    pub place: (usize, usize),
}

/// A voxel with a side to the outside.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurfaceVoxel {
    pub row: usize,
    pub column: usize,
    /// Its points clockwise from the top left.
    pub corners: [usize; 4],
    /// Which of its sides are on the surface, in the order of [`SIDES`].
    pub exposed: [bool; 4],
}

/// A body's points, springs and surface.
#[derive(Clone, Debug)]
pub struct Lattice {
    /// Slots of the dense lattice.
    pub(super) slots: usize,
    /// Length of all per-point arrays: slots, room for the sweeps to run over, extras.
    pub(super) len: usize,
    /// Horizontal, vertical, falling and rising diagonals.
    pub(super) families: [Family; 4],
    pub(super) extra_springs: Vec<ExtraSpring>,
    pub(super) actuated: Vec<ActuatedSide>,
    pub(super) active: Vec<ActiveVoxel>,
    /// Sides of rigid voxels in the order of the rigid pass.
    pub(super) rigid_links: Vec<[usize; 2]>,
    pub(super) surface: Vec<SurfaceVoxel>,
    /// Grid vertex (row, column) in the body of every point that exists, in EvoGym's order of creation.
    pub(super) points: Vec<(usize, (usize, usize))>,
    /// Non-empty voxels, row-major, with their points clockwise from the top left.
    pub(super) voxels: Vec<((usize, usize), [usize; 4])>,
    /// Rows of the body, empty ones included.
    pub(super) body_rows: usize,
}

impl Lattice {
    /// The lattice of a body.
    pub fn new(body: &Body, physics: &Physics) -> Self {
        let voxels = numbered_voxels(body);
        let pitch = voxels.pitch;
        let slots = voxels.slots;
        let length = physics.cell_size;
        let diagonal = length * std::f64::consts::SQRT_2;
        let family = |from, to, length| Family {
            from,
            to,
            length,
            stiffness: vec![0.0; slots],
            limits: (vec![0.0; slots], vec![f64::INFINITY; slots]),
        };
        let mut lattice = Lattice {
            slots,
            len: voxels.len,
            families: [
                family(0, 1, length),
                family(0, pitch, length),
                family(0, pitch + 1, diagonal),
                family(1, pitch, diagonal),
            ],
            extra_springs: Vec::new(),
            actuated: Vec::new(),
            active: Vec::new(),
            rigid_links: Vec::new(),
            surface: surface_voxels(body, &voxels.list),
            points: Vec::new(),
            voxels: voxels.list,
            body_rows: body.height(),
        };
        lattice.add_points();
        lattice.add_springs(body, physics);
        lattice.add_actuation(body);
        lattice
    }

    /// Number of points.
    pub fn point_count(&self) -> usize {
        self.points.len()
    }

    /// Number of voxels that are not empty.
    pub fn voxel_count(&self) -> usize {
        self.voxels.len()
    }

    /// Every point once, in EvoGym's order of creation: voxels row-major; in a voxel top left, top right,
    /// bottom left, bottom right.
    fn add_points(&mut self) {
        let mut known = vec![false; self.len];
        for ((row, column), corners) in &self.voxels {
            for (corner, down, right) in [(0, 0, 0), (1, 0, 1), (3, 1, 0), (2, 1, 1)] {
                let point = corners[corner];
                if !std::mem::replace(&mut known[point], true) {
                    self.points.push((point, (row + down, column + right)));
                }
            }
        }
    }

    fn add_springs(&mut self, body: &Body, physics: &Physics) {
        for (place, corners) in self.voxels.clone() {
            let material = body.voxels()[place];
            let (side, ratio) = match material {
                Material::Rigid => (physics.rigid_stiffness, physics.rigid_diagonal_ratio),
                Material::Soft => (physics.soft_stiffness, physics.soft_diagonal_ratio),
                _ => (physics.active_stiffness, physics.active_diagonal_ratio),
            };
            let [tl, tr, br, bl] = corners;
            // Voxels come row-major, so a later one overwrites; a rigid one only where there is no spring yet
            // (physics.md: start from the rigid value, every non-rigid cell overwrites).
            let keep = material == Material::Rigid;
            let sides = [[tl, tr], [tr, br], [bl, br], [tl, bl]];
            for (ends, family) in sides.into_iter().zip([0, 1, 0, 1]) {
                self.set_spring(physics, family, ends, side, keep);
            }
            self.set_spring(physics, 2, [tl, br], side * ratio, false);
            self.set_spring(physics, 3, [tr, bl], side * ratio, false);
            if material == Material::Rigid {
                self.rigid_links.extend(SIDES.map(|(a, b)| [corners[a], corners[b]]));
            }
        }
    }

    fn set_spring(&mut self, physics: &Physics, family: usize, ends: [usize; 2], stiffness: f64, keep: bool) {
        let family = &mut self.families[family];
        let slot = ends[0].wrapping_sub(family.from);
        let is_regular = slot < self.slots && ends[0] < self.slots && ends[1] == slot + family.to;
        if is_regular {
            if !keep || family.stiffness[slot] == 0.0 {
                family.stiffness[slot] = stiffness;
            }
            family.limits.0[slot] = physics.limit_low * family.length;
            family.limits.1[slot] = physics.limit_high * family.length;
            return;
        }
        match self.extra_springs.iter_mut().find(|spring| spring.ends == ends) {
            Some(spring) if !keep => spring.stiffness = stiffness,
            Some(_) => {}
            None => self.extra_springs.push(ExtraSpring { ends, length: family.length, stiffness }),
        }
    }

    fn add_actuation(&mut self, body: &Body) {
        let mut owner = std::collections::BTreeMap::new();
        for &(place, [tl, tr, br, bl]) in &self.voxels {
            let material = body.voxels()[place];
            if !material.is_active() {
                continue;
            }
            let voxel = self.active.len();
            self.active.push(ActiveVoxel { material, place });
            for ends in [[tl, tr], [bl, br]] {
                let extra = self.extra_springs.iter().position(|spring| spring.ends == ends);
                let goal = extra.map_or(ends[0], |index| self.slots + index);
                owner.entry(goal).or_insert([voxel, voxel])[1] = voxel;
            }
        }
        self.actuated = owner.into_iter().map(|(goal, voxels)| ActuatedSide { goal, voxels }).collect();
    }
}

struct NumberedVoxels {
    list: Vec<((usize, usize), [usize; 4])>,
    pitch: usize,
    slots: usize,
    len: usize,
}

/// The voxels with the numbers of their points.
fn numbered_voxels(body: &Body) -> NumberedVoxels {
    let filled: Vec<_> = body.voxels().iter().filter(|(_, m)| !m.is_empty()).map(|(p, _)| p).collect();
    let least = |f: fn(&(usize, usize)) -> usize| filled.iter().map(f).min().unwrap_or(0);
    let most = |f: fn(&(usize, usize)) -> usize| filled.iter().map(f).max().unwrap_or(0);
    let (top, left) = (least(|p| p.0), least(|p| p.1));
    let pitch = most(|p| p.1) - left + 2;
    let slots = (most(|p| p.0) - top + 2) * pitch;
    // Sweeps read up to `pitch + 1` behind the last slot.
    let mut len = slots + pitch + 1;
    let mut extra = Grid::filled(body.height() + 1, body.width() + 1, None);
    let mut list = Vec::with_capacity(filled.len());
    for (row, column) in filled {
        let corner = |down: usize, right: usize, extra: &mut Grid<Option<usize>>, len: &mut usize| {
            let (r, c) = (row + down, column + right);
            let at = |dr: isize, dc: isize| !body.at(r as isize + dr, c as isize + dc).is_empty();
            let falling = at(-1, -1) && at(0, 0) && !at(-1, 0) && !at(0, -1);
            let rising = at(-1, 0) && at(0, -1) && !at(-1, -1) && !at(0, 0);
            // Of two voxels that touch only here the lower one, for which the vertex is a top corner, is later.
            if (falling || rising) && down == 0 {
                *extra[(r, c)].get_or_insert_with(|| {
                    *len += 1;
                    *len - 1
                })
            } else {
                (r - top) * pitch + (c - left)
            }
        };
        let mut number = |down, right| corner(down, right, &mut extra, &mut len);
        let corners = [number(0, 0), number(0, 1), number(1, 1), number(1, 0)];
        list.push(((row, column), corners));
    }
    NumberedVoxels { list, pitch, slots, len }
}

fn surface_voxels(body: &Body, voxels: &[((usize, usize), [usize; 4])]) -> Vec<SurfaceVoxel> {
    let voxel = |&((row, column), corners): &((usize, usize), [usize; 4])| {
        let exposed =
            ACROSS.map(|(down, right)| body.at(row as isize + down, column as isize + right).is_empty());
        exposed.contains(&true).then_some(SurfaceVoxel { row, column, corners, exposed })
    };
    voxels.iter().filter_map(voxel).collect()
}
