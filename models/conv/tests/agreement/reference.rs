//! Reference implementation of the block in f64, term by term.

use tactnet_conv::BlockShape;

/// Inputs of a block, and a gradient of its output.
pub(crate) struct Case {
    pub(crate) x: Vec<f32>,
    pub(crate) weight: Vec<f32>,
    pub(crate) gamma: Vec<f32>,
    pub(crate) beta: Vec<f32>,
    pub(crate) grad: Vec<f32>,
}

/// Choices of a forward pass in single precision, `[batch, pooled_steps, taxels, maps_out]`.
#[derive(Clone, Copy)]
pub(crate) struct Branch<'a> {
    /// Step of the winner within its window.
    pub(crate) positions: &'a [u8],
    /// Output after ReLU: the gradient passes where it is positive.
    pub(crate) pooled: &'a [f32],
}

/// Maximum distance from a tie or from zero, in standard deviations of the map, at which a choice may differ from the f64 result.
const ROUNDING: f64 = 2e-5;

pub(crate) struct Reference {
    pub(crate) pooled: Vec<f64>,
    pub(crate) mean: Vec<f64>,
    pub(crate) variance: Vec<f64>,
    pub(crate) d_weight: Vec<f64>,
    /// Sum of the magnitudes of the terms of `d_weight`, for the weight with the largest such sum.
    pub(crate) weight_terms: f64,
    pub(crate) d_gamma: Vec<f64>,
    pub(crate) d_beta: Vec<f64>,
    pub(crate) d_input: Vec<f64>,
    /// Sum of the magnitudes of the terms of `d_input`, for the value with the largest such sum.
    pub(crate) input_terms: f64,
}

fn taps(s: &BlockShape, mut visit: impl FnMut(usize, usize, usize)) {
    let [pr, pc] = s.padding();
    for b in 0..s.batch {
        for t in 0..s.steps {
            for w in 0..s.taxels {
                for i in 0..s.kernel[0] {
                    for j in 0..s.kernel[1] {
                        let (u, v) = ((t + i).wrapping_sub(pr), (w + j).wrapping_sub(pc));
                        if u < s.steps && v < s.taxels {
                            let cell = |t, w| (b * s.steps + t) * s.taxels + w;
                            visit(i * s.kernel[1] + j, cell(t, w), cell(u, v));
                        }
                    }
                }
            }
        }
    }
}

/// Convolution output in f64, with the statistics that normalise it.
struct Convolved {
    /// `[batch, steps, taxels, maps_out]`
    y: Vec<f64>,
    mean: Vec<f64>,
    variance: Vec<f64>,
}

/// Results of the max-pool and ReLU.
struct Pooled {
    pooled: Vec<f64>,
    /// `[batch, steps, taxels, maps_out]`: gradient of the normalised maps.
    dz: Vec<f64>,
}

impl Convolved {
    /// Convolves and computes the batch statistics.
    fn new(s: &BlockShape, x: &[f64], turned: &[f64]) -> Self {
        let (ci, co, n) = (s.maps_in, s.maps_out, s.count());
        let mut y = vec![0f64; n * co];
        taps(s, |tap, to, from| {
            for i in 0..ci {
                for o in 0..co {
                    y[to * co + o] += x[from * ci + i] * turned[(tap * ci + i) * co + o];
                }
            }
        });
        let (mut mean, mut variance) = (vec![0f64; co], vec![0f64; co]);
        (0..n * co).for_each(|at| mean[at % co] += y[at] / n as f64);
        (0..n * co).for_each(|at| variance[at % co] += (y[at] - mean[at % co]).powi(2) / n as f64);
        Self { y, mean, variance }
    }

    fn inverse_deviation(&self) -> Vec<f64> {
        let variance = self.variance.iter();
        variance.map(|v| 1.0 / (v + 1e-5).sqrt()).collect()
    }

    /// Pools; `branch` holds the choices of the implementation under test.
    fn pool(&self, s: &BlockShape, case: &Case, branch: Option<Branch<'_>>) -> Pooled {
        let co = s.maps_out;
        let inverse = self.inverse_deviation();
        let mut pooled = vec![0f64; s.output_len()];
        let mut dz = vec![0f64; self.y.len()];
        for (at, output) in pooled.iter_mut().enumerate() {
            let (o, w) = (at % co, at / co % s.taxels);
            let (p, b) = (
                at / co / s.taxels % s.pooled_steps(),
                at / co / s.taxels / s.pooled_steps(),
            );
            let cell = |t: usize| ((b * s.steps + t) * s.taxels + w) * co + o;
            let z = |t: usize| {
                f64::from(case.gamma[o]) * (self.y[cell(t)] - self.mean[o]) * inverse[o]
                    + f64::from(case.beta[o])
            };
            let mut best = p * s.pool;
            for t in p * s.pool..((p + 1) * s.pool).min(s.steps) {
                if z(t) > z(best) {
                    best = t;
                }
            }
            *output = z(best).max(0.0);
            let mut passes = z(best) > 0.0;
            if let Some(branch) = branch {
                let winner = p * s.pool + usize::from(branch.positions[at]);
                assert!(
                    z(best) - z(winner) < ROUNDING,
                    "{s:?}: not the winner of window {at}"
                );
                best = winner;
                let chosen = branch.pooled[at] > 0.0;
                assert!(
                    chosen == passes || z(best).abs() < ROUNDING,
                    "{s:?}: wrong side of zero in window {at}: {}",
                    z(best)
                );
                passes = chosen;
            }
            if passes {
                dz[cell(best)] = f64::from(case.grad[at]);
            }
        }
        Pooled { pooled, dz }
    }
}

