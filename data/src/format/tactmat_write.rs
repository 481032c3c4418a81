//! Writer of TactMat's HDF5 layout.

use super::arrays::LENGTHS;
use super::tactmat;
use crate::{ConditionValues, DataError, Dataset, Samples, write_whole};
use hdf5_writer::{
    AttributeBuilder, DatasetBuilder, FILTER_DEFLATE, FILTER_SHUFFLE, FilterDescription,
    Hdf5Builder, Hdf5WritePlan, WriteOptions,
};
use std::path::Path;

/// Maximum size of a chunk, in bytes; it contains whole sweeps of a material.
const CHUNK_BYTES: usize = 1 << 18;
/// Level of gzip. Higher levels shrink a full-size file by a few percent and take several times as long.
const GZIP_LEVEL: u32 = 4;

/// Writes `dataset` in the layout of [`tactmat`](super::tactmat) with gzip chunks of whole sweeps; the file appears only
/// when it is complete.
///
/// # Errors
/// Materials with unequal numbers of sweeps, which the layout cannot represent, or a file that cannot be written.
pub fn write(path: &Path, dataset: &Dataset) -> Result<(), DataError> {
    let order = super::by_material(dataset).map_err(|error| super::in_file(path, error))?;
    let bytes = plan(dataset, &order)
        .and_then(|plan| plan.encode(WriteOptions::default()))
        .map_err(|error| {
            DataError::format(
                path,
                "HDF5 file",
                "a data set that HDF5 can hold",
                error.to_string(),
            )
        })?;
    write_whole(path, &bytes)
}

fn plan(dataset: &Dataset, order: &[usize]) -> hdf5_writer::Result<Hdf5WritePlan> {
    let conditions = dataset.condition_values();
    let dataset = dataset.without_conditions();
    let dataset = dataset.as_ref();
    let shape = dataset.shape();
    let labels = dataset.labels();
    let sweeps = order.len() / labels.len();
    let extents = [labels.len(), sweeps, shape.steps, shape.rows, shape.cols].map(|n| n as u64);
    let width = dataset.samples().bytes() / dataset.samples().len();
    let per_chunk = (CHUNK_BYTES / (shape.values() * width)).clamp(1, sweeps) as u64;
    let chunk = [1, per_chunk, extents[2], extents[3], extents[4]];
    let samples = match dataset.samples() {
        Samples::U8(values) => {
            DatasetBuilder::typed_data("samples", extents, &in_order(values, order, shape.values()))
        }
        Samples::U16(values) => {
            DatasetBuilder::typed_data("samples", extents, &in_order(values, order, shape.values()))
        }
        Samples::F32(values) => {
            DatasetBuilder::typed_data("samples", extents, &in_order(values, order, shape.values()))
        }
    }?;
    let mut samples = samples.chunked(chunk);
    if width > 1 {
        samples = samples.filter(filter(FILTER_SHUFFLE, width as u32));
    }
    let names: Vec<&str> = labels.names().collect();
    let mut file = Hdf5Builder::new()
        .dataset(samples.filter(filter(FILTER_DEFLATE, GZIP_LEVEL)))
        .dataset(DatasetBuilder::fixed_string_data(
            "materials",
            [names.len() as u64],
            &names,
        )?);
    if !dataset.is_rate_assumed() {
        let rate = AttributeBuilder::scalar(tactmat::RATE_ATTRIBUTE, dataset.sample_rate_hz())?;
        file = file.attribute(rate);
    }
    if let Some(version) = dataset.origin().twin_version() {
        let mark = f64::from(version.number());
        let mark = AttributeBuilder::scalar(tactmat::SYNTHETIC_ATTRIBUTE, mark)?;
        file = file.attribute(mark);
    }
    let records = || order.iter().map(|&index| &dataset.records()[index]);
    if dataset.has_blocks() {
        let blocks: Vec<u32> = records().filter_map(|record| record.block).collect();
        file = file.dataset(DatasetBuilder::typed_data(
            "blocks",
            &extents[..2],
            &blocks,
        )?);
    }
    for ConditionValues { condition, values } in conditions {
        let values: Vec<f32> = order.iter().map(|&index| values[index]).collect();
        let name = condition.quantity.name();
        let mut set = DatasetBuilder::typed_data(name, &extents[..2], &values)?;
        if let Some(unit) = &condition.unit {
            set = set.attribute(AttributeBuilder::fixed_string("unit", unit));
        }
        file = file.dataset(set);
    }
    if dataset.has_test_flag() {
        let flags: Vec<u8> = records().filter_map(|r| r.test).map(u8::from).collect();
        file = file.dataset(DatasetBuilder::typed_data(
            "test_flag",
            &extents[..2],
            &flags,
        )?);
    }
    if let Some(lengths) = dataset.lengths() {
        let lengths: Vec<u32> = order.iter().map(|&index| lengths[index] as u32).collect();
        file = file.dataset(DatasetBuilder::typed_data(
            LENGTHS,
            &extents[..2],
            &lengths,
        )?);
    }
    file.into_plan()
}

fn in_order<T: Copy>(values: &[T], order: &[usize], sweep: usize) -> Vec<T> {
    let mut sorted = Vec::with_capacity(values.len());
    for &index in order {
        sorted.extend_from_slice(&values[index * sweep..(index + 1) * sweep]);
    }
    sorted
}

fn filter(id: u16, parameter: u32) -> FilterDescription {
    FilterDescription {
        id,
        name: None,
        client_data: vec![parameter],
    }
}
