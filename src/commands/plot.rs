//! `morphcog plot`: writes figures as SVG, PNG and PDF.

use crate::analysis;
use crate::analysis::gates::GateWalks;
use crate::analysis::progress::Progress;
use crate::base::error::Error;
use crate::base::remedy::{Invocation, Remedy};
use crate::base::session::Session;
use crate::commands::replay;
use crate::commands::replay::{FoundRobot, ReplayOptions};
use crate::draw::error::write_whole;
use crate::draw::plot;
use crate::draw::plot::{Background, Figure, PRINT, Style};
use crate::robots::published;
use crate::search::one_by_one::Named;
use crate::shipped::exists;
use crate::store::capacity::CapacityFile;
use crate::store::eval::EvalFile;
use crate::store::folder;
use crate::store::names::METRICS;
use crate::store::names::{CAPACITY_JSON, EVAL_JSON, FigureFormat, RUN_JSON};
use crate::store::results::making;
use crate::store::run::{RunFile, different};
use crate::store::stored_run::StoredRun;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// The subject of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FigureKind {
    /// The voxels of a robot.
    Body,
    /// The position of a robot over time.
    Spacetime,
    /// Poses of a robot's rollout.
    Snapshots,
    /// The fitness in the archive.
    Archive,
    /// The metrics of a run.
    Progress,
    /// The results of `eval`.
    Accuracy,
    /// The results of `capacity`.
    Capacity,
    /// The logic gates of a run on the dataset `gates`.
    Gates,
}

impl FigureKind {
    pub(crate) const ALL: [(FigureKind, &str); 8] = [
        (FigureKind::Body, "body"),
        (FigureKind::Spacetime, "spacetime"),
        (FigureKind::Snapshots, "snapshots"),
        (FigureKind::Archive, "archive"),
        (FigureKind::Progress, "progress"),
        (FigureKind::Accuracy, "accuracy"),
        (FigureKind::Capacity, "capacity"),
        (FigureKind::Gates, "gates"),
    ];

    /// Returns true if it shows a robot, and false if it shows a run.
    pub fn is_of_robot(self) -> bool {
        matches!(
            self,
            FigureKind::Body | FigureKind::Spacetime | FigureKind::Snapshots
        )
    }
}

impl fmt::Display for FigureKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        FigureKind::ALL
            .iter()
            .filter(|(kind, _)| kind == self)
            .try_for_each(|(_, name)| f.write_str(name))
    }
}

impl FromStr for FigureKind {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let found = FigureKind::ALL.iter().find(|(_, name)| *name == text);
        let names = || FigureKind::ALL.map(|(_, name)| name).join(", ");
        found
            .map(|(kind, _)| *kind)
            .ok_or_else(|| format!("expected one of {}", names()))
    }
}

/// The figures to make, and their files.
#[derive(Clone, Debug)]
pub struct PlotOptions {
    /// The subject.
    pub kind: FigureKind,
    /// The run.json files; if empty, the newest under `runs/`.
    pub archives: Vec<PathBuf>,
    /// The robots, for kinds that show a robot.
    pub robots: Vec<Named>,
    /// The options that find robots and images; its own robot and archive are ignored.
    pub options: ReplayOptions,
    /// The control steps between poses; 0 chooses them from the walk.
    pub every: usize,
    /// The file; `None` writes one of each format beside the run.json.
    pub out: Option<PathBuf>,
    /// The pixels of PNG per inch; `None` is as for print, or as many as possible.
    pub dpi: Option<u32>,
    /// The background.
    pub background: Background,
    /// The width, title and font.
    pub style: Style,
}

/// The result of `plot`, besides files.
#[derive(Clone, Debug)]
pub struct PlotOutcome {
    pub(crate) progress: Vec<Progress>,
    pub(crate) gates: Vec<GateWalks>,
}

/// A figure and its file without the extension.
struct Made {
    figure: Figure,
    stem: PathBuf,
}

