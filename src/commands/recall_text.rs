//! Recall of each material as text.

use tactnet_pipeline::{Confusion, Estimate};

use super::evaluation_table::percent;

/// Maximum number of materials of the table.
const MOST: usize = 12;

/// Returns a table with the recall of each material, its 95 % interval and the number of its sweeps, with a line break before each row;
/// empty for more than 12 materials.
pub fn recall_text(confusion: &Confusion) -> String {
    let names = &confusion.materials;
    if names.len() > MOST {
        return String::new();
    }
    let widths = names.iter().map(|name| name.chars().count());
    let wide = widths.max().unwrap_or(0).max("material".len());
    let rows = names.iter().zip(&confusion.counts).enumerate();
    let rows = rows.map(|(label, (name, row))| {
        let sweeps: usize = row.iter().sum();
        let recall = match sweeps {
            0 => "not tested".into(),
            _ => percent(Estimate::wilson(row[label] as f64 / sweeps as f64, sweeps)),
        };
        format!("\n{name:<wide$} {recall:>22} {sweeps:>7}")
    });
    format!(
        "\n{:<wide$} {:>22} {:>7}",
        "material", "recall [%]", "sweeps"
    ) + &rows.collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(counts: &[&[usize]]) -> String {
        recall_text(&Confusion {
            materials: (0..counts.len())
                .map(|label| format!("floor {label}"))
                .collect(),
            counts: counts.iter().map(|row| row.to_vec()).collect(),
        })
    }

    /// Intervals of statsmodels.stats.proportion.proportion_confint(45, 50, method="wilson") and (10, 10).
    #[test]
    fn every_material_has_its_recall_with_interval_and_number() {
        assert_eq!(
            text(&[&[45, 5, 0], &[0, 10, 0], &[0, 0, 0]]),
            "\nmaterial             recall [%]  sweeps\
             \nfloor 0     90.0 (78.6 to 95.7)      50\
             \nfloor 1   100.0 (72.2 to 100.0)      10\
             \nfloor 2              not tested       0"
        );
        let many: Vec<Vec<usize>> = (0..13).map(|_| vec![1; 13]).collect();
        let many: Vec<&[usize]> = many.iter().map(Vec::as_slice).collect();
        assert_eq!(text(&many), "");
        assert_ne!(text(&many[..12]), "");
    }
}
