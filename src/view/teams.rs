//! What `morphcog team` says at its end, and its pictures.

use crate::base::error::Error;
use crate::base::number;
use crate::base::number::percent;
use crate::store::team::{Decoded, FIGURES, Member, TeamFile, figure};
use crate::task::voting::Accuracy;
use crate::view::console::{Console, Mode};
use crate::view::error::write_whole;
use crate::view::plot;
use std::path::Path;

/// What others did with the ten digits of MNIST in mechanics.
const LITERATURE: &str = "mechanics elsewhere: an oscillating plate with trained weights around it, 87 % of \
                          MNIST's test images (Wright et al. 2022, Nature 601, 549)";

/// After a test: a line per robot, the answers of the team, what answers the same images without
/// bodies, and pictures beside `out`, if that was written.
///
/// # Errors
/// If a picture cannot be made or written.
pub fn team(console: &Console, file: &TeamFile, out: Option<&Path>) -> Result<(), Error> {
    let pictures = match out.filter(|_| file.answers.is_some()) {
        Some(out) => pictures(file, out)?,
        None => Vec::new(),
    };
    if console.mode() == Mode::Json {
        let without = |member: &Member| Member { displacements: Vec::new(), ..member.clone() };
        let short = |decoded: &Decoded| {
            serde_json::json!({ "accuracy": decoded.accuracy, "per_class": decoded.per_class,
            "confusion": decoded.confusion })
        };
        let answers = file.answers.as_ref().map(|all| {
            serde_json::json!({ "votes": short(&all.votes), "walks": short(&all.walks), "ties": all.ties,
                "agreement": all.agreement, "not_moved": all.not_moved })
        });
        let done = serde_json::json!({
            "file": out.map(|out| out.display().to_string()), "stopped": file.answers.is_none(),
            "images": file.images.len(), "split": file.split, "classes": file.classes,
            "answers": answers, "baselines": file.baselines,
            "members": file.members.iter().map(without).collect::<Vec<_>>(), "pictures": pictures,
        });
        console.event("team", &done);
        return Ok(());
    }
    if file.members.is_empty() {
        return Ok(());
    }
    let row = |member: &Member| {
        let task = member.task.clone();
        let [own, interval] = figures(&member.own);
        vec![member.id.clone(), task, own, interval, percent(member.not_moved)]
    };
    let headers = ["robot", "task", "% of its classes", "95 % interval", "not moved %"];
    console.table(&headers, &file.members.iter().map(row).collect::<Vec<_>>());
    console.line("");
    answers(console, file);
    if let Some(out) = out {
        console.line(&format!("wrote {} and {}", out.display(), out.with_extension("csv").display()));
    }
    pictures.iter().for_each(|path| console.line(&format!("wrote {path}")));
    Ok(())
}

fn answers(console: &Console, file: &TeamFile) {
    let Some((headers, rows)) = table(file) else { return };
    let headers: Vec<&str> = headers.iter().map(String::as_str).collect();
    console.table(&headers, &rows);
    console.line("");
    remarks(file).iter().for_each(|line| console.line(line));
}

/// What the team answers, and what answers the same images without bodies: headers and rows; none
/// while there are no answers.
pub(super) fn table(file: &TeamFile) -> Option<(Vec<String>, Vec<Vec<String>>)> {
    let (Some(answers), Some(baselines)) = (&file.answers, &file.baselines) else { return None };
    let row = |name: &str, accuracy: &Accuracy| {
        let [accuracy, interval] = figures(accuracy);
        vec![name.to_string(), accuracy, interval]
    };
    let of_decoder = |decoded: &Decoded| decoded.per_class.values().map(|share| percent(*share)).collect();
    let none = || vec![String::new(); file.classes.len()];
    let rows: [(Vec<String>, Vec<String>); 6] = [
        (row("team, most votes", &answers.votes.accuracy), of_decoder(&answers.votes)),
        (row("team, sum of walks", &answers.walks.accuracy), of_decoder(&answers.walks)),
        (row("linear, pairs with votes", &baselines.linear_pairs), none()),
        (row("linear, one against rest", &baselines.linear_one_against_rest), none()),
        (row("nearest neighbour", &baselines.nearest_neighbour), none()),
        (row(&format!("best body ({})", baselines.best_body_id), &baselines.best_body), none()),
    ];
    let mut headers = ["answers", "accuracy %", "95 % interval"].map(str::to_string).to_vec();
    headers.extend(file.classes.iter().map(|class| format!("% of {class}")));
    Some((headers, rows.map(|(row, classes)| [row, classes].concat()).to_vec()))
}

/// What is to be said of these answers, in lines.
pub(super) fn remarks(file: &TeamFile) -> Vec<String> {
    let (Some(answers), Some(baselines)) = (&file.answers, &file.baselines) else { return Vec::new() };
    let (images, robots) = (file.images.len(), file.members.len());
    let mut lines = vec![
        format!("{images} {} {} images, {robots} robots, no trained weights", file.dataset, file.split),
        format!(
            "most votes: {} % of the images had a tie; on average {} % of the robots that know the answer voted \
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

/// Accuracy and interval \[%\].
fn figures(accuracy: &Accuracy) -> [String; 2] {
    let [low, high] = accuracy.interval;
    [percent(accuracy.accuracy), format!("{}–{}", percent(low), percent(high))]
}

/// Writes the confusion matrix and the poster of all bodies; their paths.
fn pictures(file: &TeamFile, out: &Path) -> Result<Vec<String>, Error> {
    let mut written = Vec::new();
    for (name, drawn) in FIGURES.into_iter().zip([plot::confusion(file), plot::poster(file)]) {
        let Some(drawn) = drawn else { continue };
        for (path, bytes) in figure(out, name).into_iter().zip([drawn.svg().into_bytes(), drawn.print()?]) {
            write_whole(&path, &bytes)?;
            written.push(path.display().to_string());
        }
    }
    Ok(written)
}
