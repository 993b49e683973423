//! `morphcog verify`: runs the commands behind the project's claims again, and compares what they
//! measure with what is claimed.

use crate::base::error::Error;
use crate::base::files::{read_text, write_atomically};
use crate::base::number;
use crate::base::observer::{Generation, Work};
use crate::base::running::Running;
use crate::base::session::Session;
use crate::base::shell::quoted;
use crate::base::text::duration;
use crate::data::dataset::{Dataset, Split};
use crate::data::files::{choose, places};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::ffi::OsString;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// All claims; `docs/claims.md` is made of them.
const CLAIMS: &str = include_str!("../../data/claims.toml");

/// The file in a claim's folder that keeps its result, so that a later call need not measure again.
const VERIFIED_JSON: &str = "verified.json";
/// The last command's events, one JSON object per line, and what it wrote to stderr.
const EVENTS: &str = "events.jsonl";
const LOG: &str = "log.txt";

/// Interval at which a running command is looked at. Longer ones delay the end of short commands.
const POLL: Duration = Duration::from_millis(50);

/// A sentence about the project, with the commands that measure it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// The name on the command line, and of its folder.
    pub name: String,
    /// The claim, in words.
    pub claim: String,
    /// The commands that measure it, in order, without the program's name. Blanks separate words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub commands: Vec<String>,
    /// The kind of the last command's JSON event that has the values.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub event: String,
    /// The values that are claimed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub values: Vec<Claimed>,
    /// The way to measure it without `verify`, because it needs more than the program.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by_hand: Option<ByHand>,
    /// Processor time of all commands \[min\].
    pub cpu_minutes: f64,
    /// The processor on which that was measured.
    pub processor: String,
    /// The images that it needs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub needs: Vec<Need>,
    /// True if it belongs to the quick selection.
    #[serde(default)]
    pub quick: bool,
    /// The file or folder in the repository that holds the result.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub shipped: String,
}

/// A claim that `verify` does not run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ByHand {
    /// The command, as typed in the repository.
    pub command: String,
    /// Its result, in words.
    pub result: String,
    /// The things it needs besides the program.
    pub needs: String,
}

/// A number that a command measures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claimed {
    /// The name of the quantity.
    pub label: String,
    /// Its place in the event, as a JSON pointer in which `*` stands for all items of a list; the
    /// value is their mean.
    pub(crate) at: String,
    /// The text or number to count: the value is how many items are equal to it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) count: Option<Value>,
    /// The value that is claimed, to the last bit.
    pub expected: f64,
    /// The largest difference that still counts as the same finding; 0: none.
    #[serde(default)]
    pub tolerance: f64,
    /// True if the value is a share, displayed in percent.
    #[serde(default)]
    pub(crate) percent: bool,
}

/// Data that a claim needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Need {
    /// MNIST.
    Mnist,
}

impl Need {
    /// Returns the name for people.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Need::Mnist => "MNIST",
        }
    }
}

/// Comparison of a measured value with the claimed one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Agreement {
    /// Equal to the last bit.
    Reproduced,
    /// Different, but by no more than the tolerance.
    WithinTolerance,
    /// Different by more, or not measured.
    NotReproduced,
}

impl Agreement {
    /// Returns the words for people.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Agreement::Reproduced => "reproduced",
            Agreement::WithinTolerance => "within tolerance",
            Agreement::NotReproduced => "not reproduced",
        }
    }
}

impl Claimed {
    /// Measures the value in an event; `None` if it is not there.
    pub fn measured(&self, event: &Value) -> Option<f64> {
        let mut found = vec![event];
        for key in self.at.split('/').skip(1) {
            found = found
                .into_iter()
                .flat_map(|value| inside(value, key))
                .collect();
        }
        if let Some(counted) = self.count.as_ref().filter(|_| !found.is_empty()) {
            return Some(found.iter().filter(|value| **value == counted).count() as f64);
        }
        let numbers: Option<Vec<f64>> = found.iter().map(|value| value.as_f64()).collect();
        let numbers = numbers.filter(|numbers| !numbers.is_empty())?;
        Some(numbers.iter().sum::<f64>() / numbers.len() as f64)
    }

    fn agreement(&self, measured: Option<f64>) -> Agreement {
        match measured.map(|value| (value - self.expected).abs()) {
            Some(0.0) => Agreement::Reproduced,
            Some(difference) if difference <= self.tolerance => Agreement::WithinTolerance,
            _ => Agreement::NotReproduced,
        }
    }

