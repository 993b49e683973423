//! [`Lattice`]: a body as points, springs and surface.
//!
//! Points lie on a dense lattice: one slot per grid vertex of the body's bounding box, row-major
//! from the top left, with a fixed row pitch. Where two voxels touch only at a corner, the later
//! voxel's point is an *off-lattice point* behind the lattice. So each of the four spring families
//! (sides and diagonals) joins points a fixed offset apart and is a plain sweep over arrays. The
//! few springs that end in an off-lattice point are kept in a list.

use crate::body::{Body, Material};
use crate::grid::Grid;
use crate::physics::Physics;
use crate::simd::{BLOCK, Buffer};
use std::collections::BTreeMap;
use std::ops::Range;

/// Sides of a voxel as visited: top, right, bottom, left; clockwise, so the normal is to the left.
pub(crate) const SIDES: [(usize, usize); 4] = [(0, 1), (1, 2), (2, 3), (3, 0)];

/// Neighbouring cell across each side, in the order of [`SIDES`].
const ACROSS: [(isize, isize); 4] = [(-1, 0), (0, 1), (1, 0), (0, -1)];

/// Number of off-lattice springs computed together.
pub(crate) const GROUP: usize = FAMILIES * BLOCK;

/// Number of spring families: horizontal, vertical, falling and rising diagonals.
pub(crate) const FAMILIES: usize = 4;

/// Returns the index of a slot's spring: by blocks of slots, then by families, as sweeps read them.
#[inline(always)]
pub(crate) fn spring_index(slot: usize, family: usize) -> usize {
    (slot / BLOCK * FAMILIES + family) * BLOCK + slot % BLOCK
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct OffLatticeSpring {
    pub ends: [usize; 2],
    pub length: f64,
    pub stiffness: f64,
}

/// A side actuated by active voxels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ActuatedSide {
    /// Index into the goals of its direction: a spring's slot, or `len` + index off the lattice.
    pub goal: usize,
    /// The one or two active voxels that share it, as indices into [`Lattice::active`].
    pub voxels: [usize; 2],
}

/// A voxel with actuated sides.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ActiveVoxel {
    pub material: Material,
    /// Position in the body, and so the position of its pixel.
    pub place: (usize, usize),
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceVoxel {
    pub row: usize,
    pub column: usize,
    /// Its points clockwise from the top left.
    pub corners: [usize; 4],
    /// True for each side on the surface, in the order of [`SIDES`].
    pub exposed: [bool; 4],
}

#[derive(Clone, Debug)]
pub(crate) struct Lattice {
    /// Number of slots from one row to the next.
    pub(crate) pitch: usize,
    /// Number of slots of the lattice proper.
    lattice_slots: usize,
    /// Number of slots, off-lattice points included; a whole number of blocks.
    pub(crate) slots: usize,
    /// Length of all per-point arrays: the slots, and room for the sweeps to look ahead.
    pub(crate) len: usize,
    /// 1 where a slot has a point, 0 elsewhere.
    pub(crate) present: Buffer,
    /// Whole blocks of slots with a point or a spring; the others need no work.
    pub(crate) active_ranges: Vec<Range<usize>>,
    /// Rest length of each family's springs \[wu\].
    pub(crate) lengths: [f64; FAMILIES],
    /// Stiffness of every spring ([`spring_index`]), 0 where there is none.
    pub(crate) stiffness: Buffer,
    /// Bit mask of every spring: all bits but the sign's, or 0 (see `Lanes::bits_and`).
    pub(crate) exists: Buffer,
    pub(crate) off_lattice_springs: Vec<OffLatticeSpring>,
    /// Horizontal sides, and those off the lattice in either direction.
    pub(crate) actuated: Vec<ActuatedSide>,
    /// Vertical sides on the lattice; empty without vertical actuators.
    pub(crate) actuated_vertical: Vec<ActuatedSide>,
    pub(crate) active: Vec<ActiveVoxel>,
    /// Sides of rigid voxels, in an order that gives the same results as the rigid pass's.
    pub(crate) rigid_links: Vec<[usize; 2]>,
    pub(crate) surface: Vec<SurfaceVoxel>,
    /// Every point with its grid vertex (row, column), in EvoGym's order of creation.
    pub(crate) points: Vec<(usize, (usize, usize))>,
    /// Non-empty voxels, row-major, with their points clockwise from the top left.
    pub(crate) voxels: Vec<((usize, usize), [usize; 4])>,
    /// Rows and columns of the body, empty ones included.
    pub(crate) body_rows: usize,
    pub(crate) body_columns: usize,
}