/// Returns the input in f64, and the weights in f64 as `[tap, maps_in, maps_out]`.
fn widened(s: &BlockShape, case: &Case) -> (Vec<f64>, Vec<f64>) {
    let (ci, co, k) = (s.maps_in, s.maps_out, s.kernel[0] * s.kernel[1]);
    let x = case.x.iter().map(|&v| f64::from(v)).collect();
    let mut turned = vec![0f64; case.weight.len()];
    for (at, &v) in case.weight.iter().enumerate() {
        turned[((at % k) * ci + at / k % ci) * co + at / k / ci] = f64::from(v);
    }
    (x, turned)
}

/// Returns the pooled output with the given mean and variance.
pub(crate) fn frozen(s: &BlockShape, case: &Case, mean: &[f32], variance: &[f32]) -> Vec<f64> {
    let (x, turned) = widened(s, case);
    let mut convolved = Convolved::new(s, &x, &turned);
    convolved.mean = mean.iter().map(|&v| f64::from(v)).collect();
    convolved.variance = variance.iter().map(|&v| f64::from(v)).collect();
    convolved.pool(s, case, None).pooled
}

/// Computes the block with batch statistics, and its gradients.
///
/// `branch` holds the choices of the implementation under test at ties and at zero. Within rounding either choice is correct, but their
/// gradients differ. A choice that rounding does not explain panics.
pub(crate) fn reference(s: &BlockShape, case: &Case, branch: Branch<'_>) -> Reference {
    let (ci, co, k) = (s.maps_in, s.maps_out, s.kernel[0] * s.kernel[1]);
    let n = s.count();
    let (x, turned) = widened(s, case);
    let convolved = Convolved::new(s, &x, &turned);
    let inverse = convolved.inverse_deviation();
    let Pooled { pooled, dz } = convolved.pool(s, case, Some(branch));
    let Convolved { y, mean, variance } = convolved;
    let (mut d_gamma, mut d_beta) = (vec![0f64; co], vec![0f64; co]);
    for at in 0..n * co {
        d_beta[at % co] += dz[at];
        d_gamma[at % co] += dz[at] * (y[at] - mean[at % co]) * inverse[at % co];
    }
    let parts = |at: usize| {
        let o = at % co;
        let hat = (y[at] - mean[o]) * inverse[o];
        let scale = f64::from(case.gamma[o]) * inverse[o];
        [dz[at], -d_beta[o] / n as f64, -hat * d_gamma[o] / n as f64].map(|part| scale * part)
    };
    let dy: Vec<f64> = (0..n * co).map(|at| parts(at).iter().sum()).collect();
    let terms: Vec<f64> = (0..n * co)
        .map(|at| parts(at).iter().map(|part| part.abs()).sum())
        .collect();
    let (mut dw, mut d_input) = (vec![0f64; turned.len()], vec![0f64; n * ci]);
    let (mut dw_terms, mut input_terms) = (vec![0f64; turned.len()], vec![0f64; n * ci]);
    taps(s, |tap, to, from| {
        for i in 0..ci {
            for o in 0..co {
                let (at, x) = ((tap * ci + i) * co + o, x[from * ci + i]);
                dw[at] += dy[to * co + o] * x;
                dw_terms[at] += terms[to * co + o] * x.abs();
                d_input[from * ci + i] += dy[to * co + o] * turned[at];
                input_terms[from * ci + i] += terms[to * co + o] * turned[at].abs();
            }
        }
    });
    let d_weight = (0..turned.len())
        .map(|at| dw[((at % k) * ci + at / k % ci) * co + at / k / ci])
        .collect();
    let largest = |terms: &[f64]| terms.iter().fold(0.0, |m: f64, &v| m.max(v));
    Reference {
        pooled,
        mean,
        variance,
        d_weight,
        weight_terms: largest(&dw_terms),
        d_gamma,
        d_beta,
        d_input,
        input_terms: largest(&input_terms),
    }
}
