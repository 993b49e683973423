//! How much each sensor of a robot moves it, by what it saw and did: the regression behind the [surrogate](super::surrogate).

use nalgebra::{DMatrix, DVector};

/// Distances over which a robot's influences may be alike \[voxels\]: the one is taken that foretells best.
const REACHES: [f64; 2] = [1.5, 3.0];

/// What influences may be charged for, in images that are missed by as much: the one is taken that foretells best.
const CHARGES: [f64; 4] = [1.0, 8.0, 64.0, 512.0];

/// Every so manieth image is foretold from the others. (Classes often take turns, and are two or four: no fold is to be of one.)
const FOLDS: usize = 5;

/// For how many images of its own counts one that a robot and a relative were both shown. What the model leaves unexplained of the
/// robot's answer it leaves of the relative's, too, so that their difference is known better than either.
const PAIR: f64 = 4.0;

/// For how many images counts at most by how much all answers of a relative lie beside the robot's: they have one cause.
const SHIFT: f64 = 64.0;

/// How wide each sensor of a robot was under an image, and how far it walked; `None` if it was not shown it.
pub type Shown = Vec<Option<(Vec<f64>, f64)>>;

/// What is to be explained of a displacement, and of each sensor how much wider it was.
type Row = (DVector<f64>, f64);

/// Displacements as a mean and, for each sensor, a part in proportion to how much wider it is than on average.
pub struct Influences {
    /// Over which they are taken to be alike \[voxels\].
    pub reach: f64,
    /// Of the sensors' likeness to a place, what makes its influence.
    pub weights: Vec<f64>,
    /// The mean displacement, and of each sensor the mean width.
    pub mean: f64,
    pub means: Vec<f64>,
}

impl Influences {
    /// The influences that are most likely, given what a robot and `relatives` of it saw and did, if those of near places are alike
    /// (regression with a Gaussian process; Rasmussen & Williams 2006, chapter 2): how near, and how large they may be, is found
    /// out by foretelling some images from the others. `sensors` are the places where the robot, or one of the relatives, has one.
    pub fn of(own: &Shown, relatives: &[Shown], sensors: &[(usize, usize)]) -> Option<Self> {
        let count = sensors.len();
        let (folds, mean, means) = folds(own, relatives, count)?;
        // nalgebra has no columns of nothing.
        if count == 0 {
            return Some(Influences { reach: REACHES[0], weights: Vec::new(), mean, means });
        }
        let moments: Vec<Moments> = folds.iter().map(|fold| Moments::of(fold, count)).collect();
        let all = moments.iter().fold(Moments::of(&[], count), |sum, fold| sum.plus(fold, 1.0));
        let mut best = (f64::INFINITY, REACHES[0], CHARGES[0]);
        for reach in REACHES {
            let likeness = likeness(sensors, reach);
            let mut errors = CHARGES.map(|charge| (0.0, reach, charge));
            for (fold, left_out) in folds.iter().zip(&moments) {
                let others = all.plus(left_out, -1.0);
                let system = product(&others.matrix, &likeness);
                for (error, _, charge) in &mut errors {
                    let weights = charged(&system, *charge, &others.vector)?;
                    let influence = product(&likeness, &weights);
                    let missed = |(seen, d): &Row| d - seen.dot(&influence.column(0));
                    let squared = |row| missed(row) * missed(row);
                    *error += fold.iter().map(squared).sum::<f64>();
                }
            }
            best = errors.into_iter().fold(best, |best, next| if next.0 < best.0 { next } else { best });
        }
        let (_, reach, charge) = best;
        let weights = charged(&product(&all.matrix, &likeness(sensors, reach)), charge, &all.vector)?;
        Some(Influences { reach, weights: weights.as_slice().to_vec(), mean, means })
    }
}

