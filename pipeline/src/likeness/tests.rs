use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use tactnet_data::{
    Dataset, Fold, LabelSet, Samples, Scheme, Seed, SweepRecord, SweepShape, SweepView, TrainSplit,
};

use super::{Difference, Likeness, LikenessVerdict, Property, TaxelOrder};

const SHAPE: SweepShape = SweepShape {
    steps: 96,
    rows: 3,
    cols: 3,
};
const MATERIALS: usize = 4;

/// Sweeps of another robot, of whom the parts differ.
#[derive(Debug, Clone, Copy, Default)]
struct Recording {
    sweeps: usize,
    /// Size of the offsets of the taxels in a block, in digits.
    block_offset: f64,
    blocks: Option<u32>,
}

/// Returns sweeps of four materials: every taxel has its own level, and an oscillation whose size and frequency depend on
/// the material, with noise.
fn sweeps(recording: Recording, seed: u64) -> Dataset {
    let mut rng = Seed(seed).rng("likeness, test sweeps");
    let mut normal = move || -> f64 { StandardNormal.sample(&mut rng) };
    let taxels = SHAPE.taxels();
    let offsets: Vec<f64> = (0..recording.blocks.unwrap_or(1) as usize * taxels)
        .map(|_| recording.block_offset * normal())
        .collect();
    let (mut values, mut records) = (Vec::new(), Vec::new());
    for label in 0..MATERIALS {
        for sweep in 0..recording.sweeps {
            let block = recording.blocks.map(|blocks| sweep as u32 % blocks);
            let (gain, phase) = ((0.1 * normal()).exp(), normal());
            let offsets = &offsets[block.unwrap_or(0) as usize * taxels..][..taxels];
            let mut noise = vec![0.0; taxels];
            for step in 0..SHAPE.steps {
                for (taxel, noise) in noise.iter_mut().enumerate() {
                    *noise = 0.6 * *noise + normal();
                    let cycles = (6.0 + 2.0 * label as f64) * step as f64 / SHAPE.steps as f64;
                    let wave = (std::f64::consts::TAU * cycles + phase + taxel as f64).sin();
                    let level = 30.0 + 4.0 * taxel as f64 + 3.0 * label as f64 + offsets[taxel];
                    let size = 4.0 + label as f64 + 0.5 * taxel as f64;
                    values.push((gain * (level + size * wave) + *noise) as f32);
                }
            }
            records.push(SweepRecord {
                label,
                sweep,
                block,
                test: None,
            });
        }
    }
    let labels = LabelSet::new(["cork", "denim", "felt", "wood"]).unwrap();
    Dataset::new("test", 100.0, SHAPE, labels, records, Samples::F32(values)).unwrap()
}

/// Returns the sweeps of `dataset`, each changed.
fn changed(dataset: &Dataset, change: impl Fn(&[f32]) -> Vec<f32>) -> Dataset {
    let values = (0..dataset.len()).flat_map(|index| change(&dataset.sweep(index)));
    Dataset::new(
        "changed",
        dataset.sample_rate_hz(),
        SHAPE,
        dataset.labels().clone(),
        dataset.records().to_vec(),
        Samples::F32(values.collect()),
    )
    .unwrap()
}

fn fitted(dataset: &Dataset) -> Likeness {
    let train = TrainSplit::all(dataset, Seed(1));
    Likeness::fit(&train, Seed(1)).unwrap().unwrap()
}

fn plain(number: usize) -> Recording {
    Recording {
        sweeps: number,
        ..Recording::default()
    }
}

