//! Strokes of the built-in digits: every digit in the ways people write it.
//!
//! A stroke is a list of places that the pen passes; [`crate::data::pen`] draws a smooth line
//! through them and varies everything. Coordinates: x to the right, y down, in digit heights.

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Place {
    /// The line passes smoothly.
    Via(f64, f64),
    /// The line turns a corner.
    Turn(f64, f64),
}

use Place::{Turn, Via};

/// One way of writing a digit: its strokes in writing order, and its weight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Variant {
    /// Relative weight among the variants of its digit.
    pub(crate) weight: u32,
    pub(crate) strokes: &'static [&'static [Place]],
}

const fn variant(weight: u32, strokes: &'static [&'static [Place]]) -> Variant {
    Variant { weight, strokes }
}

/// The ways of writing each digit, 0 to 9.
pub(crate) const DIGITS: [&[Variant]; 10] =
    [ZERO, ONE, TWO, THREE, FOUR, FIVE, SIX, SEVEN, EIGHT, NINE];

#[rustfmt::skip]
const ZERO: &[Variant] = &[
    // An oval, closed at the top.
    variant(4, &[&[
        Via(0.40, 0.01), Via(0.17, 0.10), Via(0.03, 0.38), Via(0.05, 0.72), Via(0.24, 0.97),
        Via(0.48, 0.93), Via(0.66, 0.66), Via(0.66, 0.30), Via(0.52, 0.06), Via(0.34, 0.02),
    ]]),
    // Nearly a circle, begun at the upper right, its end running into the beginning.
    variant(3, &[&[
        Via(0.66, 0.12), Via(0.42, 0.02), Via(0.12, 0.18), Via(0.01, 0.52), Via(0.16, 0.88),
        Via(0.46, 0.98), Via(0.76, 0.78), Via(0.84, 0.42), Via(0.68, 0.10), Via(0.50, 0.07),
    ]]),
    // Narrow.
    variant(2, &[&[
        Via(0.28, 0.00), Via(0.10, 0.16), Via(0.02, 0.52), Via(0.10, 0.88), Via(0.26, 1.00),
        Via(0.44, 0.84), Via(0.50, 0.48), Via(0.42, 0.14), Via(0.26, 0.01),
    ]]),
];

#[rustfmt::skip]
const ONE: &[Variant] = &[
    // A plain stroke.
    variant(6, &[&[Via(0.06, 0.00), Via(0.05, 0.50), Via(0.04, 1.00)]]),
    // With a flag.
    variant(3, &[&[Via(0.09, 0.22), Via(0.17, 0.13), Turn(0.26, 0.00), Via(0.26, 0.50), Via(0.25, 1.00)]]),
    // With a flag and a foot.
    variant(1, &[
        &[Via(0.06, 0.22), Turn(0.26, 0.00), Via(0.26, 0.50), Via(0.26, 0.98)],
        &[Via(0.02, 1.00), Via(0.26, 0.98), Via(0.50, 0.99)],
    ]),
];

#[rustfmt::skip]
const TWO: &[Variant] = &[
    // A hook and a straight foot.
    variant(4, &[&[
        Via(0.04, 0.24), Via(0.14, 0.06), Via(0.36, 0.00), Via(0.56, 0.12), Via(0.56, 0.34),
        Via(0.36, 0.64), Turn(0.02, 0.96), Via(0.32, 0.95), Via(0.66, 0.96),
    ]]),
    // A loop at the foot.
    variant(3, &[&[
        Via(0.06, 0.20), Via(0.22, 0.02), Via(0.46, 0.03), Via(0.58, 0.22), Via(0.48, 0.50),
        Via(0.26, 0.82), Via(0.10, 0.96), Via(0.01, 0.86), Via(0.12, 0.76), Via(0.32, 0.88),
        Via(0.54, 0.98), Via(0.76, 0.88),
    ]]),
    // A swan's neck with a wavy foot.
    variant(2, &[&[
        Via(0.02, 0.14), Via(0.24, 0.02), Via(0.50, 0.08), Via(0.55, 0.30), Via(0.40, 0.58),
        Via(0.16, 0.84), Turn(0.02, 0.95), Via(0.22, 0.86), Via(0.46, 0.98), Via(0.72, 0.94),
    ]]),
];

