//! From a [`Cppn`] to a [`Body`]: every node is evaluated over the whole grid at once.

use crate::base::Grid;
use crate::base::grid::GridError;
use crate::body::{Body, BodyError, MAX_SIDE, Material};
use crate::genome::cppn::{Cppn, INPUTS, OUTPUTS};

impl Cppn {
    /// Returns the network's body of `height` × `width` voxels: each cell has the material with the
    /// largest output; the first wins a tie.
    ///
    /// x goes from −1 (left column) to 1 (right), y from −1 (top row) to 1 (bottom); both are 0 if
    /// there is only one column or row. The distance to the centre, √(x² + y²), is rescaled
    /// linearly so that its smallest and largest value on the grid are −1 and 1 (0 if it is the
    /// same everywhere). The bias is 1.
    pub(crate) fn express(&self, height: usize, width: usize) -> Result<Body, BodyError> {
        if height == 0 || width == 0 {
            return Err(GridError::Empty.into());
        }
        if height > MAX_SIDE || width > MAX_SIDE {
            return Err(BodyError::TooLarge { height, width });
        }
        let outputs = self.evaluate(inputs(height, width));
        Body::new(Grid::from_fn(height, width, |row, column| {
            let cell = row * width + column;
            let mut best = 0;
            for material in 1..OUTPUTS {
                if outputs[material][cell] > outputs[best][cell] {
                    best = material;
                }
            }
            Material::ALL[best]
        }))
    }

    /// Returns the values of the outputs in all cells, from those of the inputs.
    fn evaluate(&self, inputs: [Vec<f64>; INPUTS]) -> Vec<Vec<f64>> {
        let cells = inputs[0].len();
        let mut values = Vec::from(inputs);
        values.resize(self.node_count(), Vec::new());
        for node in self.topological_order() {
            let Some(function) = self.function(node) else {
                continue;
            };
            let mut sums = vec![0.0; cells];
            // Values are finite, so an edge of weight 0 (all are at first) adds nothing.
            for edge in self.incoming(node).iter().filter(|e| e.weight != 0.0) {
                let source = &values[edge.from];
                sums.iter_mut()
                    .zip(source)
                    .for_each(|(sum, value)| *sum += edge.weight * value);
            }
            function.apply(&mut sums);
            values[node] = sums;
        }
        values.drain(INPUTS..INPUTS + OUTPUTS).collect()
    }
}

/// Returns x, y, distance and bias of all cells in row-major order.
fn inputs(height: usize, width: usize) -> [Vec<f64>; INPUTS] {
    let coordinate = |i: usize, n: usize| match n {
        1 => 0.0,
        _ => 2.0 * i as f64 / (n - 1) as f64 - 1.0,
    };
    let cells = || (0..height * width).map(|i| (i / width, i % width));
    let x: Vec<f64> = cells()
        .map(|(_, column)| coordinate(column, width))
        .collect();
    let y: Vec<f64> = cells().map(|(row, _)| coordinate(row, height)).collect();
    let mut distance: Vec<f64> = x
        .iter()
        .zip(&y)
        .map(|(x, y)| (x * x + y * y).sqrt())
        .collect();
    let least = distance.iter().copied().fold(f64::INFINITY, f64::min);
    let most = distance.iter().copied().fold(0.0, f64::max);
    for d in &mut distance {
        *d = if most > least {
            2.0 * (*d - least) / (most - least) - 1.0
        } else {
            0.0
        };
    }
    let bias = vec![1.0; height * width];
    [x, y, distance, bias]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::genome::function::Function;

    fn network(hidden: &[Function], edges: &[(usize, usize, f64)]) -> Cppn {
        let mut cppn = Cppn::initial();
        (0..28).for_each(|i| cppn.set_weight(i, 0.0));
        hidden.iter().for_each(|f| {
            cppn.add_hidden(*f);
        });
        for &(from, to, weight) in edges {
            match cppn
                .edges()
                .iter()
                .position(|e| (e.from, e.to) == (from, to))
            {
                Some(edge) => cppn.set_weight(edge, weight),
                None => cppn.connect(from, to, weight),
            }
        }
        cppn
    }

    fn text(cppn: &Cppn, height: usize, width: usize) -> String {
        cppn.express(height, width).unwrap().to_string()
    }

    #[test]
    fn weights_0_are_an_empty_body_for_the_first_output_wins_a_tie() {
        assert_eq!(text(&Cppn::initial(), 2, 3), "000\n000");
    }

    #[test]
    fn x_goes_from_left_to_right_and_y_from_top_to_bottom() {
        assert_eq!(text(&network(&[], &[(0, 5, 1.0)]), 2, 3), "001\n001");
        assert_eq!(text(&network(&[], &[(1, 6, 1.0)]), 3, 2), "00\n00\n22");
        // One column or row: 0 there.
        assert_eq!(text(&network(&[], &[(0, 5, 1.0), (1, 6, 1.0)]), 1, 1), "0");
    }

    #[test]
    fn distance_is_rescaled_to_the_grid_and_the_bias_is_1() {
        let [_, _, distance, bias] = inputs(3, 3);
        let edge = 2.0 / 2f64.sqrt() - 1.0;
        let expected = [1.0, edge, 1.0, edge, -1.0, edge, 1.0, edge, 1.0];
        distance
            .iter()
            .zip(expected)
            .for_each(|(d, e)| assert!((d - e).abs() < 1e-15, "{distance:?}"));
        assert_eq!(bias, [1.0; 9]);
        // Four corners are equally far from the centre.
        assert_eq!(inputs(2, 2)[2], [0.0; 4]);
        assert_eq!(text(&network(&[], &[(2, 5, 1.0)]), 3, 3), "111\n101\n111");
        assert_eq!(
            text(&network(&[], &[(3, 10, 0.5), (3, 5, 0.5)]), 1, 2),
            "11"
        );
    }

    #[test]
    fn a_hidden_node_applies_its_function_for_every_successor() {
        // 11 = |x| goes to two outputs: both get |x|, not x.
        let cppn = network(
            &[Function::Abs],
            &[(0, 11, 1.0), (11, 5, 0.4), (11, 6, 0.5)],
        );
        assert_eq!(text(&cppn, 1, 3), "202");
    }

    #[test]
    fn overflowing_chains_of_squares_keep_their_order() {
        let mut edges = vec![(3, 11, 1e300)];
        edges.extend((11..40).map(|n| (n, n + 1, 1.0)));
        edges.extend([(40, 5, 1.0), (40, 6, -1.0)]);
        let cppn = network(&[Function::Square; 30], &edges);
        assert_eq!(text(&cppn, 2, 2), "11\n11");
    }

    #[test]
    fn impossible_sizes_are_typed_errors() {
        let cppn = Cppn::initial();
        assert!(matches!(
            cppn.express(0, 5),
            Err(BodyError::Shape(GridError::Empty))
        ));
        assert!(matches!(
            cppn.express(5, usize::MAX),
            Err(BodyError::TooLarge { .. })
        ));
        assert_eq!(cppn.express(64, 64).unwrap().height(), 64);
    }
}