#[test]
fn p_values_hold_their_level_on_held_out_sweeps() {
    let (mut small, mut sweeps_tested, mut files, mut few) = (0, 0, 0, 0);
    let repeats = 200;
    for seed in 0..repeats {
        let dataset = sweeps(plain(25), seed);
        let fold = Fold::new(&dataset, Scheme::folds_for(&dataset), Seed(seed), 0, 0).unwrap();
        let likeness = Likeness::fit(&fold.train, Seed(seed)).unwrap().unwrap();
        let report = likeness.assess(&fold.test, Seed(seed));
        small += report.unlike_sweeps;
        sweeps_tested += fold.test.len();
        files += usize::from(report.p <= 0.05);
        // Sweeps of a single material, in a small file.
        let one = SweepView::new(&dataset, fold.test.indices()[..5].to_vec());
        few += usize::from(likeness.assess(&one, Seed(seed)).p <= 0.05);
    }
    let share = small as f64 / sweeps_tested as f64;
    assert!((0.03..=0.07).contains(&share), "{share} of the sweeps");
    // Of 200 files, 10 are expected; more than 20 have a probability below 0.2 %.
    assert!(files <= 20, "{files} of {repeats} files");
    assert!(few <= 20, "{few} of {repeats} small files");
}

/// The levels of all taxels change, each by less than they vary from sweep to sweep.
#[test]
fn a_small_change_that_all_sweeps_share_is_found() {
    let likeness = fitted(&sweeps(plain(40), 3));
    let (mut files, mut unlike_sweeps) = (0, 0);
    let repeats = 20;
    for seed in 10..10 + repeats {
        let shifted = changed(&sweeps(plain(3), seed), |sweep| {
            let values = sweep.iter().enumerate();
            values
                .map(|(at, value)| value + if at % 2 == 0 { 0.2 } else { -0.2 })
                .collect()
        });
        let report = likeness.assess(&SweepView::all(&shifted), Seed(seed));
        files += usize::from(report.verdict == LikenessVerdict::Unlike);
        unlike_sweeps += report.unlike_sweeps;
    }
    assert!(files >= 18, "{files} of {repeats} files");
    assert!(
        unlike_sweeps < 12 * repeats as usize / 2,
        "{unlike_sweeps} sweeps alone"
    );
}

/// Returns what differs in sweeps that are changed.
fn found(likeness: &Likeness, sweeps: &Dataset, change: &dyn Fn(&[f32]) -> Vec<f32>) -> Difference {
    let report = likeness.assess(&SweepView::all(&changed(sweeps, change)), Seed(3));
    assert_eq!(report.verdict, LikenessVerdict::Unlike, "{report:?}");
    report.differences[0].clone()
}

#[test]
fn what_differs_is_named() {
    let likeness = fitted(&sweeps(plain(25), 1));
    let others = sweeps(plain(5), 2);
    let taxels = SHAPE.taxels();
    let like = likeness.assess(&SweepView::all(&others), Seed(3));
    assert_eq!(
        (like.verdict, like.differences.len()),
        (LikenessVerdict::Like, 0)
    );
    let found = |change: &dyn Fn(&[f32]) -> Vec<f32>| found(&likeness, &others, change);
    let values = |change: &dyn Fn(usize, f32) -> f32| {
        found(&|sweep: &[f32]| {
            let values = sweep.iter().enumerate();
            values
                .map(|(at, value)| change(at % taxels, *value))
                .collect()
        })
    };
    let Difference::Scale { factor } = values(&|_, value| 1.5 * value) else {
        panic!("expected a factor");
    };
    assert!((factor - 1.5).abs() < 0.1, "{factor}");
    let Difference::Scale { factor } = values(&|_, value| value / 9.806_65) else {
        panic!("expected a factor");
    };
    assert!((factor * 9.806_65 - 1.0).abs() < 0.1, "{factor}");
    assert_eq!(
        values(&|_, value| -value),
        Difference::Sign { taxels: Vec::new() }
    );
    assert_eq!(
        values(&|taxel, value| if taxel == 4 { -value } else { value }),
        Difference::Sign { taxels: vec![4] }
    );
    assert_eq!(
        values(&|taxel, value| if taxel == 7 { 31.0 } else { value }),
        Difference::ConstantTaxels { taxels: vec![7] }
    );
    // Half as fast: every second value is between two.
    let slow = found(&|sweep: &[f32]| {
        let at = |step: usize, taxel: usize| sweep[step * taxels + taxel];
        (0..SHAPE.steps)
            .flat_map(|step| {
                (0..taxels)
                    .map(move |taxel| 0.5 * (at(step / 2, taxel) + at(step.div_ceil(2), taxel)))
            })
            .collect()
    });
    assert_eq!(slow, Difference::Speed { factor: 0.5 });
    let Difference::Property { property, .. } =
        values(&|taxel, value| value + if taxel % 2 == 0 { 9.0 } else { -9.0 })
    else {
        panic!("expected a property");
    };
    assert_eq!(property, Property::Level);
}

