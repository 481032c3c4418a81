//! Prints sweeps of a data set as the input of `skin_driver.c`, three per material; motions and materials go to
//! standard error.
//!
//!     sweeps_as_text DATA SWEEPS

use tactnet_data::DataSource;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(file), Some(sweeps)) = (arguments.next(), arguments.next()) else {
        return Err("usage: sweeps_as_text DATA SWEEPS".into());
    };
    let sweeps: usize = sweeps.parse()?;
    let data = DataSource::named(&file).read()?;
    let mut motion = 0;
    for label in 0..data.labels().len() {
        let of_label = (0..data.len()).filter(|sweep| data.records()[*sweep].label == label);
        for sweep in of_label.take(3) {
            if motion == sweeps {
                return Ok(());
            }
            motion += 1;
            eprintln!("{motion} {}", data.labels().name(label));
            for frame in data.sweep(sweep).chunks(data.shape().taxels()) {
                let digits: Vec<String> = frame.iter().map(|digit| digit.to_string()).collect();
                println!("{}", digits.join(" "));
            }
            println!();
        }
    }
    Ok(())
}
