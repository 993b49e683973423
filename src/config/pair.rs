//! Reading of pairs.

use serde::de::{Deserialize, Deserializer, Error};

/// Reads a pair, for `deserialize_with`: serde leaves a third item to the format, and TOML ignores
/// it.
pub(crate) fn read<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
) -> Result<[T; 2], D::Error> {
    let items = Vec::<T>::deserialize(from)?;
    let count = items.len();
    items
        .try_into()
        .map_err(|_| D::Error::custom(format!("expected a list of two, found {count}")))
}

pub(crate) fn read_some<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
) -> Result<Option<[T; 2]>, D::Error> {
    read(from).map(Some)
}