#[test]
fn another_order_of_the_taxels_is_named() {
    let likeness = fitted(&sweeps(plain(25), 1));
    let others = sweeps(plain(5), 2);
    let taxels = SHAPE.taxels();
    let reordered = |places: &dyn Fn(usize, usize) -> usize| {
        let Difference::Order { order } = found(&likeness, &others, &|sweep: &[f32]| {
            let frames = sweep.chunks_exact(taxels);
            frames
                .flat_map(|frame| (0..taxels).map(|at| frame[places(at / 3, at % 3)]))
                .collect()
        }) else {
            panic!("expected an order");
        };
        order
    };
    assert_eq!(reordered(&|r, c| c * 3 + r), TaxelOrder::Transposed);
    // Clockwise: the first row is the first column, read upwards.
    assert_eq!(
        reordered(&|r, c| (2 - c) * 3 + r),
        TaxelOrder::Rotated { degrees: 90 }
    );
    assert_eq!(
        reordered(&|r, c| r * 3 + 2 - c),
        TaxelOrder::MirroredColumns
    );
    assert_eq!(
        reordered(&|r, c| match r * 3 + c {
            1 => 8,
            8 => 1,
            at => at,
        }),
        TaxelOrder::Exchanged {
            pairs: vec![[1, 8]]
        }
    );
}

#[test]
fn another_block_is_told_from_another_sensor() {
    let blocks = Recording {
        sweeps: 30,
        block_offset: 12.0,
        blocks: Some(5),
    };
    let training = sweeps(blocks, 4);
    let likeness = fitted(&training);
    let (mut other_block, mut unlike) = (0, 0);
    for seed in 10..40 {
        let one = sweeps(
            Recording {
                sweeps: 3,
                blocks: Some(1),
                ..blocks
            },
            seed,
        );
        match likeness.assess(&SweepView::all(&one), Seed(seed)).verdict {
            LikenessVerdict::Like => {}
            LikenessVerdict::OtherBlock => other_block += 1,
            LikenessVerdict::Unlike => unlike += 1,
        }
    }
    assert!(
        other_block >= 10 && unlike <= 6,
        "{other_block} and {unlike} of 30"
    );
    let other = changed(&sweeps(plain(5), 3), |sweep| {
        sweep.iter().map(|value| -value).collect()
    });
    let report = likeness.assess(&SweepView::all(&other), Seed(1));
    assert_eq!(report.verdict, LikenessVerdict::Unlike);
}

#[test]
fn a_description_is_restored_from_its_tensors() {
    let likeness = fitted(&sweeps(plain(10), 5));
    let again = Likeness::from_weights(likeness.weights().clone(), SHAPE).unwrap();
    let others = sweeps(plain(3), 6);
    let report = |of: &Likeness| {
        serde_json::to_string(&of.assess(&SweepView::all(&others), Seed(2))).unwrap()
    };
    assert_eq!(report(&likeness), report(&again));
    let mut damaged = likeness.weights().clone();
    damaged.0.remove("within.nearest");
    assert_eq!(
        Likeness::from_weights(damaged, SHAPE).err().unwrap(),
        "no tensor `within.nearest`"
    );
}

#[test]
fn an_enrolled_material_is_like_the_training_data() {
    let all = sweeps(plain(25), 7);
    let is_known = |index: &usize| all.records()[*index].label < MATERIALS - 1;
    let (known, new): (Vec<usize>, Vec<usize>) = (0..all.len()).partition(is_known);
    let labels = LabelSet::new(["cork", "denim", "felt"]).unwrap();
    let values = known.iter().flat_map(|index| all.sweep(*index));
    let records = known.iter().map(|index| all.records()[*index].clone());
    let training = Dataset::new(
        "known",
        100.0,
        SHAPE,
        labels,
        records.collect(),
        Samples::F32(values.collect()),
    )
    .unwrap();
    let likeness = fitted(&training);
    let (enrolled, others) = new.split_at(15);
    let others = SweepView::new(&all, others.to_vec());
    assert_eq!(
        likeness.assess(&others, Seed(1)).verdict,
        LikenessVerdict::Unlike
    );
    let enrolled = SweepView::new(&all, enrolled.to_vec());
    let extended = likeness.extended(&enrolled, MATERIALS - 1).unwrap();
    assert_eq!(
        extended.assess(&others, Seed(1)).verdict,
        LikenessVerdict::Like
    );
}

