//! Stop when sure: sweeps until the belief passes a threshold, beside fixed numbers of sweeps.

use std::collections::BTreeMap;

use tactnet_data::{Fold, Scheme, shuffle};
use tactnet_models::Belief;
use tactnet_pipeline::PredictionMethod;

use super::knowledge::trained;
use super::pairs::rows_of_label;
use super::{Answer, Cancelled, Measurement, StudyContext, StudyTask};

/// Probabilities at which it stops.
const THRESHOLDS: [f64; 6] = [0.8, 0.9, 0.95, 0.99, 0.999, 0.9999];
/// Fixed numbers of sweeps.
const FIXED: [usize; 5] = [1, 2, 3, 5, 10];
/// Most sweeps for one decision.
const MOST: usize = 10;
/// Orders in which the sweeps of a material are taken.
const ORDERS: usize = 20;
/// Passes of Monte Carlo dropout.
const MC_SAMPLES: usize = 100;

/// When it stops.
#[derive(Clone, Copy)]
enum Rule {
    Until(f64),
    Fixed(usize),
}

pub(super) fn sequential(
    task: &StudyTask,
    context: &StudyContext<'_>,
) -> Result<Answer, Cancelled> {
    let (repeat, number) = (task.number / 5, task.number % 5);
    let fold = Fold::new(
        context.dataset,
        Scheme::default(),
        context.seed,
        repeat,
        number,
    )?;
    let seed = context.seed_for("sequential", task.number);
    let classifier = trained(context, "classifier", &fold.train, seed)?;
    context.say("beliefs")?;
    let mut measurements = Vec::new();
    for (method, way) in [
        ("plain", PredictionMethod::Plain),
        (
            "mc_dropout",
            PredictionMethod::McDropout {
                mc_samples: MC_SAMPLES,
            },
        ),
    ] {
        let predictions = classifier.predict(&fold.test, way)?;
        let labels: Vec<usize> = predictions.sweeps.iter().map(|sweep| sweep.label).collect();
        let of_label = rows_of_label(&labels);
        let fewest = of_label.iter().map(Vec::len).min().unwrap_or(0);
        let rules = THRESHOLDS.map(Rule::Until).into_iter().chain(
            task.sweeps_or(&FIXED)
                .iter()
                .copied()
                .filter(|sweeps| *sweeps <= fewest)
                .map(Rule::Fixed),
        );
        for rule in rules {
            let (mut right, mut taken, mut decisions) = (0, 0, 0);
            for (label, rows) in of_label.iter().enumerate() {
                for order in 0..ORDERS {
                    let mut rows = rows.clone();
                    shuffle(&mut rows, &mut seed.rng(("order of sweeps", label, order)));
                    let most = match rule {
                        Rule::Until(_) => MOST,
                        Rule::Fixed(sweeps) => sweeps,
                    };
                    let mut belief = Belief::flat(predictions.labels.len());
                    for row in rows.iter().take(most) {
                        belief.fuse(&predictions.sweeps[*row].log_probability);
                        let stop = match rule {
                            Rule::Until(sure) => belief.probabilities()[belief.label()] >= sure,
                            Rule::Fixed(_) => false,
                        };
                        if stop {
                            break;
                        }
                    }
                    right += usize::from(belief.label() == labels[rows[0]]);
                    taken += belief.sweeps();
                    decisions += 1;
                }
            }
            let setting = match rule {
                Rule::Until(sure) => format!("until {sure}"),
                Rule::Fixed(sweeps) => format!("fixed {sweeps}"),
            };
            for (measure, sum) in [("accuracy", right), ("mean sweeps", taken)] {
                let value = sum as f64 / decisions as f64;
                measurements.push(
                    Measurement::new(measure, method, value, decisions).setting(setting.as_str()),
                );
            }
        }
    }
    Ok(Answer {
        measurements,
        split: format!("repeat {repeat}, fold {number}"),
        split_content: fold.manifest().sha256,
        chosen: BTreeMap::new(),
    })
}
