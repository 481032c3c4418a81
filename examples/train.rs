//! Trains a classifier and prints its accuracy on held-out sweeps.
//!
//!     cargo run --release --example train                          a small synthetic data set
//!     cargo run --release --example train -- sweeps.h5 classifier  your own; the classifier is saved

use tactnet::{Dataset, Recipe, Seed, TwinConfig};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let dataset = match arguments.next() {
        Some(file) => Dataset::read(file)?,
        None => Dataset::twin(&TwinConfig {
            materials: 6,
            sweeps: 40,
            steps: 250,
            ..TwinConfig::default()
        })?,
    };

    // Four fifths of every material's sweeps train, the rest test.
    let fold = dataset.folds(Seed(1)).first();
    let recipe = Recipe::named("fast")?;
    let classifier = recipe
        .fit_while(&fold.train, |batch| {
            if let (true, Some(loss)) = (batch.ends_epoch(), batch.mean_loss) {
                eprintln!("epoch {}: mean loss {loss:.3} nats", batch.epoch + 1);
            }
            true
        })?
        .ok_or("stopped")?;

    let accuracy = classifier.predict(&fold.test)?.accuracy();
    println!(
        "accuracy {:.1} % on {} test sweeps of {} materials",
        100.0 * accuracy,
        fold.test.len(),
        dataset.labels().len()
    );
    if let Some(folder) = arguments.next() {
        classifier.save(&folder)?;
        println!("saved in {folder}");
    }
    Ok(())
}
