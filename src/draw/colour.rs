//! The colours of all pictures: the paper's, in tones that stay apart when shaded. Marks on the
//! voxels help colour-blind viewers tell materials apart.

use crate::body::Material;
use serde::{Serialize, Serializer};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Colour {
    /// Red, green, blue (sRGB).
    pub(crate) rgb: [u8; 3],
    /// 0 (transparent) … 255 (opaque).
    pub(crate) opacity: u8,
}

impl Colour {
    pub(crate) const fn new(red: u8, green: u8, blue: u8) -> Self {
        Colour {
            rgb: [red, green, blue],
            opacity: 255,
        }
    }

    pub(crate) const fn with_opacity(self, opacity: u8) -> Self {
        Colour {
            rgb: self.rgb,
            opacity,
        }
    }

    /// Returns the colour without its opacity, as `#rrggbb`.
    pub(crate) fn hex(self) -> String {
        let [red, green, blue] = self.rgb;
        format!("#{red:02x}{green:02x}{blue:02x}")
    }

    /// Mixes a share of this colour, 0 to 1, with another one.
    pub(crate) fn mixed(self, other: Colour, share: f64) -> Self {
        let mix = |k: usize| {
            let (own, other) = (f64::from(self.rgb[k]), f64::from(other.rgb[k]));
            (other + share * (own - other)).round() as u8
        };
        Colour::new(mix(0), mix(1), mix(2))
    }

    /// Returns the gray of an intensity in [0, 1].
    pub(crate) fn gray(intensity: f64) -> Self {
        let level = (255.0 * intensity.clamp(0.0, 1.0)).round() as u8;
        Colour::new(level, level, level)
    }
}

impl Serialize for Colour {
    /// Writes it as `#rrggbb`, as pages need it.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.hex().serialize(serializer)
    }
}

/// The sky behind the robot, and the paper behind text.
pub(crate) const PAPER: Colour = Colour::new(255, 255, 255);
/// The colour of text and axes.
pub(crate) const INK: Colour = Colour::new(34, 36, 40);
/// The colour of secondary text.
pub(crate) const FAINT: Colour = Colour::new(112, 116, 124);
pub(crate) const GROUND: Colour = Colour::new(236, 233, 226);
pub(crate) const GROUND_LINE: Colour = Colour::new(120, 112, 98);
/// The lines between the columns and rows of the world, in the paper's look.
pub(crate) const GRID: Colour = Colour::new(228, 231, 236);
/// The ground's voxels, in the paper's look.
pub(crate) const PEG: Colour = Colour::new(72, 74, 80);
/// The path of the centre of mass.
pub(crate) const TRACE: Colour = Colour::new(178, 24, 158);
/// The frame around the part of an image that a body covers: visible on black and on white.
pub(crate) const WINDOW: Colour = Colour::new(255, 176, 0);
/// The lines between voxels where they are opaque.
pub(crate) const SEAM: Colour = Colour::new(226, 228, 232);
pub(crate) const ALARM: Colour = Colour::new(190, 20, 40);

/// Areas (square voxel lengths) at which a voxel has the first, middle and last of its [`tones`].
pub(crate) const TONE_AREAS: [f64; 3] = [0.5, 1.0, 1.6];

/// Returns a material's colours when small, at rest and large.
pub(crate) fn tones(material: Material) -> [[u8; 3]; 3] {
    match material {
        Material::Empty => [[255, 255, 255]; 3],
        Material::Rigid => [[6, 6, 8], [42, 43, 47], [78, 80, 85]],
        Material::Soft => [[150, 152, 157], [186, 188, 193], [232, 234, 238]],
        Material::MuscleInPhase | Material::ActuatorHorizontal => {
            [[136, 78, 4], [240, 152, 36], [255, 214, 150]]
        }
        Material::MuscleAntiphase | Material::ActuatorVertical => {
            [[38, 96, 140], [110, 184, 232], [204, 233, 250]]
        }
        Material::SensorShrink => [[96, 8, 26], [200, 36, 58], [240, 138, 148]],
        Material::SensorExpand => [[4, 74, 46], [26, 152, 98], [134, 214, 176]],
    }
}

/// Returns the lines that mark a material on large voxels, from −½ to ½, x to the right, y up:
/// chevrons up and down for muscles, plus and minus for sensors, and for actuators two chevrons
/// outwards, whose colours are those of muscles. Colours alone cannot keep six
/// materials apart at every shade for colour-blind viewers.
pub(crate) fn mark(material: Material) -> &'static [&'static [[f64; 2]]] {
    match material {
        Material::Empty | Material::Rigid | Material::Soft => &[],
        Material::MuscleInPhase => &[&[[-0.2, -0.1], [0.0, 0.12], [0.2, -0.1]]],
        Material::MuscleAntiphase => &[&[[-0.2, 0.1], [0.0, -0.12], [0.2, 0.1]]],
        Material::SensorShrink => &[&[[-0.2, 0.0], [0.2, 0.0]]],
        Material::SensorExpand => &[&[[-0.2, 0.0], [0.2, 0.0]], &[[0.0, -0.2], [0.0, 0.2]]],
        Material::ActuatorHorizontal => &[
            &[[-0.08, -0.12], [-0.2, 0.0], [-0.08, 0.12]],
            &[[0.08, -0.12], [0.2, 0.0], [0.08, 0.12]],
        ],
        Material::ActuatorVertical => &[
            &[[-0.12, -0.08], [0.0, -0.2], [0.12, -0.08]],
            &[[-0.12, 0.08], [0.0, 0.2], [0.12, 0.08]],
        ],
    }
}

