//! Errors in terms of this module: the keyword concerned, and the remedies.

use morphcog::base::error::{Argument, Error};
use morphcog::base::remedy::Remedy;
use morphcog::cli::explain::spell;

/// Returns the text of an error and its remedies.
pub(crate) fn explained(error: &Error) -> String {
    let mut text = match &error.argument {
        // Errors in changes of a config name the key themselves.
        Some(Argument {
            name: "set",
            value: Some(value),
        }) => format!("{value}: {}", error.message),
        Some(Argument {
            name,
            value: Some(value),
        }) => format!("{name}={value}: {}", error.message),
        Some(Argument { name, value: None }) => format!("{name}: {}", error.message),
        None => error.message.clone(),
    };
    let remedies: Vec<String> = error.remedies.iter().map(words).collect();
    if !remedies.is_empty() {
        text += &format!("; {}", remedies.join(", or "));
    }
    text
}

fn words(remedy: &Remedy) -> String {
    match remedy {
        Remedy::Advice(text) => text.clone(),
        Remedy::Run(invocation, "") => format!("`{}`", spell(invocation)),
        Remedy::Run(invocation, effect) => format!("`{}` {effect}", spell(invocation)),
        Remedy::Repeat => "the same call goes on".to_string(),
        Remedy::RepeatResuming => "the same call with resume=True goes on".to_string(),
        Remedy::Resume => "go on with it by resume=True".to_string(),
        Remedy::Replace => "start anew with force=True, which replaces it".to_string(),
        Remedy::ChooseOut => "write elsewhere with out=…".to_string(),
        Remedy::MoveAway => "move it away".to_string(),
        Remedy::NameRun => "name one".to_string(),
        Remedy::AddRuns => "add runs whose tasks have it".to_string(),
        Remedy::ChooseRobots(None) => "choose others with robots=…".to_string(),
        Remedy::ChooseRobots(Some(selection)) => {
            format!("choose others, such as the fittest with robots=\"{selection}\"")
        }
        Remedy::TakeUnphysical => "leave physical_only out to take it all the same".to_string(),
        Remedy::NameData => "name the folder of the images with data=…".to_string(),
        Remedy::UseBuiltin => "use the digits that the program draws (dataset builtin)".to_string(),
        Remedy::ShowOtherDataset => "show another dataset's images with dataset=…".to_string(),
        Remedy::DrawTrainingImages => {
            "let data.train_images= draw images of the task's classes by the seed".to_string()
        }
        Remedy::NameClasses => "name the classes with classes=…".to_string(),
        Remedy::MeasureWithSeed(seed) => format!("measure with seed={seed}"),
        Remedy::LeaveOutRollouts => "leave out the moving pictures".to_string(),
        Remedy::NameMirror => "name another mirror".to_string(),
        Remedy::ChoosePort => "name another port, or leave it out to take a free one".to_string(),
        Remedy::NameRobot(id) => format!("name one, such as {id}"),
        Remedy::WriteFrames => "write its frames".to_string(),
        Remedy::FreeSpace(folder) => {
            format!("make space on the disk that {} is on", folder.display())
        }
    }
}