#[rustfmt::skip]
const THREE: &[Variant] = &[
    // Two bows meeting in a point.
    variant(4, &[&[
        Via(0.04, 0.12), Via(0.24, 0.00), Via(0.50, 0.08), Via(0.52, 0.28), Via(0.36, 0.43),
        Turn(0.18, 0.47), Via(0.44, 0.50), Via(0.60, 0.68), Via(0.52, 0.90), Via(0.28, 1.00),
        Via(0.00, 0.90),
    ]]),
    // Two bows with a small loop between them.
    variant(2, &[&[
        Via(0.08, 0.10), Via(0.30, 0.00), Via(0.52, 0.12), Via(0.46, 0.34), Via(0.26, 0.46),
        Via(0.22, 0.52), Via(0.34, 0.49), Via(0.56, 0.62), Via(0.58, 0.84), Via(0.36, 1.00),
        Via(0.02, 0.92),
    ]]),
    // A flat top.
    variant(1, &[&[
        Via(0.04, 0.02), Via(0.30, 0.01), Turn(0.56, 0.02), Via(0.42, 0.22), Turn(0.26, 0.40),
        Via(0.50, 0.46), Via(0.62, 0.68), Via(0.52, 0.92), Via(0.26, 1.00), Via(0.00, 0.90),
    ]]),
];

#[rustfmt::skip]
const FOUR: &[Variant] = &[
    // Open at the top.
    variant(5, &[
        &[Via(0.10, 0.04), Via(0.06, 0.30), Turn(0.02, 0.54), Via(0.34, 0.54), Via(0.66, 0.50)],
        &[Via(0.56, 0.02), Via(0.53, 0.50), Via(0.50, 1.00)],
    ]),
    // Open and round, in one flow.
    variant(2, &[
        &[Via(0.08, 0.06), Via(0.02, 0.34), Via(0.14, 0.54), Via(0.36, 0.52), Via(0.56, 0.38)],
        &[Via(0.60, 0.00), Via(0.56, 0.45), Via(0.54, 1.00)],
    ]),
    // Closed, with a point.
    variant(3, &[
        &[Via(0.46, 0.00), Via(0.24, 0.34), Turn(0.00, 0.64), Via(0.34, 0.64), Via(0.72, 0.62)],
        &[Via(0.46, 0.00), Via(0.48, 0.50), Via(0.48, 1.00)],
    ]),
];

#[rustfmt::skip]
const FIVE: &[Variant] = &[
    // The roof first or last: two strokes.
    variant(4, &[
        &[
            Via(0.16, 0.03), Via(0.13, 0.22), Turn(0.10, 0.44), Via(0.34, 0.38), Via(0.56, 0.52),
            Via(0.58, 0.78), Via(0.38, 0.98), Via(0.02, 0.93),
        ],
        &[Via(0.16, 0.03), Via(0.40, 0.02), Via(0.66, 0.00)],
    ]),
    // One stroke with corners.
    variant(3, &[&[
        Via(0.62, 0.01), Via(0.40, 0.02), Turn(0.16, 0.03), Via(0.10, 0.24), Turn(0.06, 0.46),
        Via(0.30, 0.40), Via(0.54, 0.54), Via(0.56, 0.80), Via(0.34, 1.00), Via(0.00, 0.90),
    ]]),
    // Round, like an S.
    variant(2, &[&[
        Via(0.66, 0.02), Via(0.38, 0.03), Via(0.18, 0.10), Via(0.12, 0.30), Via(0.30, 0.43),
        Via(0.52, 0.56), Via(0.54, 0.80), Via(0.32, 0.99), Via(0.02, 0.90),
    ]]),
];

#[rustfmt::skip]
const SIX: &[Variant] = &[
    // A bow into a loop.
    variant(4, &[&[
        Via(0.46, 0.00), Via(0.20, 0.22), Via(0.04, 0.56), Via(0.08, 0.88), Via(0.30, 1.00),
        Via(0.52, 0.88), Via(0.54, 0.66), Via(0.36, 0.53), Via(0.14, 0.64), Via(0.06, 0.78),
    ]]),
    // A straighter stem and a small loop.
    variant(2, &[&[
        Via(0.30, 0.00), Via(0.12, 0.32), Via(0.02, 0.68), Via(0.12, 0.95), Via(0.36, 0.98),
        Via(0.50, 0.82), Via(0.42, 0.64), Via(0.22, 0.66), Via(0.06, 0.84),
    ]]),
    // Bent over at the top.
    variant(1, &[&[
        Via(0.60, 0.10), Via(0.42, 0.00), Via(0.18, 0.16), Via(0.03, 0.52), Via(0.08, 0.86),
        Via(0.30, 1.00), Via(0.56, 0.86), Via(0.56, 0.62), Via(0.34, 0.50), Via(0.08, 0.66),
    ]]),
];