/// The width of a mark, in voxel lengths.
pub(crate) const MARK_EXTENT: f64 = 0.4;

/// The width of a mark's lines, in voxel lengths.
pub(crate) const MARK_WIDTH: f64 = 0.09;

/// Returns the colour of a material's mark on a voxel of colour `on`: a dark tone of the material
/// on light voxels, a light tone on dark ones.
pub(crate) fn mark_colour(material: Material, on: Colour) -> Colour {
    let [[r, g, b], _, [red, green, blue]] = tones(material);
    let [on_red, on_green, on_blue] = on.rgb.map(f64::from);
    match 0.2126 * on_red + 0.7152 * on_green + 0.0722 * on_blue > 105.0 {
        true => Colour::new(r / 2, g / 2, b / 2),
        false => Colour::new(128 + red / 2, 128 + green / 2, 128 + blue / 2),
    }
}

/// Maps a point of a mark into a voxel whose corners are given clockwise from the top left. The
/// corners decide whether y runs up or down.
pub(crate) fn placed([x, y]: [f64; 2], [a, b, c, d]: [[f64; 2]; 4]) -> [f64; 2] {
    [0, 1].map(|k| {
        let (left, right) = ((a[k] + d[k]) / 2.0, (b[k] + c[k]) / 2.0);
        let (upper, lower) = ((a[k] + b[k]) / 2.0, (c[k] + d[k]) / 2.0);
        (left + right) / 2.0 + x * (right - left) + y * (upper - lower)
    })
}

