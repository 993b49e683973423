//! The nearest training image: a classifier without a body, on the stimuli of robots. Its answers
//! depend on the images alone, to the bit.

use crate::base::Grid;

/// Returns the label of the known image nearest to an image (Euclidean distance), `None` without
/// any. If several are equally near, as is common with few sensors, returns their most frequent
/// label; the first one wins a tie.
pub(crate) fn nearest<'a, L: Copy + PartialEq>(
    known: impl IntoIterator<Item = (&'a Grid<f64>, L)>,
    image: &Grid<f64>,
) -> Option<L> {
    let (mut least, mut votes) = (f64::INFINITY, Vec::<(L, usize)>::new());
    for (other, label) in known {
        let distance = squared_distance(image.cells(), other.cells());
        if distance < least {
            least = distance;
            votes.clear();
        }
        if distance == least {
            match votes.iter_mut().find(|(voted, _)| *voted == label) {
                Some((_, count)) => *count += 1,
                None => votes.push((label, 1)),
            }
        }
    }
    let more = |a: (L, usize), b: (L, usize)| if b.1 > a.1 { b } else { a };
    votes.into_iter().reduce(more).map(|(label, _)| label)
}

/// Adds up in eight sums, which the processor computes at once; always in the same order.
fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    let (a, b) = (a.chunks(LANES), b.chunks(LANES));
    for (a, b) in a.zip(b) {
        for (sum, (x, y)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += (x - y) * (x - y);
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_image_answers_and_of_several_the_label_that_most_of_them_have() {
        let of = |left: f64, right: f64| {
            Grid::from_fn(1, 11, |_, column| [left, right][usize::from(column > 8)])
        };
        let images = [
            of(0.0, 1.0),
            of(1.0, 0.0),
            of(1.0, 0.0),
            of(1.0, 0.0),
            of(0.5, 0.5),
        ];
        let known = |labels: [char; 5]| images.iter().zip(labels);
        let labels = ['a', 'b', 'c', 'c', 'd'];
        assert_eq!(nearest(known(labels), &images[0]), Some('a'));
        assert_eq!(nearest(known(labels), &images[1]), Some('c'));
        assert_eq!(nearest(known(labels), &of(0.4, 0.6)), Some('d'));
        assert_eq!(
            nearest(known(['a', 'c', 'b', 'd', 'd']), &images[1]),
            Some('c')
        );
        assert_eq!(nearest(known(labels).take(0), &images[0]), None);
    }
}
