//! Gaits: walking bodies whose places can have other materials.

use crate::base::Grid;
use crate::base::random::Stream;
use crate::body::{Body, Material};
use crate::sim::{Physics, width};
use std::ops::Range;

/// Materials that a place can have without changing the gait.
pub(crate) const CHOICES: [Material; 3] = [
    Material::Soft,
    Material::SensorExpand,
    Material::SensorShrink,
];

/// Materials that a [design problem](super::design_problem) chooses from: sensors, with which a response is
/// measured. A soft voxel differs from one at rest: it has no goal, so the sides that it shares
/// take its neighbour's goal, and its springs have another stiffness (`physics.md`, "Actuation").
pub(crate) const SENSORS: [Material; 2] = [CHOICES[CHOSEN.start], CHOICES[CHOSEN.start + 1]];

/// Indices of [`SENSORS`] in [`CHOICES`].
pub(super) const CHOSEN: Range<usize> = 1..CHOICES.len();

/// Probability that a place is wide in a random image, and that it is narrow. Larger values leave
/// out widths in between, as under grey pixels; smaller ones tell less about the slopes.
const EXTREME: f64 = 0.4;

/// A walking body in which the materials of soft voxels and sensors are left open.
#[derive(Clone, Debug, PartialEq)]
pub struct Gait {
    body: Body,
    places: Vec<(usize, usize)>,
}

/// A material of [`CHOICES`] for each place of a gait, in the places' order.
pub(crate) type Design = Vec<Material>;

impl Gait {
    /// Returns the gait of a body; `None` if it has neither soft voxels nor sensors.
    pub fn of(body: &Body) -> Option<Self> {
        let is_place = |material: &Material| CHOICES.contains(material);
        let places: Vec<_> = body
            .voxels()
            .iter()
            .filter(|(_, m)| is_place(m))
            .map(|(place, _)| place)
            .collect();
        (!places.is_empty()).then(|| Gait {
            body: body.clone(),
            places,
        })
    }

    /// Returns the (row, column) of each soft voxel and sensor, row-major.
    pub fn places(&self) -> &[(usize, usize)] {
        &self.places
    }

    pub(crate) fn design(&self) -> Design {
        self.places
            .iter()
            .map(|place| self.body.voxels()[*place])
            .collect()
    }

    /// Builds the body with these materials at its places.
    ///
    /// # Panics
    /// If the design does not have one material for each place.
    pub(crate) fn built(&self, design: &[Material]) -> Body {
        assert_eq!(
            design.len(),
            self.places.len(),
            "a design has one material for each place"
        );
        let mut voxels = self.body.voxels().clone();
        for (place, material) in self.places.iter().zip(design) {
            voxels[*place] = *material;
        }
        Body::new(voxels).expect("a body with other materials is as large as before")
    }

    pub(crate) fn probe(&self) -> Body {
        self.body.probe()
    }

    /// Returns the body with this design, but with all sensors expanding.
    pub(crate) fn probe_of(&self, design: &[Material]) -> Body {
        let expanding = |material: &Material| match material {
            Material::Soft => Material::Soft,
            _ => Material::SensorExpand,
        };
        self.built(&design.iter().map(expanding).collect::<Vec<_>>())
    }

    /// Returns the image under which the [`probe_of`](Gait::probe_of) a design walks as the design
    /// does under a stimulus.
    pub(crate) fn as_probe(&self, design: &[Material], stimulus: &Grid<f64>) -> Grid<f64> {
        let mut image = stimulus.clone();
        for (place, material) in self.places.iter().zip(design) {
            if *material == Material::SensorShrink {
                image[*place] = 1.0 - stimulus.or_default(*place);
            }
        }
        image
    }

    /// Returns the target width of each place under an image \[rest widths\].
    pub(crate) fn widths(
        &self,
        design: &[Material],
        stimulus: &Grid<f64>,
        physics: &Physics,
    ) -> Vec<f64> {
        let width = |(place, material): (&(usize, usize), &Material)| {
            width(*material, stimulus.or_default(*place), physics)
        };
        self.places.iter().zip(design).map(width).collect()
    }
}

