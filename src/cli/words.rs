//! [`offering`]: values that are one of a few words, for shells to complete.

use crate::store::images::HeldOut;
use clap::builder::{PossibleValue, TypedValueParser};
use clap::{Arg, Command};
use std::ffi::OsStr;

/// Reads a value as `parser` does, which also says what is wrong with it. Shells offer the words, and
/// help lists them.
pub(super) fn offering<P: TypedValueParser>(
    words: impl IntoIterator<Item = &'static str>,
    parser: P,
) -> Offering<P> {
    Offering { words: words.into_iter().collect(), parser }
}

/// What [`offering`] makes.
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

/// Reads which images that robots are not trained on.
pub(super) fn held_out() -> impl TypedValueParser<Value = HeldOut> {
    offering(["test", "validation"], str::parse::<HeldOut>)
}
