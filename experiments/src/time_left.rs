//! Estimates the remaining time of an experiment.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use tactnet_pipeline::{ModelRecipe, RunDir};

use crate::tasks::{ExperimentDir, TaskState};
use crate::{Job, Plan, Task};

/// Assumed ratio between the times of a network and of a baseline, before both were measured.
const NETWORK: f64 = 20.0;
/// Assumed minimum time of a network in seconds, before one was measured: hundreds of training steps, however small
/// the sweeps.
const LEAST_NETWORK: f64 = 20.0;
/// Minimum interval between two reads of the training progress.
const LOOK_EVERY: Duration = Duration::from_secs(2);

/// Estimate of the remaining time, based on the durations of similar tasks.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeLeft {
    /// Number of tasks that run at the same time.
    jobs: usize,
    /// Unfinished tasks by identifier.
    open: BTreeMap<String, OpenTask>,
    /// Durations of finished tasks, in seconds.
    durations: BTreeMap<Kind, Vec<f64>>,
    /// Time of the last [`TimeLeft::look`].
    last_look: Option<Instant>,
}

/// Properties that determine the duration of a task.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Kind {
    trains_network: bool,
    model: String,
    data: String,
    steps: Option<usize>,
}

#[derive(Debug, Clone, PartialEq)]
struct OpenTask {
    kind: Kind,
    /// Start time; `None` while the task waits.
    started: Option<Instant>,
    /// Run directory of the task.
    run: PathBuf,
    /// Training progress at the last look.
    trained: Option<TrainingProgress>,
}

/// Progress of a network's training.
#[derive(Debug, Clone, Copy, PartialEq)]
struct TrainingProgress {
    /// Estimated time of all epochs, in seconds.
    seconds: f64,
    /// Estimated time of the remaining epochs, in seconds.
    left: f64,
}

impl TimeLeft {
    /// Returns an estimate for an experiment before its tasks run; finished tasks provide durations.
    ///
    /// - `jobs`: number of tasks that run at the same time
    pub(crate) fn of(dir: &ExperimentDir, jobs: usize) -> Self {
        let mut left = Self {
            jobs,
            open: BTreeMap::new(),
            durations: BTreeMap::new(),
            last_look: None,
        };
        for task in &dir.plan.tasks {
            let kind = Kind::of(&dir.plan, task);
            let open = OpenTask {
                kind,
                started: None,
                run: dir.task_dir(task),
                trained: None,
            };
            left.open.insert(task.id.clone(), open);
            if dir.state(task) == TaskState::Done {
                left.end(task, dir.train_seconds(task));
            }
        }
        left
    }

    /// Records the start of a task.
    pub fn start(&mut self, task: &Task, now: Instant) {
        if let Some(open) = self.open.get_mut(&task.id) {
            open.started = Some(now);
        }
    }

    /// Records the successful end of a task.
    ///
    /// - `seconds`: its duration; 0 if unknown
    pub fn end(&mut self, task: &Task, seconds: f64) {
        if let Some(open) = self.open.remove(&task.id)
            && seconds > 0.0
        {
            self.durations.entry(open.kind).or_default().push(seconds);
        }
    }

    /// Records a failure: the task waits again.
    pub fn fail(&mut self, task: &Task) {
        if let Some(open) = self.open.get_mut(&task.id) {
            (open.started, open.trained) = (None, None);
        }
    }

    /// Reads the progress of running trainings from their run directories, at most every two seconds.
    pub fn look(&mut self, now: Instant) {
        if self
            .last_look
            .is_some_and(|at| now.saturating_duration_since(at) < LOOK_EVERY)
        {
            return;
        }
        self.last_look = Some(now);
        for open in self.open.values_mut() {
            if open.started.is_some() && open.kind.trains_network {
                open.trained = TrainingProgress::of(&open.run);
            }
        }
    }

    /// Returns the time until the last task ends; `None` until a duration is known.
    pub fn at(&self, now: Instant) -> Option<Duration> {
        let each: Option<Vec<f64>> = self
            .open
            .values()
            .map(|open| {
                if let Some(trained) = open.trained {
                    return Some(trained.left);
                }
                let whole = self.expected(&open.kind)?;
                let spent = open.started.map_or(0.0, |started| {
                    now.saturating_duration_since(started).as_secs_f64()
                });
                // A task that exceeds its estimate is expected to take 10 % longer still.
                Some(whole.max(1.1 * spent) - spent)
            })
            .collect();
        let each = each?;
        let longest = each.iter().copied().fold(0.0, f64::max);
        let shared = each.iter().sum::<f64>() / self.jobs.max(1) as f64;
        Some(Duration::from_secs_f64(shared.max(longest)))
    }