#[test]
fn too_few_sweeps_have_no_description() {
    let mut rng = Seed(1).rng("few");
    let number = rng.random_range(1..5);
    let few = sweeps(plain(number), 8);
    let train = TrainSplit::all(&few, Seed(1));
    assert!(Likeness::fit(&train, Seed(1)).unwrap().is_none());
}

/// A taxel that a third of the sweeps do not touch is not unusual in any single sweep, but in ten of ten it is.
#[test]
fn a_dead_taxel_that_is_often_untouched_is_found() {
    let taxels = SHAPE.taxels();
    let untouched = |dataset: &Dataset, one_in: usize| {
        let mut values: Vec<f32> = (0..dataset.len())
            .flat_map(|index| dataset.sweep(index))
            .collect();
        for sweep in (0..dataset.len()).filter(|sweep| sweep % one_in == 0) {
            let of_sweep = &mut values[sweep * SHAPE.values()..][..SHAPE.values()];
            let taxel = of_sweep[4..].iter_mut().step_by(taxels);
            taxel.for_each(|value| *value = 46.0);
        }
        let (labels, records) = (dataset.labels().clone(), dataset.records().to_vec());
        Dataset::new("", 100.0, SHAPE, labels, records, Samples::F32(values)).unwrap()
    };
    let mut unlike = 0;
    for seed in 0..10 {
        let likeness = fitted(&untouched(&sweeps(plain(25), seed), 3));
        let others = sweeps(plain(3), 100 + seed);
        let p = |one_in: usize| {
            let others = untouched(&others, one_in);
            likeness.assess(&SweepView::all(&others), Seed(seed)).p
        };
        unlike += usize::from(p(3) <= 0.05);
        assert!(p(1) <= 0.05, "{}", p(1));
    }
    // Of ten sets, 0.5 are expected; four or more have a probability of 0.1 %.
    assert!(unlike <= 3, "{unlike} of 10");
}

#[test]
fn dead_taxels_are_those_that_change_in_training_sweeps_only() {
    let taxels = SHAPE.taxels();
    let constant = |of: &'static [usize]| {
        move |sweep: &[f32]| -> Vec<f32> {
            let values = sweep.iter().enumerate();
            values
                .map(|(at, value)| {
                    if of.contains(&(at % taxels)) {
                        0.0
                    } else {
                        *value
                    }
                })
                .collect()
        }
    };
    // Taxel 2 does not change in four of 100 training sweeps.
    let training = sweeps(plain(25), 1);
    let count = std::cell::Cell::new(0);
    let training = changed(&training, |sweep| {
        count.set(count.get() + 1);
        match count.get() % 25 {
            0 => constant(&[2])(sweep),
            _ => sweep.to_vec(),
        }
    });
    let likeness = fitted(&training);
    let three = sweeps(plain(3), 2);
    let three = |of| changed(&three, constant(of));
    let dead = |of| likeness.dead_taxels(&SweepView::all(&three(of)));
    assert!(dead(&[]).is_empty());
    assert_eq!(dead(&[2, 7]), [7]);
    assert_eq!(dead(&[5, 7]), [5, 7]);
    // More than a quarter of nine.
    assert!(dead(&[4, 5, 7]).is_empty());
    // Constant in the first sweep only.
    let first = std::cell::Cell::new(true);
    let once = changed(&sweeps(plain(1), 3), |sweep| match first.replace(false) {
        true => constant(&[7])(sweep),
        false => sweep.to_vec(),
    });
    assert!(likeness.dead_taxels(&SweepView::all(&once)).is_empty());
}
