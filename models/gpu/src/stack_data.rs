//! Inputs, state and measurements of networks that train together.

use tactnet_conv::AdamStep;

/// Training method that all networks share.
#[derive(Debug, Clone, PartialEq)]
pub struct StackMethod {
    /// Factor of the features that dropout keeps.
    pub kept: f32,
    /// L2 penalty and betas of Adam; learning rate and epsilon come with each network's batch.
    pub adam: AdamStep,
    /// Number of leading parameters with an L2 penalty.
    pub penalized: usize,
    /// Adversarial perturbation of the sweeps, if any.
    pub attack: Option<StackAttack>,
}

/// Adversarial training: `alpha E(x) + (1 - alpha) E(x + r)` with `r = epsilon sign(dE/dx)`.
#[derive(Debug, Clone, PartialEq)]
pub struct StackAttack {
    /// Weight of the clean loss.
    pub alpha: f64,
    /// Perturbation of each taxel in the units of the sweeps: `[networks][taxels]`.
    pub epsilon: Vec<f32>,
    /// True if running statistics also follow the perturbed sweeps.
    pub follow_both: bool,
}

/// State of all networks, one after another.
#[derive(Debug, Clone, PartialEq)]
pub struct StackState {
    /// `[networks][parameters]`
    pub parameters: Vec<f32>,
    /// First and second moments of Adam, `[networks][parameters]` each.
    pub moments: [Vec<f32>; 2],
    /// `[networks][statistics]`: running means and variances.
    pub running: Vec<f32>,
}

/// Raw sweeps on the device, from which batches are selected.
#[derive(Debug, Clone, Copy)]
pub struct StackDigits<'a> {
    /// Bits per raw value: 8 or 16.
    pub bits: usize,
    /// `[sweeps][words]`: raw values of each sweep, the first in the lowest bits of a word.
    pub words: &'a [u32],
    /// `[networks][2][taxels]`: value to subtract from a raw value, then factor.
    pub scaling: &'a [f32],
}

/// Sweeps of a batch, `[networks][batch]`.
#[derive(Debug, Clone, Copy)]
pub enum StackSweeps<'a> {
    /// Indices of sweeps on the device.
    Chosen(&'a [u32]),
    /// `[networks][batch][steps][taxels]`, normalised.
    Values(&'a [f32]),
}

/// Batch of every network. Padding sweeps have no effect, but must be finite; use zeros.
#[derive(Debug, Clone, Copy)]
pub struct StackBatch<'a> {
    /// Number of sweeps in each network's batch; 0 leaves the network unchanged.
    pub counts: &'a [u32],
    /// Sweeps of all networks.
    pub sweeps: StackSweeps<'a>,
    /// `[networks][batch]`
    pub labels: &'a [u32],
    /// `[networks][batch][words]` for each pass (clean, perturbed): bit `f % 32` of word `f / 32` is set if feature `f` is kept.
    pub masks: &'a [&'a [u32]],
    /// Learning rate and epsilon of Adam for each network, with bias correction.
    pub rates: &'a [[f32; 2]],
}

/// Measurements of one network in one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StackMeasured {
    /// Mean cross entropy in nats of the clean and of the perturbed sweeps.
    pub loss: [f32; 2],
    /// Number of correct predictions on the clean and on the perturbed sweeps; the latter is 0 without a perturbation.
    pub correct: [usize; 2],
}
