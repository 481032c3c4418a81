//! Matrices that a product reads and writes, each a rule from indices to a place in a buffer.

use cubecl::prelude::*;
use tactnet_conv::BlockShape;

/// Sizes that the rules use. What each means is said there; those that a rule does not name do not matter to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub(crate) struct Layout {
    pub(crate) steps: usize,
    pub(crate) taxels: usize,
    pub(crate) maps: usize,
    /// Maps of the other side of the convolution.
    pub(crate) others: usize,
    /// Kernel: time steps by taxels.
    pub(crate) kernel: [usize; 2],
    /// Rows and columns of a matrix that lies there as it is.
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    /// Ranges of steps that a sweep is cut into, the new steps of each, and the step of a window that the first of them is.
    pub(crate) ranges: usize,
    pub(crate) range: usize,
    pub(crate) offset: usize,
    /// Steps of a window that are not zero.
    pub(crate) filled: usize,
    /// Windows of the batch: sweeps times ranges.
    pub(crate) windows: usize,
    /// Frequencies.
    pub(crate) bins: usize,
    /// Ranges on either side that reach into this one.
    pub(crate) neighbours: usize,
    /// Whether taps count backwards.
    pub(crate) mirrored: bool,
}

impl Layout {
    /// Of a matrix that lies there as it is.
    pub(crate) fn in_order(rows: usize, columns: usize) -> Self {
        Self {
            rows,
            columns,
            ..Self::default()
        }
    }

    /// Of a block's maps: those that come in, and as others those that go out.
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

/// A matrix for each member of a batch, that of a network beginning at `from`.
#[cube]
pub(crate) trait Matrix: Send + Sync + 'static {
    /// Returns entry `[i][j]` of member `z`.
    fn at(data: &[f32], from: usize, z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32;
}

/// The transpose of `M`.
pub(crate) struct Transposed<M> {
    _matrix: core::marker::PhantomData<M>,
}

#[cube]
impl<M: Matrix> Matrix for Transposed<M> {
    fn at(data: &[f32], from: usize, z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32 {
        M::at(data, from, z, j, i, l)
    }
}

/// `[rows][columns]`, the same for every member.
pub(crate) struct Shared2;

#[cube]
impl Matrix for Shared2 {
    fn at(data: &[f32], from: usize, _z: usize, i: usize, j: usize, #[comptime] l: Layout) -> f32 {
        data[from + i * l.columns + j]
    }
}

/// Patches of maps `[batch][steps][taxels][maps]` under a kernel with zeros around: row = position, column = `(step, taxel, map)`.
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
/// part, map)`. Part 0 is real, 1 imaginary.
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

/// Spectra of the weights, conjugated, `[2 bins][kernel taxels][maps][others]`, as the real matrix that multiplies `(real, imaginary)`:
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

/// The adjoint of [`Factors`]: row = `(taxel, part, other map)`, column = `(part, map)`.
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
    // Both real or both imaginary take the real part.
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
        // Of x conj(y): re re + im im, and im re - re im.
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

/// Where a product's entries go.
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

/// `[members][rows][columns]`.
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

/// Weights `[others][maps][kernel steps][kernel taxels]`; indices as of [`TapsInTime`].
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