/// Makes figures, and reports each file to the observer when it is written.
///
/// # Errors
/// Returns an error if an input is invalid, or a figure cannot be made or written.
pub fn plot(wanted: &PlotOptions, session: &Session) -> Result<PlotOutcome, Error> {
    let formats = formats(wanted.out.as_deref())?;
    let archives = match wanted.archives.as_slice() {
        [] if !wanted.kind.is_of_robot() => vec![folder::newest_run()?],
        archives => archives.to_vec(),
    };
    let count = match wanted.kind {
        FigureKind::Progress => 1,
        kind if kind.is_of_robot() => wanted.robots.len(),
        _ => archives.len(),
    };
    if count > 1 && wanted.out.is_some() {
        return Err(
            Error::usage(format!("expected with one figure only, these are {count}")).about("out"),
        );
    }
    let named = |path: &Path, format: FigureFormat| match path.extension() {
        Some(_) => path.to_path_buf(),
        None => with_ending(path, format),
    };
    if let Some(path) = &wanted.out {
        formats
            .iter()
            .try_for_each(|format| folder::writable(&named(path, *format)))?;
    }
    let (mut progress, mut gates) = (Vec::new(), Vec::new());
    let write = |made: Made| -> Result<(), Error> {
        let figure = made.figure.on(wanted.background);
        has_letters(&figure, &wanted.style)?;
        let made = |format: &FigureFormat| -> Result<(PathBuf, Vec<u8>), Error> {
            let path = match &wanted.out {
                Some(path) => named(path, *format),
                None => with_ending(&made.stem, *format),
            };
            let bytes = match format {
                FigureFormat::Png => png(session, &path, &figure, wanted.dpi)?,
                format => figure.bytes(*format)?,
            };
            Ok((path, bytes))
        };
        // Makes all files before writing any.
        for (path, bytes) in formats.iter().map(made).collect::<Result<Vec<_>, _>>()? {
            write_whole(&path, &bytes)?;
            session.observer.wrote(&path, "");
        }
        Ok(())
    };
    if wanted.kind == FigureKind::Progress {
        let (figure, lines) = of_progress(wanted, &archives, session)?;
        let stem = folder::beside_all(&archives, &format!("plot-{}", wanted.kind));
        write(Made { figure, stem })?;
        progress = lines;
    } else if wanted.kind == FigureKind::Gates {
        for path in &archives {
            let (figure, found) = of_gates(wanted, path, session)?;
            let stem = stem(path, wanted.kind, "");
            write(Made { figure, stem })?;
            gates.extend(found);
        }
    } else if wanted.kind.is_of_robot() {
        for robot in &wanted.robots {
            write(of_robot(wanted, robot, session)?)?;
        }
    } else {
        if wanted.kind == FigureKind::Archive {
            let runs: Vec<RunFile> = archives
                .iter()
                .map(|path| RunFile::read(path))
                .collect::<Result<_, _>>()?;
            different(archives.iter().map(PathBuf::as_path).zip(&runs))?;
        }
        let made = |path: &PathBuf| -> Result<Made, Error> {
            let stem = stem(path, wanted.kind, &result_name(wanted.kind, path));
            Ok(Made {
                figure: of_run(wanted, path)?,
                stem,
            })
        };
        let all = archives.iter().map(made).collect::<Result<Vec<_>, _>>()?;
        if let Some(dpi) = wanted.dpi.filter(|_| formats.contains(&FigureFormat::Png)) {
            all.iter()
                .try_for_each(|made| possible(&made.figure, dpi))?;
        }
        all.into_iter().try_for_each(write)?;
    }
    Ok(PlotOutcome { progress, gates })
}

/// Makes one figure, of a run or of a robot of it, and writes nothing.
///
/// # Errors
/// Returns an error if an input is invalid, there are several runs or robots, or the figure cannot
/// be made.
pub fn one(wanted: &PlotOptions, session: &Session) -> Result<Figure, Error> {
    let [path] = &wanted.archives[..] else {
        return Err(Error::usage("expected one run".to_string()).about("archive"));
    };
    let figure = match wanted.kind {
        kind if kind.is_of_robot() => {
            let [robot] = &wanted.robots[..] else {
                return Err(Error::usage("expected one robot".to_string()).about("robot"));
            };
            of_robot(wanted, robot, session)?.figure
        }
        FigureKind::Gates => of_gates(wanted, path, session)?.0,
        FigureKind::Progress => of_progress(wanted, &wanted.archives, session)?.0,
        _ => of_run(wanted, path)?,
    };
    Ok(figure.on(wanted.background))
}

/// Encodes a figure as PNG; notes if its resolution is lower than usual.
fn png(
    session: &Session,
    path: &Path,
    figure: &Figure,
    dpi: Option<u32>,
) -> Result<Vec<u8>, Error> {
    if let Some(dpi) = dpi {
        possible(figure, dpi)?;
        return Ok(figure.png(dpi)?);
    }
    let fitting = figure.fitting(PRINT);
    if fitting < PRINT {
        let text = format!("{fitting} pixels per inch, because with {PRINT} it would be too large");
        session
            .observer
            .note(&format!("note: {}: {text}", path.display()));
    }
    Ok(figure.print()?)
}