    /// Returns the expected duration of a task in seconds, from the first known of these: finished tasks of its kind,
    /// running trainings of its kind, all finished networks or baselines, all running trainings, all finished tasks.
    /// In the last case a network counts as [`NETWORK`] baselines and takes at least [`LEAST_NETWORK`].
    fn expected(&self, kind: &Kind) -> Option<f64> {
        let weight = |kind: &Kind| if kind.trains_network { NETWORK } else { 1.0 };
        let mean = |of: &dyn Fn(&Kind) -> bool| {
            let own = self.durations.iter().filter(|(other, _)| of(other));
            let (seconds, weights) =
                own.fold((0.0, 0.0), |(seconds, weights), (other, durations)| {
                    let all = durations.len() as f64;
                    (
                        seconds + durations.iter().sum::<f64>(),
                        weights + all * weight(other),
                    )
                });
            (weights > 0.0).then(|| weight(kind) * seconds / weights)
        };
        let training = |of: &dyn Fn(&Kind) -> bool| {
            let running = self.open.values().filter(|open| of(&open.kind));
            let seconds = running.filter_map(|open| open.trained.map(|trained| trained.seconds));
            let (sum, count) = seconds.fold((0.0, 0.0), |(sum, count), s| (sum + s, count + 1.0));
            (count > 0.0).then(|| sum / count)
        };
        mean(&|other| other == kind)
            .or_else(|| training(&|other| other == kind))
            .or_else(|| mean(&|other| other.trains_network == kind.trains_network))
            .or_else(|| training(&|other| other.trains_network == kind.trains_network))
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

impl TrainingProgress {
    /// Reads the progress of a network's training; `None` before the end of the first epoch and for other tasks.
    fn of(run: &Path) -> Option<Self> {
        let run = RunDir::open(run).ok()?;
        let ModelRecipe::Network(recipe) = run.config().ok()?.recipe else {
            return None;
        };
        let epochs = run.metrics_before(usize::MAX).ok()?;
        let spent: f64 = epochs.iter().map(|epoch| epoch.seconds).sum();
        (!epochs.is_empty()).then(|| {
            let seconds = spent / epochs.len() as f64 * recipe.training.epochs as f64;
            Self {
                seconds,
                left: (seconds - spent).max(0.0),
            }
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

    /// Plans a baseline and a network on the twin, five folds each.
    fn experiment(jobs: usize) -> (Vec<Task>, TimeLeft, tempfile::TempDir) {
        let folder = tempfile::tempdir().unwrap();
        let settings = ["data=twin", "models=[\"knn-l\", \"fast\"]", "probes=[]"];
        let settings: Vec<String> = settings.map(String::from).into();
        let recipe = ExperimentRecipe::load("crossval_baselines", &settings).unwrap();
        let dir =
            ExperimentDir::create(&folder.path().join("out"), &recipe.with_data().unwrap(), "")
                .unwrap();
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
        // Another fast baseline does not change the estimate for networks.
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
    fn a_network_that_trains_tells_of_itself_and_of_its_kind_by_its_epochs() {
        let (tasks, mut left, folder) = experiment(1);
        let begun = Instant::now();
        left.end(&tasks[0], 1.0);
        left.end(&tasks[1], 1.0);
        left.start(&tasks[2], begun);
        assert_eq!(
            seconds(&left, begun),
            2.0 * 20.0,
            "nothing but its kind is known"
        );
        left.look(begun);
        assert_eq!(
            seconds(&left, begun),
            2.0 * 20.0,
            "it has not begun to train"
        );
        let run = left.open[&tasks[2].id].run.clone();
        train_a_part(folder.path(), &run);
        let spent: Vec<f64> = RunDir::open(&run)
            .unwrap()
            .metrics_before(usize::MAX)
            .unwrap()
            .iter()
            .map(|epoch| epoch.seconds)
            .collect();
        assert!((1..4).contains(&spent.len()), "{spent:?} of four epochs");
        left.look(begun + Duration::from_secs(1));
        assert_eq!(seconds(&left, begun), 2.0 * 20.0, "looked a moment ago");
        left.look(begun + Duration::from_secs(3));
        let epoch = spent.iter().sum::<f64>() / spent.len() as f64;
        // The rest of this training, and another one like it.
        let expected = epoch * (4 - spent.len()) as f64 + 4.0 * epoch;
        let found = seconds(&left, begun + Duration::from_secs(3));
        assert!((found - expected).abs() < 1e-9, "{found}, not {expected}");
        // The total time of a finished task is more accurate, since it includes the time after the epochs.
        left.end(&tasks[2], 100.0);
        assert_eq!(seconds(&left, begun), 100.0);
    }

    /// Trains a small network for two of four epochs, or one batch more.
    fn train_a_part(folder: &Path, run: &Path) {
        use tactnet_data::{format::Format, twin};
        use tactnet_pipeline::{Program, Provenance, Session, TrainEvent, TrainJob, TrainSpec};
        let [data, recipe] = ["small.h5", "small.toml"].map(|name| folder.join(name));
        let dataset = twin::small(2, 6, 60).unwrap();
        Format::TactMat.write(&data, &dataset).unwrap();
        let text = "name = \"small\"\nnetwork = { maps = [3, 4], hidden = 8, keep_probability = 0.8 }\n[training]\nepochs = 4\n\
                    batch = 8\nlearning_rate = 0.005\nmethod = { kind = \"base\" }\n";
        std::fs::write(&recipe, text).unwrap();
        let job = TrainJob::try_from(TrainSpec {
            data: data.display().to_string(),
            recipe: recipe.display().to_string(),
            ..TrainSpec::default()
        });
        let program = Program {
            provenance: Provenance::of_this_process("0", "test"),
            command: |spec| spec.data.clone(),
        };
        let session = Session::begin(&job.unwrap(), Some(run), program, |_| Ok(())).unwrap();
        let batches = std::cell::Cell::new(0);
        let count = |event: TrainEvent<'_>| {
            batches.set(batches.get() + usize::from(matches!(event, TrainEvent::Batch { .. })));
        };
        session.train(count, || batches.get() >= 5).unwrap();
    }

    #[test]
    fn jobs_side_by_side_share_the_work_but_no_task_is_split() {
        let (tasks, mut left, _folder) = experiment(4);
        left.end(&tasks[0], 1.0);
        left.end(&tasks[2], 100.0);
        assert_eq!(seconds(&left, Instant::now()), 100.0, "one network is left");
        left.jobs = 1;
        assert_eq!(seconds(&left, Instant::now()), 101.0);
        // Another runner ran it, so its duration is unknown.
        left.end(&tasks[3], 0.0);
        assert_eq!(seconds(&left, Instant::now()), 1.0);
    }
}
