//! Text of `tactnet data info`.

use std::fmt::{self, Formatter};

use tactnet_data::Info;

/// Properties of a data set as text, one a line; the materials follow.
pub struct InfoTable(pub Info);

impl fmt::Display for InfoTable {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let info = &self.0;
        let name = &info.name;
        match info.lengths {
            None => writeln!(f, "{name}: {} sweeps of {}", info.sweeps, info.shape)?,
            Some(lengths) => writeln!(
                f,
                "{name}: {} sweeps of {} to {} steps (median {}) of {}x{} taxels",
                info.sweeps,
                lengths.shortest,
                lengths.longest,
                lengths.median,
                info.shape.rows,
                info.shape.cols
            )?,
        }
        write_values(f, info)?;
        write_conditions(f, info)?;
        match (info.block_numbers, info.blocks) {
            (Some(numbers), Some(blocks)) if numbers != blocks => writeln!(
                f,
                "  blocks       {numbers} ({blocks} of one material each)"
            )?,
            (_, Some(blocks)) => writeln!(f, "  blocks       {blocks}")?,
            (_, None) => writeln!(f, "  blocks       not in the file")?,
        }
        match info.test_sweeps {
            Some(test) => writeln!(f, "  test split   {test} sweeps, marked in the file")?,
            None => writeln!(f, "  test split   not in the file")?,
        }
        writeln!(f, "  sha256       {}", info.sha256)?;
        write_materials(f, info)
    }
}

/// Writes the duration of a sweep and the distribution of the values.
fn write_values(f: &mut Formatter<'_>, info: &Info) -> fmt::Result {
    let rate = info.sample_rate_hz;
    let assumed = match info.sample_rate_assumed {
        true => " (assumed: not in the data)",
        false => "",
    };
    let seconds = info.sweep_seconds;
    let sweep = match info.lengths {
        None => "a sweep",
        Some(_) => "the longest sweep",
    };
    writeln!(
        f,
        "  duration     {seconds:.3} s {sweep} at {rate} Hz{assumed}"
    )?;
    // The file may store a wider type: values are held in the smallest type that represents all of them.
    let holds = match info.element {
        "u8" => " (whole numbers from 0 to 255)",
        "u16" => " (whole numbers from 0 to 65535)",
        _ => "",
    };
    let mebibytes = info.memory_bytes as f64 / f64::from(1 << 20);
    let element = info.element;
    writeln!(
        f,
        "  values       held as {element}{holds}, {mebibytes:.1} MiB"
    )?;
    write!(f, "  range        {:.4} to {:.4}, ", info.min, info.max)?;
    let (mean, std) = (info.mean, info.std);
    writeln!(f, "mean {mean:.4}, standard deviation {std:.4}")?;
    write!(f, "  percentiles ")?;
    for (percent, value) in &info.percentiles {
        write!(f, " {percent}%: {value:.4}")?;
    }
    writeln!(f, "\n  zeros        {:.1} %", 100.0 * info.zeros)?;
    match info.not_finite {
        0 => Ok(()),
        count => writeln!(f, "  not finite   {count}"),
    }
}

/// Writes the range of each condition, and the material with the smallest and with the largest mean.
fn write_conditions(f: &mut Formatter<'_>, info: &Info) -> fmt::Result {
    for of in &info.conditions {
        let name = of.condition.quantity.name();
        let unit = of.condition.unit.as_deref();
        let unit = unit.map_or(String::new(), |unit| format!(" {unit}"));
        write!(
            f,
            "  {name:12} {:.4} to {:.4}{unit}, known for every sweep",
            of.min, of.max
        )?;
        let mut means: Vec<_> = of.means.iter().zip(&info.materials).collect();
        means.sort_by(|a, b| a.0.total_cmp(b.0));
        if let [(low, least), .., (high, most)] = means[..] {
            write!(
                f,
                "; mean {low:.4} (`{}`) to {high:.4} (`{}`)",
                least.name, most.name
            )?;
        }
        writeln!(f)?;
    }
    Ok(())
}

/// Writes the materials and their numbers of sweeps.
fn write_materials(f: &mut Formatter<'_>, info: &Info) -> fmt::Result {
    let materials = &info.materials;
    if materials.is_empty() {
        return write!(
            f,
            "  materials    none named: sweeps for `tactnet predict`, `same` or `enroll`"
        );
    }
    write!(f, "  materials    {}", materials.len())?;
    let widths = materials.iter().map(|m| m.name.chars().count());
    let width = widths.max().unwrap_or(0);
    for (label, material) in materials.iter().enumerate() {
        let (name, sweeps) = (&material.name, material.sweeps);
        write!(f, "\n    {label:>3}  {name:width$}  {sweeps} sweeps")?;
        if let Some(test) = material.test_sweeps {
            write!(f, ", {test} for testing")?;
        }
        if let Some(lengths) = material.lengths {
            let (shortest, longest) = (lengths.shortest, lengths.longest);
            write!(
                f,
                ", {shortest} to {longest} steps, median {}",
                lengths.median
            )?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use tactnet_data::info;
    use tactnet_data::twin;

    use super::*;

    #[test]
    fn the_table_names_blocks_of_several_materials_and_values_that_are_not_finite() {
        let info = Info {
            element: "u16",
            block_numbers: Some(2),
            blocks: Some(4),
            not_finite: 2,
            ..info(&twin::small(2, 4, 30).unwrap())
        };
        let text = InfoTable(info).to_string();
        for line in [
            "blocks       2 (4 of one material each)",
            "held as u16 (whole numbers from 0 to 65535), ",
            "not finite   2",
        ] {
            assert!(text.contains(line), "{text}");
        }
    }
}
