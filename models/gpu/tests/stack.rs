//! Networks that train together compared with each network alone.
#![cfg(feature = "vulkan")]

mod noise;

use cubecl::client::Client;
use tactnet_conv::AdamStep;
use tactnet_conv_gpu::{
    Stack, StackAttack, StackBatch, StackDigits, StackMeasured, StackMethod, StackShape,
    StackState, StackSweeps,
};

use noise::noise;

/// Maximum number of sweeps in a batch. The second network has one less in every other step, the third has none in the last steps.
const BATCH: usize = 4;
const STEPS: usize = 5;
const NETWORKS: usize = 3;
const SWEEPS: usize = 9;

fn shape(networks: usize, blocks: &[[usize; 2]]) -> StackShape {
    StackShape {
        networks,
        batch: BATCH,
        steps: 60,
        taxels: 4,
        blocks: blocks.to_vec(),
        kernel: [15, 5],
        hidden: 8,
        materials: 3,
    }
}

fn counts(step: usize) -> [u32; NETWORKS] {
    let second = if step.is_multiple_of(2) { 3 } else { 4 };
    let third = if step < 4 { 4 } else { 0 };
    [4, second, third]
}

/// Returns `[networks][len]` of all networks, or the part of the network `only`.
fn of<T: Clone>(all: &[T], len: usize, only: Option<usize>) -> Vec<T> {
    match only {
        None => all.to_vec(),
        Some(network) => all[network * len..][..len].to_vec(),
    }
}

struct Case {
    blocks: &'static [[usize; 2]],
    attack: Option<(f64, bool)>,
    /// True if raw sweeps are on the device.
    digits: bool,
    capacity: usize,
}

/// Raw sweeps of one byte per value, and the scaling of each network.
struct RawSweeps {
    bytes: Vec<u8>,
    /// `[networks][offset, gain][taxels]`
    scaling: Vec<f32>,
}

impl RawSweeps {
    fn new(shape: &StackShape) -> Self {
        let taxels = shape.taxels;
        let scaling = (0..NETWORKS).flat_map(|network| {
            let offset = (0..taxels).map(move |x| 100.0 + (network + x) as f32);
            let gain = (0..taxels).map(move |x| 0.01 + 0.001 * (network * x) as f32);
            offset.chain(gain)
        });
        Self {
            bytes: noise(SWEEPS * shape.values(), 3)
                .iter()
                .map(|value| (value * 200.0 + 110.0) as u8)
                .collect(),
            scaling: scaling.collect(),
        }
    }

    /// Returns four bytes per word.
    fn words(&self) -> Vec<u32> {
        let (words, _) = self.bytes.as_chunks();
        words.iter().map(|four| u32::from_le_bytes(*four)).collect()
    }

    /// Returns the scaled sweeps with these numbers; zeros for sweeps that fill up a batch.
    fn scaled(
        &self,
        chosen: &[u32],
        shape: &StackShape,
        capacity: usize,
        only: Option<usize>,
    ) -> Vec<f32> {
        let taxels = shape.taxels;
        let sweep = |(at, &number): (usize, &u32)| {
            let network = only.unwrap_or(at / capacity);
            let own = &self.scaling[network * 2 * taxels..][..2 * taxels];
            let fills = at % capacity >= BATCH;
            let sweep = &self.bytes[number as usize * shape.values()..][..shape.values()];
            sweep.iter().enumerate().map(move |(i, &digit)| {
                let x = i % taxels;
                if fills {
                    0.0
                } else {
                    (f32::from(digit) - own[x]) * own[taxels + x]
                }
            })
        };
        chosen.iter().enumerate().flat_map(sweep).collect()
    }
}

/// Returns initial weights and moments.
fn state(shape: &StackShape, only: Option<usize>) -> StackState {
    let (parameters, statistics) = (shape.parameters(), shape.statistics());
    let mut running = noise(NETWORKS * statistics, 2);
    running.iter_mut().for_each(|value| *value += 1.0);
    StackState {
        parameters: of(&noise(NETWORKS * parameters, 1), parameters, only),
        moments: [(); 2].map(|()| vec![0.0; shape.networks * parameters]),
        running: of(&running, statistics, only),
    }
}

fn method(shape: &StackShape, case: &Case, only: Option<usize>) -> StackMethod {
    StackMethod {
        kept: 1.25,
        adam: AdamStep {
            l2: 1e-3,
            beta: [0.9, 0.999],
            rate: 0.0,
            epsilon: 0.0,
        },
        penalized: shape.weights(),
        attack: case.attack.map(|(alpha, follow_both)| StackAttack {
            alpha,
            epsilon: of(
                &[0.05, 0.1, 0.2].map(|e| [e; 4]).concat(),
                shape.taxels,
                only,
            ),
            follow_both,
        }),
    }
}

/// Random sweeps, labels and masks of a step. They are drawn for all networks; a stack of one network uses its part.
struct Draws {
    chosen: Vec<u32>,
    labels: Vec<u32>,
    masks: Vec<Vec<u32>>,
}

impl Draws {
    fn of(step: usize, shape: &StackShape, case: &Case, only: Option<usize>) -> Self {
        let seeded = |len: usize, seed: u64| noise(NETWORKS * BATCH * len, 10 * step as u64 + seed);
        let own = |all: Vec<u32>, len: usize| -> Vec<u32> {
            let padded = all.chunks(BATCH * len).flat_map(|own| {
                let mut own = own.to_vec();
                own.resize(case.capacity * len, 0);
                own
            });
            of(&padded.collect::<Vec<u32>>(), case.capacity * len, only)
        };
        let draw = |seed: u64, up_to: f32| -> Vec<u32> {
            let drawn = seeded(1, seed);
            own(
                drawn.iter().map(|v| ((v + 0.5) * up_to) as u32).collect(),
                1,
            )
        };
        let mask = |seed: u64| -> Vec<u32> {
            let words = seeded(shape.mask_words(), seed);
            let words = words
                .iter()
                .map(|v| v.to_bits().rotate_left(9) | 0x1111_1111);
            own(words.collect(), shape.mask_words())
        };
        let passes = 1 + u64::from(case.attack.is_some());
        Self {
            chosen: draw(4, SWEEPS as f32),
            labels: draw(5, 3.0),
            masks: (0..passes).map(|pass| mask(6 + pass)).collect(),
        }
    }
}

