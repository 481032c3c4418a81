//! End of a training step of several networks: Adam for all parameters and running statistics of all layers, one kernel each.

use cubecl::client::Client;
use cubecl::prelude::*;
use tactnet_conv::AdamStep;

use crate::head::{element, launch, row};
use crate::networks::{Place, Stacked, begin};

/// Weight of the latest batch in the running statistics.
const MOMENTUM: f32 = 0.1;

/// Inputs of one step.
#[derive(Clone, Copy)]
pub(crate) struct StepInputs<'a> {
    /// `[rate, epsilon, correction of each layer's variance]` of each network
    pub(crate) of_step: &'a Stacked,
    /// Number of sweeps of each network, `[1]` each.
    pub(crate) counts: &'a Stacked,
}

/// Settings of Adam that all networks share.
#[derive(Clone, Copy)]
pub(crate) struct AdamMethod {
    /// L2 penalty and betas; rate and epsilon come with [`StepInputs::of_step`].
    pub(crate) step: AdamStep,
    /// Number of leading parameters with an L2 penalty.
    pub(crate) penalized: usize,
}

/// Parameters and moments of every network, `[parameters]` each.
#[derive(Debug, Clone)]
pub(crate) struct AdamState {
    pub(crate) parameters: Stacked,
    pub(crate) first: Stacked,
    pub(crate) second: Stacked,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Sizes {
    /// Number of parameters of a network.
    len: usize,
    /// Number of leading parameters with an L2 penalty.
    penalized: usize,
    /// Location of each network's numbers for this step.
    of_step: Place,
    counts: Place,
    cubes: usize,
    /// True if a second gradient is added.
    two: bool,
}

/// Returns parameters and moments after a step; networks without sweeps do not change.
///
/// - `gradients`: one gradient, or two that are added
pub(crate) fn adam(
    client: &Client,
    networks: usize,
    state: &AdamState,
    gradients: &[Stacked],
    inputs: StepInputs<'_>,
    method: AdamMethod,
) -> AdamState {
    let StepInputs { of_step, counts } = inputs;
    let AdamMethod { step, penalized } = method;
    let len = state.parameters.place.stride;
    let sizes = Sizes {
        len,
        penalized,
        of_step: of_step.place,
        counts: counts.place,
        cubes: row(len),
        two: gradients.len() > 1,
    };
    let (first, last) = (&gradients[0], &gradients[gradients.len() - 1]);
    let [parameters, mean, square] = [(); 3].map(|()| Stacked::floats(client, networks, len));
    let (count, dim) = launch(len, networks);
    // SAFETY: lengths are those of the buffers, and the kernel stays below `len` of each network.
    unsafe {
        update::launch_unchecked(
            client,
            count,
            dim,
            state.parameters.arg(),
            first.arg(),
            last.arg(),
            state.first.arg(),
            state.second.arg(),
            of_step.arg(),
            counts.arg(),
            parameters.arg(),
            mean.arg(),
            square.arg(),
            step.l2,
            step.beta[0],
            step.beta[1],
            sizes,
        );
    }
    AdamState {
        parameters,
        first: mean,
        second: square,
    }
}

#[cube(launch_unchecked)]
fn update(
    parameter: &[f32],
    gradient: &[f32],
    other: &[f32],
    first: &[f32],
    second: &[f32],
    of_step: &[f32],
    counts: &[u32],
    new_parameter: &mut [f32],
    new_first: &mut [f32],
    new_second: &mut [f32],
    l2: f32,
    beta_1: f32,
    beta_2: f32,
    #[comptime] s: Sizes,
) {
    let own = element(s.cubes);
    if own < s.len {
        let network = CUBE_POS_Z as usize;
        let at = network * s.len + own;
        let value = parameter[at];
        let mut new_value = value;
        let mut mean = first[at];
        let mut square = second[at];
        if counts[begin(network, s.counts)] > 0u32 {
            let rate = of_step[begin(network, s.of_step)];
            let epsilon = of_step[begin(network, s.of_step) + 1];
            let mut gradient = gradient[at];
            if s.two {
                gradient += other[at];
            }
            if own < s.penalized {
                gradient += l2 * value;
            }
            mean = beta_1 * mean + (1.0f32 - beta_1) * gradient;
            square = beta_2 * square + (1.0f32 - beta_2) * gradient * gradient;
            new_value = value - rate * mean / (square.sqrt() + epsilon);
        }
        new_first[at] = mean;
        new_second[at] = square;
        new_parameter[at] = new_value;
    }
}

/// Returns the running statistics after moving them towards those of a batch; networks without sweeps do not change.
///
/// - `batch`: means and biased variances
/// - `factors`: for each statistic, the index of its factor in `of_step`; 0 for none
pub(crate) fn follow(
    client: &Client,
    networks: usize,
    running: &Stacked,
    batch: &Stacked,
    factors: &Stacked,
    inputs: StepInputs<'_>,
) -> Stacked {
    let StepInputs { of_step, counts } = inputs;
    let len = running.place.stride;
    let out = Stacked::floats(client, networks, len);
    let (count, dim) = launch(len, networks);
    // SAFETY: lengths are those of the buffers, and the kernel stays below `len` of each network.
    unsafe {
        move_towards::launch_unchecked(
            client,
            count,
            dim,
            running.arg(),
            batch.arg(),
            factors.arg(),
            of_step.arg(),
            counts.arg(),
            out.arg(),
            len,
            [of_step.place, counts.place],
            row(len),
        );
    }
    out
}

#[cube(launch_unchecked)]
fn move_towards(
    running: &[f32],
    batch: &[f32],
    factors: &[u32],
    of_step: &[f32],
    counts: &[u32],
    out: &mut [f32],
    #[comptime] len: usize,
    #[comptime] places: [Place; 2],
    #[comptime] cubes: usize,
) {
    let own = element(cubes);
    if own < len {
        let network = CUBE_POS_Z as usize;
        let at = network * len + own;
        let mut value = running[at];
        if counts[begin(network, comptime!(places[1]))] > 0u32 {
            let mut newest = batch[at];
            let factor = factors[own] as usize;
            if factor > 0 {
                newest *= of_step[begin(network, comptime!(places[0])) + factor];
            }
            value = value * (1.0f32 - MOMENTUM) + newest * MOMENTUM;
        }
        out[at] = value;
    }
}
