//! How far an experiment is.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use tactnet_experiments::Event;

use crate::commands::progress_line::{COLUMNS, about, end_of};

/// A bar over tasks on a terminal, a line per task elsewhere.
pub struct Progress {
    bar: Option<ProgressBar>,
    begun: Instant,
    done_before: usize,
    done: usize,
    all: usize,
}

impl Progress {
    pub fn new() -> Self {
        Self {
            bar: None,
            begun: Instant::now(),
            done_before: 0,
            done: 0,
            all: 0,
        }
    }

    /// Shows what has happened.
    pub fn show(&mut self, event: &Event<'_>) {
        match event {
            Event::Begun { done, all } => {
                (self.done_before, self.done, self.all) = (*done, *done, *all);
                self.bar = std::io::stderr()
                    .is_terminal()
                    .then(|| task_bar(*done, *all, ProgressDrawTarget::stderr()));
                if self.bar.is_none() {
                    say!("{all} tasks, {done} done");
                }
            }
            Event::Started { task } => {
                if let Some(bar) = &self.bar {
                    bar.set_message(task.id.clone());
                }
            }
            Event::Done { task, seconds } => {
                self.done += 1;
                match &self.bar {
                    Some(bar) => bar.inc(1),
                    None => {
                        let spent = self.begun.elapsed();
                        let here = (self.done - self.done_before) as f64;
                        let left = spent.mul_f64((self.all - self.done) as f64 / here);
                        let counted = format!("{}/{}", self.done, self.all);
                        let took = Duration::from_secs_f64(*seconds);
                        say!("{}", done_text(&counted, &task.id, took, left));
                    }
                }
            }
            Event::Failed {
                task,
                attempt,
                reason,
            } => {
                let line = format!("{} failed (attempt {attempt}): {reason}", task.id);
                match &self.bar {
                    Some(bar) => bar.println(line),
                    None => say!("{line}"),
                }
            }
        }
    }

    /// Removes the bar.
    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// In at most 60 columns; of a long name the end.
fn done_text(counted: &str, task: &str, took: Duration, left: Duration) -> String {
    let times = format!("in {}, {} to go", about(took), about(left));
    let room = COLUMNS.saturating_sub(counted.len() + times.len() + 2);
    format!("{counted} {} {times}", end_of(task, room))
}

fn task_bar(done: usize, all: usize, target: ProgressDrawTarget) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(all as u64), target);
    if let Ok(style) =
        ProgressStyle::with_template("{pos}/{len} tasks [{bar:15}] {eta} to go, {wide_msg}")
    {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.set_position(done as u64);
    bar.reset_eta();
    bar.enable_steady_tick(Duration::from_secs(1));
    bar
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::progress_line::Screen;

    #[test]
    fn the_longest_line_of_an_experiment_fits_terminals_of_every_width() {
        let long = "a_data_set_with_a_long_name-multirocket-hydra-removed-run1-fold4";
        let days = Duration::from_secs(99 * 86_400);
        let line = done_text("1000/1000", long, days, days);
        assert_eq!(line.chars().count(), COLUMNS, "{line}");
        assert!(
            line.contains("-run1-fold4 in 99 days, 99 days to go"),
            "{line}"
        );
        let minute = Duration::from_secs(60);
        assert_eq!(
            done_text(
                "3/8",
                "twin-knn-l-run0-fold2",
                Duration::from_secs(2),
                minute
            ),
            "3/8 twin-knn-l-run0-fold2 in 2 s, 60 s to go"
        );
        let shown = Screen::shows(
            |target| task_bar(500, 1000, target),
            |bar| bar.set_message(long),
        );
        assert!(shown[0].starts_with("500/1000 tasks [==="), "{shown:?}");
        assert!(shown[3].ends_with(long), "{shown:?}");
    }
}
