//! Values of all sweeps in their native element type.

/// Values in row-major order, stored in their recorded type and converted to `f32` batch by batch.
///
/// ```
/// use tactnet_data::Samples;
///
/// let samples = Samples::U16(vec![10, 1000, 65535]);
/// let mut out = [0.0; 2];
/// samples.copy_to(1, &mut out);
/// assert_eq!(out, [1000.0, 65535.0]);
/// assert_eq!((samples.element(), samples.bytes()), ("u16", 6));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub enum Samples {
    /// 8-bit digits, such as TactMat's.
    U8(Vec<u8>),
    /// 16-bit digits, such as the BioTac's.
    U16(Vec<u16>),
    /// All other numbers.
    F32(Vec<f32>),
}

impl Samples {
    /// Returns the number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::F32(v) => v.len(),
        }
    }

    /// Returns true if the list is empty.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the name of the element type: `u8`, `u16` or `f32`.
    pub fn element(&self) -> &'static str {
        match self {
            Self::U8(_) => "u8",
            Self::U16(_) => "u16",
            Self::F32(_) => "f32",
        }
    }

    /// Returns the largest value of an integer type; `None` for `f32`.
    pub fn element_max(&self) -> Option<f32> {
        match self {
            Self::U8(_) => Some(f32::from(u8::MAX)),
            Self::U16(_) => Some(f32::from(u16::MAX)),
            Self::F32(_) => None,
        }
    }

    /// Returns the memory of the values, in bytes.
    pub fn bytes(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => 2 * v.len(),
            Self::F32(v) => 4 * v.len(),
        }
    }

    /// Copies `out.len()` values from index `start` on to `out`, as `f32`.
    ///
    /// # Panics
    /// If there are fewer values.
    pub fn copy_to(&self, start: usize, out: &mut [f32]) {
        let range = start..start + out.len();
        match self {
            Self::U8(v) => out
                .iter_mut()
                .zip(&v[range])
                .for_each(|(o, &x)| *o = f32::from(x)),
            Self::U16(v) => out
                .iter_mut()
                .zip(&v[range])
                .for_each(|(o, &x)| *o = f32::from(x)),
            Self::F32(v) => out.copy_from_slice(&v[range]),
        }
    }

    /// Returns the first `head` values of every `whole` values.
    pub(crate) fn heads(&self, whole: usize, head: usize) -> Self {
        fn cut<T: Copy>(values: &[T], whole: usize, head: usize) -> Vec<T> {
            values
                .chunks_exact(whole)
                .flat_map(|chunk| &chunk[..head])
                .copied()
                .collect()
        }
        match self {
            Self::U8(v) => Self::U8(cut(v, whole, head)),
            Self::U16(v) => Self::U16(cut(v, whole, head)),
            Self::F32(v) => Self::F32(cut(v, whole, head)),
        }
    }

    /// Replaces the frames of each sweep after its last one by this frame.
    ///
    /// - `whole`: number of values of a padded sweep
    /// - `lengths`: number of frames of each sweep, at least 1
    pub(crate) fn repeat_last_frames(&mut self, whole: usize, taxels: usize, lengths: &[usize]) {
        fn fill<T: Copy>(values: &mut [T], whole: usize, taxels: usize, lengths: &[usize]) {
            for (sweep, steps) in values.chunks_exact_mut(whole).zip(lengths) {
                for at in steps * taxels..whole {
                    sweep[at] = sweep[at - taxels];
                }
            }
        }
        match self {
            Self::U8(v) => fill(v, whole, taxels, lengths),
            Self::U16(v) => fill(v, whole, taxels, lengths),
            Self::F32(v) => fill(v, whole, taxels, lengths),
        }
    }

    /// Returns the runs of `whole` values at `positions`, in that order.
    pub(crate) fn gather(&self, whole: usize, positions: &[usize]) -> Self {
        fn pick<T: Copy>(values: &[T], whole: usize, positions: &[usize]) -> Vec<T> {
            positions
                .iter()
                .flat_map(|position| &values[position * whole..][..whole])
                .copied()
                .collect()
        }
        match self {
            Self::U8(v) => Self::U8(pick(v, whole, positions)),
            Self::U16(v) => Self::U16(pick(v, whole, positions)),
            Self::F32(v) => Self::F32(pick(v, whole, positions)),
        }
    }

    /// Passes the little-endian bytes of the values to `visit` in pieces, for hashing.
    pub(crate) fn for_each_le_chunk(&self, mut visit: impl FnMut(&[u8])) {
        /// Number of values per piece.
        const CHUNK: usize = 1 << 14;
        match self {
            Self::U8(v) => v.chunks(CHUNK).for_each(visit),
            Self::U16(v) => v.chunks(CHUNK).for_each(|chunk| {
                visit(
                    &chunk
                        .iter()
                        .flat_map(|x| x.to_le_bytes())
                        .collect::<Vec<u8>>(),
                );
            }),
            Self::F32(v) => v.chunks(CHUNK).for_each(|chunk| {
                visit(
                    &chunk
                        .iter()
                        .flat_map(|x| x.to_le_bytes())
                        .collect::<Vec<u8>>(),
                );
            }),
        }
    }
}
