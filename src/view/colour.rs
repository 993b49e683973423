//! The colours of all pictures: the paper's, in tones that stay apart for colour-blind eyes and
//! when shaded.

use crate::body::Material;

/// A colour with opacity, 8 bits each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Colour {
    /// Red, green, blue (sRGB).
    pub rgb: [u8; 3],
    /// 0 (transparent) … 255 (opaque).
    pub opacity: u8,
}

impl Colour {
    /// An opaque colour.
    pub const fn new(red: u8, green: u8, blue: u8) -> Self {
        Colour { rgb: [red, green, blue], opacity: 255 }
    }

    /// The same with another opacity.
    pub const fn with_opacity(self, opacity: u8) -> Self {
        Colour { rgb: self.rgb, opacity }
    }

    /// Its red, green and blue as `#rrggbb`.
    pub fn hex(self) -> String {
        let [red, green, blue] = self.rgb;
        format!("#{red:02x}{green:02x}{blue:02x}")
    }

    /// Gray of an intensity in [0, 1].
    pub fn gray(intensity: f64) -> Self {
        let level = (255.0 * intensity.clamp(0.0, 1.0)).round() as u8;
        Colour::new(level, level, level)
    }
}

/// Sky behind the robot, and paper behind text.
pub const PAPER: Colour = Colour::new(255, 255, 255);
/// Text and axes.
pub const INK: Colour = Colour::new(34, 36, 40);
/// Text of less weight.
pub const FAINT: Colour = Colour::new(112, 116, 124);
/// Ground.
pub const GROUND: Colour = Colour::new(236, 233, 226);
/// Lines on the ground.
pub const GROUND_LINE: Colour = Colour::new(120, 112, 98);
/// Lines between the columns and rows of the world, in the paper's look.
pub const GRID: Colour = Colour::new(228, 231, 236);
/// The ground's voxels, in the paper's look.
pub const PEG: Colour = Colour::new(72, 74, 80);
/// Path of the centre of mass.
pub const TRACE: Colour = Colour::new(178, 24, 158);
/// Lines between voxels, where they are not see-through.
pub const SEAM: Colour = Colour::new(226, 228, 232);
/// Warnings.
pub const ALARM: Colour = Colour::new(190, 20, 40);

/// Areas (square voxel lengths) at which a voxel has the first, middle and last of its [`tones`].
pub const TONE_AREAS: [f64; 3] = [0.5, 1.0, 1.6];

/// A material's colours when small, at rest and large.
pub fn tones(material: Material) -> [[u8; 3]; 3] {
    match material {
        Material::Empty => [[255, 255, 255]; 3],
        Material::Rigid => [[6, 6, 8], [48, 49, 53], [122, 124, 130]],
        Material::Soft => [[92, 94, 98], [163, 165, 170], [222, 224, 228]],
        Material::MuscleInPhase => [[136, 78, 4], [240, 152, 36], [255, 214, 150]],
        Material::MuscleAntiphase => [[38, 96, 140], [110, 184, 232], [204, 233, 250]],
        Material::SensorShrink => [[96, 8, 26], [200, 36, 58], [240, 138, 148]],
        Material::SensorExpand => [[4, 74, 46], [26, 152, 98], [134, 214, 176]],
    }
}

/// A voxel's colour: its material's, darker the smaller its area (square voxel lengths) is now.
pub fn shade(material: Material, area: f64) -> Colour {
    let [small, rest, large] = tones(material);
    let [low, middle, high] = TONE_AREAS;
    let (from, to, t) = if area < middle {
        (small, rest, (area - low) / (middle - low))
    } else {
        (rest, large, (area - middle) / (high - middle))
    };
    // A NaN area counts as the one at rest.
    let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
    let mix = |k: usize| (f64::from(from[k]) + t * (f64::from(to[k]) - f64::from(from[k]))).round() as u8;
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
            assert!(levels.windows(2).all(|w| w[0] < w[1]), "{material:?} {levels:?}");
            // Clearly visible: at least a fifth of the whole scale between small and large.
            assert!(levels[levels.len() - 1] - levels[0] > 51.0, "{material:?}");
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
