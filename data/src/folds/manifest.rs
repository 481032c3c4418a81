//! Splits as data, stored with every result so that the split can be repeated.

use super::split::{SplitKey, TestSplit};
use super::{Fold, Scheme, TrainSplit};
use crate::{DataError, Dataset, Seed, sha256_hex};
use serde::{Deserialize, Serialize};

/// Indices of the training and test sweeps, with the scheme and the data set that they belong to.
///
/// The indices define the split, so it stays the same even if a later version splits differently.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SplitManifest {
    /// Version of this layout, [`SplitManifest::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Scheme of the split.
    pub scheme: Scheme,
    /// Number of the repetition; `run` in the file, whose hash covers that name.
    #[serde(rename = "run", alias = "repeat")]
    pub repeat: usize,
    /// Number of the fold in its repeat.
    pub fold: usize,
    /// Seed of the random choices.
    pub seed: Seed,
    /// [`Dataset::sha256`] of the data set.
    pub data_sha256: String,
    /// Indices of the training sweeps, ascending.
    pub train: Vec<usize>,
    /// Indices of the test sweeps, ascending.
    pub test: Vec<usize>,
    /// SHA-256 of all other fields, [`SplitManifest::digest`].
    pub sha256: String,
}

impl SplitManifest {
    /// Version of the layout that is written and read.
    pub const SCHEMA_VERSION: u32 = 1;

    /// Returns the SHA-256, in hex, of all other fields as a JSON array in the order of their declaration, without white
    /// space.
    ///
    /// In Python: `sha256(json.dumps(list(manifest.values())[:-1], separators=(",", ":")).encode()).hexdigest()`.
    pub fn digest(&self) -> String {
        let fields = (
            self.schema_version,
            self.scheme,
            self.repeat,
            self.fold,
            self.seed,
            &self.data_sha256,
            &self.train,
            &self.test,
        );
        let json = serde_json::to_vec(&fields)
            .unwrap_or_else(|error| panic!("numbers and strings always have a JSON form: {error}"));
        sha256_hex(&json)
    }

    /// Returns the split that the manifest describes.
    ///
    /// # Errors
    /// Another layout version, a hash that does not match the fields, another data set than the one that was split, or
    /// invalid indices.
    pub fn fold<'a>(&self, dataset: &'a Dataset) -> Result<Fold<'a>, DataError> {
        if self.schema_version != Self::SCHEMA_VERSION {
            return Err(DataError::inconsistent(
                "split manifest",
                format!("schema version {}", Self::SCHEMA_VERSION),
                format!("version {}", self.schema_version),
            ));
        }
        let digest = self.digest();
        if self.sha256 != digest {
            return Err(DataError::inconsistent(
                "split manifest",
                format!("SHA-256 {digest} over its fields"),
                self.sha256.as_str(),
            ));
        }
        if self.data_sha256 != dataset.sha256() {
            return Err(DataError::inconsistent(
                "split manifest",
                format!("a split of the data set with SHA-256 {}", self.data_sha256),
                format!("`{}` with {}", dataset.name(), dataset.sha256()),
            ));
        }
        self.check_indices(dataset.len())?;
        Ok(Fold {
            dataset,
            scheme: self.scheme,
            seed: self.seed,
            repeat: self.repeat,
            fold: self.fold,
            train: TrainSplit::new(
                dataset,
                self.train.clone(),
                SplitKey {
                    scheme: self.scheme,
                    seed: self.seed,
                    repeat: self.repeat,
                    fold: self.fold,
                },
            ),
            test: TestSplit::new(dataset, self.test.clone()),
        })
    }

    fn check_indices(&self, sweeps: usize) -> Result<(), DataError> {
        let mut taken = vec![false; sweeps];
        for (side, indices) in [("train", &self.train), ("test", &self.test)] {
            let wrong = |found| {
                let expected = format!("ascending indices below {sweeps}, each on one side only");
                DataError::inconsistent(format!("split manifest, `{side}`"), expected, found)
            };
            if indices.is_empty() && !(side == "test" && self.scheme == Scheme::TrainOnAll) {
                return Err(wrong("none".into()));
            }
            if let Some(pair) = indices.windows(2).find(|pair| pair[0] >= pair[1]) {
                return Err(wrong(format!("{} before {}", pair[0], pair[1])));
            }
            for &index in indices {
                match taken.get_mut(index) {
                    Some(taken) if !*taken => *taken = true,
                    Some(_) => return Err(wrong(format!("{index} on both"))),
                    None => return Err(wrong(index.to_string())),
                }
            }
        }
        Ok(())
    }
}

