//! Values of the command line: words that shells complete ([`offering`]), and numbers whose errors
//! say what was expected.

use crate::base::threads::MOST_THREADS;
use crate::config;
use crate::store::images::HeldOut;
use clap::builder::{PossibleValue, TypedValueParser};
use clap::{Arg, Command};
use std::ffi::OsStr;
use std::ops::RangeInclusive;

/// Parses a value with `parser`, which also reports errors. Shells and help list the words.
pub(super) fn offering<P: TypedValueParser>(
    words: impl IntoIterator<Item = &'static str>,
    parser: P,
) -> Offering<P> {
    Offering {
        words: words.into_iter().collect(),
        parser,
    }
}

#[derive(Clone)]
pub(super) struct Offering<P> {
    words: Vec<&'static str>,
    parser: P,
}

impl<P: TypedValueParser> TypedValueParser for Offering<P> {
    type Value = P::Value;

    fn parse_ref(
        &self,
        command: &Command,
        argument: Option<&Arg>,
        value: &OsStr,
    ) -> Result<P::Value, clap::Error> {
        self.parser.parse_ref(command, argument, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(self.words.iter().map(PossibleValue::new)))
    }
}

pub(super) fn held_out() -> impl TypedValueParser<Value = HeldOut> {
    offering(["test", "validation"], str::parse::<HeldOut>)
}

/// Largest number accepted where the program sets no limit, or a lower one elsewhere.
pub(super) const MOST: u64 = u32::MAX as u64;

pub(super) fn whole<T>(range: RangeInclusive<u64>) -> impl TypedValueParser<Value = T>
where
    T: TryFrom<u64> + Clone + Send + Sync + 'static,
{
    move |text: &str| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number
            .and_then(|number| T::try_from(number).ok())
            .ok_or_else(|| {
                let (least, most) = (range.start(), range.end());
                format!("expected a whole number from {least} to {most}")
            })
    }
}

/// Parses a seed: a number that a config can keep.
pub(super) fn seed() -> impl TypedValueParser<Value = u64> {
    whole(0..=config::MAX_NUMBER)
}

/// Parses a number of threads, or of things that need one each.
pub(super) fn threads() -> impl TypedValueParser<Value = u16> {
    whole(1..=u64::from(MOST_THREADS))
}

pub(super) fn decimal() -> impl TypedValueParser<Value = f64> {
    |text: &str| {
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| "expected a number, such as 0.5".to_string())
    }
}

/// Lets options take values that look like negative numbers, so that each reports what it expected.
pub(super) fn with_negative_numbers(command: Command) -> Command {
    let allowing = |argument: Arg| match argument.get_action().takes_values() {
        true => argument.allow_negative_numbers(true),
        false => argument,
    };
    command
        .mut_args(allowing)
        .mut_subcommands(with_negative_numbers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::Cli;
    use clap::CommandFactory;

    /// Returns the error of a command line, empty if there is none.
    fn said(line: &str) -> String {
        let command = with_negative_numbers(Cli::command());
        let words = std::iter::once("morphcog").chain(line.split_whitespace());
        command
            .try_get_matches_from(words)
            .map_or_else(|error| error.to_string(), |_| String::new())
    }

    #[test]
    fn numbers_that_are_none_or_out_of_range_say_which_are_expected() {
        for (line, expected) in [
            (
                "evolve --generations 1e9",
                "'--generations <GENERATIONS>': expected a whole number from 1 to",
            ),
            (
                "evolve --seed -1",
                "'--seed <SEED>': expected a whole number from 0 to",
            ),
            (
                "eval --seed 1.5",
                "'--seed <SEED>': expected a whole number from 0 to",
            ),
            (
                "replay --width 4294967296",
                "'--width <WIDTH>': expected a whole number from 0 to 4294967295\n",
            ),
            (
                "eval --threads 0",
                "'--threads <THREADS>': expected a whole number from 1 to",
            ),
            (
                "eval --threshold far",
                "'--threshold <THRESHOLD>': expected a number, such as 0.5\n",
            ),
            (
                "reproduce --scale nan",
                "'--scale <SCALE>': expected a number, such as 0.5\n",
            ),
            (
                "serve --port 65536",
                "'--port <PORT>': expected a whole number from 0 to 65535\n",
            ),
        ] {
            assert!(said(line).contains(expected), "{line}: {}", said(line));
        }
        for line in [
            "evolve -c a.toml --seed 9223372036854775807",
            "eval --threshold -1",
            "eval --seed 9223372036854775807",
        ] {
            assert_eq!(said(line), "");
        }
    }
}
