//! `morphcog data`: fetches, imports and describes datasets.

#[cfg(feature = "import")]
use crate::base::{error::Error, session::Session};
use crate::data::catalogue::{Catalogue, known_as};
use crate::data::dataset::{Dataset, DatasetError, Split};
use crate::data::files::DatasetPlace;
#[cfg(feature = "import")]
pub use crate::data::import::{self, ClassCount, ImportOptions, ImportSource, Imported};
use crate::data::info::DatasetInfo;
use std::collections::BTreeMap;

#[derive(Debug)]
pub(crate) struct FoundDataset {
    pub(crate) info: DatasetInfo,
    /// Names of its files that are identical to the published ones.
    pub(crate) published: Vec<String>,
    /// Splits that belong to a dataset known by another name, with that name.
    pub(crate) others: BTreeMap<Split, &'static str>,
    pub(crate) problems: Vec<(Split, DatasetError)>,
}

/// Inspects each split by itself, since one may be missing; without any, the error is that of the
/// training images. `transpose`: see [`Dataset::oriented`].
pub(crate) fn info(
    name: &str,
    given: &[DatasetPlace],
    transpose: Option<bool>,
) -> Result<FoundDataset, DatasetError> {
    let mut info: Option<DatasetInfo> = None;
    let mut problems = Vec::new();
    for split in Split::ALL {
        match Dataset::oriented(name, given, &[split], transpose) {
            Ok(dataset) => match &mut info {
                Some(info) => info.splits.extend(dataset.info().splits),
                None => info = Some(dataset.info()),
            },
            Err(problem) => problems.push((split, problem)),
        }
    }
    let Some(info) = info else {
        return Err(problems.swap_remove(0).1);
    };
    let known = Catalogue::named(name).map_or_else(|_| Vec::new(), |catalogue| catalogue.files);
    let files = info.splits.values().flat_map(|split| &split.files);
    let published = files.filter(|file| known.iter().any(|k| k.sha256 == file.sha256));
    let published = published.map(|file| file.name.clone()).collect();
    let known = info
        .splits
        .iter()
        .filter_map(|(&split, found)| Some((split, known_as(&found.fingerprint, &found.files)?)));
    let others = known.filter(|(_, known)| *known != name).collect();
    Ok(FoundDataset {
        info,
        published,
        others,
        problems,
    })
}

/// Makes a dataset of pictures, arrays or tables, with a contact sheet of its training images.
///
/// # Errors
/// Reports sources without a dataset in them, and a folder that is taken. Nothing is left then.
#[cfg(feature = "import")]
pub fn import(
    source: ImportSource,
    options: &ImportOptions,
    session: &Session,
) -> Result<Imported, Error> {
    let staged = import::stage(source, options, session)?;
    #[cfg(feature = "figures")]
    draw_sheet(&staged, &options.name)?;
    session.check()?;
    staged.commit()
}

#[cfg(all(feature = "import", feature = "figures"))]
fn draw_sheet(staged: &import::Staged, name: &str) -> Result<(), Error> {
    use crate::data::files::places;
    use crate::draw::sheet;
    /// Images of each class.
    const SAMPLES: usize = 16;
    let places = places(Some(staged.path()), None, None);
    let dataset = Dataset::load(name, &places, &[Split::Train])?;
    let sheet =
        sheet::contact_sheet(&dataset, Split::Train, SAMPLES).and_then(|sheet| sheet::png(&sheet));
    match sheet {
        Ok(png) => staged.write(import::store::SHEET_PNG, &png),
        // Of many classes of large images there is none.
        Err(sheet::SheetError::Size { .. }) => Ok(()),
        Err(error) => Err(Error::other(error.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::files::places;
    use crate::data::idx;

    #[test]
    fn info_shows_the_split_that_is_there_and_why_the_other_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let given = places(Some(folder.path()), None, None);
        assert!(
            info("mnist", &given, None)
                .unwrap_err()
                .to_string()
                .contains("train images")
        );
        let write =
            |name: &str, bytes: Vec<u8>| std::fs::write(folder.path().join(name), bytes).unwrap();
        write(
            "t10k-images-idx3-ubyte",
            [idx::header(&[2, 1, 1]), vec![0, 255]].concat(),
        );
        write(
            "t10k-labels-idx1-ubyte",
            [idx::header(&[2]), vec![3, 3]].concat(),
        );
        let found = info("mnist", &given, None).unwrap();
        assert_eq!(found.info.splits[&Split::Test].per_class[&3], 2);
        assert!(matches!(found.problems.as_slice(), [(Split::Train, _)]));
        assert!(found.published.is_empty());
        let builtin = info("builtin", &[], None).unwrap().info;
        assert_eq!(
            (builtin.splits.len(), builtin.differences()),
            (2, Vec::new())
        );
        write(
            "train-images-idx3-ubyte",
            [idx::header(&[2, 2, 1]), vec![0, 255, 0, 9]].concat(),
        );
        write(
            "train-labels-idx1-ubyte",
            [idx::header(&[2]), vec![3, 4]].concat(),
        );
        assert_eq!(
            info("mnist", &given, None).unwrap().info.differences(),
            [
                "train images have 2 × 1 pixels, test images 1 × 1",
                "there are no test images of class 4"
            ]
        );
    }
}
