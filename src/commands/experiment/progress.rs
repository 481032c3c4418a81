//! Progress display of an experiment.

use std::fmt::Write;
use std::io::IsTerminal;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use tactnet_experiments::{Event, Task, TimeLeft};

use crate::commands::progress_line::{COLUMNS, about, end_of};
use crate::output;

/// A progress bar over tasks on a terminal, or one line per task elsewhere.
pub struct Progress {
    bar: Option<ProgressBar>,
    left: Left,
    done: usize,
    all: usize,
}

/// Estimate of the remaining time, shared with the bar.
#[derive(Debug, Clone, Default)]
struct Left(Arc<Mutex<Option<TimeLeft>>>);

impl Left {
    fn change(&self, change: impl FnOnce(&mut TimeLeft)) {
        let mut left = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        left.as_mut().map(change);
    }

    /// Returns a text such as `2.5 min to go`; empty without an estimate.
    fn text(&self) -> String {
        let mut left = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let time = left.as_mut().and_then(|left| {
            let now = Instant::now();
            left.look(now);
            left.at(now)
        });
        time.map_or(String::new(), |time| format!("{} to go", about(time)))
    }
}

impl Progress {
    pub fn new() -> Self {
        Self {
            bar: None,
            left: Left::default(),
            done: 0,
            all: 0,
        }
    }

    /// Displays an event.
    pub fn show(&mut self, event: &Event<'_>) {
        match event {
            Event::Begun { done, all, left } => {
                (self.done, self.all) = (*done, *all);
                self.left = Left(Arc::new(Mutex::new(Some(left.clone()))));
                self.bar = std::io::stderr().is_terminal().then(|| {
                    task_bar(*done, *all, self.left.clone(), ProgressDrawTarget::stderr())
                });
                if self.bar.is_none() {
                    say!("{}, {done} done", output::counted(*all, "task"));
                }
            }
            Event::Started { task } => {
                self.left.change(|left| left.start(task, Instant::now()));
                if let Some(bar) = &self.bar {
                    bar.set_message(task.id.clone());
                }
            }
            Event::Done { task, seconds } => {
                self.done += 1;
                self.left.change(|left| left.end(task, *seconds));
                match &self.bar {
                    Some(bar) => bar.inc(1),
                    None => {
                        let counted = format!("{}/{}", self.done, self.all);
                        let took = Duration::from_secs_f64(*seconds);
                        say!("{}", done_text(&counted, &task.id, took, &self.left.text()));
                    }
                }
            }
            Event::Interrupted { task, reason } => {
                self.lose(task, &format!("{} interrupted, goes on: {reason}", task.id));
            }
            Event::Failed {
                task,
                attempt,
                reason,
            } => {
                let line = format!("{} failed (attempt {attempt}): {reason}", task.id);
                self.lose(task, &line);
            }
        }
    }

    /// Prints a line about a task that ended without a result.
    fn lose(&self, task: &Task, line: &str) {
        self.left.change(|left| left.fail(task));
        match &self.bar {
            Some(bar) => bar.println(line),
            None => say!("{line}"),
        }
    }

    /// Removes the bar.
    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Returns the line of a finished task in at most 60 columns; a long name keeps its end.
fn done_text(counted: &str, task: &str, took: Duration, left: &str) -> String {
    let times = match left {
        "" => format!("in {}", about(took)),
        left => format!("in {}, {left}", about(took)),
    };
    let room = COLUMNS.saturating_sub(counted.len() + times.len() + 2);
    format!("{counted} {} {times}", end_of(task, room))
}

fn task_bar(done: usize, all: usize, left: Left, target: ProgressDrawTarget) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(all as u64), target);
    if let Ok(style) = ProgressStyle::with_template("{pos}/{len} tasks [{bar:15}] {left}{wide_msg}")
    {
        let told = move |_: &ProgressState, out: &mut dyn Write| {
            let text = left.text();
            // A failed write cannot be reported anywhere.
            let _ = match text.as_str() {
                "" => Ok(()),
                text => write!(out, "{text}, "),
            };
        };
        bar.set_style(style.progress_chars("=> ").with_key("left", told));
    }
    bar.set_position(done as u64);
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
        let line = done_text("1000/1000", long, days, "99 days to go");
        assert_eq!(line.chars().count(), COLUMNS, "{line}");
        assert!(
            line.contains("-run1-fold4 in 99 days, 99 days to go"),
            "{line}"
        );
        let took = Duration::from_secs(2);
        for (left, end) in [("60 s to go", ", 60 s to go"), ("", "")] {
            assert_eq!(
                done_text("3/8", "twin-knn-l-run0-fold2", took, left),
                format!("3/8 twin-knn-l-run0-fold2 in 2 s{end}")
            );
        }
        let shown = Screen::shows(
            |target| task_bar(500, 1000, Left::default(), target),
            |bar| bar.set_message(long),
        );
        assert!(shown[0].starts_with("500/1000 tasks [==="), "{shown:?}");
        assert!(shown[3].ends_with(long), "{shown:?}");
    }
}
