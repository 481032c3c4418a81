//! The values of a five-dimensional HDF5 data set, decoded chunk by chunk on all cores.
//!
//! The crate `hdf5-reader` parses the file; its own full read decodes one chunk after the other into the stored element
//! type. Here each band of chunks is decoded, narrowed and put into place on a thread of its own, so a file of `f64`
//! digits never stands in memory as `f64`.

use super::DEFLATE_LIMIT;
use super::narrow::{Stored, TooWide, Width, join, narrow, widen, width_of};
use crate::Samples;
use hdf5_reader::chunk_index::{self, ChunkEntry};
use hdf5_reader::dataset::{SliceInfo, SliceInfoElem};
use hdf5_reader::error::Error;
use hdf5_reader::filters::apply_pipeline_with_limit;
use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::filter_pipeline::FilterPipelineMessage;
use hdf5_reader::messages::layout::{ChunkIndexing, DataLayout};
use hdf5_reader::{ByteOrder, Dataset, Datatype, Hdf5File, btree_v1};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Dimensions of `samples`: materials, sweeps, steps, rows, cols.
pub(super) const RANK: usize = 5;

/// What a data set should hold and what it holds instead.
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

    /// What the HDF5 crate says, with filters by name.
    pub(super) fn from_hdf5(error: &Error) -> Self {
        match error {
            Error::Context { source, .. } => Self::from_hdf5(source),
            Error::UnsupportedFilter(filter) => Self::new(
                "no filter, or gzip, shuffle, fletcher32, szip, nbit or scale-offset",
                format!(
                    "the filter {}; rewrite the file with gzip",
                    filter_name(filter)
                ),
            ),
            other => Self::new("readable HDF5", other.to_string()),
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

/// All values of `dataset`, whatever number type they are stored in, narrowed.
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
    match *dataset.dtype() {
        Datatype::FixedPoint {
            size: 1,
            signed: false,
            ..
        } => values.read::<u8>(),
        Datatype::FixedPoint {
            size: 1,
            signed: true,
            ..
        } => values.read::<i8>(),
        Datatype::FixedPoint {
            size: 2,
            signed: false,
            ..
        } => values.read::<u16>(),
        Datatype::FixedPoint {
            size: 2,
            signed: true,
            ..
        } => values.read::<i16>(),
        Datatype::FixedPoint {
            size: 4,
            signed: false,
            ..
        } => values.read::<u32>(),
        Datatype::FixedPoint {
            size: 4,
            signed: true,
            ..
        } => values.read::<i32>(),
        Datatype::FixedPoint {
            size: 8,
            signed: false,
            ..
        } => values.read::<u64>(),
        Datatype::FixedPoint {
            size: 8,
            signed: true,
            ..
        } => values.read::<i64>(),
        Datatype::FloatingPoint { size: 4, .. } => values.read::<f32>(),
        Datatype::FloatingPoint { size: 8, .. } => values.read::<f64>(),
        ref other => Err(Mismatch::new(
            "integers of 8, 16, 32 or 64 bits or floats of 32 or 64 bits",
            type_name(other),
        )),
    }
}

/// How people call an HDF5 type.
pub(super) fn type_name(datatype: &Datatype) -> String {
    match datatype {
        Datatype::FixedPoint {
            size, signed: true, ..
        } => format!("i{}", 8 * u32::from(*size)),
        Datatype::FixedPoint { size, .. } => format!("u{}", 8 * u32::from(*size)),
        Datatype::FloatingPoint { size, .. } => format!("f{}", 8 * u32::from(*size)),
        Datatype::String { .. } => "strings".into(),
        Datatype::VarLen { .. } => "variable-length values".into(),
        Datatype::Compound { .. } => "compound values".into(),
        Datatype::Enum { .. } => "enumerated values".into(),
        Datatype::Array { .. } => "arrays".into(),
        Datatype::Opaque { .. } => "opaque values".into(),
        Datatype::Reference { .. } => "references".into(),
        Datatype::Bitfield { .. } => "bit fields".into(),
    }
}

struct Values<'a> {
    file: &'a Hdf5File,
    dataset: &'a Dataset,
    shape: [usize; RANK],
    order: ByteOrder,
}

