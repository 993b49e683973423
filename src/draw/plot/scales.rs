//! Colours of figures: sets and scales that colour-blind viewers can tell apart.

use crate::draw::colour::Colour;

/// Blue of Okabe & Ito's set.
pub(crate) const BLUE: Colour = Colour::new(0, 114, 178);
/// Vermillion of Okabe & Ito's set.
pub(crate) const VERMILLION: Colour = Colour::new(213, 94, 0);
/// Bluish green of Okabe & Ito's set.
pub(crate) const GREEN: Colour = Colour::new(0, 158, 115);
/// Colours for separate lines: Okabe & Ito's set without its yellow.
pub(crate) const SET: [Colour; 6] = [
    BLUE,
    VERMILLION,
    GREEN,
    Colour::new(204, 121, 167),
    Colour::new(86, 180, 233),
    Colour::new(230, 159, 0),
];
/// Grid lines.
pub(crate) const GRID: Colour = Colour::new(226, 228, 232);
/// Lines around cells.
pub(crate) const CELL: Colour = Colour::new(190, 194, 200);

/// Viridis (van der Walt & Smith), from dark to bright.
const VIRIDIS: [[u8; 3]; 11] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x24, 0x75],
    [0x41, 0x44, 0x87],
    [0x35, 0x5f, 0x8d],
    [0x2a, 0x78, 0x8e],
    [0x21, 0x91, 0x8c],
    [0x22, 0xa8, 0x84],
    [0x44, 0xbf, 0x70],
    [0x7a, 0xd1, 0x51],
    [0xbd, 0xdf, 0x26],
    [0xfd, 0xe7, 0x25],
];

/// Purple over white (zero) to green (ColorBrewer's PRGn): neither end is a muscle's colour.
const PURPLE_GREEN: [[u8; 3]; 9] = [
    [0x76, 0x2a, 0x83],
    [0x99, 0x70, 0xab],
    [0xc2, 0xa5, 0xcf],
    [0xe7, 0xd4, 0xe8],
    [0xf7, 0xf7, 0xf7],
    [0xd9, 0xf0, 0xd3],
    [0xa6, 0xdb, 0xa0],
    [0x5a, 0xae, 0x61],
    [0x1b, 0x78, 0x37],
];

/// Values below a scale.
pub(crate) const BELOW: Colour = Colour::new(0xa6, 0xa8, 0xad);

/// White to dark blue (ColorBrewer's Blues), for shares of a whole.
const BLUES: [[u8; 3]; 6] = [
    [0xff, 0xff, 0xff],
    [0xd6, 0xe6, 0xf4],
    [0xab, 0xcf, 0xe6],
    [0x56, 0xa0, 0xce],
    [0x1d, 0x6c, 0xb1],
    [0x08, 0x30, 0x6b],
];

/// Returns the colour at `t` in [0, 1] of a scale from dark to bright.
pub(crate) fn sequential(t: f64) -> Colour {
    between(&VIRIDIS, t)
}

/// Returns the colour at `t` in [−1, 1] of a scale with a neutral middle.
pub(crate) fn diverging(t: f64) -> Colour {
    between(&PURPLE_GREEN, (t + 1.0) / 2.0)
}

/// Returns the colour of a share in [0, 1], from white to dark.
pub(crate) fn share(t: f64) -> Colour {
    between(&BLUES, t)
}

/// Interpolates between equally spaced colours; `t` is in [0, 1].
fn between(colours: &[[u8; 3]], t: f64) -> Colour {
    let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) } * (colours.len() - 1) as f64;
    let low = (t.floor() as usize).min(colours.len() - 2);
    let share = t - low as f64;
    let mix = |k: usize| {
        let (a, b) = (f64::from(colours[low][k]), f64::from(colours[low + 1][k]));
        (a + share * (b - a)).round() as u8
    };
    Colour::new(mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_hold_their_ends_and_rise_in_brightness() {
        assert_eq!(sequential(0.0).rgb, VIRIDIS[0]);
        assert_eq!(sequential(2.0).rgb, VIRIDIS[10]);
        assert_eq!(sequential(f64::NAN).rgb, VIRIDIS[0]);
        assert_eq!(diverging(0.0).rgb, [0xf7; 3]);
        let level = |c: Colour| {
            0.21 * f64::from(c.rgb[0]) + 0.72 * f64::from(c.rgb[1]) + 0.07 * f64::from(c.rgb[2])
        };
        let levels: Vec<f64> = (0..=20)
            .map(|i| level(sequential(f64::from(i) / 20.0)))
            .collect();
        assert!(levels.windows(2).all(|w| w[0] < w[1]), "{levels:?}");
        let shares: Vec<f64> = (0..=20)
            .map(|i| level(share(f64::from(i) / 20.0)))
            .collect();
        assert!(shares[0] > 254.0 && shares[20] < 60.0, "{shares:?}");
        assert!(shares.windows(2).all(|w| w[0] > w[1]), "{shares:?}");
    }
}
