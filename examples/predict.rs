//! Opens a classifier and prints the material and the confidence for each sweep of a file.
//!
//!     cargo run --release --example predict -- classifier sweeps.h5

use tactnet::{Classifier, Dataset, SweepView};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(folder), Some(file)) = (arguments.next(), arguments.next()) else {
        return Err("usage: predict CLASSIFIER SWEEPS".into());
    };
    let classifier = Classifier::load(folder)?;
    let dataset = Dataset::read(file)?;
    let materials: Vec<&str> = classifier.materials().collect();

    let predictions = classifier.predict(&SweepView::all(&dataset))?;
    for sweep in predictions.sweeps.iter().take(10) {
        let label = sweep.predicted();
        println!(
            "sweep {:>4}: {:<28} {:>5.1} %   (is {})",
            sweep.index,
            materials[label],
            100.0 * sweep.log_probability[label].exp(),
            materials[sweep.label]
        );
    }
    let accuracy = 100.0 * predictions.accuracy();
    println!(
        "accuracy {accuracy:.1} % on all {} sweeps, those that it was trained on included",
        dataset.len()
    );
    Ok(())
}
