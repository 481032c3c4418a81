//! How long the tasks that an experiment has left will take.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use crate::tasks::{ExperimentDir, TaskState};
use crate::{Job, Plan, Task};

/// How many times as long as a baseline a network, or a study that trains networks, takes where neither has been measured.
const NETWORK: f64 = 20.0;
/// Seconds that a network takes at least where none has been measured: hundreds of training steps, however small the sweeps.
const LEAST_NETWORK: f64 = 20.0;

/// Estimates the time that is left from how long tasks of the same kind took.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeLeft {
    /// Tasks that run at once.
    jobs: usize,
    /// Tasks that have not ended, by their identifiers.
    open: BTreeMap<String, Open>,
    /// Seconds that tasks took.
    took: BTreeMap<Kind, Vec<f64>>,
}

/// What decides how long a task takes.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Kind {
    trains_network: bool,
    model: String,
    data: String,
    steps: Option<usize>,
}

#[derive(Debug, Clone, PartialEq)]
struct Open {
    kind: Kind,
    /// `None` while it waits.
    started: Option<Instant>,
}

impl TimeLeft {
    /// Looks at an experiment before its tasks are run; those that have ended say how long they took.
    ///
    /// - `jobs`: tasks that run at once
    pub(crate) fn of(dir: &ExperimentDir, jobs: usize) -> Self {
        let mut left = Self {
            jobs,
            open: BTreeMap::new(),
            took: BTreeMap::new(),
        };
        for task in &dir.plan.tasks {
            let kind = Kind::of(&dir.plan, task);
            let started = None;
            left.open.insert(task.id.clone(), Open { kind, started });
            if dir.state(task) == TaskState::Done {
                left.end(task, dir.train_seconds(task));
            }
        }
        left
    }

    /// Notes that a task runs.
    pub fn start(&mut self, task: &Task, now: Instant) {
        if let Some(open) = self.open.get_mut(&task.id) {
            open.started = Some(now);
        }
    }

    /// Notes that a task has ended well.
    ///
    /// - `seconds`: that it took; 0 where that is not known
    pub fn end(&mut self, task: &Task, seconds: f64) {
        if let Some(open) = self.open.remove(&task.id)
            && seconds > 0.0
        {
            self.took.entry(open.kind).or_default().push(seconds);
        }
    }

    /// Notes that a task has ended without a result: it waits again.
    pub fn fail(&mut self, task: &Task) {
        if let Some(open) = self.open.get_mut(&task.id) {
            open.started = None;
        }
    }

    /// Returns the time until the last task ends; `None` before one has told how long tasks take.
    pub fn at(&self, now: Instant) -> Option<Duration> {
        let each: Option<Vec<f64>> = self
            .open
            .values()
            .map(|open| {
                let whole = self.expected(&open.kind)?;
                let spent = open.started.map_or(0.0, |started| {
                    now.saturating_duration_since(started).as_secs_f64()
                });
                // One that takes longer than expected takes a little longer still.
                Some(whole.max(1.1 * spent) - spent)
            })
            .collect();
        let each = each?;
        let longest = each.iter().copied().fold(0.0, f64::max);
        let shared = each.iter().sum::<f64>() / self.jobs.max(1) as f64;
        Some(Duration::from_secs_f64(shared.max(longest)))
    }

    /// Seconds that a task should take: the mean of those of its kind, or else of all networks or baselines, or else of all tasks, where a
    /// network weighs as much as [`NETWORK`] baselines, and takes [`LEAST_NETWORK`] at least.
    fn expected(&self, kind: &Kind) -> Option<f64> {
        let weight = |kind: &Kind| if kind.trains_network { NETWORK } else { 1.0 };
        let mean = |of: &dyn Fn(&Kind) -> bool| {
            let own = self.took.iter().filter(|(other, _)| of(other));
            let (seconds, weights) = own.fold((0.0, 0.0), |(seconds, weights), (other, took)| {
                let all = took.len() as f64;
                (
                    seconds + took.iter().sum::<f64>(),
                    weights + all * weight(other),
                )
            });
            (weights > 0.0).then(|| weight(kind) * seconds / weights)
        };
        mean(&|other| other == kind)
            .or_else(|| mean(&|other| other.trains_network == kind.trains_network))
            .or_else(|| {
                let least = if kind.trains_network {
                    LEAST_NETWORK
                } else {
                    0.0
                };
                mean(&|_| true).map(|seconds| seconds.max(least))
            })
    }
}

