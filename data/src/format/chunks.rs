//! Values of a five-dimensional HDF5 data set, decoded chunk by chunk on all cores.
//!
//! The crate `hdf5-reader` parses the file; its own full read decodes one chunk after the other into the stored element
//! type. Here threads decode and narrow bands of chunks in parallel, so a file of `f64` digits is never in memory as
//! `f64`.

use super::DEFLATE_LIMIT;
use super::chunk_grid::{Band, ChunkGrid, RANK};
use super::mismatch::{Mismatch, type_name};
use super::narrow::{HELD, Stored, TooWide, Width, join, narrow, widen, width_of};
use super::resolution::SomeSweeps;
use super::tile::TileCopy;
use crate::Samples;
use hdf5_reader::chunk_index::ChunkEntry;
use hdf5_reader::dataset::{SliceInfo, SliceInfoElem};
use hdf5_reader::filters::apply_pipeline_with_limit;
use hdf5_reader::{ByteOrder, Dataset, Datatype, Hdf5File};
use rayon::prelude::*;

/// Returns all values of `dataset`, of any stored number type, narrowed.
pub(super) fn read_samples(
    file: &Hdf5File,
    dataset: &Dataset,
    shape: [usize; RANK],
) -> Result<Samples, Mismatch> {
    let (size, order) = match *dataset.dtype() {
        Datatype::FixedPoint {
            size, byte_order, ..
        }
        | Datatype::FloatingPoint { size, byte_order } => (u64::from(size), byte_order),
        _ => (1, ByteOrder::LittleEndian),
    };
    let bytes = shape
        .iter()
        .try_fold(size, |n, &extent| n.checked_mul(extent as u64));
    let room = file.storage().len().saturating_mul(DEFLATE_LIMIT);
    if bytes.is_none_or(|bytes| bytes > room) {
        return Err(Mismatch::new(
            format!("at most {room} bytes, which is all that this file can hold"),
            format!("a shape of {shape:?}"),
        ));
    }
    let values = Values {
        file,
        dataset,
        shape,
        order,
    };
    values.read_stored()
}

/// Data set with its file.
struct Values<'a> {
    file: &'a Hdf5File,
    dataset: &'a Dataset,
    shape: [usize; RANK],
    order: ByteOrder,
}

