//! The paper's published results, for comparison with ours.

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PaperRow {
    pub(crate) task: &'static str,
    /// Mean accuracy of ten robots on held-out images \[%\] (section "Generalization test").
    pub(crate) accuracy: f64,
    /// Hidden neurons of the equivalent network, if any ("Morphological cognition capacity").
    pub(crate) mlp: Option<f64>,
    /// Kernels of the equivalent convolutional network.
    pub(crate) cnn: Option<f64>,
}

/// The paper's table, on MNIST.
pub(crate) const PAPER: [PaperRow; 8] = [
    PaperRow {
        task: "0|1",
        accuracy: 76.57,
        mlp: Some(16.8),
        cnn: Some(5.9),
    },
    PaperRow {
        task: "0|123",
        accuracy: 68.47,
        mlp: None,
        cnn: None,
    },
    PaperRow {
        task: "1|023",
        accuracy: 58.96,
        mlp: None,
        cnn: Some(16.2),
    },
    PaperRow {
        task: "2|013",
        accuracy: 70.01,
        mlp: None,
        cnn: None,
    },
    PaperRow {
        task: "3|012",
        accuracy: 72.00,
        mlp: None,
        cnn: None,
    },
    PaperRow {
        task: "01|23",
        accuracy: 58.22,
        mlp: None,
        cnn: Some(15.1),
    },
    PaperRow {
        task: "02|13",
        accuracy: 62.02,
        mlp: None,
        cnn: Some(24.0),
    },
    PaperRow {
        task: "03|12",
        accuracy: 57.14,
        mlp: None,
        cnn: Some(13.7),
    },
];

/// Returns the paper's row of a task; there are rows for MNIST only.
pub(crate) fn row(dataset: &str, task: &str) -> Option<&'static PaperRow> {
    PAPER
        .iter()
        .find(|row| dataset == "mnist" && row.task == task)
}