#[rustfmt::skip]
const SEVEN: &[Variant] = &[
    // Roof and stem.
    variant(5, &[&[
        Via(-0.04, 0.06), Via(0.28, 0.05), Turn(0.62, 0.03), Via(0.44, 0.40), Via(0.26, 1.00),
    ]]),
    // With a bar.
    variant(2, &[
        &[Via(0.02, 0.06), Via(0.30, 0.04), Turn(0.62, 0.02), Via(0.46, 0.44), Via(0.24, 1.00)],
        &[Via(0.14, 0.52), Via(0.38, 0.50), Via(0.62, 0.48)],
    ]),
    // With a hook at the roof's beginning.
    variant(2, &[&[
        Via(-0.04, 0.22), Turn(-0.01, 0.04), Via(0.30, 0.06), Turn(0.64, 0.03), Via(0.42, 0.46),
        Via(0.30, 1.00),
    ]]),
    // Round at the shoulder.
    variant(2, &[&[
        Via(-0.08, 0.14), Via(0.20, 0.02), Via(0.50, 0.04), Via(0.57, 0.20), Via(0.44, 0.52),
        Via(0.34, 1.00),
    ]]),
];

#[rustfmt::skip]
const EIGHT: &[Variant] = &[
    // One line that crosses itself.
    variant(5, &[&[
        Via(0.54, 0.13), Via(0.34, 0.00), Via(0.12, 0.10), Via(0.14, 0.31), Via(0.34, 0.48),
        Via(0.56, 0.68), Via(0.54, 0.90), Via(0.30, 1.00), Via(0.06, 0.90), Via(0.05, 0.70),
        Via(0.28, 0.49), Via(0.50, 0.28), Via(0.53, 0.12), Via(0.42, 0.02),
    ]]),
    // Two rings.
    variant(2, &[
        &[
            Via(0.32, 0.00), Via(0.12, 0.10), Via(0.10, 0.32), Via(0.30, 0.46), Via(0.50, 0.32),
            Via(0.50, 0.10), Via(0.30, 0.00),
        ],
        &[
            Via(0.30, 0.46), Via(0.07, 0.58), Via(0.04, 0.84), Via(0.28, 1.00), Via(0.54, 0.86),
            Via(0.54, 0.60), Via(0.32, 0.46),
        ],
    ]),
    // Open at the upper right.
    variant(1, &[&[
        Via(0.58, 0.06), Via(0.34, 0.01), Via(0.12, 0.12), Via(0.16, 0.32), Via(0.36, 0.48),
        Via(0.52, 0.68), Via(0.46, 0.92), Via(0.24, 1.00), Via(0.06, 0.86), Via(0.12, 0.64),
        Via(0.36, 0.44), Via(0.60, 0.14),
    ]]),
];

#[rustfmt::skip]
const NINE: &[Variant] = &[
    // A ring and a straight stem.
    variant(4, &[&[
        Via(0.54, 0.12), Via(0.34, 0.00), Via(0.10, 0.12), Via(0.06, 0.36), Via(0.26, 0.50),
        Via(0.48, 0.36), Turn(0.56, 0.08), Via(0.54, 0.50), Via(0.48, 1.00),
    ]]),
    // A ring and a bent stem.
    variant(3, &[&[
        Via(0.52, 0.16), Via(0.36, 0.01), Via(0.12, 0.10), Via(0.04, 0.34), Via(0.22, 0.48),
        Via(0.46, 0.38), Turn(0.56, 0.10), Via(0.56, 0.52), Via(0.46, 0.88), Via(0.24, 1.00),
        Via(0.06, 0.94),
    ]]),
    // In one round flow.
    variant(2, &[&[
        Via(0.56, 0.10), Via(0.32, 0.00), Via(0.08, 0.16), Via(0.08, 0.40), Via(0.30, 0.48),
        Via(0.52, 0.32), Via(0.58, 0.14), Via(0.54, 0.40), Via(0.42, 0.72), Via(0.28, 1.00),
    ]]),
];
