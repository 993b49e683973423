//! `morphcog data`: fetching and describing datasets.

pub mod catalogue;
pub mod fetch;

use crate::task::dataset::{Dataset, DatasetError, Split};
use crate::task::files::Place;
use crate::task::info::DatasetInfo;
use catalogue::Catalogue;
use std::io::{self, Write};
use std::path::Path;

/// What there is of a dataset (`morphcog data info`).
#[derive(Debug)]
pub struct Found {
    /// Name, folder and the splits that can be used.
    pub info: DatasetInfo,
    /// Names of those of its files that are exactly the published ones.
    pub published: Vec<String>,
    /// Why other splits cannot be used.
    pub problems: Vec<(Split, DatasetError)>,
}

/// Looks at both splits of a dataset, each on its own: one may be there without the other.
///
/// # Errors
/// Why the training images cannot be loaded, if the test images cannot be either.
pub fn info(name: &str, given: &[Place]) -> Result<Found, DatasetError> {
    let mut info: Option<DatasetInfo> = None;
    let mut problems = Vec::new();
    for split in Split::ALL {
        match Dataset::load(name, given, &[split]) {
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
    Ok(Found { info, published, problems })
}

/// Writes a file so that, whatever happens, either the old or the whole new content is there: to a temporary
/// file in the same folder, synced, renamed.
///
/// # Errors
/// The system's, if the folder does not exist or cannot be written.
pub fn write_atomically(file: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // What an ordinary file gets (the process's umask still applies), not a temporary file's owner-only.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut temporary = builder.prefix(".morphcog-").tempfile_in(folder)?;
    temporary.write_all(bytes)?;
    temporary.as_file().sync_all()?;
    temporary.persist(file)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::{files::places, idx};

    #[test]
    fn info_shows_the_split_that_is_there_and_why_the_other_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let given = places(Some(folder.path()), None, None);
        assert!(info("mnist", &given).unwrap_err().to_string().contains("train images"));
        let write = |name: &str, bytes: Vec<u8>| std::fs::write(folder.path().join(name), bytes).unwrap();
        write("t10k-images-idx3-ubyte", [idx::header(&[2, 1, 1]), vec![0, 255]].concat());
        write("t10k-labels-idx1-ubyte", [idx::header(&[2]), vec![3, 3]].concat());
        let found = info("mnist", &given).unwrap();
        assert_eq!(found.info.splits[&Split::Test].per_class[&3], 2);
        assert!(matches!(found.problems.as_slice(), [(Split::Train, _)]));
        assert!(found.published.is_empty());
        assert_eq!(info("builtin", &[]).unwrap().info.splits.len(), 2);
    }

    #[test]
    fn writing_replaces_a_file_whole_and_leaves_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a");
        std::fs::write(&file, "old").unwrap();
        write_atomically(&file, b"new").unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"new");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(write_atomically(&folder.path().join("no/a"), b"new").is_err());
    }
}
