//! The words of a report: its title, a methods paragraph, and the commands that reproduce it.

use crate::analysis::dossier::Dossier;
use crate::base::hash::short;
use crate::base::number;
use crate::base::number::percent;
use crate::base::remedy::{Invocation, Value};
use crate::base::shell::in_shell;
use crate::base::text::counted;
use crate::config::capacity::CapacityConfig;
use crate::config::train::TrainConfig;
use crate::config::{Config, Settings, flatten};
use crate::data::dataset::is_drawn;
use crate::draw::html::escape;
use crate::draw::report::Spell;
use crate::search::held_out_run;
use crate::shipped::exists;
use crate::store::capacity::CapacityFile;
use crate::store::eval::Mean;
use crate::store::images::{HowMany, ImageRef};
use crate::store::names::{CONFIG, EVAL_JSON};
use crate::store::run::RunFile;
use crate::store::training::Origin;
use crate::task::answer;
use crate::task::fitness::Fitness;
use crate::task::margins::Margins;
use crate::task::perturbation::ByTurns;
use crate::task::protocol::RolloutMode;
use crate::task::stimulus::Encoding;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Names a run, with its folder if another run has the same name.
pub(super) fn name(dossier: &Dossier) -> String {
    let folder = dossier.path.parent().filter(|_| dossier.namesake.is_some());
    let folder = folder.map_or(String::new(), |folder| format!(" ({})", folder.display()));
    format!(
        "{}, seed {}{folder}",
        dossier.run.called(),
        dossier.run.config.seed
    )
}

pub(super) fn title(runs: &[Dossier]) -> String {
    match runs {
        [one] => format!("{} – morphcog", name(one)),
        several => format!("{} runs – morphcog", several.len()),
    }
}

/// Returns links to the runs, if there are several.
pub(super) fn contents(runs: &[Dossier]) -> String {
    if runs.len() < 2 {
        return String::new();
    }
    let link = |(number, dossier): (usize, &Dossier)| {
        format!("<a href=\"#run{number}\">{}</a>\n", escape(&name(dossier)))
    };
    format!(
        "<nav aria-label=\"Runs\">\n{}</nav>\n",
        runs.iter().enumerate().map(link).collect::<String>()
    )
}

fn rewarded(fitness: Fitness) -> &'static str {
    match fitness {
        Fitness::Min => {
            "the smallest distance walked in the correct direction, or minus the largest one in the wrong direction"
        }
        Fitness::MeanClipped => {
            "the mean distance walked in the correct direction, in tens of voxel lengths and clipped to −1 and 1, both \
             groups weighing the same"
        }
        Fitness::Response => {
            "how far apart the two images of a pair, opposites of each other, move the body with all soft voxels \
             and sensors made expanding sensors, less what it walks anyway; every second pair with a start one \
             voxel higher and without length limits"
        }
    }
}

fn evolved(dossier: &Dossier) -> String {
    let run = &dossier.run;
    let evaluations = dossier.effort().map_or(String::new(), |(_, count)| {
        format!(" ({} evaluations)", number::fixed(count, 0))
    });
    format!(
        "were encoded by compositional pattern-producing networks and evolved with MAP-Elites for {} \
         generations{evaluations}, seed {}, using morphcog {}. The archive's dimensions are the numbers of muscle, \
         sensor and all voxels in seven bins each{}; {} of the {} cells that can be filled were filled. Each generation mutated up \
         to {} elites; an offspring replaced an elite only if it was strictly fitter.",
        run.generations,
        run.config.seed,
        run.program_version,
        if run.dimensions.tasks.len() > 1 {
            ", and the task performed"
        } else {
            ""
        },
        run.stats.num_elites,
        run.dimensions.possible_cells,
        run.config.map_elites.parents,
    )
}