/// Returns state and measurements after all steps.
fn trained(
    client: &Client,
    case: &Case,
    only: Option<usize>,
) -> (StackState, Vec<Vec<StackMeasured>>) {
    let networks = if only.is_some() { 1 } else { NETWORKS };
    let shape = StackShape {
        batch: case.capacity,
        ..shape(networks, case.blocks)
    };
    let raw = RawSweeps::new(&shape);
    let words = raw.words();
    let scaling = of(&raw.scaling, 2 * shape.taxels, only);
    let digits = case.digits.then_some(StackDigits {
        bits: 8,
        words: &words,
        scaling: &scaling,
    });
    let (method, state) = (method(&shape, case, only), state(&shape, only));
    let mut stack = Stack::new(client, shape.clone(), method, &state, digits);
    for step in 0..STEPS {
        let draws = Draws::of(step, &shape, case, only);
        let masks: Vec<&[u32]> = draws.masks.iter().map(Vec::as_slice).collect();
        let values = raw.scaled(&draws.chosen, &shape, case.capacity, only);
        stack.step(&StackBatch {
            counts: &of(&counts(step), 1, only),
            sweeps: if case.digits {
                StackSweeps::Chosen(&draws.chosen)
            } else {
                StackSweeps::Values(&values)
            },
            labels: &draws.labels,
            masks: &masks,
            rates: &of(&[[1e-2, 1e-8], [2e-2, 1e-8], [5e-3, 1e-8]], 1, only),
        });
    }
    let measured = stack.measured();
    (stack.state(), measured)
}

fn case(blocks: &'static [[usize; 2]], attack: Option<(f64, bool)>) -> Case {
    Case {
        blocks,
        attack,
        digits: true,
        capacity: BATCH,
    }
}

fn client() -> Client {
    cubecl::Device::default().client()
}

fn alone_and_beside_others(case: &Case) {
    let client = client();
    let (together, measured) = trained(&client, case, None);
    let shape = shape(1, case.blocks);
    for network in 0..NETWORKS {
        let (alone, measured_alone) = trained(&client, case, Some(network));
        let own = |all: &[f32], len: usize| all[network * len..][..len].to_vec();
        assert_eq!(
            alone.parameters,
            own(&together.parameters, shape.parameters())
        );
        for (alone, together) in alone.moments.iter().zip(&together.moments) {
            assert_eq!(alone, &own(together, shape.parameters()));
        }
        assert_eq!(alone.running, own(&together.running, shape.statistics()));
        for (step, (alone, together)) in measured_alone.iter().zip(&measured).enumerate() {
            assert_eq!(alone[0], together[network], "step {step}");
            assert!(alone[0].loss[0].is_finite());
        }
        let start = own(&noise(NETWORKS * shape.parameters(), 1), shape.parameters());
        // All parameters except those of units that no sweep activates.
        let pairs = alone.parameters.iter().zip(&start);
        let learnt = pairs.filter(|(a, b)| a != b).count();
        assert!(10 * learnt > 9 * start.len(), "{learnt} of {}", start.len());
    }
}

/// Blocks that take two routes: taps in registers, and spectra.
const MAPS: &[[usize; 2]] = &[[4, 10], [6, 3]];
/// Blocks that take two routes: taps in registers, and one product over taps.
const FEW: &[[usize; 2]] = &[[2, 10], [5, 6]];

/// A single test process, because each process makes the driver compile the same kernels.
#[test]
fn a_network_is_the_same_to_the_bit_alone_and_beside_others() {
    alone_and_beside_others(&case(MAPS, None));
    alone_and_beside_others(&case(FEW, Some((0.0, false))));
    alone_and_beside_others(&case(MAPS, Some((0.5, true))));
    digits_are_normalised_on_the_device_as_elsewhere();
    sweeps_that_fill_up_a_batch_count_for_nothing();
}

fn digits_are_normalised_on_the_device_as_elsewhere() {
    let client = client();
    let digits = case(MAPS, None);
    let values = Case {
        digits: false,
        ..case(MAPS, None)
    };
    assert!(trained(&client, &digits, None) == trained(&client, &values, None));
}

/// The order of summation differs here, so results are not equal to the bit.
fn sweeps_that_fill_up_a_batch_count_for_nothing() {
    let client = client();
    let (tight, measured) = trained(&client, &case(MAPS, None), None);
    let roomy = Case {
        capacity: BATCH + 3,
        ..case(MAPS, None)
    };
    let (roomy, also) = trained(&client, &roomy, None);
    let apart = |a: &[f32], b: &[f32]| -> f64 {
        let off: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        let all: f64 = b.iter().map(|b| f64::from(*b).powi(2)).sum();
        (off / all).sqrt()
    };
    assert!(apart(&roomy.parameters, &tight.parameters) < 1e-4);
    assert!(apart(&roomy.running, &tight.running) < 1e-4);
    for (a, b) in measured.iter().flatten().zip(also.iter().flatten()) {
        assert!((a.loss[0] - b.loss[0]).abs() < 1e-3, "{a:?} {b:?}");
    }
}
