//! Sweeps of a batch: selected and normalised on the device, and perturbed along the sign of a gradient.

use cubecl::client::Client;
use cubecl::prelude::*;

use crate::head::{element, launch, row};
use crate::networks::{Place, Stacked, begin};
use crate::stack_data::StackDigits;
use crate::stack_shape::StackShape;

/// Number of bits in a word of raw values.
const WORD: usize = 32;

/// Raw sweeps on the device, packed into words with the first value in the lowest bits.
#[derive(Debug)]
pub(crate) struct Digits {
    /// `[sweeps][words]`, shared by all networks.
    words: Stacked,
    /// `[2][taxels]` of each network: value to subtract from a raw value, then factor.
    scaling: Stacked,
    sizes: Sizes,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Sizes {
    batch: usize,
    /// Number of values in a sweep.
    values: usize,
    taxels: usize,
    /// Bits per raw value.
    bits: usize,
    /// Number of words in a sweep.
    width: usize,
}

impl Digits {
    /// Uploads the raw sweeps.
    pub(crate) fn upload(client: &Client, shape: &StackShape, digits: StackDigits<'_>) -> Self {
        let StackDigits {
            bits,
            words,
            scaling,
        } = digits;
        let values = shape.values();
        let sizes = Sizes {
            batch: shape.batch,
            values,
            taxels: shape.taxels,
            bits,
            width: values.div_ceil(WORD / bits),
        };
        let of_all = client.create_from_slice(u32::as_bytes(words));
        let own = client.create_from_slice(f32::as_bytes(scaling));
        Self {
            words: Stacked::single(&of_all, words.len()),
            scaling: Stacked::each(&own, shape.networks, 2 * shape.taxels),
            sizes,
        }
    }

    /// Returns the normalised sweeps of a batch, `[batch][steps][taxels]`; padding sweeps are zero.
    ///
    /// - `chosen`: `[batch]`, indices of sweeps
    pub(crate) fn batch(
        &self,
        client: &Client,
        networks: usize,
        chosen: &Stacked,
        counts: &Stacked,
    ) -> Stacked {
        let len = self.sizes.batch * self.sizes.values;
        let out = Stacked::floats(client, networks, len);
        let (count, dim) = launch(len, networks);
        // SAFETY: lengths are those of the buffers; the caller of the stack guarantees that the indices are below the number of uploaded sweeps.
        unsafe {
            unpack::launch_unchecked(
                client,
                count,
                dim,
                self.words.arg(),
                self.scaling.arg(),
                chosen.arg(),
                counts.arg(),
                out.arg(),
                self.sizes,
                [self.scaling.place, chosen.place, counts.place],
                row(len),
            );
        }
        out
    }
}

#[cube(launch_unchecked)]
fn unpack(
    words: &[u32],
    scaling: &[f32],
    chosen: &[u32],
    counts: &[u32],
    out: &mut [f32],
    #[comptime] s: Sizes,
    #[comptime] places: [Place; 3],
    #[comptime] cubes: usize,
) {
    let at = element(cubes);
    if at < comptime!(s.batch * s.values) {
        let network = CUBE_POS_Z as usize;
        let sweep = at / s.values;
        let value = at % s.values;
        let mut found = 0.0f32;
        if sweep < counts[begin(network, comptime!(places[2]))] as usize {
            let number = chosen[begin(network, comptime!(places[1])) + sweep] as usize;
            let parts = comptime!(WORD / s.bits);
            let word = words[number * s.width + value / parts];
            let shift = (value % parts * s.bits) as u32;
            let digit = (word >> shift) & comptime!((1u32 << s.bits) - 1);
            let taxel = begin(network, comptime!(places[0])) + value % s.taxels;
            found = (f32::cast_from(digit) - scaling[taxel]) * scaling[taxel + s.taxels];
        }
        out[network * comptime!(s.batch * s.values) + at] = found;
    }
}

/// Returns `sweeps + epsilon sign(gradient)`, each `[batch][steps][taxels]`.
///
/// - `epsilon`: `[taxels]`
pub(crate) fn perturbed(
    client: &Client,
    shape: &StackShape,
    sweeps: &Stacked,
    gradient: &Stacked,
    epsilon: &Stacked,
) -> Stacked {
    let (networks, taxels) = (shape.networks, shape.taxels);
    let len = shape.batch * shape.values();
    let out = Stacked::floats(client, networks, len);
    let (count, dim) = launch(len, networks);
    // SAFETY: lengths are those of the buffers, and the kernel stays below `len`.
    unsafe {
        perturb::launch_unchecked(
            client,
            count,
            dim,
            sweeps.arg(),
            gradient.arg(),
            epsilon.arg(),
            out.arg(),
            len,
            taxels,
            epsilon.place,
            row(len),
        );
    }
    out
}

#[cube(launch_unchecked)]
fn perturb(
    sweeps: &[f32],
    gradient: &[f32],
    epsilon: &[f32],
    out: &mut [f32],
    #[comptime] len: usize,
    #[comptime] taxels: usize,
    #[comptime] place: Place,
    #[comptime] cubes: usize,
) {
    let at = element(cubes);
    if at < len {
        let network = CUBE_POS_Z as usize;
        let from = network * len + at;
        let slope = gradient[from];
        let step = epsilon[begin(network, place) + at % taxels];
        let mut value = sweeps[from];
        if slope > 0.0f32 {
            value += step;
        } else if slope < 0.0f32 {
            value -= step;
        }
        out[from] = value;
    }
}