impl Values<'_> {
    fn read<T: Stored>(&self) -> Result<Samples, Mismatch> {
        match self.chunk_grid()? {
            Some(grid) => self.read_chunks::<T>(&grid),
            None => self.read_block::<T>(),
        }
    }

    /// Contiguous and compact storage: one material after the other.
    fn read_block<T: Stored>(&self) -> Result<Samples, Mismatch> {
        let pieces: Result<Vec<Samples>, Mismatch> = (0..self.shape[0])
            .into_par_iter()
            .map(|material| {
                let mut selection = SliceInfo::all(RANK);
                let material = material as u64;
                selection.selections[0] = SliceInfoElem::Slice {
                    start: material,
                    end: material + 1,
                    step: 1,
                };
                let values = T::read_box(self.dataset, &selection)
                    .map_err(|error| Mismatch::from_hdf5(&error))?;
                narrow(&values).map_err(too_wide)
            })
            .collect();
        pieces.map(join)
    }

    /// Every band is decoded straight into its part of a `u8` result, as most data sets need no more.
    fn read_chunks<T: Stored>(&self, grid: &ChunkGrid) -> Result<Samples, Mismatch> {
        let bands = grid.bands(self.shape);
        let mut bytes = vec![0; self.shape.iter().product()];
        let mut rest = bytes.as_mut_slice();
        let mut parts = Vec::with_capacity(bands.len());
        for band in &bands {
            let (part, behind) = rest.split_at_mut(band.extent(self.shape).iter().product());
            parts.push((band, part));
            rest = behind;
        }
        let wider: Vec<Option<Samples>> = parts
            .into_par_iter()
            .map(|(band, part)| self.read_band::<T>(grid, band, part))
            .collect::<Result<_, _>>()?;
        if wider.iter().all(Option::is_none) {
            return Ok(Samples::U8(bytes));
        }
        let mut start = 0;
        let pieces = bands.iter().zip(wider).map(|(band, wider)| {
            let end = start + band.extent(self.shape).iter().product::<usize>();
            let piece = wider.unwrap_or_else(|| Samples::U8(bytes[start..end].to_vec()));
            start = end;
            piece
        });
        Ok(join(pieces.collect()))
    }

    /// Reads a band into `bytes`, or returns its values if they do not fit there.
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

    /// The bytes of one chunk, unpacked.
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

    /// Where the chunks lie in the file; none for storage that is not chunked.
    fn chunk_grid(&self) -> Result<Option<ChunkGrid>, Mismatch> {
        let hdf5 = |error| Mismatch::from_hdf5(&error);
        let header = self
            .file
            .get_or_parse_header(self.dataset.address())
            .map_err(hdf5)?;
        let mut layout = None;
        let mut filters = None;
        let mut fill_value = None;
        for message in &header.messages {
            match message {
                HdfMessage::DataLayout(message) => layout = Some(&message.layout),
                HdfMessage::FilterPipeline(pipeline) => filters = Some(pipeline.clone()),
                HdfMessage::FillValue(message) if message.value.is_some() => {
                    fill_value.clone_from(&message.value);
                }
                _ => {}
            }
        }
        let Some(DataLayout::Chunked {
            address,
            dims,
            chunk_indexing,
            ..
        }) = layout
        else {
            return Ok(None);
        };
        // Some versions of the message carry the element's size as one dimension more.
        let Some(chunk) = dims.first_chunk::<RANK>().copied() else {
            return Err(Mismatch::new("chunks of 5 dimensions", format!("{dims:?}")));
        };
        let chunk = chunk.map(|extent| extent as usize);
        let size = self.dataset.raw_element_size().map_err(hdf5)?;
        let chunk_bytes = chunk
            .iter()
            .try_fold(size, |n, &extent| n.checked_mul(extent));
        let room = self.file.storage().len().saturating_mul(DEFLATE_LIMIT);
        let Some(chunk_bytes) = chunk_bytes.filter(|&bytes| bytes > 0 && bytes as u64 <= room)
        else {
            return Err(Mismatch::new(
                "chunks that the file can hold",
                format!("{chunk:?}"),
            ));
        };
        let shape = self.shape.map(|extent| extent as u64);
        let entries = self
            .chunk_entries(
                *address,
                &dims[..RANK],
                chunk_indexing.as_ref(),
                &shape,
                size,
            )
            .map_err(hdf5)?;
        ChunkGrid {
            chunk,
            chunk_bytes,
            filters,
            fill_value,
            entries: BTreeMap::new(),
        }
        .with_entries(entries, self.shape)
        .map(Some)
    }

    fn chunk_entries(
        &self,
        address: u64,
        dims: &[u32],
        indexing: Option<&ChunkIndexing>,
        shape: &[u64],
        size: usize,
    ) -> hdf5_reader::error::Result<Vec<ChunkEntry>> {
        let superblock = self.file.superblock();
        let (offset_size, length_size) = (superblock.offset_size, superblock.length_size);
        let storage = self.file.storage();
        let undefined = u64::MAX >> (64 - 8 * u32::from(offset_size.clamp(1, 8)));
        if address == u64::MAX || address == undefined {
            return Ok(Vec::new());
        }
        match indexing {
            None => btree_v1::collect_btree_v1_leaves_storage(
                storage,
                address,
                offset_size,
                length_size,
                Some(RANK as u32),
                dims,
                None,
            )?
            .into_iter()
            .map(|(key, address)| match key {
                btree_v1::BTreeV1Key::RawData {
                    chunk_size,
                    filter_mask,
                    mut offsets,
                } => {
                    offsets.truncate(RANK);
                    Ok(ChunkEntry {
                        address,
                        size: chunk_size.into(),
                        filter_mask,
                        offsets,
                    })
                }
                btree_v1::BTreeV1Key::Group { .. } => {
                    Err(Error::InvalidData("a group's node among the chunks".into()))
                }
            })
            .collect(),
            Some(ChunkIndexing::SingleChunk {
                filtered_size,
                filters,
            }) => Ok(vec![chunk_index::single_chunk_entry(
                address,
                *filtered_size,
                *filters,
                RANK,
            )]),
            Some(ChunkIndexing::BTreeV2) => chunk_index::collect_v2_chunk_entries_storage(
                storage,
                address,
                offset_size,
                length_size,
                RANK as u32,
                dims,
                None,
            ),
            Some(ChunkIndexing::Implicit) => chunk_index::collect_implicit_chunk_entries(
                address,
                shape,
                dims,
                size,
                None,
                storage.len(),
            ),
            Some(ChunkIndexing::FixedArray { .. }) => {
                hdf5_reader::fixed_array::collect_fixed_array_chunk_entries_storage(
                    storage,
                    address,
                    offset_size,
                    length_size,
                    shape,
                    dims,
                    None,
                )
            }
            Some(ChunkIndexing::ExtensibleArray { .. }) => {
                hdf5_reader::extensible_array::collect_extensible_array_chunk_entries_storage(
                    storage,
                    address,
                    offset_size,
                    length_size,
                    shape,
                    self.dataset.max_dims(),
                    dims,
                    None,
                )
            }
        }
    }
}