impl Lattice {
    pub fn new(body: &Body, physics: &Physics) -> Self {
        let voxels = numbered_voxels(body);
        let NumberedVoxels { pitch, slots, .. } = voxels;
        let length = physics.cell_size;
        let diagonal = length * std::f64::consts::SQRT_2;
        let mut lattice = Lattice {
            pitch,
            slots,
            // Sweeps look from a slot to the row below, one block ahead.
            len: slots + pitch + BLOCK,
            present: Buffer::zeros(slots + pitch + BLOCK),
            active_ranges: Vec::new(),
            lengths: [length, length, diagonal, diagonal],
            stiffness: Buffer::zeros(slots * FAMILIES),
            exists: Buffer::zeros(slots * FAMILIES),
            off_lattice_springs: Vec::new(),
            actuated: Vec::new(),
            actuated_vertical: Vec::new(),
            active: Vec::new(),
            rigid_links: Vec::new(),
            lattice_slots: voxels.lattice_slots,
            surface: surface_voxels(body, &voxels.list),
            points: Vec::new(),
            voxels: voxels.list,
            body_rows: body.height(),
            body_columns: body.width(),
        };
        lattice.add_points();
        lattice.add_springs(body, physics);
        lattice.add_actuation(body);
        lattice.rigid_links = in_rounds(&lattice.rigid_links, lattice.len);
        lattice.find_active_ranges();
        lattice
    }

    /// Lists every point once, in EvoGym's order of creation: voxels row-major; within a voxel top
    /// left, top right, bottom left, bottom right.
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
            // Voxels come row-major, so a later one overwrites. A rigid one does so only where
            // there is no spring yet (physics.md, "Points and springs").
            let keep = material == Material::Rigid;
            let sides = [[tl, tr], [tr, br], [bl, br], [tl, bl]];
            for (ends, family) in sides.into_iter().zip([0, 1, 0, 1]) {
                self.set_spring(family, ends, side, keep);
            }
            self.set_spring(2, [tl, br], side * ratio, false);
            self.set_spring(3, [tr, bl], side * ratio, false);
            if material == Material::Rigid {
                self.rigid_links
                    .extend(SIDES.map(|(a, b)| [corners[a], corners[b]]));
            }
        }
    }

    fn set_spring(&mut self, family: usize, ends: [usize; 2], stiffness: f64, keep: bool) {
        // Offsets from the slot to the spring's first and second point.
        let (from, to) = [
            (0, 1),
            (0, self.pitch),
            (0, self.pitch + 1),
            (1, self.pitch),
        ][family];
        let slot = ends[0].wrapping_sub(from);
        if slot < self.lattice_slots && ends[0] < self.lattice_slots && ends[1] == slot + to {
            let index = spring_index(slot, family);
            if !keep || self.exists[index].to_bits() == 0 {
                self.stiffness[index] = stiffness;
            }
            self.exists[index] = f64::from_bits(u64::MAX >> 1);
            return;
        }
        match self
            .off_lattice_springs
            .iter_mut()
            .find(|spring| spring.ends == ends)
        {
            Some(spring) if !keep => spring.stiffness = stiffness,
            Some(_) => {}
            None => self.off_lattice_springs.push(OffLatticeSpring {
                ends,
                length: self.lengths[family],
                stiffness,
            }),
        }
    }

    /// Returns the number of goals of horizontal springs and of those off the lattice, in whole
    /// groups.
    pub(crate) fn goal_count(&self) -> usize {
        self.len + self.off_lattice_springs.len() + GROUP
    }

    fn find_active_ranges(&mut self) {
        let mut used = vec![false; self.slots / BLOCK];
        for (point, _) in &self.points {
            self.present[*point] = 1.0;
            used[point / BLOCK] = true;
        }
        for slot in 0..self.slots {
            let exists = |family: &usize| self.exists[spring_index(slot, *family)].to_bits() != 0;
            if (0..FAMILIES).any(|family| exists(&family)) {
                used[slot / BLOCK] = true;
            }
            // All but vertical springs reach into the next column, perhaps of the next block.
            if [0, 2, 3].iter().any(exists) {
                used[(slot + 1) / BLOCK] = true;
            }
        }
        for (block, _) in used.into_iter().enumerate().filter(|(_, used)| *used) {
            let slots = block * BLOCK..(block + 1) * BLOCK;
            match self.active_ranges.last_mut() {
                Some(range) if range.end == slots.start => range.end = slots.end,
                _ => self.active_ranges.push(slots),
            }
        }
    }

    fn add_actuation(&mut self, body: &Body) {
        // A horizontal and a vertical side may begin in the same slot.
        let mut owners = [const { BTreeMap::new() }; 2];
        for &(place, [tl, tr, br, bl]) in &self.voxels {
            let material = body.voxels()[place];
            if !material.is_active() {
                continue;
            }
            let voxel = self.active.len();
            self.active.push(ActiveVoxel { material, place });
            let is_vertical = material == Material::ActuatorVertical;
            let sides = match is_vertical {
                true => [[tl, bl], [tr, br]],
                false => [[tl, tr], [bl, br]],
            };
            for ends in sides {
                let off_lattice = self
                    .off_lattice_springs
                    .iter()
                    .position(|spring| spring.ends == ends);
                let goal = off_lattice.map_or(ends[0], |index| self.len + index);
                let owner = &mut owners[usize::from(is_vertical && off_lattice.is_none())];
                owner.entry(goal).or_insert([voxel, voxel])[1] = voxel;
            }
        }
        [self.actuated, self.actuated_vertical] = owners.map(|owner: BTreeMap<_, _>| {
            let side = |(goal, voxels)| ActuatedSide { goal, voxels };
            owner.into_iter().map(side).collect()
        });
    }
}

