//! Comparison of sweeps with the training sweeps as text.

use super::{Difference, LikenessReport, LikenessVerdict, Property, TaxelOrder};

/// Maximum number of taxels in a sentence.
const MAX_TAXELS: usize = 8;

impl LikenessReport {
    /// Returns the verdict in one line; empty without sweeps.
    pub fn text(&self) -> String {
        let sweeps = self.p_of_sweeps.len();
        let p = p_text(self.p);
        if sweeps == 0 {
            return String::new();
        }
        let differences: Vec<String> = self.differences.iter().map(difference_text).collect();
        let differences = match differences.is_empty() {
            true => String::new(),
            false => format!(": {}", differences.join("; ")),
        };
        match self.verdict {
            LikenessVerdict::Like => format!("like the training data ({p})"),
            LikenessVerdict::OtherBlock => format!(
                "like another recording block: unlike the training sweeps ({p}), but their recording blocks differ as much from one \
                 another ({}){differences}",
                p_text(self.p_other_block.unwrap_or(1.0))
            ),
            LikenessVerdict::Unlike => format!(
                "UNLIKE the training data ({p}; {} of {sweeps} sweeps){differences}",
                self.unlike_sweeps
            ),
        }
    }

    /// Returns the verdict in one line, with the p-value of the last of several sweeps.
    pub fn text_with_last_sweep(&self) -> String {
        let text = self.text();
        match self.p_of_sweeps.as_slice() {
            [_, .., last] => format!("{text}; the last sweep alone: {}", p_text(*last)),
            _ => text,
        }
    }
}

fn p_text(p: f64) -> String {
    match p {
        small if small < 0.01 => format!("p = {small:.3}"),
        p => format!("p = {p:.2}"),
    }
}

fn difference_text(difference: &Difference) -> String {
    match difference {
        Difference::ConstantTaxels { taxels } => {
            format!(
                "{} never change{}",
                taxels_text(taxels),
                if taxels.len() == 1 { "s" } else { "" }
            )
        }
        Difference::Scale { factor } => format!(
            "values are {factor:.3} times those of the training data; is the unit or the gain different?"
        ),
        Difference::Sign { taxels } if taxels.is_empty() => "values have the opposite sign".into(),
        Difference::Sign { taxels } => {
            format!("values of {} have the opposite sign", taxels_text(taxels))
        }
        Difference::Order { order } => format!("taxels are {}", order_text(order)),
        Difference::Speed { factor } => format!(
            "everything happens {factor:.2} times as fast; is the speed of the stroke or the sample rate different?"
        ),
        Difference::Property {
            property,
            deviation,
            taxels,
        } => {
            let place = match taxels.is_empty() {
                true => String::new(),
                false => format!(", most at {}", taxels_text(taxels)),
            };
            format!(
                "{} by {deviation:.1} standard deviations{place}; is it another sensor, robot or material?",
                match property {
                    Property::Level => "the taxels' means deviate",
                    Property::Spread => "the taxels' spreads deviate",
                    Property::Change => "the changes from frame to frame deviate",
                    Property::Spectrum => "the spectrum deviates",
                }
            )
        }
    }
}

fn order_text(order: &TaxelOrder) -> String {
    match order {
        TaxelOrder::Transposed => "transposed: rows and columns are exchanged".into(),
        TaxelOrder::Reversed => "in reverse order".into(),
        TaxelOrder::Rotated { degrees } => format!("rotated by {degrees} degrees"),
        TaxelOrder::MirroredColumns => "mirrored: the columns are in reverse order".into(),
        TaxelOrder::MirroredRows => "mirrored: the rows are in reverse order".into(),
        TaxelOrder::Exchanged { pairs } => {
            let pairs: Vec<String> = pairs.iter().map(|[a, b]| format!("{a} and {b}")).collect();
            format!("exchanged: {}", pairs.join(", "))
        }
        TaxelOrder::Permuted { places } => {
            let places: Vec<String> = places.iter().map(usize::to_string).collect();
            format!(
                "in another order: those of the training data are now at {}",
                places.join(", ")
            )
        }
    }
}

fn taxels_text(taxels: &[usize]) -> String {
    let mut shown: Vec<String> = taxels
        .iter()
        .take(MAX_TAXELS)
        .map(usize::to_string)
        .collect();
    if taxels.len() > MAX_TAXELS {
        shown.push(format!("and {} more", taxels.len() - MAX_TAXELS));
    }
    format!(
        "taxel{} {}",
        if taxels.len() == 1 { "" } else { "s" },
        shown.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verdict_names_what_differs() {
        let mut report = LikenessReport {
            verdict: LikenessVerdict::Unlike,
            p: 0.001,
            p_other_block: None,
            unlike_sweeps: 9,
            p_of_sweeps: vec![0.001; 12],
            differences: vec![Difference::Order {
                order: TaxelOrder::Exchanged {
                    pairs: vec![[0, 2]],
                },
            }],
        };
        assert_eq!(
            report.text(),
            "UNLIKE the training data (p = 0.001; 9 of 12 sweeps): taxels are exchanged: 0 and 2"
        );
        report.verdict = LikenessVerdict::Like;
        report.differences.clear();
        report.p = 0.4;
        assert_eq!(report.text(), "like the training data (p = 0.40)");
        assert_eq!(
            report.text_with_last_sweep(),
            "like the training data (p = 0.40); the last sweep alone: p = 0.001"
        );
        report.p_of_sweeps.truncate(1);
        assert_eq!(report.text_with_last_sweep(), report.text());
    }
}
