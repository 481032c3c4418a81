use super::*;
use tactnet_data::Seed;

#[test]
fn a_thousand_steps_have_the_published_number_of_features() {
    let (dilations, biases) = spaced_dilations(1000, 10_000);
    assert_eq!(dilations.first(), Some(&1));
    assert_eq!(dilations.last(), Some(&124));
    assert_eq!(biases.iter().sum::<usize>() * KERNELS, 9996);
    assert_eq!(spaced_dilations(9, 84), (vec![1], vec![1]));
}

#[test]
fn a_result_is_the_convolution_written_out() {
    let values: Vec<f32> = (0..3 * 40).map(|i| ((i * 37) % 23) as f32).collect();
    let series = Series::from_frames(&values, 3);
    let mut workspace = Workspace::default();
    for (order, dilation) in [(Order::Base, 2), (Order::Difference, 2), (Order::Base, 4)] {
        workspace.prepare(&series, dilation, order);
        for kernel in [0, 41, 83] {
            let taxels = [2, 0];
            workspace.convolve(&taxels, kernel, 0..40);
            let result = workspace.result.steps().to_vec();
            for (step, found) in result.iter().enumerate() {
                let mut expected = 0.0;
                for tap in 0..TAPS {
                    let shift = i64::from(order == Order::Difference && tap < 4);
                    let at = step as i64 + (tap as i64 - 4) * dilation as i64 + shift;
                    if (0..40).contains(&at) {
                        let weight = if HEAVY_TAPS[kernel].contains(&tap) {
                            2.0
                        } else {
                            -1.0
                        };
                        let sum: f32 = taxels.iter().map(|&t| series.taxel(t)[at as usize]).sum();
                        expected += weight * sum;
                    }
                }
                assert_eq!(*found, expected, "{order:?}, step {step}");
            }
        }
    }
}

#[test]
fn shares_lie_around_their_quantiles() {
    let noise = |sweep: usize| -> Series {
        let mut rng = Seed(5).rng(("noise", sweep));
        let values: Vec<f32> = (0..2 * 200).map(|_| rng.random::<f32>()).collect();
        Series::from_frames(&values, 2)
    };
    let mut rng = Seed(1).rng("kernels");
    let kernels = Kernels::fit([2, 200], Order::Base, 840, 20, noise, &mut rng);
    let mut out = vec![0.0; kernels.len()];
    let workspace = &mut Workspace::default();
    kernels.transform(&noise(99), Order::Base, Pooling::Share, workspace, &mut out);
    assert_eq!(out.len(), 840);
    let mean = out.iter().sum::<f32>() / 840.0;
    assert!((0.4..0.6).contains(&mean), "{mean}");
}
