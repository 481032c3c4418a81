//! Matrices that a product reads and writes, each a rule that maps indices to an address in a buffer.

use cubecl::prelude::*;
use tactnet_conv::BlockShape;

/// Sizes that the rules use; each rule uses only the fields that its documentation mentions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub(crate) struct Layout {
    pub(crate) steps: usize,
    pub(crate) taxels: usize,
    pub(crate) maps: usize,
    /// Number of maps on the other side of the convolution.
    pub(crate) others: usize,
    /// Kernel size, time steps by taxels.
    pub(crate) kernel: [usize; 2],
    /// Number of rows of a row-major matrix.
    pub(crate) rows: usize,
    /// Number of columns of a row-major matrix.
    pub(crate) columns: usize,
    /// Number of ranges of steps in a sweep.
    pub(crate) ranges: usize,
    /// Number of new steps per range.
    pub(crate) range: usize,
    /// Step of a window where its range begins.
    pub(crate) offset: usize,
    /// Number of non-zero steps in a window.
    pub(crate) filled: usize,
    /// Number of windows in the batch: sweeps times ranges.
    pub(crate) windows: usize,
    /// Number of frequencies.
    pub(crate) bins: usize,
    /// Number of ranges on either side whose windows overlap this one.
    pub(crate) neighbours: usize,
    /// True if taps are read in reverse order.
    pub(crate) mirrored: bool,
}

impl Layout {
    /// Returns the layout of a matrix in row-major order.
    pub(crate) fn in_order(rows: usize, columns: usize) -> Self {
        Self {
            rows,
            columns,
            ..Self::default()
        }
    }

    /// Returns the layout of a block's maps: `maps` are the input maps, `others` the output maps.
    pub(crate) fn of(shape: &BlockShape) -> Self {
        Self {
            steps: shape.steps,
            taxels: shape.taxels,
            maps: shape.maps_in,
            others: shape.maps_out,
            kernel: shape.kernel,
            ..Self::default()
        }
    }
}

/// Matrix for each member of a batch; the data of a network begins at `from`.
#[cube]
pub(crate) trait Matrix: Send + Sync + 'static {
    /// Returns entry `[i][j]` of member `z`.
    fn at(data: &[f32], from: usize, z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32;
}

/// Transpose of `M`.
pub(crate) struct Transposed<M> {
    _matrix: core::marker::PhantomData<M>,
}

