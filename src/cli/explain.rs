//! Errors in terms of the command line: the option concerned, and the command to type.

use crate::base::error::{Argument, Error};
use crate::base::remedy::{Invocation, Remedy, Value};
use crate::base::shell::{in_shell, quoted};
use std::fmt;

/// An error as the terminal shows it.
#[derive(Debug)]
pub struct Explained {
    /// Description of the problem.
    pub message: String,
    /// Remedies, in one sentence.
    pub hint: Option<String>,
}

impl fmt::Display for Explained {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Explained {}

/// Puts an error into terms of the command line.
pub fn explain(error: &Error) -> Explained {
    let message = match &error.argument {
        Some(Argument {
            name,
            value: Some(value),
        }) => format!("{} {value}: {}", option(name), error.message),
        Some(Argument { name, value: None }) => format!("{}: {}", option(name), error.message),
        None => error.message.clone(),
    };
    Explained {
        message,
        hint: hint(&error.remedies),
    }
}

/// Joins remedies into one sentence: "resume it with --resume, or write elsewhere with --out".
fn hint(remedies: &[Remedy]) -> Option<String> {
    // A step that follows another remedy is no alternative to it.
    let (last, is_then) = match remedies {
        [.., _, last @ (Remedy::Repeat | Remedy::RepeatResuming)] => (Some(words(last)), true),
        _ => (None, false),
    };
    let alternatives: Vec<String> = remedies[..remedies.len() - usize::from(is_then)]
        .iter()
        .map(words)
        .collect();
    let text = match alternatives.as_slice() {
        [] => return None,
        [one] => one.clone(),
        [first, second] => format!("{first}, or {second}"),
        [first @ .., last] => format!("{}, or {last}", first.join(", ")),
    };
    Some(last.map_or(text.clone(), |last| format!("{text}; then {last}")))
}

fn words(remedy: &Remedy) -> String {
    match remedy {
        Remedy::Advice(text) => text.clone(),
        Remedy::Run(invocation, "") => format!("`{}`", spell(invocation)),
        Remedy::Run(invocation, effect) => format!("`{}` {effect}", spell(invocation)),
        Remedy::Repeat => "the same command goes on".to_string(),
        Remedy::RepeatResuming => "the same command with --resume goes on".to_string(),
        Remedy::Resume => "go on with it by --resume".to_string(),
        Remedy::Replace => "start anew with --force, which replaces it".to_string(),
        Remedy::ChooseOut => "write elsewhere with --out".to_string(),
        Remedy::MoveAway => "move it away".to_string(),
        Remedy::NameRun => "name one with --archive".to_string(),
        Remedy::AddRuns => "add runs whose tasks have it with --archive".to_string(),
        Remedy::ChooseRobots(None) => "choose others with --robots".to_string(),
        Remedy::ChooseRobots(Some(selection)) => {
            format!("choose others, such as the fittest with --robots {selection}")
        }
        Remedy::TakeUnphysical => "leave --physical-only out to take it all the same".to_string(),
        Remedy::NameData => "name the folder of the images with --data".to_string(),
        Remedy::UseBuiltin => {
            "use the digits that the program draws with --dataset builtin".to_string()
        }
        Remedy::ShowOtherDataset => "show another dataset's images with --dataset NAME".to_string(),
        Remedy::DrawTrainingImages => {
            "let --set data.train_images= draw images of the task's classes by the seed".to_string()
        }
        Remedy::NameClasses => "name the classes with --classes".to_string(),
        Remedy::MeasureWithSeed(seed) => format!("measure with --seed {seed}"),
        Remedy::LeaveOutRollouts => "leave out the moving pictures with --rollouts 0".to_string(),
        Remedy::NameMirror => "name another mirror with --mirror".to_string(),
        Remedy::ChoosePort => {
            "name another with --port, or leave it out to take a free one".to_string()
        }
        Remedy::NameRobot(id) => format!("name one, as in --robot {id}"),
        Remedy::WriteFrames => {
            "write its frames with --format frames, which prints the command that makes a film of them"
                .to_string()
        }
        Remedy::FreeSpace(folder) => {
            format!("make space on the disk that {} is on", folder.display())
        }
    }
}

fn option(name: &str) -> String {
    format!("--{}", name.replace('_', "-"))
}

/// Returns a command as typed into a shell.
pub fn spell(invocation: &Invocation) -> String {
    let value = |value: &Value| match value {
        Value::Word(word) => quoted(word),
        Value::Path(path) => in_shell(path),
        Value::Placeholder(text) => (*text).to_string(),
    };
    let mut line = format!("morphcog {}", invocation.command);
    for word in invocation.values.iter().map(value) {
        line += &format!(" {word}");
    }
    for (name, given) in &invocation.options {
        line += &format!(" {}", option(name));
        if let Some(given) = given {
            line += &format!(" {}", value(given));
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn arguments_and_remedies_are_spelled_as_they_are_typed() {
        let error =
            Error::argument("control_steps", 0, "expected 1 or more").remedy(Remedy::Resume);
        let explained = explain(&error.remedy(Remedy::ChooseOut).remedy(Remedy::Replace));
        assert_eq!(explained.message, "--control-steps 0: expected 1 or more");
        let hint = "go on with it by --resume, write elsewhere with --out, or start anew with --force, which \
                    replaces it";
        assert_eq!(explained.hint.as_deref(), Some(hint));
        let full = Error::other("full".to_string()).remedy(Remedy::FreeSpace("a".into()));
        let hint = "make space on the disk that a is on; then the same command goes on";
        assert_eq!(
            explain(&full.remedy(Remedy::Repeat)).hint.as_deref(),
            Some(hint)
        );
        assert_eq!(
            explain(&Error::other("x".to_string()).remedy(Remedy::Repeat))
                .hint
                .unwrap(),
            "the same command goes on"
        );
        assert_eq!(explain(&Error::other("x".to_string())).hint, None);
    }

    #[test]
    fn commands_are_spelled_for_a_shell() {
        let invocation = Invocation::new("train")
            .option("archive", Path::new("a b"))
            .option("task", "4|9");
        assert_eq!(
            spell(&invocation),
            "morphcog train --archive 'a b' --task '4|9'"
        );
        let fetch = Invocation::new("data fetch")
            .value("mnist")
            .option("to", Value::Placeholder("DIR"));
        assert_eq!(
            spell(&fetch.switch("force", true)),
            "morphcog data fetch mnist --to DIR --force"
        );
    }
}
