//! Reading two of a kind.

use serde::de::{Deserialize, Deserializer, Error};

/// Two of a kind, for `deserialize_with`. An array's own reader leaves a third to the format, and
/// TOML's passes it over.
///
/// # Errors
/// Of a list that is shorter or longer, or what is wrong with an item.
pub fn read<'de, D: Deserializer<'de>, T: Deserialize<'de>>(from: D) -> Result<[T; 2], D::Error> {
    let items = Vec::<T>::deserialize(from)?;
    let count = items.len();
    items.try_into().map_err(|_| D::Error::custom(format!("expected a list of two, found {count}")))
}

/// The same where there may be none.
///
/// # Errors
/// As [`read`].
pub fn read_some<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
) -> Result<Option<[T; 2]>, D::Error> {
    read(from).map(Some)
}
