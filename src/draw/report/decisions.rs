//! The answers of a team, as a table and in remarks, for the page and the terminal.

use crate::base::number;
use crate::base::number::percent;
use crate::store::team::Accuracy;
use crate::store::team::{Decoded, TeamFile};

/// Published results on the ten digits of MNIST in mechanics.
const LITERATURE: &str = "mechanics elsewhere: an oscillating plate with trained weights around it, 87 % of \
                          MNIST's test images (Wright et al. 2022, Nature 601, 549)";

/// Returns headers and rows of the team's answers and of baselines without bodies on the same
/// images, or `None` without answers.
pub(crate) fn table(file: &TeamFile) -> Option<(Vec<String>, Vec<Vec<String>>)> {
    let (Some(answers), Some(baselines)) = (&file.answers, &file.baselines) else {
        return None;
    };
    let row = |name: &str, accuracy: &Accuracy| {
        let [accuracy, interval] = figures(accuracy);
        vec![name.to_string(), accuracy, interval]
    };
    let of_decoder = |decoded: &Decoded| {
        decoded
            .per_class
            .values()
            .map(|share| percent(*share))
            .collect()
    };
    let none = || vec![String::new(); file.classes.len()];
    let rows: [(Vec<String>, Vec<String>); 6] = [
        (
            row("team, most votes", &answers.votes.accuracy),
            of_decoder(&answers.votes),
        ),
        (
            row("team, sum of walks", &answers.walks.accuracy),
            of_decoder(&answers.walks),
        ),
        (
            row("linear, pairs with votes", &baselines.linear_pairs),
            none(),
        ),
        (
            row(
                "linear, one against rest",
                &baselines.linear_one_against_rest,
            ),
            none(),
        ),
        (
            row("nearest neighbour", &baselines.nearest_neighbour),
            none(),
        ),
        (
            row(
                &format!("best body ({})", baselines.best_body_id),
                &baselines.best_body,
            ),
            none(),
        ),
    ];
    let mut headers = ["answers", "accuracy %", "95 % interval"]
        .map(str::to_string)
        .to_vec();
    let names = file.names();
    let of = |class: &u8| format!("% of {}", names.name(*class));
    headers.extend(file.classes.iter().map(of));
    Some((
        headers,
        rows.map(|(row, classes)| [row, classes].concat()).to_vec(),
    ))
}

/// Returns remarks on these answers, in lines.
pub(crate) fn remarks(file: &TeamFile) -> Vec<String> {
    let (Some(answers), Some(baselines)) = (&file.answers, &file.baselines) else {
        return Vec::new();
    };
    let (images, robots) = (file.images.len(), file.members.len());
    let mut lines = vec![
        format!(
            "{images} {} {} images, {robots} robots, no trained weights",
            file.dataset, file.split
        ),
        format!(
            "most votes: {} % of the images had a tie, which the longer walks decided; on average {} % of the robots that know the answer voted \
             for it, {} of {robots} did not move",
            percent(answers.ties),
            percent(answers.agreement),
            number::fixed(answers.not_moved, 1)
        ),
        format!(
            "linear classifiers and nearest neighbour: {} training images, the pixels that the robots see",
            baselines.training_images
        ),
    ];
    if file.dataset == "mnist" && file.classes.len() == 10 {
        lines.push(LITERATURE.to_string());
    }
    lines
}

/// Formats accuracy and interval \[%\].
pub(crate) fn figures(accuracy: &Accuracy) -> [String; 2] {
    let [low, high] = accuracy.interval;
    [
        percent(accuracy.accuracy),
        format!("{}–{}", percent(low), percent(high)),
    ]
}
