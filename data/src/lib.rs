//! Data sets of a tactile skin: sweeps, their materials, checks and splits.
//!
//! ```text
//! HDF5 / npz / twin ──> Dataset ──> check ──> folds ──> TrainSplit, TestSplit
//! ```
//!
//! A [`Dataset`] stores its sweeps in their native element type (`u8`, `u16` or `f32`) and converts one sweep at a time
//! to `f32`. This crate trains no models.
//!
//! ```
//! use tactnet_data::twin::TwinConfig;
//! use tactnet_data::{CheckedDataset, Seed};
//!
//! let config = TwinConfig { materials: 3, sweeps: 10, steps: 200, ..TwinConfig::default() };
//! let dataset = CheckedDataset::twin(&config)?;
//! let fold = dataset.folds(Seed(1)).first();
//! println!("train on {} sweeps, test on {}", fold.train.len(), fold.test.len());
//! # Ok::<(), tactnet_data::DataError>(())
//! ```

mod check;
mod checked_dataset;
mod data_origin;
mod data_source;
mod dataset;
mod error;
#[cfg(feature = "fetch")]
mod fetch;
mod finding;
mod folds;
pub mod format;
mod hex;
mod info;
mod known_names;
mod material;
mod material_name;
mod material_split;
mod read_file;
mod remedy;
mod samples;
mod seed;
mod shuffle;
mod spreadsheet;
pub mod twin;
mod value_range;
mod write_whole;

pub use check::{
    Confounding, check, check_lengths, check_unlabelled, refuse_errors, refuse_leaks,
    shared_within_blocks,
};
pub use checked_dataset::{CheckedDataset, Folds};
pub use data_origin::DataOrigin;
pub use data_source::DataSource;
pub use dataset::{
    ASSUMED_RATE_HZ, Condition, ConditionValues, Dataset, Quantity, SweepRecord, SweepShape,
};
pub use error::{DataError, is_wrong_path};
#[cfg(feature = "fetch")]
pub use fetch::{
    FetchError, Fetched, Origin, Progress, PublicSet, SetProgress, Source, fetch, git_blob_id,
};
pub use finding::{
    CheckReport, Finding, FindingGroup, FindingKind, Place, Severity, group_findings,
};
pub use folds::{Fold, Scheme, SplitManifest, SweepView, TestSplit, TrainSplit, ValidationSplit};
pub use hex::{hex, sha256_hex};
pub use info::{ConditionInfo, Info, LengthRange, MaterialInfo, info};
pub use known_names::{is_same_name, known_names, near_name};
pub use material::{LabelSet, Material, is_control};
pub use material_name::normal_name;
pub(crate) use material_name::{is_invisible, plain_name, skeleton};
pub use material_split::MaterialSplit;
pub use read_file::{open_file, read_file, read_text};
pub use remedy::Remedy;
pub use samples::Samples;
pub use seed::Seed;
pub use shuffle::shuffle;
pub use spreadsheet::spreadsheet_cell;
pub use value_range::ValueRange;
pub use write_whole::{UNFINISHED, write_whole};