/// Returns the pixel that makes an expanding sensor as wide as a soft voxel; 0 or 1 if none does.
fn resting(physics: &Physics) -> f64 {
    let [narrow, wide] = [0.0, 1.0].map(|pixel| width(Material::SensorExpand, pixel, physics));
    let rest = width(Material::Soft, 0.0, physics);
    if wide > narrow {
        ((rest - narrow) / (wide - narrow)).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// Draws an image under which each place of a probe is, independently of all others, as wide as
/// possible (with probability 0.4), as narrow as possible (0.4), or at rest (0.2).
pub(crate) fn random_image(
    height: usize,
    width: usize,
    physics: &Physics,
    random: &mut Stream,
) -> Grid<f64> {
    let rest = resting(physics);
    Grid::from_fn(height, width, |_, _| {
        let drawn = random.unit();
        if drawn < EXTREME {
            1.0
        } else if drawn < 2.0 * EXTREME {
            0.0
        } else {
            rest
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, stream};

    fn random(child: u64) -> Stream {
        stream(1, Purpose::RandomImages, 0, child)
    }

    #[test]
    fn a_gait_is_what_walks_and_its_designs_are_what_it_is_made_of() {
        let body: Body = "2635/3104".parse().unwrap();
        let gait = Gait::of(&body).unwrap();
        assert_eq!(gait.places(), [(0, 0), (0, 1), (0, 3)]);
        assert_eq!(gait.built(&gait.design()), body);
        assert_eq!(gait.probe(), "6636/3104".parse().unwrap());
        let image = Grid::from_fn(2, 4, |_, column| if column == 1 { 1.0 } else { 0.25 });
        assert_eq!(
            gait.widths(&gait.design(), &image, &Physics::default()),
            [1.0, 1.6, 1.35]
        );
        assert_eq!(Gait::of(&"3/1".parse().unwrap()), None);
    }

    #[test]
    fn random_images_make_places_wide_narrow_or_at_rest_independently_of_each_other() {
        let physics = Physics::default();
        let mut random = random(0);
        let gait = Gait::of(&"65".parse().unwrap()).unwrap();
        let rest = gait.widths(
            &[Material::Soft; 2],
            &Grid::from_fn(1, 2, |_, _| 0.0),
            &physics,
        )[0];
        let drawn: Vec<Vec<f64>> = (0..4000)
            .map(|_| {
                let image = random_image(1, 2, &physics, &mut random);
                gait.widths(&[Material::SensorExpand; 2], &image, &physics)
            })
            .collect();
        let share = |kind: &dyn Fn(&[f64]) -> bool| {
            drawn.iter().filter(|widths| kind(widths)).count() as f64 / 4000.0
        };
        for (width, expected) in [(1.6, 0.4), (0.6, 0.4), (rest, 0.2)] {
            for place in 0..2 {
                let share = share(&|widths| (widths[place] - width).abs() < 1e-9);
                assert!(
                    (share - expected).abs() < 0.03,
                    "{width} at {place}: {share}"
                );
            }
        }
        let both = share(&|widths| widths.iter().all(|width| (width - 1.6).abs() < 1e-9));
        assert!((both - 0.16).abs() < 0.03, "{both}");
    }

    #[test]
    fn a_probe_can_be_as_wide_as_any_design_under_any_image() {
        let gait = Gait::of(&"562/365".parse().unwrap()).unwrap();
        let image = Grid::from_fn(2, 3, |row, column| 0.1 * (3 * row + column) as f64);
        let mut random = random(3);
        for _ in 0..30 {
            let design: Design = gait
                .places()
                .iter()
                .map(|_| CHOICES[random.below(3)])
                .collect();
            let probe = Gait::of(&gait.probe_of(&design)).unwrap().design();
            let is_soft = |material: &Material| *material == Material::Soft;
            assert!(probe.iter().map(is_soft).eq(design.iter().map(is_soft)));
            let seen = gait.as_probe(&design, &image);
            let (found, expected) = (
                gait.widths(&probe, &seen, &Physics::default()),
                gait.widths(&design, &image, &Physics::default()),
            );
            assert!(
                found
                    .iter()
                    .zip(&expected)
                    .all(|(a, b)| (a - b).abs() < 1e-12),
                "{found:?} {expected:?}"
            );
        }
    }
}
