//! The datasets that can be downloaded: their addresses, and the checksums of their files.

use crate::data::info::FileInfo;
pub(crate) const FETCHABLE: [&str; 2] = ["mnist", "fashion-mnist"];

/// A file to download, as published.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RemoteFile {
    /// Its name, on the mirrors and on disk.
    pub name: String,
    /// Its size, bytes.
    pub bytes: u64,
    /// SHA-256 in lower-case hexadecimal.
    pub sha256: String,
    /// SHA-256 of the unpacked content, if known.
    pub content_sha256: Option<String>,
}

/// A dataset that can be downloaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Catalogue {
    /// Name of the dataset.
    pub name: String,
    /// Addresses of the folders with the files, tried in this order for each file.
    pub mirrors: Vec<String>,
    /// The files.
    pub files: Vec<RemoteFile>,
}

/// The name of a dataset that cannot be downloaded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("\"{name}\" cannot be fetched; expected {}", FETCHABLE.join(" or "))]
pub struct UnknownDataset {
    pub(crate) name: String,
}

/// Name, size and SHA-256 of a dataset's training images and labels, test images and labels.
type Published = [(&'static str, u64, &'static str); 4];

const MNIST: Published = [
    (
        "train-images-idx3-ubyte.gz",
        9_912_422,
        "440fcabf73cc546fa21475e81ea370265605f56be210a4024d2ca8f203523609",
    ),
    (
        "train-labels-idx1-ubyte.gz",
        28_881,
        "3552534a0a558bbed6aed32b30c495cca23d567ec52cac8be1a0730e8010255c",
    ),
    (
        "t10k-images-idx3-ubyte.gz",
        1_648_877,
        "8d422c7b0a1c1c79245a5bcf07fe86e33eeafee792b84584aec276f5a2dbc4e6",
    ),
    (
        "t10k-labels-idx1-ubyte.gz",
        4_542,
        "f7ae60f92e00ec6debd23a6088c31dbd2371eca3ffa0defaefb259924204aec6",
    ),
];

/// SHA-256 of the unpacked files of MNIST, in their order.
const MNIST_UNPACKED: [&str; 4] = [
    "ba891046e6505d7aadcbbe25680a0738ad16aec93bde7f9b65e87a2fc25776db",
    "65a50cbbf4e906d70832878ad85ccda5333a97f0f4c3dd2ef09a8a9eef7101c5",
    "0fa7898d509279e482958e8ce81c8e77db3f2f8254e26661ceb7762c4d494ce7",
    "ff7bcfd416de33731a308c3f266cc351222c34898ecbeaf847f06e48f7ec33f2",
];

/// SHA-256 of the content of MNIST's training and test split, however it is packed.
pub(crate) const MNIST_CONTENT: [&str; 2] = [
    "c5097fdd51cfdbe7695fd9df3612695696864b5c424f58d843ffdc5d335e9914",
    "18489308deedfe2f7bd3a11e599a597126f161d991b1ffcffb71642aa76f7f62",
];

const MNIST_MIRRORS: [&str; 2] = [
    "https://ossci-datasets.s3.amazonaws.com/mnist/",
    "https://storage.googleapis.com/cvdf-datasets/mnist/",
];

const FASHION_MNIST: Published = [
    (
        "train-images-idx3-ubyte.gz",
        26_421_880,
        "3aede38d61863908ad78613f6a32ed271626dd12800ba2636569512369268a84",
    ),
    (
        "train-labels-idx1-ubyte.gz",
        29_515,
        "a04f17134ac03560a47e3764e11b92fc97de4d1bfaf8ba1a3aa29af54cc90845",
    ),
    (
        "t10k-images-idx3-ubyte.gz",
        4_422_102,
        "346e55b948d973a97e58d2351dde16a484bd415d4595297633bb08f03db6a073",
    ),
    (
        "t10k-labels-idx1-ubyte.gz",
        5_148,
        "67da17c76eaffca5446c3361aaab5c3cd6d1c2608764d35dfb1850b086bf8dd5",
    ),
];

const FASHION_MNIST_MIRRORS: [&str; 3] = [
    "http://fashion-mnist.s3-website.eu-central-1.amazonaws.com/",
    "https://storage.googleapis.com/tensorflow/tf-keras-datasets/",
    "https://raw.githubusercontent.com/zalandoresearch/fashion-mnist/master/data/fashion/",
];

impl Catalogue {
    /// Returns the files and mirrors of "mnist" or "fashion-mnist".
    ///
    /// # Errors
    /// Returns [`UnknownDataset`] for any other name.
    pub fn named(name: &str) -> Result<Self, UnknownDataset> {
        let (mirrors, files, unpacked): (&[&str], _, _) = match name {
            "mnist" => (&MNIST_MIRRORS, MNIST, MNIST_UNPACKED.map(Some)),
            "fashion-mnist" => (&FASHION_MNIST_MIRRORS, FASHION_MNIST, [None; 4]),
            _ => {
                return Err(UnknownDataset {
                    name: name.to_string(),
                });
            }
        };
        let file =
            |((name, bytes, sha256), content): ((&str, u64, &str), Option<&str>)| RemoteFile {
                name: name.to_string(),
                bytes,
                sha256: sha256.to_string(),
                content_sha256: content.map(str::to_string),
            };
        Ok(Catalogue {
            name: name.to_string(),
            mirrors: mirrors.iter().map(ToString::to_string).collect(),
            files: files.into_iter().zip(unpacked).map(file).collect(),
        })
    }
}

/// Recognises a dataset, whatever its name: MNIST by content, Fashion-MNIST by published files.
pub(crate) fn known_as(fingerprint: &str, files: &[FileInfo]) -> Option<&'static str> {
    let are_published = |published: &Published| {
        let is_one = |file: &FileInfo| {
            published
                .iter()
                .any(|(_, _, sha256)| *sha256 == file.sha256)
        };
        files.len() == 2 && files.iter().all(is_one)
    };
    if MNIST_CONTENT.contains(&fingerprint) {
        return Some("mnist");
    }
    are_published(&FASHION_MNIST).then_some("fashion-mnist")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn everything_fetchable_has_four_different_files_and_two_mirrors() {
        for name in FETCHABLE {
            let catalogue = Catalogue::named(name).unwrap();
            let sums: BTreeSet<&str> = catalogue.files.iter().map(|f| f.sha256.as_str()).collect();
            assert_eq!((catalogue.files.len(), sums.len()), (4, 4));
            assert!(
                sums.iter()
                    .all(|sum| sum.len() == 64 && sum.chars().all(|c| c.is_ascii_hexdigit()))
            );
            assert!(catalogue.mirrors.len() >= 2);
        }
        let error = Catalogue::named("kmnist").unwrap_err().to_string();
        assert_eq!(
            error,
            "\"kmnist\" cannot be fetched; expected mnist or fashion-mnist"
        );
    }

    #[test]
    fn splits_are_known_by_their_content_or_their_published_files() {
        let named = |fingerprint: &str, files: &[&str]| {
            let file = |sha256: &&str| FileInfo {
                name: String::new(),
                bytes: 1,
                sha256: sha256.to_string(),
            };
            known_as(fingerprint, &files.iter().map(file).collect::<Vec<_>>())
        };
        assert_eq!(named(MNIST_CONTENT[1], &[]), Some("mnist"));
        let [(_, _, images), (_, _, labels), ..] = FASHION_MNIST;
        assert_eq!(named("", &[images, labels]), Some("fashion-mnist"));
        // With other labels it is another dataset.
        assert_eq!(named("", &[images, "0"]), None);
        assert_eq!(named("", &[]), None);
    }
}