fn too_wide(value: TooWide) -> Mismatch {
    Mismatch::new("values that a 32-bit float holds", value.0)
}

/// The chunks of a data set.
struct ChunkGrid {
    chunk: [usize; RANK],
    chunk_bytes: usize,
    filters: Option<FilterPipelineMessage>,
    fill_value: Option<Vec<u8>>,
    /// By position in the grid.
    entries: BTreeMap<[usize; RANK], ChunkEntry>,
}

/// Chunks whose values lie one behind the other in the result.
struct Band {
    materials: Range<usize>,
    sweeps: Range<usize>,
    chunks: Vec<ChunkEntry>,
    expected_chunks: usize,
}

impl Band {
    /// The extents of the band in a data set of `shape`.
    fn extent(&self, shape: [usize; RANK]) -> [usize; RANK] {
        let [_, _, steps, rows, cols] = shape;
        [self.materials.len(), self.sweeps.len(), steps, rows, cols]
    }
}

impl ChunkGrid {
    /// Takes the chunks inside `shape`; one that a shrunk data set left behind is ignored.
    fn with_entries(
        mut self,
        entries: Vec<ChunkEntry>,
        shape: [usize; RANK],
    ) -> Result<Self, Mismatch> {
        for entry in entries {
            let mut place = [0; RANK];
            let mut inside = true;
            for axis in 0..RANK {
                let offset = entry.offsets.get(axis).copied().unwrap_or(u64::MAX);
                let extent = self.chunk[axis] as u64;
                if !offset.is_multiple_of(extent) {
                    return Err(Mismatch::new(
                        format!("chunks on a grid of {:?}", self.chunk),
                        format!("a chunk at {:?}", entry.offsets),
                    ));
                }
                inside &= offset < shape[axis] as u64;
                place[axis] = (offset / extent) as usize;
            }
            if inside && let Some(twice) = self.entries.insert(place, entry) {
                return Err(Mismatch::new(
                    "one chunk at each place",
                    format!("two at {:?}", twice.offsets),
                ));
            }
        }
        Ok(self)
    }