#[cube]
impl<M: Matrix> Matrix for Transposed<M> {
    fn at(data: &[f32], from: usize, z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32 {
        M::at(data, from, z, j, i, l)
    }
}

/// `[rows][columns]`, shared by all members.
pub(crate) struct Shared2;

#[cube]
impl Matrix for Shared2 {
    fn at(data: &[f32], from: usize, _z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32 {
        data[from + i * l.columns + j]
    }
}

/// Patches of maps `[batch][steps][taxels][maps]` under a kernel, with zero padding: row = position, column = `(step, taxel, map)`.
pub(crate) struct Patches;

#[cube]
impl Matrix for Patches {
    fn at(data: &[f32], from: usize, _z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32 {
        let (half_t, half_x) = comptime!((l.kernel[0] / 2, l.kernel[1] / 2));
        let kernel_x = comptime!(l.kernel[1]);
        let map = j % l.maps;
        let tap = j / l.maps;
        let (dt, dx) = (tap / kernel_x, tap % kernel_x);
        let x = i % l.taxels + dx;
        let row = i / l.taxels;
        let t = row % l.steps + dt;
        let mut value = 0.0f32;
        if t >= half_t && t < l.steps + half_t && x >= half_x && x < l.taxels + half_x {
            value = data[from + ((row + dt - half_t) * l.taxels + x - half_x) * l.maps + map];
        }
        value
    }
}

/// Weights `[others][maps][kernel steps][kernel taxels]`: row = `(step, taxel, map)`, column = other map.
pub(crate) struct Taps;

#[cube]
impl Matrix for Taps {
    fn at(data: &[f32], from: usize, _z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32 {
        let kernel = comptime!(l.kernel[0] * l.kernel[1]);
        let map = i % l.maps;
        let tap = i / l.maps;
        data[from + (j * l.maps + map) * kernel + tap]
    }
}

/// Weights `[others][maps][kernel steps][kernel taxels]`: row = step, column = `(taxel, map, other map)`.
pub(crate) struct TapsInTime;

#[cube]
impl Matrix for TapsInTime {
    fn at(data: &[f32], from: usize, _z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32 {
        let (kernel_t, kernel_x) = comptime!((l.kernel[0], l.kernel[1]));
        let other = j % l.others;
        let map = j / l.others % l.maps;
        let dx = j / comptime!(l.others * l.maps);
        data[from + ((other * l.maps + map) * kernel_t + i) * kernel_x + dx]
    }
}

/// Windows of maps `[batch][steps][taxels][maps]`: member = window, row = step of the window, column = `(taxel, map)`.
pub(crate) struct Windows;

#[cube]
impl Matrix for Windows {
    fn at(data: &[f32], from: usize, z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32 {
        let row = comptime!(l.taxels * l.maps);
        let sweep = z / l.ranges;
        let t = z % l.ranges * l.range + i;
        let mut value = 0.0f32;
        if i < l.filled && t >= l.offset && t < comptime!(l.steps + l.offset) {
            value = data[from + (sweep * l.steps + t - l.offset) * row + j];
        }
        value
    }
}

/// Spectra `[windows][2 bins][taxels][maps]` under the kernel's taxels: member = bin, row = `(window, taxel)`, column = `(taxel of the kernel,
/// part, map)`. Part 0 is real, part 1 imaginary.
pub(crate) struct Neighbours;

#[cube]
impl Matrix for Neighbours {
    fn at(data: &[f32], from: usize, z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32 {
        let half = comptime!(l.kernel[1] / 2);
        let map = j % l.maps;
        let part = j / l.maps % 2;
        let mut dx = j / comptime!(2 * l.maps);
        if l.mirrored {
            dx = comptime!(l.kernel[1] - 1) - dx;
        }
        let x = i % l.taxels + dx;
        let window = i / l.taxels;
        let mut value = 0.0f32;
        if x >= half && x < comptime!(l.taxels + half) {
            let row = window * comptime!(2 * l.bins) + 2 * z + part;
            value = data[from + (row * l.taxels + x - half) * l.maps + map];
        }
        value
    }
}

/// Conjugated spectra of the weights, `[2 bins][kernel taxels][maps][others]`, as the real matrix that multiplies `(real, imaginary)`:
/// member = bin, row = `(taxel, part, map)`, column = `(part, other map)`.
pub(crate) struct Factors;

#[cube]
impl Matrix for Factors {
    fn at(data: &[f32], from: usize, z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32 {
        let map = i % l.maps;
        let part = i / l.maps % 2;
        let dx = i / comptime!(2 * l.maps);
        let other = j % l.others;
        let to = j / l.others;
        factor(data, from, z, dx, part, to, map, other, l)
    }
}

/// Adjoint of [`Factors`]: row = `(taxel, part, other map)`, column = `(part, map)`.
pub(crate) struct AdjointFactors;

#[cube]
impl Matrix for AdjointFactors {
    fn at(data: &[f32], from: usize, z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32 {
        let other = i % l.others;
        let to = i / l.others % 2;
        let dx = i / comptime!(2 * l.others);
        let map = j % l.maps;
        let part = j / l.maps;
        factor(data, from, z, dx, part, to, map, other, l)
    }
}

#[cube]
fn factor(
    data: &[f32],
    from: usize,
    z: usize,
    dx: usize,
    part: usize,
    to: usize,
    map: usize,
    other: usize,
    #[comptime] l: Layout,
) -> f32 {
    // Two equal parts use the real part of the spectrum, two different ones the imaginary part.
    let imaginary = (part + to) % 2;
    let row = (2 * z + imaginary) * comptime!(l.kernel[1]) + dx;
    let value = data[from + (row * l.maps + map) * l.others + other];
    let mut signed = value;
    if part > to {
        signed = -value;
    }
    signed
}

/// Products `[bins][windows][taxels][2][maps]`: member = window, row = `(neighbour, bin, part)`, column = `(taxel, map)`.
pub(crate) struct ByBin;

#[cube]
impl Matrix for ByBin {
    fn at(data: &[f32], from: usize, z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32 {
        let map = j % l.maps;
        let x = j / l.maps;
        let part = i % 2;
        let bin = i / 2 % l.bins;
        let neighbour = i / comptime!(2 * l.bins);
        let range = z % l.ranges + neighbour;
        let mut value = 0.0f32;
        if range >= l.neighbours && range < comptime!(l.ranges + l.neighbours) {
            let window = z + neighbour - l.neighbours;
            let row = (bin * l.windows + window) * l.taxels + x;
            value = data[from + (row * 2 + part) * l.maps + map];
        }
        value
    }
}

/// Correlations of parts `[bins][kernel taxels][2][maps][2][others]` as spectra of the weights' gradient: row = `(bin, part)`,
/// column = `(taxel, map, other map)`.
pub(crate) struct Correlations;

#[cube]
impl Matrix for Correlations {
    fn at(data: &[f32], from: usize, _z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32 {
        let other = j % l.others;
        let map = j / l.others % l.maps;
        let dx = j / comptime!(l.others * l.maps);
        let part = i % 2;
        let row = i / 2 * comptime!(l.kernel[1]) + dx;
        // Parts of x conj(y): re re + im im, and im re - re im.
        let first = ((row * 2 + part) * l.maps + map) * 2 * l.others + other;
        let second = ((row * 2 + 1 - part) * l.maps + map) * 2 * l.others + l.others + other;
        let mut value = data[from + first];
        if part == 0 {
            value += data[from + second];
        } else {
            value -= data[from + second];
        }
        value
    }
}

/// Rule for the address of a product's entries.
#[cube]
pub(crate) trait Store: Send + Sync + 'static {
    /// Writes entry `[i][j]` of member `z`.
    fn put(
        data: &mut [f32],
        from: usize,
        z: usize,
        i: usize,
        j: usize,
        value: f32,
        #[comptime] l: Layout,
    );
}

/// `[members][rows][columns]`
pub(crate) struct InOrder;

#[cube]
impl Store for InOrder {
    fn put(
        data: &mut [f32],
        from: usize,
        z: usize,
        i: usize,
        j: usize,
        value: f32,
        #[comptime] l: Layout,
    ) {
        data[from + (z * l.rows + i) * l.columns + j] = value;
    }
}

/// `[batch][steps][taxels][maps]` from windows: row = step of the range, column = `(taxel, map)`.
pub(crate) struct IntoSteps;

#[cube]
impl Store for IntoSteps {
    fn put(
        data: &mut [f32],
        from: usize,
        z: usize,
        i: usize,
        j: usize,
        value: f32,
        #[comptime] l: Layout,
    ) {
        let sweep = z / l.ranges;
        let t = z % l.ranges * l.range + i;
        if t < l.steps {
            data[from + (sweep * l.steps + t) * l.columns + j] = value;
        }
    }
}

/// Weights `[others][maps][kernel steps][kernel taxels]`, with the indices of [`TapsInTime`].
pub(crate) struct IntoTaps;

#[cube]
impl Store for IntoTaps {
    fn put(
        data: &mut [f32],
        from: usize,
        _z: usize,
        i: usize,
        j: usize,
        value: f32,
        #[comptime] l: Layout,
    ) {
        let (kernel_t, kernel_x) = comptime!((l.kernel[0], l.kernel[1]));
        let other = j % l.others;
        let map = j / l.others % l.maps;
        let dx = j / comptime!(l.others * l.maps);
        data[from + ((other * l.maps + map) * kernel_t + i) * kernel_x + dx] = value;
    }
}
