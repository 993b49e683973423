//! The results of `morphcog team`, and its pictures.

use crate::base::error::Error;
use crate::base::number::percent;
use crate::cli::output::console::{Console, Mode};
use crate::draw::plot;
use crate::draw::plot::Style;
use crate::draw::report::decisions::{figures, remarks, table};
use crate::store::team::{Decoded, FIGURES, Member, TeamFile, figure};
use std::path::Path;

/// Writes the results of a test: a line per robot, the team's answers, the baselines without
/// bodies, and pictures beside `out`, if that was written.
pub(crate) fn team(console: &Console, file: &TeamFile, out: Option<&Path>) -> Result<(), Error> {
    let pictures = match out.filter(|_| file.answers.is_some()) {
        Some(out) => pictures(file, out)?,
        None => Vec::new(),
    };
    if console.mode() == Mode::Json {
        let without = |member: &Member| Member {
            displacements: Vec::new(),
            ..member.clone()
        };
        let short = |decoded: &Decoded| {
            serde_json::json!({ "accuracy": decoded.accuracy, "per_class": decoded.per_class,
            "confusion": decoded.confusion })
        };
        let answers = file.answers.as_ref().map(|all| {
            serde_json::json!({ "votes": short(&all.votes), "walks": short(&all.walks), "ties": all.ties,
                "agreement": all.agreement, "not_moved": all.not_moved })
        });
        let mut done = serde_json::json!({
            "file": out.map(|out| out.display().to_string()), "stopped": file.answers.is_none(),
            "images": file.images.len(), "split": file.split, "classes": file.classes,
            "answers": answers, "baselines": file.baselines,
            "members": file.members.iter().map(without).collect::<Vec<_>>(), "pictures": pictures,
        });
        if !file.class_names.is_empty() {
            done["class_names"] = serde_json::json!(file.class_names);
        }
        console.event("team", &done);
        return Ok(());
    }
    if file.members.is_empty() {
        return Ok(());
    }
    let row = |member: &Member| {
        let task = member.task.clone();
        let [own, interval] = figures(&member.own);
        vec![
            member.id.clone(),
            task,
            own,
            interval,
            percent(member.not_moved),
        ]
    };
    let headers = [
        "robot",
        "task",
        "% of its classes",
        "95 % interval",
        "not moved %",
    ];
    console.table(&headers, &file.members.iter().map(row).collect::<Vec<_>>());
    console.line("");
    answers(console, file);
    if let Some(out) = out {
        console.line(&format!(
            "wrote {} and {}",
            out.display(),
            out.with_extension("csv").display()
        ));
    }
    pictures
        .iter()
        .for_each(|path| console.line(&format!("wrote {path}")));
    Ok(())
}

fn answers(console: &Console, file: &TeamFile) {
    let Some((headers, rows)) = table(file) else {
        return;
    };
    let headers: Vec<&str> = headers.iter().map(String::as_str).collect();
    console.table(&headers, &rows);
    console.line("");
    remarks(file).iter().for_each(|line| console.line(line));
}

/// Writes the confusion matrix and the poster of all bodies; returns their paths.
fn pictures(file: &TeamFile, out: &Path) -> Result<Vec<String>, Error> {
    let (mut written, style) = (Vec::new(), Style::default());
    for (name, drawn) in FIGURES
        .into_iter()
        .zip([plot::confusion(file, &style), plot::poster(file, &style)])
    {
        let Some(drawn) = drawn else { continue };
        let paths = figure(out, name);
        drawn.write(&paths)?;
        for path in paths {
            written.push(path.display().to_string());
        }
    }
    Ok(written)
}
