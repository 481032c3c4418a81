//! The numbers of all sweeps in their native element type.

/// Values in row-major order, kept as they were recorded and widened to `f32` one batch at a time.
#[derive(Debug, Clone, PartialEq)]
pub enum Samples {
    /// 8-bit digits, as TactMat.
    U8(Vec<u8>),
    /// 16-bit digits, as the BioTac.
    U16(Vec<u16>),
    /// Anything else.
    F32(Vec<f32>),
}

impl Samples {
    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::F32(v) => v.len(),
        }
    }

    /// Returns true if there is no value.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The element type's name: `u8`, `u16` or `f32`.
    pub fn element(&self) -> &'static str {
        match self {
            Self::U8(_) => "u8",
            Self::U16(_) => "u16",
            Self::F32(_) => "f32",
        }
    }

    /// The largest value the element type can hold, where it is an integer type.
    pub fn element_max(&self) -> Option<f32> {
        match self {
            Self::U8(_) => Some(f32::from(u8::MAX)),
            Self::U16(_) => Some(f32::from(u16::MAX)),
            Self::F32(_) => None,
        }
    }

    /// Memory of the values, in bytes.
    pub fn bytes(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => 2 * v.len(),
            Self::F32(v) => 4 * v.len(),
        }
    }

    /// Widens `out.len()` values that start at `start` into `out`.
    ///
    /// # Panics
    /// If the range ends behind the last value.
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

    /// The first `head` values of every `whole`.
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

    /// The runs of `whole` values at `positions`, in that order.
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

    /// The values' little-endian bytes, piece by piece, for hashing.
    pub(crate) fn for_each_le_chunk(&self, mut visit: impl FnMut(&[u8])) {
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