/// Checks that the user's font has all letters of a figure.
fn has_letters(figure: &Figure, style: &Style) -> Result<(), Error> {
    let lacking = figure.lacking();
    if style.is_embedded() || lacking.is_empty() {
        return Ok(());
    }
    let letters: Vec<String> = lacking.iter().take(8).map(char::to_string).collect();
    let more = if lacking.len() > 8 { " and others" } else { "" };
    let text = format!(
        "{}: the font lacks letters of the figure: {}{more}",
        figure.title(),
        letters.join(" ")
    );
    let error = Error::input(text).about("font");
    Err(error.advice("choose a font that has them, or none for the program's own"))
}

/// Checks that a figure can have so many pixels per inch.
fn possible(figure: &Figure, dpi: u32) -> Result<(), Error> {
    let most = figure.fitting(dpi);
    match most < dpi {
        true => {
            let text = format!(
                "{}: expected at most {most}, or an .svg or .pdf file",
                figure.title()
            );
            Err(Error::argument("dpi", dpi, text))
        }
        false => Ok(()),
    }
}

/// Returns the formats that a file name implies.
pub(crate) fn formats(out: Option<&Path>) -> Result<Vec<FigureFormat>, Error> {
    let all = FigureFormat::ALL.to_vec();
    let Some(path) = out else {
        return Ok(all);
    };
    folder::check_is_file_path(path)?;
    let Some(ending) = path.extension() else {
        return Ok(all);
    };
    let is_meant = |format: &FigureFormat| ending.eq_ignore_ascii_case(format.ending());
    match all.into_iter().find(is_meant) {
        Some(format) => Ok(vec![format]),
        None => {
            let text = "expected a file name that ends in .svg, .png or .pdf";
            Err(Error::argument("out", path.display(), text))
        }
    }
}

fn with_ending(stem: &Path, format: FigureFormat) -> PathBuf {
    let mut name = stem.as_os_str().to_owned();
    name.push(".");
    name.push(format.ending());
    PathBuf::from(name)
}

/// Returns the error for a robot named with a kind of figure that shows none.
pub(crate) fn no_robot(kind: FigureKind) -> Error {
    let of_robots = FigureKind::ALL
        .iter()
        .filter(|(kind, _)| kind.is_of_robot())
        .map(|(_, name)| *name);
    let of_robots = of_robots.collect::<Vec<_>>().join(", ");
    let text = format!("plot {kind} shows no single robot; expected with {of_robots} only");
    Error::usage(text).about("robot")
}

/// Returns the error for a run with too few generations for a line.
fn too_short(path: &Path, run: &RunFile, generations: usize) -> Error {
    let path = path.with_file_name(METRICS);
    let text = format!(
        "{}: expected at least 2 generations, found {generations}",
        path.display()
    );
    match run.origin {
        Some(_) => Error::input(text).remedy(Remedy::Run(
            Invocation::new("plot").value("accuracy"),
            "shows what its test found",
        )),
        None => Error::input(text),
    }
}

/// `plot-<kind>[-robot]` beside a run.json.
fn stem(archive: &Path, kind: FigureKind, robot: &str) -> PathBuf {
    let name = if robot.is_empty() {
        format!("plot-{kind}")
    } else {
        format!("plot-{kind}-{robot}")
    };
    // Published robots have names by which their files are known.
    match archive == published::archive() {
        true => PathBuf::from(name),
        false => folder::beside(archive, &name),
    }
}

fn of_robot(wanted: &PlotOptions, named: &Named, session: &Session) -> Result<Made, Error> {
    let Named { archive, robot } = named.clone();
    let options = ReplayOptions {
        robot,
        archive: Some(archive.clone()),
        ..wanted.options.clone()
    };
    let made = |found: &FoundRobot, figure| Made {
        figure,
        stem: stem(&archive, wanted.kind, &found.name),
    };
    if wanted.kind == FigureKind::Body {
        let found = replay::find(&options)?;
        return Ok(made(
            &found,
            plot::body(&found.body, &found.title(), &wanted.style),
        ));
    }
    let subject = replay::subject(&options)?;
    let title = subject.found.title();
    let recording = replay::record_subject(&subject, session.stop)?;
    let figure = match wanted.kind {
        FigureKind::Snapshots => plot::snapshots(&recording, wanted.every, &title, &wanted.style),
        _ => plot::spacetime(&recording, &title, &wanted.style),
    }?;
    Ok(made(&subject.found, figure))
}

/// Makes the figure of a run's logic gates; returns their walks, too.
fn of_gates(
    wanted: &PlotOptions,
    path: &Path,
    session: &Session,
) -> Result<(Figure, Vec<GateWalks>), Error> {
    let source = StoredRun::read(path)?;
    let found = analysis::gates::walks(&source, session)?;
    let figure = plot::gates(&found, source.run.called(), &wanted.style);
    Ok((figure, found))
}