impl Values<'_> {
    /// Reads values of the stored number type.
    fn read_stored(&self) -> Result<Samples, Mismatch> {
        match *self.dataset.dtype() {
            Datatype::FixedPoint {
                size: 1,
                signed: false,
                ..
            } => self.read::<u8>(),
            Datatype::FixedPoint {
                size: 1,
                signed: true,
                ..
            } => self.read::<i8>(),
            Datatype::FixedPoint {
                size: 2,
                signed: false,
                ..
            } => self.read::<u16>(),
            Datatype::FixedPoint {
                size: 2,
                signed: true,
                ..
            } => self.read::<i16>(),
            Datatype::FixedPoint {
                size: 4,
                signed: false,
                ..
            } => self.read::<u32>(),
            Datatype::FixedPoint {
                size: 4,
                signed: true,
                ..
            } => self.read::<i32>(),
            Datatype::FixedPoint {
                size: 8,
                signed: false,
                ..
            } => self.read::<u64>(),
            Datatype::FixedPoint {
                size: 8,
                signed: true,
                ..
            } => self.read::<i64>(),
            Datatype::FloatingPoint { size: 4, .. } => self.read::<f32>(),
            Datatype::FloatingPoint { size: 8, .. } => self.read::<f64>(),
            Datatype::FloatingPoint { size: 2, .. } => Err(Mismatch::new(
                "numbers of 8, 16, 32 or 64 bits",
                "float16; store it as float32: `samples.astype('f4')`",
            )),
            ref other => Err(Mismatch::new(
                "integers of 8, 16, 32 or 64 bits or floats of 32 or 64 bits",
                type_name(other),
            )),
        }
    }

    fn read<T: Stored>(&self) -> Result<Samples, Mismatch> {
        match ChunkGrid::of(self.file, self.dataset, self.shape)? {
            Some(grid) => self.read_chunks::<T>(&grid),
            None => self.read_block::<T>(),
        }
    }

    /// Reads contiguous or compact storage, one material after the other.
    fn read_block<T: Stored>(&self) -> Result<Samples, Mismatch> {
        let materials = self.shape[0];
        let length = self.shape[1..].iter().product();
        Self::gather(&vec![length; materials], |material, bytes| {
            let mut selection = SliceInfo::all(RANK);
            let start = material as u64;
            selection.selections[0] = SliceInfoElem::Slice {
                start,
                end: start + 1,
                step: 1,
            };
            let values = T::read_box(self.dataset, &selection)
                .map_err(|error| Mismatch::from_hdf5(&error))?;
            if width_of(&values).map_err(too_wide)? > Width::U8 {
                return narrow(&values).map(Some).map_err(too_wide);
            }
            bytes
                .iter_mut()
                .zip(values)
                .for_each(|(byte, value)| *byte = value.to_u8());
            Ok(None)
        })
    }

    fn read_chunks<T: Stored>(&self, grid: &ChunkGrid) -> Result<Samples, Mismatch> {
        let bands = grid.bands(self.shape);
        let lengths: Vec<usize> = bands
            .iter()
            .map(|band| band.extent(self.shape).iter().product())
            .collect();
        Self::gather(&lengths, |index, bytes| {
            self.read_band::<T>(grid, &bands[index], bytes)
        })
    }

    /// Reads parts of the given lengths on all cores, straight into a `u8` result, which most data sets fit. Returns the
    /// values of parts that do not fit.
    fn gather(
        lengths: &[usize],
        read: impl Fn(usize, &mut [u8]) -> Result<Option<Samples>, Mismatch> + Sync,
    ) -> Result<Samples, Mismatch> {
        let mut bytes = vec![0; lengths.iter().sum()];
        let mut rest = bytes.as_mut_slice();
        let mut parts = Vec::with_capacity(lengths.len());
        for &length in lengths {
            let (part, behind) = rest.split_at_mut(length);
            parts.push(part);
            rest = behind;
        }
        let wider: Vec<Option<Samples>> = parts
            .into_par_iter()
            .enumerate()
            .map(|(index, part)| read(index, part))
            .collect::<Result<_, _>>()?;
        if wider.iter().all(Option::is_none) {
            return Ok(Samples::U8(bytes));
        }
        let mut start = 0;
        let pieces = lengths.iter().zip(wider).map(|(length, wider)| {
            let end = start + length;
            let piece = wider.unwrap_or_else(|| Samples::U8(bytes[start..end].to_vec()));
            start = end;
            piece
        });
        Ok(join(pieces.collect()))
    }

    /// Reads a band into `bytes`, or returns its values if they do not fit.
    fn read_band<T: Stored>(
        &self,
        grid: &ChunkGrid,
        band: &Band,
        bytes: &mut [u8],
    ) -> Result<Option<Samples>, Mismatch> {
        let extent = band.extent(self.shape);
        let mut wider = None;
        if band.chunks.len() < band.expected_chunks
            && let Some(fill) = &grid.fill_value
            && let Some(&value) = T::decode(fill.clone(), self.order).first()
        {
            match narrow(&vec![value; bytes.len()]).map_err(too_wide)? {
                Samples::U8(values) => bytes.copy_from_slice(&values),
                values => wider = Some(values),
            }
        }
        for entry in &band.chunks {
            let tile = T::decode(self.decode(grid, entry)?, self.order);
            let mut offset = [0; RANK];
            for (axis, start) in offset.iter_mut().enumerate() {
                *start = entry.offsets[axis] as usize;
            }
            offset[0] -= band.materials.start;
            offset[1] -= band.sweeps.start;
            let copy = TileCopy::new(offset, grid.chunk, extent);
            let width = width_of(&tile).map_err(too_wide)?;
            wider = match wider {
                None if width == Width::U8 => None,
                None => Some(widen(Samples::U8(bytes.to_vec()), width)),
                Some(values) => Some(widen(values, width)),
            };
            match &mut wider {
                None => copy.run(&tile, bytes, T::to_u8),
                Some(Samples::U8(out)) => copy.run(&tile, out, T::to_u8),
                Some(Samples::U16(out)) => copy.run(&tile, out, T::to_u16),
                Some(Samples::F32(out)) => copy.run(&tile, out, T::to_f32),
            }
        }
        Ok(wider)
    }

    /// Returns the unpacked bytes of one chunk.
    fn decode(&self, grid: &ChunkGrid, entry: &ChunkEntry) -> Result<Vec<u8>, Mismatch> {
        let hdf5 = |error| Mismatch::from_hdf5(&error);
        let stored = if entry.size > 0 {
            entry.size as usize
        } else {
            grid.chunk_bytes
        };
        let packed = self
            .file
            .storage()
            .read_range(entry.address, stored)
            .map_err(hdf5)?;
        let filters = grid
            .filters
            .as_ref()
            .map_or(&[][..], |pipeline| &pipeline.filters);
        let bytes = apply_pipeline_with_limit(
            packed.as_ref(),
            filters,
            entry.filter_mask,
            grid.chunk_bytes / grid.chunk.iter().product::<usize>(),
            None,
            Some(grid.chunk_bytes + 1),
        )
        .map_err(hdf5)?;
        if bytes.len() != grid.chunk_bytes {
            return Err(Mismatch::new(
                format!(
                    "{} bytes in the chunk at {:?}",
                    grid.chunk_bytes, entry.offsets
                ),
                format!("{} bytes", bytes.len()),
            ));
        }
        Ok(bytes)
    }
}