/// Returns a voxel's colour: its material's, darker the smaller its area (square voxel lengths).
pub(crate) fn shade(material: Material, area: f64) -> Colour {
    let [small, rest, large] = tones(material);
    let [low, middle, high] = TONE_AREAS;
    let (from, to, t) = if area < middle {
        (small, rest, (area - low) / (middle - low))
    } else {
        (rest, large, (area - middle) / (high - middle))
    };
    // A NaN area counts as the area at rest.
    let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
    let mix =
        |k: usize| (f64::from(from[k]) + t * (f64::from(to[k]) - f64::from(from[k]))).round() as u8;
    Colour::new(mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn brightness(colour: Colour) -> f64 {
        let [r, g, b] = colour.rgb.map(f64::from);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    #[test]
    fn smaller_voxels_are_darker_for_every_material() {
        for material in Material::ALL.into_iter().skip(1) {
            let areas = (0..=44).map(|i| 0.5 + 0.025 * f64::from(i));
            let levels: Vec<f64> = areas.map(|a| brightness(shade(material, a))).collect();
            assert!(
                levels.windows(2).all(|w| w[0] < w[1]),
                "{material:?} {levels:?}"
            );
            // Clearly visible: small and large differ by at least a fifth of the whole scale.
            assert!(levels[levels.len() - 1] - levels[0] > 51.0, "{material:?}");
        }
    }

    /// Matrices from linear red, green and blue to what viewers without one kind of cone perceive
    /// (Machado et al. 2009, severity 1): protanopia, deuteranopia, tritanopia.
    const BLIND: [[[f64; 3]; 3]; 3] = [
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ],
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ],
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ],
    ];

    fn times(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| (0..3).map(|i| matrix[k][i] * v[i]).sum())
    }

    /// CIE L*a*b* (D65) of a colour as perceived by `eyes`.
    fn lab(colour: Colour, eyes: &[[f64; 3]; 3]) -> [f64; 3] {
        let linear = colour.rgb.map(|v| {
            let v = f64::from(v) / 255.0;
            if v <= 0.04045 {
                v / 12.92
            } else {
                ((v + 0.055) / 1.055).powf(2.4)
            }
        });
        let seen = times(eyes, linear).map(|v| v.clamp(0.0, 1.0));
        let to_xyz = [
            [0.412_456_4, 0.357_576_1, 0.180_437_5],
            [0.212_672_9, 0.715_152_2, 0.072_175],
            [0.019_333_9, 0.119_192, 0.950_304_1],
        ];
        let [x, y, z] = times(&to_xyz, seen);
        let f = |v: f64| {
            if v > 216.0 / 24389.0 {
                v.cbrt()
            } else {
                (24389.0 / 27.0 * v + 16.0) / 116.0
            }
        };
        let (x, y, z) = (f(x / 0.95047), f(y), f(z / 1.08883));
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    /// CIEDE2000 (Sharma, Wu & Dalal 2005).
    fn difference([l1, a1, b1]: [f64; 3], [l2, a2, b2]: [f64; 3]) -> f64 {
        let mean_c = (a1.hypot(b1) + a2.hypot(b2)) / 2.0;
        let g = 0.5 * (1.0 - (mean_c.powi(7) / (mean_c.powi(7) + 25f64.powi(7))).sqrt());
        let (a1, a2) = (a1 * (1.0 + g), a2 * (1.0 + g));
        let (c1, c2) = (a1.hypot(b1), a2.hypot(b2));
        let hue = |a: f64, b: f64| b.atan2(a).to_degrees().rem_euclid(360.0);
        let (h1, h2) = (hue(a1, b1), hue(a2, b2));
        let is_gray = c1 * c2 == 0.0;
        let dh = if is_gray {
            0.0
        } else {
            (h2 - h1 + 540.0).rem_euclid(360.0) - 180.0
        };
        let mean_h = match is_gray {
            true => h1 + h2,
            false if (h1 - h2).abs() <= 180.0 => (h1 + h2) / 2.0,
            false => ((h1 + h2 + 360.0) / 2.0).rem_euclid(360.0),
        };
        let (dl, dc) = (l2 - l1, c2 - c1);
        let dh = 2.0 * (c1 * c2).sqrt() * (dh / 2.0).to_radians().sin();
        let (l, c) = ((l1 + l2) / 2.0, (c1 + c2) / 2.0);
        let cos = |degrees: f64| degrees.to_radians().cos();
        let t = 1.0 - 0.17 * cos(mean_h - 30.0)
            + 0.24 * cos(2.0 * mean_h)
            + 0.32 * cos(3.0 * mean_h + 6.0)
            - 0.2 * cos(4.0 * mean_h - 63.0);
        let sl = 1.0 + 0.015 * (l - 50.0).powi(2) / (20.0 + (l - 50.0).powi(2)).sqrt();
        let (sc, sh) = (1.0 + 0.045 * c, 1.0 + 0.015 * c * t);
        let turn = 60.0 * (-((mean_h - 275.0) / 25.0).powi(2)).exp();
        let rt = -2.0 * (c.powi(7) / (c.powi(7) + 25f64.powi(7))).sqrt() * turn.to_radians().sin();
        let (dl, dc, dh) = (dl / sl, dc / sc, dh / sh);
        (dl * dl + dc * dc + dh * dh + rt * dc * dh).sqrt()
    }

    #[test]
    fn the_colour_difference_is_that_of_its_authors() {
        // Three pairs from the paper's table.
        for (one, other, expected) in [
            ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
            ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
            ([2.0776, 0.0795, -1.135], [0.9033, -0.0636, -0.5514], 0.9082),
        ] {
            assert!(
                (difference(one, other) - expected).abs() < 1e-4,
                "{one:?} {other:?}"
            );
        }
    }

    #[test]
    fn any_two_materials_are_told_apart_by_all_eyes_at_every_shade_by_colour_or_by_mark() {
        let shades = |material| (0..=22).map(move |k| shade(material, 0.5 + 0.05 * f64::from(k)));
        let materials: Vec<Material> = Material::ALL.into_iter().skip(1).collect();
        for (k, one) in materials.iter().enumerate() {
            for other in &materials[..k] {
                if mark(*one) != mark(*other) {
                    continue;
                }
                for eyes in &BLIND {
                    let differences =
                        shades(*one).flat_map(|a| shades(*other).map(move |b| (a, b)));
                    let least = differences
                        .map(|(a, b)| difference(lab(a, eyes), lab(b, eyes)))
                        .fold(f64::INFINITY, f64::min);
                    assert!(least >= 20.0, "{one:?} {other:?}: {least}");
                }
            }
        }
    }

    #[test]
    fn a_mark_is_seen_on_every_shade_of_its_material() {
        let marked = Material::ALL
            .into_iter()
            .filter(|material| !mark(*material).is_empty());
        for material in marked {
            for k in 0..=22 {
                let fill = shade(material, 0.5 + 0.05 * f64::from(k));
                for eyes in &BLIND {
                    let of = difference(lab(fill, eyes), lab(mark_colour(material, fill), eyes));
                    assert!(of >= 20.0, "{material:?} {k}: {of}");
                }
            }
        }
    }

    #[test]
    fn extreme_areas_stay_in_the_scale() {
        let soft = |area| shade(Material::Soft, area);
        assert_eq!(soft(-3.0), soft(0.5));
        assert_eq!(soft(f64::INFINITY), soft(1.6));
        assert_eq!(soft(f64::NEG_INFINITY), soft(0.0));
        assert_eq!(soft(1.0).rgb, tones(Material::Soft)[1]);
        let _ = soft(f64::NAN);
    }
}
