//! How far an experiment is.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use tactnet_experiments::Event;

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
                self.bar = std::io::stderr().is_terminal().then(|| bar(*done, *all));
                if self.bar.is_none() {
                    eprintln!("{all} tasks, {done} done");
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
                        eprintln!(
                            "{}/{} {} in {seconds:.0} s, {} to go",
                            self.done,
                            self.all,
                            task.id,
                            HumanDuration(left)
                        );
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
                    None => eprintln!("{line}"),
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

fn bar(done: usize, all: usize) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(all as u64), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template(
        "{pos}/{len} tasks [{bar:30}] {elapsed} gone, {eta} to go, {msg}",
    ) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.set_position(done as u64);
    bar.reset_eta();
    bar.enable_steady_tick(Duration::from_secs(1));
    bar
}
