//! Expected and actual content of HDF5 data sets, for messages.

use hdf5_reader::Datatype;
use hdf5_reader::error::Error;
use hdf5_reader::messages::datatype::VarLenKind;

/// Command that copies a file without filters, links and virtual data sets.
pub(super) const COPY: &str = "h5py copies all values into one file: `with h5py.File(FILE) as f, h5py.File(\"copy.h5\", \"w\") as g: [g.create_dataset(n, data=f[n][()]) for n in f]; g.attrs.update(f.attrs)`";

/// Expected and actual content of an HDF5 data set.
#[derive(Debug)]
pub(super) struct Mismatch {
    pub(super) expected: String,
    pub(super) found: String,
}

impl Mismatch {
    pub(super) fn new(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self {
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// Converts an error of the HDF5 crate; filters are named.
    pub(super) fn from_hdf5(error: &Error) -> Self {
        match error {
            Error::Context { source, .. } => Self::from_hdf5(source),
            Error::UnsupportedFilter(filter) => Self::new(
                "no filter, or gzip, shuffle, fletcher32, szip, nbit or scale-offset",
                format!("the filter {}; {COPY}", filter_name(filter)),
            ),
            Error::UnsupportedLayoutClass(3) => Self::new(
                "values in this file",
                format!("a virtual data set, whose values are in other files; {COPY}"),
            ),
            other => {
                let words = other.to_string();
                match words.contains("external raw data file") {
                    true => Self::new("values in this file", format!("{words}; {COPY}")),
                    false => Self::new("readable HDF5", words),
                }
            }
        }
    }
}

fn filter_name(filter: &str) -> String {
    let id = filter.rsplit(' ').next().unwrap_or_default();
    let name = match id {
        "4" => "SZIP",
        "305" => "LZO",
        "307" => "bzip2",
        "32000" => "LZF",
        "32001" => "Blosc",
        "32004" => "LZ4",
        "32008" => "bitshuffle",
        "32013" => "ZFP",
        "32015" => "Zstandard",
        "32017" => "SZ",
        "32026" => "Blosc2",
        _ => return format!("of number {id}"),
    };
    format!("{name} (filter {id})")
}

/// Returns the usual name of an HDF5 type.
pub(super) fn type_name(datatype: &Datatype) -> String {
    match datatype {
        Datatype::FixedPoint {
            size, signed: true, ..
        } => format!("i{}", 8 * u32::from(*size)),
        Datatype::FixedPoint { size, .. } => format!("u{}", 8 * u32::from(*size)),
        Datatype::FloatingPoint { size, .. } => format!("f{}", 8 * u32::from(*size)),
        Datatype::String { .. } => "strings".into(),
        Datatype::VarLen {
            kind: VarLenKind::String,
            ..
        } => "strings".into(),
        Datatype::VarLen { .. } => "variable-length values".into(),
        Datatype::Compound { .. } => "compound values".into(),
        Datatype::Enum { .. } => "enumerated values".into(),
        Datatype::Array { .. } => "arrays".into(),
        Datatype::Opaque { .. } => "opaque values".into(),
        Datatype::Reference { .. } => "references".into(),
        Datatype::Bitfield { .. } => "bit fields".into(),
    }
}