    /// Returns a value for people.
    pub(crate) fn shown(&self, value: f64) -> String {
        match (self.percent, value.fract() == 0.0) {
            (true, _) => format!("{} %", number::percent(value)),
            (false, true) => number::fixed(value, 0),
            (false, false) => number::fixed(value, 2),
        }
    }

    /// Returns the claimed value with its tolerance, for people.
    pub(crate) fn claimed(&self) -> String {
        let value = self.shown(self.expected);
        match (self.tolerance > 0.0, self.percent) {
            (false, _) => value,
            (true, true) => {
                let tolerance = number::fixed(100.0 * self.tolerance, 1);
                format!("{} ± {tolerance} %", number::percent(self.expected))
            }
            (true, false) => format!("{value} ± {}", self.tolerance),
        }
    }
}

impl Claim {
    /// Returns its commands as typed in the repository.
    pub fn typed(&self) -> Vec<String> {
        match &self.by_hand {
            Some(by_hand) => vec![by_hand.command.clone()],
            None => self.commands.iter().map(|words| typed(words)).collect(),
        }
    }

    /// Returns what it needs, for people; empty if it needs nothing but the program.
    pub fn needed(&self) -> String {
        match &self.by_hand {
            Some(by_hand) => by_hand.needs.clone(),
            None => self
                .needs
                .iter()
                .map(|need| need.name())
                .collect::<Vec<_>>()
                .join(", "),
        }
    }

    /// Returns the claimed values, for people.
    pub fn expected(&self) -> String {
        let value = |claimed: &Claimed| format!("{} {}", claimed.label, claimed.claimed());
        match &self.by_hand {
            Some(by_hand) => by_hand.result.clone(),
            None => self.values.iter().map(value).collect::<Vec<_>>().join(", "),
        }
    }
}

fn typed(words: &str) -> String {
    let words: Vec<String> = words.split_whitespace().map(quoted).collect();
    format!("morphcog {}", words.join(" "))
}

/// Returns what stands under a key of an object or an index of a list; `*` means all items.
fn inside<'a>(value: &'a Value, key: &str) -> Vec<&'a Value> {
    match value {
        Value::Array(items) if key == "*" => items.iter().collect(),
        Value::Array(items) => {
            let index = key.parse::<usize>().ok();
            index
                .and_then(|index| items.get(index))
                .into_iter()
                .collect()
        }
        _ => value.get(key).into_iter().collect(),
    }
}

/// Returns all claims.
///
/// # Errors
/// Returns an error if the built-in list is damaged (which a test excludes).
pub fn claims() -> Result<Vec<Claim>, Error> {
    #[derive(Deserialize)]
    struct List {
        claim: Vec<Claim>,
    }
    let list: Result<List, _> = toml::from_str(CLAIMS);
    list.map(|list| list.claim)
        .map_err(|error| Error::other(format!("data/claims.toml: {error}")))
}

/// Selection of claims.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Choice {
    /// Those that need no data and little time.
    Quick,
    /// All that the program can measure.
    All,
    /// These.
    Named(Vec<String>),
}

/// Returns the chosen claims, in the order of the list.
pub(crate) fn chosen(choice: &Choice) -> Result<Vec<Claim>, Error> {
    let all = claims()?;
    if let Choice::Named(names) = choice {
        for name in names {
            match all.iter().find(|claim| claim.name == *name) {
                None => {
                    let names: Vec<&str> = all.iter().map(|claim| claim.name.as_str()).collect();
                    let text = format!("{name}: expected a claim: {}", names.join(", "));
                    return Err(Error::usage(text));
                }
                Some(Claim {
                    by_hand: Some(by_hand),
                    ..
                }) => {
                    let text = format!("{name}: it needs {}", by_hand.needs);
                    let advice = format!("measure it by hand: {}", by_hand.command);
                    return Err(Error::usage(text).advice(&advice));
                }
                Some(_) => {}
            }
        }
    }
    let is_chosen = |claim: &Claim| {
        claim.by_hand.is_none()
            && match choice {
                Choice::Quick => claim.quick,
                Choice::All => true,
                Choice::Named(names) => names.contains(&claim.name),
            }
    };
    Ok(all.into_iter().filter(is_chosen).collect())
}

/// Options of `verify`.
pub(crate) struct VerifyOptions {
    /// The claims, in their order.
    pub(crate) claims: Vec<Claim>,
    /// The folder for their results, a folder each.
    pub(crate) out: PathBuf,
    /// True if claims that have a result are measured again.
    pub(crate) fresh: bool,
    /// Makes a process of this program that writes its events as JSON.
    pub(crate) program: Box<dyn Fn() -> Result<Command, Error>>,
}