fn trained(run: &RunFile, origin: &Origin) -> String {
    let TrainConfig {
        random_images,
        rounds,
        images,
        final_images,
        challengers,
        ..
    } = run.config.train;
    let window = match origin.windows {
        0 => String::new(),
        windows => format!(" (and one of {windows} windows of the images)"),
    };
    let taught = match rounds {
        0 => "Its sensors were kept".to_string(),
        _ => format!(
            "The response of its gait was measured under {random_images} random images. By a linear model of that, \
             its sensors{window} were chosen, in {rounds} rounds of {images} training images"
        ),
    };
    format!(
        "were encoded by compositional pattern-producing networks and evolved with MAP-Elites. One of the run {} \
         ({} generations) was trained with morphcog {}, seed {}. {taught}; then {challengers} bodies, changed in \
         some sensors or voxels, challenged it on {final_images} training images at a time.",
        origin.name, origin.generations, run.program_version, run.config.seed,
    )
}

fn perturbed(run: &RunFile) -> String {
    let ByTurns {
        start,
        length_limits,
    } = run.config.train.perturbations;
    let start = (start > 0).then(|| format!("from starts raised by up to {start} voxels"));
    let limits =
        length_limits.then(|| "half of the time with length limits beyond all goals".to_string());
    let both: Vec<String> = start.into_iter().chain(limits).collect();
    if both.is_empty() {
        String::new()
    } else {
        format!(" ({})", both.join(", "))
    }
}

/// Returns a methods paragraph that could go into a paper.
pub(super) fn methods(dossier: &Dossier) -> String {
    let run = &dossier.run;
    let config = &run.config;
    let (height, width) = (config.body.height, config.body.width);
    let made = run
        .origin
        .as_ref()
        .map_or_else(|| evolved(dossier), |origin| trained(run, origin));
    let encoding = match config.stimulus.encoding {
        Encoding::Intensity => "proportional to the pixel's intensity".to_string(),
        Encoding::Saturated => "1 for any pixel above 0".to_string(),
        Encoding::Threshold => format!(
            "1 for any pixel above {} of full intensity",
            config.stimulus.level
        ),
    };
    let margin = match config.stimulus.margin {
        none if none.is_none() => String::new(),
        margin if margin == Margins::same(margin.top) => {
            format!(" (without a margin of {margin} pixels)")
        }
        Margins {
            top,
            right,
            bottom,
            left,
        } => format!(
            " (without its {top} rows of pixels at the top, {bottom} at the bottom, {left} columns on the left and {right} on the right)"
        ),
    };
    let steps = config.protocol.control_steps;
    let cycles = (f64::from(steps) / f64::from(config.physics.cycle_steps) * 100.0).round() / 100.0;
    let rollout = match config.protocol.rollout {
        RolloutMode::Fresh => "a rollout of its own from the initial state",
        RolloutMode::Sequential => "one continuous rollout for all images",
    };
    let counts = |label: u8| {
        run.training_images
            .iter()
            .filter(|image| image.label == label)
            .count()
    };
    let names = config.class_names();
    let images: Vec<String> = config
        .classes()
        .into_iter()
        .map(|class| format!("{} of class {}", counts(class), names.name(class)))
        .collect();
    let shown = if run.origin.is_some() {
        "The fitness is that on"
    } else {
        "Robots were trained on"
    };
    let conditions = if run.origin.is_some() {
        perturbed(run)
    } else {
        String::new()
    };
    let mut text = format!(
        "Bodies of at most {height} × {width} voxels (rigid, soft, two phases of muscle, shrinking and expanding \
         sensors) {made} {shown} {} images of {} ({}); each image{margin} was shown for {steps} control steps \
         ({cycles} actuation cycles) in {rollout}{conditions}, a sensor's stimulus being {encoding}. Fitness is {}.",
        run.training_images.len(),
        run.dataset.name,
        images.join(", "),
        rewarded(run.fitness()),
    );
    if let Some(report) = dossier
        .findings
        .eval
        .as_ref()
        .filter(|report| !report.means.is_empty())
    {
        let mean = |(task, mean): (&String, &Mean)| {
            let interval = mean.interval.map_or(String::new(), |[low, high]| {
                format!(
                    " (95 % bootstrap interval {}–{} %)",
                    percent(low),
                    percent(high)
                )
            });
            format!("{} %{interval} on {task}", percent(mean.accuracy))
        };
        let means: Vec<String> = report.means.iter().map(mean).collect();
        text += &format!(
            " On {} held-out {}{} images, for {} control steps each and with displacements up to {} voxel lengths \
             counted as wrong, {} ({}) reached a mean accuracy of {}.",
            report.images.len(),
            report
                .trained_on
                .as_ref()
                .map_or(String::new(), |_| format!("{} ", report.dataset)),
            report.split,
            report.control_steps,
            report.threshold,
            counted(report.robots.len(), "robot", "robots"),
            report.selection(),
            means.join(", ")
        );
    }
    if let Some(audit) = &dossier.findings.audit {
        let physical = audit
            .robots
            .iter()
            .filter(|robot| robot.is_physical())
            .count();
        text += &format!(
            " {} audited under changes of start, time step, material and stimulus; {physical} kept the behaviour.",
            match audit.robots.len() {
                1 => "One robot was".to_string(),
                robots => format!("{robots} robots were"),
            }
        );
    }
    format!("<p>{}</p>\n", escape(&text))
}