/// Returns some of the sweeps of a data set, if 32-bit floats may lose their resolution; `None` for other types.
pub(super) fn some_sweeps(
    dataset: &Dataset,
    shape: [usize; RANK],
) -> Result<Option<SomeSweeps>, Mismatch> {
    match *dataset.dtype() {
        Datatype::FloatingPoint { size: 8, .. } => some_of::<f64>(dataset, shape),
        Datatype::FixedPoint { size, signed, .. } => match (size, signed) {
            (4, true) => some_of::<i32>(dataset, shape),
            (4, false) => some_of::<u32>(dataset, shape),
            (8, true) => some_of::<i64>(dataset, shape),
            (8, false) => some_of::<u64>(dataset, shape),
            _ => return Ok(None),
        },
        _ => return Ok(None),
    }
    .map(Some)
}

fn some_of<T: Stored>(dataset: &Dataset, shape: [usize; RANK]) -> Result<SomeSweeps, Mismatch> {
    /// Number of sweeps, which may each need a chunk with many others.
    const SWEEPS: usize = 16;
    let all = shape[0] * shape[1];
    let count = all.min(SWEEPS);
    let mut some = SomeSweeps::of_array(&[count, shape[2], shape[3] * shape[4]]);
    for number in 0..count {
        let sweep = number * all / count;
        let mut selection = SliceInfo::all(RANK);
        for (axis, at) in [sweep / shape[1], sweep % shape[1]].into_iter().enumerate() {
            let start = at as u64;
            selection.selections[axis] = SliceInfoElem::Slice {
                start,
                end: start + 1,
                step: 1,
            };
        }
        let values =
            T::read_box(dataset, &selection).map_err(|error| Mismatch::from_hdf5(&error))?;
        some.push(&values.into_iter().map(T::to_f64).collect::<Vec<f64>>());
    }
    Ok(some)
}

fn too_wide(value: TooWide) -> Mismatch {
    Mismatch::new(HELD, value.0)
}