struct NumberedVoxels {
    list: Vec<((usize, usize), [usize; 4])>,
    pitch: usize,
    lattice_slots: usize,
    slots: usize,
}

/// Numbers the points of all voxels.
fn numbered_voxels(body: &Body) -> NumberedVoxels {
    let filled: Vec<_> = body
        .voxels()
        .iter()
        .filter(|(_, m)| !m.is_empty())
        .map(|(p, _)| p)
        .collect();
    let least = |f: fn(&(usize, usize)) -> usize| filled.iter().map(f).min().unwrap_or(0);
    let most = |f: fn(&(usize, usize)) -> usize| filled.iter().map(f).max().unwrap_or(0);
    let (top, left) = (least(|p| p.0), least(|p| p.1));
    let (width, height) = (most(|p| p.1) - left + 2, most(|p| p.0) - top + 2);
    // Whole blocks per row are faster to work on, unless they add many slots.
    let padded = width.next_multiple_of(BLOCK);
    let pitch = if 4 * padded <= 5 * width {
        padded
    } else {
        width
    };
    let lattice_slots = height * pitch;
    let mut len = lattice_slots;
    let mut off_lattice = Grid::filled(body.height() + 1, body.width() + 1, None);
    let mut list = Vec::with_capacity(filled.len());
    for (row, column) in filled {
        let corner =
            |down: usize, right: usize, off_lattice: &mut Grid<Option<usize>>, len: &mut usize| {
                let (r, c) = (row + down, column + right);
                let at =
                    |dr: isize, dc: isize| !body.at(r as isize + dr, c as isize + dc).is_empty();
                let falling = at(-1, -1) && at(0, 0) && !at(-1, 0) && !at(0, -1);
                let rising = at(-1, 0) && at(0, -1) && !at(-1, -1) && !at(0, 0);
                // If two voxels touch only here, the later one has the vertex as a top corner.
                if (falling || rising) && down == 0 {
                    *off_lattice[(r, c)].get_or_insert_with(|| {
                        *len += 1;
                        *len - 1
                    })
                } else {
                    (r - top) * pitch + (c - left)
                }
            };
        let mut number = |down, right| corner(down, right, &mut off_lattice, &mut len);
        let corners = [number(0, 0), number(0, 1), number(1, 1), number(1, 0)];
        list.push(((row, column), corners));
    }
    NumberedVoxels {
        list,
        pitch,
        lattice_slots,
        slots: len.next_multiple_of(BLOCK),
    }
}

fn surface_voxels(body: &Body, voxels: &[((usize, usize), [usize; 4])]) -> Vec<SurfaceVoxel> {
    let voxel = |&((row, column), corners): &((usize, usize), [usize; 4])| {
        let exposed = ACROSS.map(|(down, right)| {
            body.at(row as isize + down, column as isize + right)
                .is_empty()
        });
        exposed.contains(&true).then_some(SurfaceVoxel {
            row,
            column,
            corners,
            exposed,
        })
    };
    voxels.iter().filter_map(voxel).collect()
}

/// Groups links of the rigid pass that share no point, for the processor; others keep their order.
fn in_rounds(links: &[[usize; 2]], points: usize) -> Vec<[usize; 2]> {
    let mut taken = vec![0; points];
    let mut round = |&[a, b]: &[usize; 2]| {
        // It comes after every earlier link at either end.
        let round = 1 + taken[a].max(taken[b]);
        (taken[a], taken[b]) = (round, round);
        (round, [a, b])
    };
    let mut rounds: Vec<_> = links.iter().map(&mut round).collect();
    rounds.sort_by_key(|(round, _)| *round);
    rounds.into_iter().map(|(_, link)| link).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_hold_every_link_and_keep_the_order_of_those_that_share_a_point() {
        // The sides of 3 × 3 rigid voxels; neighbours share one.
        let corners = |voxel: usize| [0, 1, 5, 4].map(|corner| voxel / 3 * 4 + voxel % 3 + corner);
        let sides = |voxel: usize| SIDES.map(|(a, b)| [corners(voxel)[a], corners(voxel)[b]]);
        let links: Vec<[usize; 2]> = (0..9).flat_map(sides).collect();
        let rounds = in_rounds(&links, 16);
        assert_ne!(rounds, links);
        for point in 0..16 {
            let at = |links: &[[usize; 2]]| {
                links
                    .iter()
                    .filter(|link| link.contains(&point))
                    .copied()
                    .collect::<Vec<_>>()
            };
            assert_eq!(at(&rounds), at(&links));
        }
    }
}