/// What is to be explained, in parts of which each is foretold from the others: of every image how the robot's answer differs from its
/// mean; and of every relative how its answers to the images that both were shown differ from the robot's, on average, and each from
/// that. With the robot's mean displacement, and of each sensor the mean width; `None` if it was not shown any.
fn folds(own: &Shown, relatives: &[Shown], count: usize) -> Option<(Vec<Vec<Row>>, f64, Vec<f64>)> {
    let mut folds = vec![Vec::new(); FOLDS];
    let mut add = |rows: Vec<(usize, Vec<f64>, f64)>, weight: f64| {
        let (mean, means) = means(rows.iter().map(|(_, wider, d)| (wider.as_slice(), *d)), count)?;
        for (image, wider, displacement) in &rows {
            let wider = DVector::from_fn(count, |i, _| weight * (wider[i] - means[i]));
            folds[image % FOLDS].push((wider, weight * (displacement - mean)));
        }
        Some((mean, means, rows.len() as f64))
    };
    let own_rows = own.iter().enumerate().filter_map(|(image, shown)| {
        let (seen, displacement) = shown.as_ref()?;
        Some((image, seen.clone(), *displacement))
    });
    let (mean, means, _) = add(own_rows.collect(), 1.0)?;
    let mut shifts = Vec::new();
    for (number, relative) in relatives.iter().enumerate() {
        let pairs = own.iter().zip(relative).enumerate().filter_map(|(image, (own, shown))| {
            let ((of_own, own), (seen, displacement)) = (own.as_ref()?, shown.as_ref()?);
            Some((image, seen.iter().zip(of_own).map(|(x, own)| x - own).collect(), displacement - own))
        });
        if let Some((beside, wider, images)) = add(pairs.collect(), PAIR.sqrt()) {
            let weight = (SHIFT * images / (SHIFT + images)).sqrt();
            shifts.push((number, (DVector::from_fn(count, |i, _| weight * wider[i]), weight * beside)));
        }
    }
    shifts.into_iter().for_each(|(number, shift)| folds[number % FOLDS].push(shift));
    Some((folds, mean, means))
}

/// The mean displacement, and each sensor's mean width; `None` of no images.
fn means<'a>(shown: impl Iterator<Item = (&'a [f64], f64)>, count: usize) -> Option<(f64, Vec<f64>)> {
    let (mut number, mut sum, mut sums) = (0.0, 0.0, vec![0.0; count]);
    for (seen, displacement) in shown {
        number += 1.0;
        sum += displacement;
        sums.iter_mut().zip(seen).for_each(|(sum, x)| *sum += x);
    }
    (number > 0.0).then(|| (sum / number, sums.into_iter().map(|sum| sum / number).collect()))
}

/// Sums over rows, of products of widths with each other, and with the displacement.
struct Moments {
    matrix: DMatrix<f64>,
    /// One column.
    vector: DMatrix<f64>,
}

impl Moments {
    fn of(rows: &[Row], count: usize) -> Self {
        let (mut matrix, mut vector) = (DMatrix::zeros(count, count), DMatrix::zeros(count, 1));
        for (seen, displacement) in rows {
            vector.column_mut(0).axpy(*displacement, seen, 1.0);
            for (mut column, x) in matrix.column_iter_mut().zip(seen.iter()) {
                column.axpy(*x, seen, 1.0);
            }
        }
        Moments { matrix, vector }
    }

    fn plus(&self, other: &Moments, factor: f64) -> Self {
        Moments {
            matrix: &self.matrix + &other.matrix * factor,
            vector: &self.vector + &other.vector * factor,
        }
    }
}

/// The u for which influences K u, with K the likeness, make the sum of squared errors and the charge for u' K u smallest: of
/// (M K + charge) u = vector, with M K the system.
fn charged(system: &DMatrix<f64>, charge: f64, vector: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mut matrix = system.clone();
    (0..matrix.nrows()).for_each(|i| matrix[(i, i)] += charge);
    matrix.lu().solve(vector)
}

/// A product of matrices in one order of sums on every machine, which nalgebra's own is not.
fn product(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let mut result = DMatrix::zeros(left.nrows(), right.ncols());
    for (mut column, factors) in result.column_iter_mut().zip(right.column_iter()) {
        for (of_left, x) in left.column_iter().zip(factors.iter()) {
            column.axpy(*x, &of_left, 1.0);
        }
    }
    result
}

fn likeness(sensors: &[(usize, usize)], reach: f64) -> DMatrix<f64> {
    DMatrix::from_fn(sensors.len(), sensors.len(), |i, j| alike(sensors[i], sensors[j], reach))
}

/// How much alike the influences of two places are taken to be: 1 of the same, half that at the reach.
pub fn alike((row, column): (usize, usize), (r, c): (usize, usize), reach: f64) -> f64 {
    let squared = (row.abs_diff(r) * row.abs_diff(r) + column.abs_diff(c) * column.abs_diff(c)) as f64;
    1.0 / (1.0 + squared / (reach * reach))
}