    /// Splits along the materials, and along the sweeps too where a chunk holds one material only.
    fn bands(&self, shape: [usize; RANK]) -> Vec<Band> {
        let across: usize = (2..RANK)
            .map(|axis| shape[axis].div_ceil(self.chunk[axis]))
            .product();
        let sweep_chunks = shape[1].div_ceil(self.chunk[1]);
        let by_sweep = self.chunk[0] == 1;
        let mut bands: BTreeMap<(usize, usize), Vec<ChunkEntry>> = BTreeMap::new();
        for material in 0..shape[0].div_ceil(self.chunk[0]) {
            for sweep in 0..if by_sweep { sweep_chunks } else { 1 } {
                bands.insert((material, sweep), Vec::new());
            }
        }
        for (place, entry) in &self.entries {
            let key = (place[0], if by_sweep { place[1] } else { 0 });
            bands.entry(key).or_default().push(entry.clone());
        }
        bands
            .into_iter()
            .map(|((material, sweep), chunks)| {
                let first = material * self.chunk[0];
                let materials = first..(first + self.chunk[0]).min(shape[0]);
                let first = sweep * self.chunk[1];
                let sweeps = if by_sweep {
                    first..(first + self.chunk[1]).min(shape[1])
                } else {
                    0..shape[1]
                };
                let expected_chunks = if by_sweep {
                    across
                } else {
                    across * sweep_chunks
                };
                Band {
                    materials,
                    sweeps,
                    chunks,
                    expected_chunks,
                }
            })
            .collect()
    }
}

/// Copies a chunk to its place in a larger box, as few and as long runs as possible.
struct TileCopy {
    /// Extent, stride in the chunk and stride in the box, outermost first; axes that run on are one.
    axes: Vec<(usize, usize, usize)>,
    start: usize,
}

impl TileCopy {
    fn new(offset: [usize; RANK], chunk: [usize; RANK], outer: [usize; RANK]) -> Self {
        let mut axes: Vec<(usize, usize, usize)> = Vec::with_capacity(RANK);
        let (mut from, mut to, mut start) = (1, 1, 0);
        for axis in (0..RANK).rev() {
            let extent = chunk[axis].min(outer[axis] - offset[axis]);
            start += offset[axis] * to;
            match axes.last_mut() {
                Some((run, f, t)) if *run * *f == from && *run * *t == to => *run *= extent,
                _ if extent == 1 => {}
                _ => axes.push((extent, from, to)),
            }
            from *= chunk[axis];
            to *= outer[axis];
        }
        axes.reverse();
        Self { axes, start }
    }

    fn run<T: Copy, U: Copy>(&self, tile: &[T], out: &mut [U], convert: impl Fn(T) -> U + Copy) {
        copy_axes(&self.axes, tile, &mut out[self.start..], convert);
    }
}

fn copy_axes<T: Copy, U: Copy>(
    axes: &[(usize, usize, usize)],
    tile: &[T],
    out: &mut [U],
    convert: impl Fn(T) -> U + Copy,
) {
    match axes {
        [] => out[0] = convert(tile[0]),
        [(extent, 1, 1)] => {
            out[..*extent]
                .iter_mut()
                .zip(&tile[..*extent])
                .for_each(|(o, &x)| *o = convert(x));
        }
        [(extent, from, to)] => {
            let values = tile.iter().step_by(*from).take(*extent);
            out.iter_mut()
                .step_by(*to)
                .zip(values)
                .for_each(|(o, &x)| *o = convert(x));
        }
        [(extent, from, to), inner @ ..] => {
            for i in 0..*extent {
                copy_axes(inner, &tile[i * from..], &mut out[i * to..], convert);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_tile_lands_where_its_offset_says(
            chunk in prop::array::uniform5(1usize..4),
            outer in prop::array::uniform5(1usize..6),
            place in prop::array::uniform5(0usize..5),
        ) {
            let offset: [usize; RANK] = std::array::from_fn(|a| chunk[a] * (place[a] % outer[a].div_ceil(chunk[a])));
            let tile: Vec<u32> = (1..=chunk.iter().product::<usize>() as u32).collect();
            let mut out = vec![0u32; outer.iter().product()];
            TileCopy::new(offset, chunk, outer).run(&tile, &mut out, |x| x);
            for (index, &value) in out.iter().enumerate() {
                let mut rest = index;
                let mut at = [0; RANK];
                for axis in (0..RANK).rev() {
                    at[axis] = rest % outer[axis];
                    rest /= outer[axis];
                }
                let inside = (0..RANK).all(|a| at[a] >= offset[a] && at[a] < offset[a] + chunk[a]);
                let expected = if inside {
                    tile[(0..RANK).fold(0, |n, a| n * chunk[a] + at[a] - offset[a])]
                } else {
                    0
                };
                prop_assert_eq!(value, expected, "{:?}", at);
            }
        }
    }
}