/// The result of a claim.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Verified {
    /// The claim, so that a later call knows whether it is still the same.
    pub(crate) claim: Claim,
    /// The version of the program that measured it.
    pub(crate) program_version: String,
    /// The measured values, in the order of the claimed ones; `None` if an event lacks it.
    pub(crate) measured: Vec<Option<f64>>,
    /// Comparison of each with the claimed value.
    pub(crate) agreements: Vec<Agreement>,
    /// The error of a command that failed, or does not tell a value.
    pub(crate) error: Option<String>,
    /// Wall-clock time \[s\].
    pub(crate) seconds: f64,
}

impl Verified {
    /// Returns the worst of all values.
    pub(crate) fn agreement(&self) -> Agreement {
        let worst = self.agreements.iter().copied().max();
        worst.unwrap_or(Agreement::NotReproduced)
    }

    fn new(claim: &Claim, result: Result<Value, String>, seconds: f64) -> Self {
        let (event, error) = match result {
            Ok(event) => (Some(event), None),
            Err(error) => (None, Some(error)),
        };
        let measured = |claimed: &Claimed| claimed.measured(event.as_ref()?);
        let measured: Vec<Option<f64>> = claim.values.iter().map(measured).collect();
        let lacking = claim.values.iter().zip(&measured);
        let mut lacking = lacking
            .filter(|(_, value)| value.is_none())
            .map(|(claimed, _)| {
                format!("no number at {} in the event {:?}", claimed.at, claim.event)
            });
        let error = error.or_else(|| lacking.next());
        let agreements = claim.values.iter().zip(&measured);
        Verified {
            agreements: agreements
                .map(|(claimed, value)| claimed.agreement(*value))
                .collect(),
            claim: claim.clone(),
            program_version: env!("CARGO_PKG_VERSION").to_string(),
            measured,
            error,
            seconds,
        }
    }
}

/// The results of `verify`.
pub(crate) struct VerifyOutcome {
    pub(crate) verified: Vec<Verified>,
    /// True if a signal came before all were measured.
    pub(crate) stopped: bool,
}

/// Measures claims one by one, each in a folder of its own. Those with a result there are not
/// measured again.
pub(crate) fn verify(options: &VerifyOptions, session: &Session) -> Result<VerifyOutcome, Error> {
    let environment = environment(&options.claims, session)?;
    let mut verified = Vec::new();
    for claim in &options.claims {
        let folder = options.out.join(&claim.name);
        let known = known(claim, &folder).filter(|_| !options.fresh);
        let result = match known {
            Some(known) => known,
            None => {
                session.observer.note(&format!(
                    "{}: {} CPU minutes on {}",
                    claim.name,
                    minutes(claim.cpu_minutes),
                    claim.processor
                ));
                match measure(claim, &folder, options, &environment, session)? {
                    Some(result) => result,
                    None => {
                        return Ok(VerifyOutcome {
                            verified,
                            stopped: true,
                        });
                    }
                }
            }
        };
        session.observer.note(&format!(
            "{}: {} ({})",
            claim.name,
            result.agreement().words(),
            duration(result.seconds)
        ));
        verified.push(result);
    }
    Ok(VerifyOutcome {
        verified,
        stopped: false,
    })
}

/// Returns a number of minutes with as many digits as it is worth.
pub(crate) fn minutes(value: f64) -> String {
    number::fixed(value, usize::from(value < 9.95))
}

/// Returns the environment of the commands: where the data are, whatever their folder is.
///
/// # Errors
/// Returns an error if data are missing, before anything is measured.
fn environment(
    claims: &[Claim],
    session: &Session,
) -> Result<Vec<(&'static str, OsString)>, Error> {
    let absolute =
        |path: &Path| std::path::absolute(path).map_err(|error| Error::reading(path, &error));
    let needs = |need: Need| claims.iter().any(|claim| claim.needs.contains(&need));
    let mut environment = Vec::new();
    if needs(Need::Mnist) {
        let given = places(
            session.data_folder(),
            std::env::var_os("MORPHCOG_DATA"),
            None,
        );
        Dataset::load("mnist", &given, &[Split::Train, Split::Test])?;
        let folder = choose("mnist", &given)
            .expect("it was loaded from there")
            .path;
        environment.push(("MORPHCOG_DATA", absolute(&folder)?.into_os_string()));
    }
    if let Some(threads) = session.threads {
        environment.push(("RAYON_NUM_THREADS", threads.to_string().into()));
    }
    Ok(environment)
}

