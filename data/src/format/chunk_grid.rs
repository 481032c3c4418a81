//! Positions of the chunks of a five-dimensional HDF5 data set in its file.

use super::DEFLATE_LIMIT;
use super::mismatch::Mismatch;
use hdf5_reader::chunk_index::{self, ChunkEntry};
use hdf5_reader::error::Error;
use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::filter_pipeline::FilterPipelineMessage;
use hdf5_reader::messages::layout::{ChunkIndexing, DataLayout};
use hdf5_reader::{Dataset, Hdf5File, btree_v1, extensible_array, fixed_array};
use std::collections::BTreeMap;
use std::ops::Range;

/// Number of dimensions of `samples`: materials, sweeps, steps, rows, cols.
pub(super) const RANK: usize = 5;

/// Chunks of a data set.
pub(super) struct ChunkGrid {
    /// Extents of a chunk.
    pub(super) chunk: [usize; RANK],
    /// Size of an unpacked chunk, in bytes.
    pub(super) chunk_bytes: usize,
    pub(super) filters: Option<FilterPipelineMessage>,
    /// Stored value of chunks that were never written.
    pub(super) fill_value: Option<Vec<u8>>,
    /// Chunks by their position in the grid.
    entries: BTreeMap<[usize; RANK], ChunkEntry>,
}

/// Chunks whose values are adjacent in the result.
pub(super) struct Band {
    pub(super) materials: Range<usize>,
    pub(super) sweeps: Range<usize>,
    pub(super) chunks: Vec<ChunkEntry>,
    pub(super) expected_chunks: usize,
}

impl Band {
    /// Returns the extents of the band in a data set of `shape`.
    pub(super) fn extent(&self, shape: [usize; RANK]) -> [usize; RANK] {
        let [_, _, steps, rows, cols] = shape;
        [self.materials.len(), self.sweeps.len(), steps, rows, cols]
    }
}

impl ChunkGrid {
    /// Returns the chunks of `dataset` in `file`; `None` for storage without chunks.
    pub(super) fn of(
        file: &Hdf5File,
        dataset: &Dataset,
        shape: [usize; RANK],
    ) -> Result<Option<Self>, Mismatch> {
        let hdf5 = |error| Mismatch::from_hdf5(&error);
        let header = file.get_or_parse_header(dataset.address()).map_err(hdf5)?;
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
        let size = dataset.raw_element_size().map_err(hdf5)?;
        let room = file.storage().len().saturating_mul(DEFLATE_LIMIT);
        let (chunk, chunk_bytes) = chunk_size(dims, size, room)?;
        let superblock = file.superblock();
        let index = ChunkIndex {
            file,
            dataset,
            address: *address,
            dims: &dims[..RANK],
            size,
            offset_size: superblock.offset_size,
            length_size: superblock.length_size,
        };
        let entries = index
            .entries(chunk_indexing.as_ref(), shape)
            .map_err(hdf5)?;
        Self {
            chunk,
            chunk_bytes,
            filters,
            fill_value,
            entries: BTreeMap::new(),
        }
        .with_entries(entries, shape)
        .map(Some)
    }

    /// Adds the chunks inside `shape`. Chunks outside, which remain when a data set shrinks, are ignored.
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

    /// Splits the chunks into bands by material, and by sweep if a chunk has only one material.
    pub(super) fn bands(&self, shape: [usize; RANK]) -> Vec<Band> {
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

/// Returns the extents of a chunk, and its size in bytes.
///
/// - `size`: size of one value, in bytes
/// - `room`: maximum size of all values of the file, in bytes
fn chunk_size(dims: &[u32], size: usize, room: u64) -> Result<([usize; RANK], usize), Mismatch> {
    // Some versions of the message contain the element's size as an additional dimension.
    let Some(chunk) = dims.first_chunk::<RANK>().copied() else {
        return Err(Mismatch::new("chunks of 5 dimensions", format!("{dims:?}")));
    };
    let chunk = chunk.map(|extent| extent as usize);
    let bytes = chunk
        .iter()
        .try_fold(size, |n, &extent| n.checked_mul(extent));
    match bytes.filter(|&bytes| bytes > 0 && bytes as u64 <= room) {
        Some(bytes) => Ok((chunk, bytes)),
        None => Err(Mismatch::new(
            "chunks that the file can hold",
            format!("{chunk:?}"),
        )),
    }
}

/// Index of the chunks in the file; HDF5 has six kinds.
struct ChunkIndex<'a> {
    file: &'a Hdf5File,
    dataset: &'a Dataset,
    address: u64,
    dims: &'a [u32],
    /// Size of one value, in bytes.
    size: usize,
    /// Size of an address in the file, in bytes.
    offset_size: u8,
    /// Size of a length in the file, in bytes.
    length_size: u8,
}

impl ChunkIndex<'_> {
    /// Returns the chunks of a data set with these extents, in any order.
    fn entries(
        &self,
        indexing: Option<&ChunkIndexing>,
        shape: [usize; RANK],
    ) -> hdf5_reader::error::Result<Vec<ChunkEntry>> {
        let (address, dims) = (self.address, self.dims);
        let shape = &shape.map(|extent| extent as u64);
        let storage = self.file.storage();
        let undefined = u64::MAX >> (64 - 8 * u32::from(self.offset_size.clamp(1, 8)));
        if address == u64::MAX || address == undefined {
            return Ok(Vec::new());
        }
        match indexing {
            None => self.btree_v1_entries(),
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
                self.offset_size,
                self.length_size,
                RANK as u32,
                dims,
                None,
            ),
            Some(ChunkIndexing::Implicit) => chunk_index::collect_implicit_chunk_entries(
                address,
                shape,
                dims,
                self.size,
                None,
                storage.len(),
            ),
            Some(ChunkIndexing::FixedArray { .. }) => self.fixed_array_entries(shape),
            Some(ChunkIndexing::ExtensibleArray { .. }) => self.extensible_array_entries(shape),
        }
    }

    fn fixed_array_entries(&self, shape: &[u64]) -> hdf5_reader::error::Result<Vec<ChunkEntry>> {
        fixed_array::collect_fixed_array_chunk_entries_storage(
            self.file.storage(),
            self.address,
            self.offset_size,
            self.length_size,
            shape,
            self.dims,
            None,
        )
    }

    fn extensible_array_entries(
        &self,
        shape: &[u64],
    ) -> hdf5_reader::error::Result<Vec<ChunkEntry>> {
        extensible_array::collect_extensible_array_chunk_entries_storage(
            self.file.storage(),
            self.address,
            self.offset_size,
            self.length_size,
            shape,
            self.dataset.max_dims(),
            self.dims,
            None,
        )
    }

    /// Returns the chunks of a B-tree of version 1, which older versions of HDF5 write.
    fn btree_v1_entries(&self) -> hdf5_reader::error::Result<Vec<ChunkEntry>> {
        let leaves = btree_v1::collect_btree_v1_leaves_storage(
            self.file.storage(),
            self.address,
            self.offset_size,
            self.length_size,
            Some(RANK as u32),
            self.dims,
            None,
        )?;
        let entry = |(key, address)| match key {
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
        };
        leaves.into_iter().map(entry).collect()
    }
}
