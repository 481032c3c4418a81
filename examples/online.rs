//! Classifies sweeps frame by frame, as a skin would send them, and fuses the beliefs of three sweeps.
//!
//!     cargo run --release --example online -- classifier sweeps.h5

use tactnet::{Classifier, Dataset};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(folder), Some(file)) = (arguments.next(), arguments.next()) else {
        return Err("usage: online CLASSIFIER SWEEPS".into());
    };
    let classifier = Classifier::load(folder)?;
    let dataset = Dataset::read(file)?;
    let materials: Vec<String> = classifier.materials().map(String::from).collect();
    let most_probable = |probabilities: &[f64]| {
        let best =
            (0..probabilities.len()).max_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b]));
        best.unwrap_or(0)
    };

    let mut online = classifier.online()?;
    let shape = dataset.shape();
    let mut digits = vec![0.0; shape.values()];
    // Three sweeps of the file's first material.
    let sweeps = (0..dataset.len()).filter(|sweep| dataset.records()[*sweep].label == 0);
    for sweep in sweeps.take(3) {
        dataset.copy_sweep(sweep, &mut digits);
        online.begin();
        for (number, frame) in digits.chunks_exact(shape.taxels()).enumerate() {
            online.push(frame);
            // The belief is available at any time; a quarter of a sweep is already informative.
            if number + 1 == shape.steps / 4 || number + 1 == shape.steps {
                let belief = online.classify();
                let label = most_probable(belief.log_probability);
                println!(
                    "sweep {sweep}, {:>4} of {} frames: {:<28} {:>5.1} %, entropy {:.2} nats",
                    number + 1,
                    shape.steps,
                    materials[label],
                    100.0 * belief.log_probability[label].exp(),
                    belief.entropy
                );
            }
        }
        online.fuse();
    }
    let fused = online.fused().probabilities();
    let label = most_probable(&fused);
    println!(
        "all three: {} {:.1} % (is {})",
        materials[label],
        100.0 * fused[label],
        dataset.labels().name(0)
    );
    Ok(())
}