/// Returns the result in a folder, if this version of the program measured the same claim.
fn known(claim: &Claim, folder: &Path) -> Option<Verified> {
    let text = read_text(&folder.join(VERIFIED_JSON)).ok()?;
    let found: Verified = serde_json::from_str(&text).ok()?;
    let is_same = found.claim == *claim && found.program_version == env!("CARGO_PKG_VERSION");
    (is_same && found.error.is_none()).then_some(found)
}

/// Runs the commands of a claim; `None` if a signal stopped them.
fn measure(
    claim: &Claim,
    folder: &Path,
    options: &VerifyOptions,
    environment: &[(&'static str, OsString)],
    session: &Session,
) -> Result<Option<Verified>, Error> {
    std::fs::create_dir_all(folder).map_err(|error| Error::writing(folder, &error))?;
    let begin = Instant::now();
    let mut result = Err("it has no command".to_string());
    for words in &claim.commands {
        let mut command = (options.program)()?;
        command
            .args(words.split_whitespace())
            .envs(environment.iter().map(|(name, value)| (name, value)))
            .current_dir(folder);
        let (status, events) = run(command, folder, session)?;
        if session.check().is_err() {
            return Ok(None);
        }
        let last = |kind: &str| events.iter().rev().find(|event| event["event"] == kind);
        if !status.success() {
            let message = last("error").and_then(|event| event["message"].as_str());
            let message = message.map_or(status.to_string(), str::to_string);
            result = Err(format!("morphcog {words}: {message}"));
            break;
        }
        result = last(&claim.event)
            .cloned()
            .ok_or_else(|| format!("morphcog {words}: no event {:?}", claim.event));
    }
    let verified = Verified::new(claim, result, begin.elapsed().as_secs_f64());
    let text = serde_json::to_string_pretty(&verified).expect("plain data can be written");
    let path = folder.join(VERIFIED_JSON);
    write_atomically(&path, text.as_bytes()).map_err(|error| Error::writing(&path, &error))?;
    Ok(Some(verified))
}

/// Runs a command to its end, passes on its progress, and returns its events. A stop of the session
/// stops it.
fn run(
    mut command: Command,
    folder: &Path,
    session: &Session,
) -> Result<(ExitStatus, Vec<Value>), Error> {
    let create = |name: &str| {
        let path = folder.join(name);
        File::create(&path).map_err(|error| Error::writing(&path, &error))
    };
    command
        .stdin(Stdio::null())
        .stdout(create(EVENTS)?)
        .stderr(create(LOG)?);
    // In a group of its own: Ctrl-C reaches this process only, which stops the command once.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    let failed = |error: std::io::Error| Error::other(format!("a command cannot run: {error}"));
    let mut child = Running(command.spawn().map_err(failed)?);
    let path = folder.join(EVENTS);
    let mut events = Events::open(&path)?;
    let mut relay = Relay {
        session,
        label: None,
    };
    let mut is_stopped = false;
    let status = loop {
        if session.stop.load(Ordering::Relaxed) && !is_stopped {
            stop(&mut child.0);
            is_stopped = true;
        }
        let status = child.0.try_wait().map_err(failed)?;
        for event in events
            .more()
            .map_err(|error| Error::reading(&path, &error))?
        {
            relay.pass(&event);
        }
        if let Some(status) = status {
            break status;
        }
        std::thread::sleep(POLL);
    };
    Ok((status, events.all))
}

fn stop(child: &mut Child) {
    #[cfg(unix)]
    {
        use rustix::process::{Pid, Signal, kill_process};
        let process = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
        // If it has just ended, there is nothing to stop.
        let _ = process.map(|process| kill_process(process, Signal::TERM));
    }
    #[cfg(not(unix))]
    let _ = child.kill();
}

/// The events of a command that is still writing them.
struct Events {
    file: File,
    read: u64,
    rest: Vec<u8>,
    all: Vec<Value>,
}

impl Events {
    fn open(path: &Path) -> Result<Self, Error> {
        let file = File::open(path).map_err(|error| Error::reading(path, &error))?;
        Ok(Events {
            file,
            read: 0,
            rest: Vec::new(),
            all: Vec::new(),
        })
    }

    /// Reads what was written since the last call, and returns the new events.
    fn more(&mut self) -> std::io::Result<Vec<Value>> {
        self.file.seek(SeekFrom::Start(self.read))?;
        self.read += self.file.read_to_end(&mut self.rest)? as u64;
        let whole = self
            .rest
            .iter()
            .rposition(|byte| *byte == b'\n')
            .map_or(0, |at| at + 1);
        let lines: Vec<u8> = self.rest.drain(..whole).collect();
        let lines = lines.split(|byte| *byte == b'\n');
        let new: Vec<Value> = lines
            .filter_map(|line| serde_json::from_slice(line).ok())
            .collect();
        self.all.extend(new.iter().cloned());
        Ok(new)
    }
}

/// Passes the progress of a command on to the observer.
struct Relay<'s> {
    session: &'s Session<'s>,
    /// The label of the work that the observer knows.
    label: Option<String>,
}

impl Relay<'_> {
    fn pass(&mut self, event: &Value) {
        let observer = self.session.observer;
        match event["event"].as_str() {
            Some("progress") => {
                let number = |key: &str| event[key].as_u64();
                let text = |key: &str| event[key].as_str().unwrap_or("").to_string();
                let (Some(done), Some(total)) = (number("done"), number("total")) else {
                    return;
                };
                let label = text("label");
                if self.label.as_ref() == Some(&label) {
                    return observer.progress(done);
                }
                let (unit, known) = (text("unit"), done);
                observer.begins(&Work {
                    label: label.clone(),
                    total,
                    known,
                    unit,
                });
                self.label = Some(label);
            }
            Some("generation") => {
                if let Ok(generation) = serde_json::from_value::<Generation>(event.clone()) {
                    observer.generation(&generation);
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::collections::BTreeSet;
    use std::sync::atomic::AtomicBool;

    fn claimed(at: &str, expected: f64) -> Claimed {
        Claimed {
            label: "value".to_string(),
            at: at.to_string(),
            count: None,
            expected,
            tolerance: 0.25,
            percent: false,
        }
    }

    #[test]
    fn values_are_found_by_their_place_and_lists_have_a_mean_or_a_count() {
        let event = json!({"means": {"0|1": {"accuracy": 0.5}},
            "robots": [{"right": 4, "verdict": "physical"}, {"right": 1, "verdict": "fragile"}]});
        let measured = |at: &str| claimed(at, 0.0).measured(&event);
        assert_eq!(measured("/means/0|1/accuracy"), Some(0.5));
        assert_eq!(measured("/robots/1/right"), Some(1.0));
        assert_eq!(measured("/robots/*/right"), Some(2.5));
        for lacking in [
            "/means/2|3/accuracy",
            "/robots/2/right",
            "/robots/*/verdict",
            "/robots",
        ] {
            assert_eq!(measured(lacking), None, "{lacking}");
        }
        let count = |at: &str, what: Value| {
            Claimed {
                count: Some(what),
                ..claimed(at, 0.0)
            }
            .measured(&event)
        };
        assert_eq!(count("/robots/*/verdict", json!("physical")), Some(1.0));
        assert_eq!(count("/robots/*/right", json!(4)), Some(1.0));
        assert_eq!(count("/robots/*/right", json!(7)), Some(0.0));
        assert_eq!(count("/robots/*/task", json!(7)), None);
    }

    #[test]
    fn only_the_same_bits_are_reproduced_and_the_tolerance_is_what_is_allowed_beside_them() {
        let agreement = |value| claimed("", 1.0).agreement(value);
        assert_eq!(agreement(Some(1.0)), Agreement::Reproduced);
        assert_eq!(
            agreement(Some(1.0 + f64::EPSILON)),
            Agreement::WithinTolerance
        );
        assert_eq!(agreement(Some(0.75)), Agreement::WithinTolerance);
        assert_eq!(agreement(Some(0.74)), Agreement::NotReproduced);
        assert_eq!(agreement(Some(f64::NAN)), Agreement::NotReproduced);
        assert_eq!(agreement(None), Agreement::NotReproduced);
    }

    #[test]
    fn claims_have_names_values_costs_and_results_that_ship() {
        let claims = claims().unwrap();
        let names: BTreeSet<&str> = claims.iter().map(|claim| claim.name.as_str()).collect();
        assert_eq!(names.len(), claims.len(), "a name is used once");
        for claim in &claims {
            let Claim {
                name,
                commands,
                values,
                by_hand,
                ..
            } = claim;
            let is_run = !commands.is_empty() && !values.is_empty() && !claim.event.is_empty();
            assert_ne!(is_run, by_hand.is_some(), "{name}");
            assert!(
                claim.cpu_minutes > 0.0 && !claim.processor.is_empty(),
                "{name}"
            );
            assert!(
                !claim.quick || claim.needs.is_empty(),
                "{name}: quick ones need no data"
            );
            for path in claim.shipped.split(", ").filter(|path| !path.is_empty()) {
                assert!(Path::new(path).exists(), "{name}: {path}");
            }
        }
        let quick: f64 = chosen(&Choice::Quick)
            .unwrap()
            .iter()
            .map(|claim| claim.cpu_minutes)
            .sum();
        assert!(quick > 0.0 && quick <= 5.0, "{quick} minutes");
    }

    /// A claim whose command is a line for a shell, which writes an event.
    fn shell(name: &str, line: &str) -> Claim {
        Claim {
            name: name.to_string(),
            claim: "A line is written".to_string(),
            commands: vec![line.to_string()],
            event: "done".to_string(),
            values: vec![claimed("/value", 1.0)],
            by_hand: None,
            cpu_minutes: 0.1,
            processor: "any".to_string(),
            needs: Vec::new(),
            quick: false,
            shipped: String::new(),
        }
    }

    #[cfg(unix)]
    fn options(claims: Vec<Claim>, out: &Path) -> VerifyOptions {
        let program = || {
            let mut shell = Command::new("sh");
            shell.args(["-c", "echo run >>runs; eval \"$*\"", "sh"]);
            Ok(shell)
        };
        VerifyOptions {
            claims,
            out: out.to_path_buf(),
            fresh: false,
            program: Box::new(program),
        }
    }

    #[cfg(unix)]
    #[test]
    fn results_are_kept_and_failures_are_said_and_measured_again() {
        let folder = tempfile::tempdir().unwrap();
        let done = |value: &str| format!(r#"echo '{{"event":"done","value":{value}}}'"#);
        let claims = vec![
            shell("same", &done("1.0")),
            shell("near", &done("1.125")),
            shell("far", &done("2")),
            shell("silent", "true"),
            shell("lacking", &done("{}")),
            shell(
                "failing",
                r#"echo '{"event":"error","message":"no room"}'; exit 1"#,
            ),
        ];
        let mut options = options(claims, folder.path());
        let session = Session::default();
        let outcome = verify(&options, &session).unwrap();
        assert!(!outcome.stopped);
        let agreements: Vec<Agreement> = outcome.verified.iter().map(Verified::agreement).collect();
        use Agreement::{NotReproduced, Reproduced, WithinTolerance};
        let expected = [
            Reproduced,
            WithinTolerance,
            NotReproduced,
            NotReproduced,
            NotReproduced,
            NotReproduced,
        ];
        assert_eq!(agreements, expected);
        let error = |index: usize| outcome.verified[index].error.as_deref().unwrap_or("");
        assert!(
            error(2).is_empty() && error(3).contains("no event \"done\""),
            "{}",
            error(3)
        );
        assert_eq!(error(4), "no number at /value in the event \"done\"");
        assert!(error(5).ends_with("exit 1: no room"), "{}", error(5));
        // What was measured is known; what failed is tried again.
        verify(&options, &session).unwrap();
        let runs = |name: &str| {
            let path = folder.path().join(name).join("runs");
            std::fs::read_to_string(path).unwrap().lines().count()
        };
        assert_eq!((runs("same"), runs("far"), runs("failing")), (1, 1, 2));
        options.claims[0].values[0].expected = 2.0;
        options.claims.truncate(1);
        let changed = verify(&options, &session).unwrap().verified;
        assert_eq!(
            (changed[0].agreement(), runs("same")),
            (NotReproduced, 2),
            "another claim"
        );
        options.fresh = true;
        verify(&options, &session).unwrap();
        assert_eq!(runs("same"), 3);
    }

    #[cfg(unix)]
    #[test]
    fn a_stop_ends_the_command_and_leaves_no_result() {
        let folder = tempfile::tempdir().unwrap();
        let stop = AtomicBool::new(true);
        let options = options(vec![shell("long", "sleep 60")], folder.path());
        let begin = Instant::now();
        let outcome = verify(&options, &Session::new(&stop, &())).unwrap();
        assert!(outcome.stopped && outcome.verified.is_empty());
        assert!(begin.elapsed() < Duration::from_secs(30));
        assert!(!folder.path().join("long").join(VERIFIED_JSON).exists());
    }
}