impl Kind {
    fn of(plan: &Plan, task: &Task) -> Self {
        let spec = match &task.job {
            Job::Train(spec) => spec,
            Job::Question(task) => &task.networks,
        };
        Self {
            trains_network: plan.trains_network(task),
            model: task.model.clone(),
            data: spec.data.clone(),
            steps: spec.steps,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ExperimentRecipe;

    /// A baseline and a network on the twin, five folds each, nothing done.
    fn experiment(jobs: usize) -> (Vec<Task>, TimeLeft, tempfile::TempDir) {
        let folder = tempfile::tempdir().unwrap();
        let settings = ["data=twin", "models=[\"knn-l\", \"fast\"]", "probes=[]"];
        let settings: Vec<String> = settings.map(String::from).into();
        let recipe = ExperimentRecipe::load("crossval_baselines", &settings).unwrap();
        let dir = ExperimentDir::create(&folder.path().join("out"), &recipe, "").unwrap();
        let of = |model: &str| -> Vec<Task> {
            let tasks = dir.plan.tasks.iter();
            tasks
                .filter(|task| task.model == model)
                .take(2)
                .cloned()
                .collect()
        };
        let tasks = [of("knn-l"), of("fast")].concat();
        assert_eq!(tasks.len(), 4);
        let mut left = TimeLeft::of(&dir, jobs);
        left.open
            .retain(|id, _| tasks.iter().any(|task| task.id == *id));
        (tasks, left, folder)
    }

    fn seconds(left: &TimeLeft, now: Instant) -> f64 {
        left.at(now).unwrap().as_secs_f64()
    }

    #[test]
    fn a_network_weighs_as_much_as_twenty_baselines_until_one_was_measured() {
        let (tasks, mut left, _folder) = experiment(1);
        let now = Instant::now();
        assert_eq!(left.at(now), None, "nothing is known yet");
        let mut quick = left.clone();
        quick.end(&tasks[0], 0.1);
        assert!((seconds(&quick, now) - 0.1 - 2.0 * 20.0).abs() < 1e-9);
        left.end(&tasks[0], 2.0);
        assert_eq!(seconds(&left, now), 2.0 + 2.0 * 40.0);
        left.end(&tasks[2], 90.0);
        assert_eq!(seconds(&left, now), 2.0 + 90.0);
        // A fast other baseline changes nothing about the networks.
        left.end(&tasks[1], 2.0);
        assert_eq!(seconds(&left, now), 90.0);
        left.end(&tasks[3], 80.0);
        assert_eq!(seconds(&left, now), 0.0);
    }

    #[test]
    fn the_time_of_a_running_task_counts_and_never_runs_out_before_it_ends() {
        let (tasks, mut left, _folder) = experiment(1);
        let begun = Instant::now();
        left.end(&tasks[0], 1.0);
        left.end(&tasks[1], 1.0);
        left.end(&tasks[2], 100.0);
        left.start(&tasks[3], begun);
        let after = |s: u64| seconds(&left, begun + Duration::from_secs(s));
        assert_eq!((after(0), after(60)), (100.0, 40.0));
        assert!((after(200) - 20.0).abs() < 1e-9, "{}", after(200));
        left.fail(&tasks[3]);
        assert_eq!(seconds(&left, begun + Duration::from_secs(60)), 100.0);
    }

    #[test]
    fn jobs_side_by_side_share_the_work_but_no_task_is_split() {
        let (tasks, mut left, _folder) = experiment(4);
        left.end(&tasks[0], 1.0);
        left.end(&tasks[2], 100.0);
        assert_eq!(seconds(&left, Instant::now()), 100.0, "one network is left");
        left.jobs = 1;
        assert_eq!(seconds(&left, Instant::now()), 101.0);
        // Somebody else ran it, and nobody knows for how long.
        left.end(&tasks[3], 0.0);
        assert_eq!(seconds(&left, Instant::now()), 1.0);
    }
}