/// Makes the figure of the metrics of runs; returns the lines, too. Runs that are too short are
/// left out with a warning, unless all are.
fn of_progress(
    wanted: &PlotOptions,
    archives: &[PathBuf],
    session: &Session,
) -> Result<(Figure, Vec<Progress>), Error> {
    let paths: Vec<&Path> = archives.iter().map(PathBuf::as_path).collect();
    let runs: Vec<RunFile> = paths
        .iter()
        .map(|path| RunFile::read(path))
        .collect::<Result<_, _>>()?;
    let named = || paths.iter().copied().zip(&runs);
    different(named())?;
    let (mut lines, mut short) = (Vec::new(), Vec::new());
    for (path, run) in named() {
        let line = Progress::of(run, path)?;
        match line.moments.len() {
            0 | 1 => short.push(too_short(path, run, line.moments.len())),
            _ => lines.push(line),
        }
    }
    match short.first() {
        Some(error) if lines.is_empty() => return Err(error.clone()),
        _ => short
            .iter()
            .for_each(|error| session.observer.warning(&format!("{error}; left out"))),
    }
    let figure = plot::progress(&lines, &wanted.style);
    Ok((figure, lines))
}

fn of_run(wanted: &PlotOptions, path: &Path) -> Result<Figure, Error> {
    let (kind, style) = (wanted.kind, &wanted.style);
    let maker = if kind == FigureKind::Accuracy {
        "eval"
    } else {
        "capacity"
    };
    let with_maker = |error: Error| match error.remedies.is_empty() {
        true => error.remedy(Remedy::Run(making(maker, path), "makes it")),
        false => error,
    };
    match kind {
        FigureKind::Accuracy => {
            let beside = result(path, EVAL_JSON);
            let report = match beside == *path {
                true => EvalFile::read(path),
                false => RunFile::read(path).and_then(|run| EvalFile::of_runs(&beside, &[&run])),
            };
            let (report, path) = (report.map_err(with_maker)?, beside);
            if report.robots.is_empty() {
                let text = format!(
                    "{}: robots: expected at least one, found none",
                    path.display()
                );
                return Err(with_maker(Error::input(text)));
            }
            Ok(plot::accuracy(&report, style))
        }
        FigureKind::Capacity => {
            let (beside, eval) = (result(path, CAPACITY_JSON), folder::beside(path, EVAL_JSON));
            let mut file = CapacityFile::read(&beside).map_err(with_maker)?;
            if beside != *path {
                let run = RunFile::read(path)?;
                let is_of_it = match exists(&eval) {
                    // The runs of its robots.
                    true => file.is_of(&EvalFile::of_runs(&eval, &[&run])?),
                    false => file.run == run.name,
                };
                if !is_of_it {
                    let text = format!(
                        "{}: it is about the robots of another run",
                        beside.display()
                    );
                    let remedy = Remedy::Run(making("capacity", path), "makes that of this run");
                    return Err(Error::input(text).remedy(remedy));
                }
                file.run = run.called().to_string();
            }
            Ok(plot::capacity(&file, style))
        }
        _ => RunFile::read(path).map(|run| plot::archive(&run, style)),
    }
}

/// Returns the usual result file of a run.json, or the given file itself if it is no run.json.
fn result(path: &Path, name: &str) -> PathBuf {
    match path.file_name().is_some_and(|given| given == RUN_JSON) {
        true => folder::beside(path, name),
        false => path.to_path_buf(),
    }
}

/// Returns the part of a figure's name that comes from a directly named result file.
fn result_name(kind: FigureKind, path: &Path) -> String {
    let is_result = matches!(kind, FigureKind::Accuracy | FigureKind::Capacity);
    let stem = path
        .file_stem()
        .filter(|_| is_result && path.file_name().is_some_and(|name| name != RUN_JSON));
    stem.map_or(String::new(), |stem| stem.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_named_and_endings_say_the_format() {
        for (kind, name) in FigureKind::ALL {
            assert_eq!(
                (name.parse::<FigureKind>(), kind.to_string()),
                (Ok(kind), name.to_string())
            );
        }
        assert!(
            "pie"
                .parse::<FigureKind>()
                .unwrap_err()
                .contains("spacetime")
        );
        let one = |path: &str| formats(Some(Path::new(path))).unwrap();
        assert_eq!(one("a.SVG"), [FigureFormat::Svg]);
        assert_eq!(one("a.pdf"), [FigureFormat::Pdf]);
        assert_eq!(one("a"), FigureFormat::ALL);
        assert_eq!(
            formats(Some(Path::new("a.eps")))
                .unwrap_err()
                .kind
                .exit_code(),
            2
        );
        assert_eq!(
            with_ending(Path::new("x/plot-a.b"), FigureFormat::Svg),
            Path::new("x/plot-a.b.svg")
        );
    }
}
