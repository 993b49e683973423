//! `morphcog data import`: its arguments, and the words about a dataset that was made.

use crate::base::error::{Error, ErrorKind};
use crate::base::shell::{in_shell, quoted};
use crate::base::text::counted;
use crate::cli::output::console::{Console, Mode};
use crate::cli::values::{decimal, seed, threads, whole};
use crate::cli::{Resources, in_session};
use crate::commands::data::{self, ImportOptions, ImportSource, Imported};
use crate::data::import::{Fit, Fitted};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Number of images that are listed among those left out.
const LISTED: usize = 10;

#[derive(Debug, Args)]
pub(super) struct ImportArgs {
    /// Folder with one subfolder of pictures per class, or .npz, .npy, CSV, Parquet or IDX files.
    #[arg(required = true, value_name = "SOURCE")]
    sources: Vec<PathBuf>,
    /// Name of the dataset to make.
    #[arg(long)]
    name: String,
    /// Folder to write (default: data/<name>).
    #[arg(long, value_name = "DIR")]
    to: Option<PathBuf>,
    /// Share of each class for tests, if the source has no test images of its own.
    #[arg(long, value_name = "SHARE", default_value_t = 0.2, value_parser = decimal())]
    test: f64,
    /// Seed for drawing the test images.
    #[arg(long, default_value_t = 1, value_parser = seed())]
    seed: u64,
    /// Side of the images made of pictures, in pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 28, value_parser = whole::<usize>(4..=512))]
    size: usize,
    /// How pictures are fitted into that (auto: small ones of one size are kept).
    #[arg(long, value_enum, default_value_t = FitWord::Auto)]
    fit: FitWord,
    /// Invert all pictures (auto: if most have a bright ground).
    #[arg(long, value_enum, default_value_t = Choice::Auto)]
    invert: Choice,
    /// Swap rows and columns (auto: of files of EMNIST).
    #[arg(long, value_enum, default_value_t = Choice::Auto)]
    transpose: Choice,
    /// Replace a dataset that is in the folder.
    #[arg(long)]
    force: bool,
    /// Threads (default: one per core).
    #[arg(long, value_parser = threads())]
    threads: Option<u16>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FitWord {
    Auto,
    /// The whole picture, scaled.
    Whole,
    /// What stands out from the ground, scaled and centred.
    Content,
    /// The pixels as they are.
    Keep,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Choice {
    Auto,
    Yes,
    No,
}

impl Choice {
    fn chosen(self) -> Option<bool> {
        match self {
            Choice::Auto => None,
            Choice::Yes => Some(true),
            Choice::No => Some(false),
        }
    }
}

pub(super) fn run(args: ImportArgs, console: &Console) -> Result<(), Error> {
    let options = ImportOptions {
        name: args.name,
        to: args.to,
        test: args.test,
        seed: args.seed,
        size: args.size,
        fit: match args.fit {
            FitWord::Auto => Fit::Auto,
            FitWord::Whole => Fit::Whole,
            FitWord::Content => Fit::Content,
            FitWord::Keep => Fit::Keep,
        },
        invert: args.invert.chosen(),
        transpose: args.transpose.chosen(),
        force: args.force,
    };
    let source = ImportSource::Paths(args.sources);
    let made = in_session(console, Resources::of(args.threads, None), |session| {
        data::import(source, &options, session)
    });
    let made = made.map_err(|error| match error.kind {
        ErrorKind::Stopped => Error::stopped("stopped; nothing is written".to_string()),
        _ => error,
    })?;
    said(console, &made);
    next(console, &options, &made);
    Ok(())
}

/// Writes what was made, of what, and how.
fn said(console: &Console, made: &Imported) {
    if console.mode() == Mode::Json {
        return console.event("imported", made);
    }
    let row = |class: &data::ClassCount| {
        let (train, test) = (class.train, class.test);
        let name = class.name.clone().unwrap_or_default();
        let numbers = [train, test, train + test].map(|count| count.to_string());
        [vec![class.class.to_string(), name], numbers.to_vec()].concat()
    };
    let mut rows: Vec<Vec<String>> = made.classes.iter().map(row).collect();
    let mut headers = vec!["class", "name", "train", "test", "total"];
    if made.classes.iter().all(|class| class.name.is_none()) {
        headers.remove(1);
        rows.iter_mut().for_each(|row| drop(row.remove(1)));
    }
    console.table(&headers, &rows);
    for line in about(made) {
        console.line(&line);
    }
    for refused in made.refused.iter().take(LISTED) {
        console.warning(&format!("left out: {}: {}", refused.source, refused.reason));
    }
    if made.refused.len() > LISTED {
        let more = made.refused.len() - LISTED;
        console.warning(&format!(
            "left out: {}",
            counted(more, "more image", "more images")
        ));
    }
}

/// Describes how images were made of pictures.
fn about(made: &Imported) -> Vec<String> {
    let said = |[height, width]: [usize; 2]| format!("{height} × {width}");
    let size = said(made.size);
    let from = match made.sizes {
        [one, other] if one == other => said(one),
        [least, most] => format!("{} to {}", said(least), said(most)),
    };
    let mut lines = vec![match made.fit {
        Fitted::Kept => format!("images: {size} pixels, as they were"),
        Fitted::Whole => format!("images: {size} pixels; whole pictures of {from} were scaled"),
        Fitted::Content => format!(
            "images: {size} pixels; of pictures of {from}, what stands out was cut out, scaled and centred"
        ),
    }];
    let why = if made.inversion_chosen {
        "as asked for"
    } else {
        "most have a bright ground"
    };
    if made.inverted {
        lines.push(format!(
            "inverted ({why}): robots see bright things on a dark ground"
        ));
    }
    if made.transposed {
        let why = if made.emnist {
            "EMNIST's files are mirrored and turned"
        } else {
            "as asked for"
        };
        lines.push(format!("rows and columns were swapped ({why})"));
    }
    lines.push(match made.own_split {
        true => "training and test images are the source's own".to_string(),
        false => "test images were drawn from each class by the seed".to_string(),
    });
    lines.extend(made.notes.iter().cloned());
    if made.passed_over > 0 {
        let files = counted(
            made.passed_over,
            "file that is no picture was",
            "files that are no pictures were",
        );
        lines.push(format!("{files} passed over"));
    }
    if !made.refused.is_empty() {
        lines.push(format!(
            "{} left out",
            counted(made.refused.len(), "image was", "images were")
        ));
    }
    lines
}

/// Says where the dataset is, and what can be done with it.
fn next(console: &Console, options: &ImportOptions, made: &Imported) {
    if console.mode() != Mode::Json {
        let folder = made.folder.display();
        console.line_about(
            &made.folder,
            &format!("wrote {folder}; sheet.png shows images of each class"),
        );
    }
    // Otherwise they would be searched for where the environment says.
    let is_elsewhere = std::env::var_os("MORPHCOG_DATA").is_some_and(|value| !value.is_empty());
    let data = match options.to.is_some() || is_elsewhere {
        true => format!(" --data {}", in_shell(&made.folder)),
        false => String::new(),
    };
    let name = quoted(&made.name);
    console.suggest(
        "next:",
        &format!("morphcog train --pairs --dataset {name}{data}"),
    );
}