impl Fold<'_> {
    /// Returns the split as data.
    pub fn manifest(&self) -> SplitManifest {
        let mut manifest = SplitManifest {
            schema_version: SplitManifest::SCHEMA_VERSION,
            scheme: self.scheme,
            repeat: self.repeat,
            fold: self.fold,
            seed: self.seed,
            data_sha256: self.dataset.sha256().to_owned(),
            train: self.train.indices().to_vec(),
            test: self.test.indices().to_vec(),
            sha256: String::new(),
        };
        manifest.sha256 = manifest.digest();
        manifest
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::recorded;
    use super::*;

    fn manifest(dataset: &Dataset) -> SplitManifest {
        Fold::new(dataset, Scheme::default(), Seed(3), 1, 2)
            .unwrap()
            .manifest()
    }

    /// Returns the message about a manifest with a valid hash and invalid content.
    fn refusal(dataset: &Dataset, spoil: impl FnOnce(&mut SplitManifest)) -> String {
        let mut manifest = manifest(dataset);
        spoil(&mut manifest);
        manifest.sha256 = manifest.digest();
        manifest.fold(dataset).unwrap_err().to_string()
    }

    #[test]
    fn a_manifest_gives_the_same_split_back() {
        let dataset = recorded(&[20, 23], 4);
        let fold = Fold::new(&dataset, Scheme::default(), Seed(3), 1, 2).unwrap();
        let json = serde_json::to_string_pretty(&fold.manifest()).unwrap();
        let read: SplitManifest = serde_json::from_str(&json).unwrap();
        assert_eq!(read, fold.manifest());
        let again = read.fold(&dataset).unwrap();
        assert_eq!(again.train.indices(), fold.train.indices());
        assert_eq!(again.test.indices(), fold.test.indices());
        assert_eq!(again.manifest(), fold.manifest());
        let (inner, same) = (fold.inner(4).unwrap(), again.inner(4).unwrap());
        assert_eq!(inner.0.indices(), same.0.indices());
        assert_eq!(inner.1.indices(), same.1.indices());
    }

    #[test]
    fn a_manifest_refuses_another_data_set() {
        let error = manifest(&recorded(&[20, 23], 4))
            .fold(&recorded(&[20, 24], 4))
            .unwrap_err();
        assert!(
            error
                .to_string()
                .contains("a split of the data set with SHA-256"),
            "{error}"
        );
    }

    #[test]
    fn a_manifest_refuses_fields_that_its_hash_does_not_cover() {
        let dataset = recorded(&[20, 23], 4);
        let mut manifest = manifest(&dataset);
        manifest.seed = Seed(4);
        let error = manifest.fold(&dataset).unwrap_err().to_string();
        assert!(error.contains("over its fields"), "{error}");
    }

    #[test]
    fn a_manifest_refuses_what_is_no_split() {
        let dataset = recorded(&[20, 23], 4);
        let error = refusal(&dataset, |m| m.schema_version = 2);
        assert!(
            error.contains("expected schema version 1, found version 2"),
            "{error}"
        );
        let error = refusal(&dataset, |m| m.test[0] = m.train[0]);
        assert!(error.contains("on both"), "{error}");
        let error = refusal(&dataset, |m| m.test.push(43));
        assert!(
            error.contains("`test`: expected ascending indices below 43"),
            "{error}"
        );
        let error = refusal(&dataset, |m| m.train.swap(0, 1));
        assert!(error.contains("before"), "{error}");
        let error = refusal(&dataset, |m| m.train.clear());
        assert!(
            error.contains("`train`") && error.contains("found none"),
            "{error}"
        );
    }

    #[test]
    fn the_hash_is_the_one_that_the_documentation_describes() {
        let manifest = SplitManifest {
            schema_version: 1,
            scheme: Scheme::StratifiedKFold {
                folds: 5,
                repeats: 2,
            },
            repeat: 0,
            fold: 1,
            seed: Seed(7),
            data_sha256: "00ff".into(),
            train: vec![0, 1, 3],
            test: vec![2],
            sha256: String::new(),
        };
        assert_eq!(
            manifest.digest(),
            "0492c8912995da0e51a6839892378814d5fb5d702602cf02ad8c4f753a3fde6e"
        );
    }
}