/// Returns the commands that reproduce a run and its tests. They omit other criteria of audits and
/// other hyperparameters of networks.
pub(super) fn commands(dossier: &Dossier, spell: Spell) -> String {
    let number = dossier
        .namesake
        .map_or(String::new(), |before| format!("-{}", before + 1));
    let again = PathBuf::from(format!(
        "again/{}-seed{}{number}",
        dossier.run.name, dossier.run.config.seed
    ));
    let of_run =
        |command: &'static str| Invocation::new(command).option("archive", again.as_path());
    let mut lines = made_by(dossier, &again, spell);
    let found = &dossier.findings;
    if let Some(audit) = &found.audit {
        let ids: Vec<&str> = audit.robots.iter().map(|robot| robot.id.as_str()).collect();
        let all = of_run("audit");
        let audit = if ids.len() < audit.elites {
            all.option("robots", ids.join(","))
        } else {
            all
        };
        lines.push(spell(&audit));
    }
    if let Some(report) = &found.eval {
        let ids: Vec<&str> = report
            .robots
            .iter()
            .map(|robot| robot.id.as_str())
            .collect();
        let mut eval = of_run("eval")
            .option("images", how_many(&report.images).to_string())
            .option("seed", report.seed.to_string())
            .option("robots", ids.join(","));
        if report.trained_on.is_some() {
            eval = eval.option("dataset", report.dataset.as_str());
        }
        if report.threshold != answer::THRESHOLD {
            eval = eval.option("threshold", report.threshold.to_string());
        }
        let cycles = report.control_steps / dossier.run.config.physics.cycle_steps.max(1);
        if cycles != held_out_run::CYCLES {
            eval = eval.option("cycles", cycles.to_string());
        }
        lines.push(spell(&eval));
    }
    if let Some(file) = &found.capacity {
        let capacity = Invocation::new("capacity").option("eval", again.join(EVAL_JSON).as_path());
        lines.push(spell(&with_settings(capacity, file)));
    }
    lines.push(spell(&of_run("report")));
    format!("<pre>{}</pre>\n", escape(&lines.join("\n")))
}

/// Infers the requested number of images from those measured. If all available images happen to be
/// evenly divided, both answers mean the same.
fn how_many(images: &[ImageRef]) -> HowMany {
    let mut counts = BTreeMap::<u8, usize>::new();
    images
        .iter()
        .for_each(|image| *counts.entry(image.label).or_default() += 1);
    match counts.values().min().zip(counts.values().max()) {
        Some((least, most)) if most - least > 1 => HowMany::All,
        _ => HowMany::Evenly(images.len()),
    }
}

