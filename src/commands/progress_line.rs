//! Progress lines that fit a narrow terminal.

use std::time::Duration;

/// Width of the narrowest supported terminal, in columns.
pub const COLUMNS: usize = 60;

/// Formats a remaining time in at most 7 columns: `89 s`, `2.5 min`, `89 min`, `7.5 h`, `12 days`.
pub fn about(left: Duration) -> String {
    let seconds = left.as_secs_f64();
    // Small counts are shown in halves of a unit, so that progress is visible.
    let in_units = |unit: f64| {
        let count = seconds / unit;
        if count < 9.75 {
            (2.0 * count).round() / 2.0
        } else {
            count.round()
        }
    };
    if seconds < 99.5 {
        format!("{} s", seconds.round())
    } else if in_units(60.0) < 90.0 {
        format!("{} min", in_units(60.0))
    } else if in_units(3600.0) < 48.0 {
        format!("{} h", in_units(3600.0))
    } else {
        format!("{} days", (seconds / 86_400.0).round().min(99.0))
    }
}

/// Formats a non-negative number in at most 5 columns.
pub fn in_five_columns(number: f64) -> String {
    match number {
        _ if number < 9.9995 => format!("{number:.3}"),
        _ if number < 99.995 => format!("{number:.2}"),
        _ if number < 999.95 => format!("{number:.1}"),
        _ if number < 99_999.5 => format!("{number:.0}"),
        _ => format!("{number:.0e}"),
    }
}

/// Returns the end of `name` in at most `columns` columns; `…` marks the omitted part.
pub fn end_of(name: &str, columns: usize) -> String {
    let letters = name.chars().count();
    if letters <= columns {
        return name.into();
    }
    let end: String = name.chars().skip(letters + 1 - columns.max(1)).collect();
    format!("…{end}")
}

/// Test terminal with a fixed width that keeps its output.
#[cfg(test)]
#[derive(Debug, Clone)]
pub struct Screen {
    columns: u16,
    written: std::sync::Arc<std::sync::Mutex<Vec<String>>>,
}

#[cfg(test)]
impl Screen {
    /// Draws a bar at several widths after `update`; returns the line of each terminal, narrowest first.
    pub fn shows(
        make: impl Fn(indicatif::ProgressDrawTarget) -> indicatif::ProgressBar,
        update: impl Fn(&indicatif::ProgressBar),
    ) -> Vec<String> {
        let shown = [COLUMNS, 72, 80, 132].map(|columns| {
            let screen = Self {
                columns: columns as u16,
                written: std::sync::Arc::default(),
            };
            let bar = make(indicatif::ProgressDrawTarget::term_like(Box::new(
                screen.clone(),
            )));
            update(&bar);
            bar.force_draw();
            let written = screen.written.lock().unwrap();
            for line in written.iter() {
                assert!(line.chars().count() <= columns, "{columns} columns: {line}");
            }
            let last = written.iter().rfind(|line| !line.trim().is_empty());
            last.unwrap().clone()
        });
        shown.into()
    }
}

#[cfg(test)]
impl indicatif::TermLike for Screen {
    fn width(&self) -> u16 {
        self.columns
    }
    fn move_cursor_up(&self, _: usize) -> std::io::Result<()> {
        Ok(())
    }
    fn move_cursor_down(&self, _: usize) -> std::io::Result<()> {
        Ok(())
    }
    fn move_cursor_right(&self, _: usize) -> std::io::Result<()> {
        Ok(())
    }
    fn move_cursor_left(&self, _: usize) -> std::io::Result<()> {
        Ok(())
    }
    fn write_line(&self, text: &str) -> std::io::Result<()> {
        self.write_str(text)
    }
    fn write_str(&self, text: &str) -> std::io::Result<()> {
        self.written
            .lock()
            .unwrap()
            .push(text.trim_matches('\r').into());
        Ok(())
    }
    fn clear_line(&self) -> std::io::Result<()> {
        Ok(())
    }
    fn flush(&self) -> std::io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_numbers_are_short() {
        for (seconds, shown) in [
            (0.0, "0 s"),
            (89.4, "89 s"),
            (99.6, "1.5 min"),
            (121.0, "2 min"),
            (149.0, "2.5 min"),
            (584.0, "9.5 min"),
            (586.0, "10 min"),
            (5369.0, "89 min"),
            (5371.0, "1.5 h"),
            (27_000.0, "7.5 h"),
            (172_000.0, "2 days"),
            (1e9, "99 days"),
        ] {
            let text = about(Duration::from_secs_f64(seconds));
            assert_eq!(text, shown, "{seconds}");
            assert!(text.len() <= 7);
        }
        for (number, shown) in [
            (0.0, "0.000"),
            (9.9996, "10.00"),
            (99.996, "100.0"),
            (1234.6, "1235"),
            (1e30, "1e30"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(in_five_columns(number), shown);
        }
        assert_eq!(end_of("twin-fast-fold0", 20), "twin-fast-fold0");
        assert_eq!(end_of("twin-fast-fold0", 6), "…fold0");
    }
}