/// Returns the command that reproduces the run, after the facts that it needs.
fn made_by(dossier: &Dossier, again: &Path, spell: Spell) -> Vec<String> {
    let (run, config) = (&dossier.run, dossier.path.with_file_name(CONFIG));
    let Some(origin) = &run.origin else {
        let known = exists(&config);
        let missing = format!(
            "# CONFIG: the key \"config\" of {}",
            in_shell(&dossier.path)
        );
        let config = if known {
            Value::Path(config)
        } else {
            Value::Placeholder("CONFIG")
        };
        let name = &run.dataset.name;
        let evolve = Invocation::new("evolve").option("config", config);
        let (images, evolve) = match is_drawn(name) {
            true => (None, evolve),
            false => {
                let images = format!("# IMAGES: the folder with the files of {name}");
                (
                    Some(images),
                    evolve.option("data", Value::Placeholder("IMAGES")),
                )
            }
        };
        let line = spell(&evolve.option("out", again));
        return (!known)
            .then_some(missing)
            .into_iter()
            .chain(images)
            .chain([line])
            .collect();
    };
    let gaits = format!(
        "# GAITS: run {}, SHA-256 of its content {}…",
        origin.name,
        short(&origin.sha256)
    );
    let robot = run.elites.first().and_then(|robot| robot.parent.as_deref());
    let mut train = Invocation::new("train")
        .option("archive", Value::Placeholder("GAITS"))
        .option("task", run.dimensions.tasks.join(" "))
        .option("seed", run.config.seed.to_string());
    if let Some(robot) = robot {
        train = train.option("robots", robot);
    }
    // The gaits' run may have other values of these.
    train = train.option("set", format!("data.dataset={}", run.config.data.dataset));
    for (key, value) in seeing_and_training(&run.config) {
        let value = value
            .as_str()
            .map_or_else(|| value.to_string(), str::to_string);
        train = train.option("set", format!("{key}={value}"));
    }
    vec![gaits, spell(&train.option("out", again))]
}

/// Returns the keys of `[stimulus]`, `[train]` and `[validation]` with values, defaults included.
fn seeing_and_training(config: &Config) -> Settings {
    let mut settings = Settings::new();
    for (section, keys) in [
        ("stimulus", toml::Value::try_from(config.stimulus)),
        ("train", toml::Value::try_from(config.train)),
        ("validation", toml::Value::try_from(config.validation)),
    ] {
        flatten(
            section,
            keys.expect("every field is a number, text or table, which TOML has"),
            &mut settings,
        );
    }
    // Files leave these out where they are 0.
    for key in ["stimulus.margin", "train.windows"] {
        settings
            .entry(key.to_string())
            .or_insert(toml::Value::Integer(0));
    }
    settings
}

/// Adds those settings of a capacity to a command that its file has and that are not the defaults.
fn with_settings(command: Invocation, file: &CapacityFile) -> Invocation {
    let usual = CapacityConfig::default();
    let mut command = command
        .switch("clean", file.patience_on != "test")
        .switch("physical_only", file.physical_only);
    if file.trainings != usual.trainings {
        command = command.option("set", format!("trainings={}", file.trainings));
    }
    let curves: Vec<_> = file.tasks.iter().flat_map(|task| &task.curves).collect();
    let sizes: Vec<usize> = curves
        .iter()
        .flat_map(|curve| curve.points.iter().map(|point| point.size))
        .collect();
    let points = curves.first().map_or(&[][..], |curve| &curve.points[..]);
    if let (Some(least), Some(most)) = (sizes.iter().min(), sizes.iter().max())
        && !usual.sizes().eq(points.iter().map(|point| point.size))
    {
        let step = points
            .windows(2)
            .next()
            .map_or(1, |two| two[1].size.saturating_sub(two[0].size).max(1));
        command = command
            .option("set", format!("sizes=[{least},{most}]"))
            .option("set", format!("step={step}"));
    }
    command
}
