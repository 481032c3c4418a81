//! An experiment on a cluster whose programs fail as on busy or strange sites. The programs are `tests/slurm-shim`.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::command::{Lab, assert_says, expect, signal, stderr, tactnet};

/// An experiment of two quick tasks, and the state of the cluster's programs.
struct Cluster {
    lab: Lab,
    shim: PathBuf,
}

impl Cluster {
    fn new() -> Self {
        let lab = Lab::new();
        let shim = lab.path("shim");
        fs::create_dir_all(shim.join("bin")).unwrap();
        fs::create_dir(shim.join("jobs")).unwrap();
        for program in ["sbatch", "squeue", "sacct", "scancel"] {
            let own = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/slurm-shim");
            symlink(own, shim.join("bin").join(program)).unwrap();
        }
        Self { lab, shim }
    }

    fn command(&self) -> Command {
        let mut command = tactnet(["experiment", "run", "crossval_baselines"]);
        let data = format!("data={}", self.lab.path("twin.h5").display());
        for setting in [&data, "folds=2", "models=means", "probes=[]", "groups=2"] {
            command.args(["--set", setting]);
        }
        let path = std::env::var("PATH").unwrap();
        command
            .arg("--out")
            .arg(self.lab.path("out"))
            .args(["--engine", "slurm"])
            .env(
                "PATH",
                format!("{}:{path}", self.shim.join("bin").display()),
            )
            .env("SLURM_SHIM", &self.shim);
        command
    }

    /// Runs the experiment, and returns what it says.
    fn run(&self, code: i32) -> String {
        stderr(&expect(code, self.command()))
    }

    /// Starts the experiment.
    fn start(&self) -> Child {
        let mut runner = self.command();
        runner.stdout(Stdio::null()).stderr(Stdio::null());
        runner.spawn().unwrap()
    }

    /// Runs the experiment on jobs that wait for some seconds, and expects one job.
    fn runs_one_job_that_waits(&self) {
        self.fault("hold", "");
        let mut runner = self.start();
        sleep(Duration::from_secs(4));
        fs::remove_file(self.shim.join("hold")).unwrap();
        assert!(runner.wait().unwrap().success());
        assert_eq!(self.submissions(), 1);
    }

    /// Prepares a fault of the shim.
    fn fault(&self, name: &str, lines: &str) {
        fs::write(self.shim.join(name), lines).unwrap();
    }

    fn calls(&self, program: &str) -> Vec<String> {
        let calls = fs::read_to_string(self.shim.join("calls")).unwrap_or_default();
        let of_program = calls.lines().filter(|call| call.starts_with(program));
        of_program.map(String::from).collect()
    }

    fn submissions(&self) -> usize {
        fs::read_dir(self.shim.join("jobs")).unwrap().count()
    }
}

#[test]
fn a_restarted_runner_finds_its_job_although_the_queue_fails_once() {
    let cluster = Cluster::new();
    cluster.fault("hold", "");
    let mut first = cluster.start();
    let begun = Instant::now();
    while cluster.calls("squeue").len() < 3 {
        assert!(
            begun.elapsed() < Duration::from_secs(60),
            "the job is in the queue"
        );
        sleep(Duration::from_millis(20));
    }
    signal("KILL", first.id());
    first.wait().unwrap();
    // Neither a failing queue nor a record that is missing makes the next runner submit again.
    fs::remove_file(cluster.lab.path("out/slurm/job.json")).unwrap();
    cluster.fault(
        "fail-squeue",
        "slurm_load_jobs error: Unable to contact slurm controller\n",
    );
    cluster.runs_one_job_that_waits();
}

#[test]
fn lines_around_the_job_id_and_lost_answers_leave_no_second_job() {
    let cluster = Cluster::new();
    cluster.fault("banner", "* 99 jobs wait; see https://help *\n");
    cluster.run(0);
    assert_eq!(cluster.submissions(), 1);

    // The controller accepts the job, but its answer is lost.
    let cluster = Cluster::new();
    cluster.fault("lose-answer", "");
    cluster.runs_one_job_that_waits();

    // An answer without an id: the job is found in the queue.
    let cluster = Cluster::new();
    cluster.fault("no-id", "");
    cluster.runs_one_job_that_waits();
}

#[test]
fn a_busy_controller_is_asked_again_and_a_refusal_is_final() {
    let cluster = Cluster::new();
    let busy = "Batch job submission failed: Socket timed out on send/recv operation\n";
    cluster.fault("fail-sbatch", &busy.repeat(2));
    cluster.run(0);
    assert_eq!(
        (cluster.calls("sbatch").len(), cluster.submissions()),
        (3, 1)
    );

    let cluster = Cluster::new();
    cluster.fault("fail-sbatch", "invalid partition specified: gpu\n");
    let said = cluster.run(1);
    assert!(said.contains("invalid partition specified"), "{said}");
    assert_eq!(cluster.calls("sbatch").len(), 1);
}

#[test]
fn preempted_tasks_and_failed_nodes_use_up_no_attempt() {
    let cluster = Cluster::new();
    // Five ends that are not the task's own, more than the three attempts.
    let ends = "PREEMPTED slurmstepd: error: *** CANCELLED DUE TO PREEMPTION ***\nNODE_FAIL \n";
    cluster.fault("end-0", &(ends.repeat(2) + "PREEMPTED \n"));
    let said = cluster.run(0);
    assert_eq!(said.matches("interrupted, goes on").count(), 5, "{said}");
    assert!(!said.contains("failed (attempt"), "{said}");
    // The other task is not run again.
    let arrays = cluster.calls("sbatch");
    assert!(arrays[0].contains("--array=0-1%"), "{arrays:?}");
    assert!(
        arrays[1..].iter().all(|call| call.contains("--array=0%")),
        "{arrays:?}"
    );
}

#[test]
fn a_task_out_of_memory_gets_more_or_is_given_up_by_that_name() {
    let cluster = Cluster::new();
    cluster.fault(
        "end-1",
        "OUT_OF_MEMORY slurmstepd: error: Detected 1 oom_kill event in StepId=7.batch.\n",
    );
    let said = cluster.run(0);
    assert!(said.contains("failed (attempt 1): out of memory"), "{said}");
    assert_says!(
        said,
        "it had 1000 MiB, and the next attempt asks for 2000 MiB"
    );
    assert!(cluster.calls("sbatch")[1].contains("--mem=2000M"));

    // Without accounting the log names the end, and nobody knows how much memory the task had.
    let cluster = Cluster::new();
    cluster.fault("no-accounting", "");
    cluster.fault(
        "end-1",
        "FAILED slurmstepd: error: Detected 1 oom_kill event in StepId=7.batch.\n",
    );
    let said = cluster.run(1);
    assert_eq!(cluster.submissions(), 1);
    assert!(
        said.contains("out of memory: ") && said.contains("needs more memory"),
        "{said}"
    );
    let last = said.trim().lines().last().unwrap();
    assert!(
        last.contains("1 of 2 tasks failed") && last.contains("out of memory"),
        "{said}"
    );
}

#[test]
fn a_task_at_its_time_limit_goes_on_from_its_checkpoint() {
    let limit = "TIMEOUT slurmstepd: error: *** CANCELLED DUE TO TIME LIMIT ***\n";
    let cluster = Cluster::new();
    cluster.fault("end-0", &limit.repeat(4));
    let checkpoint = "out/tasks/twin-means-run0-fold0/checkpoint.safetensors";
    let checkpoint = cluster.lab.path(checkpoint).display().to_string();
    cluster.fault("checkpoint-0", &checkpoint);
    let said = cluster.run(0);
    assert_eq!(
        said.matches("interrupted, goes on: time limit").count(),
        4,
        "{said}"
    );

    // Without a new checkpoint, more of the same would not help.
    let cluster = Cluster::new();
    cluster.fault("end-0", &limit.repeat(3));
    let said = cluster.run(1);
    assert_eq!(said.matches("failed (attempt").count(), 3, "{said}");
    assert!(said.contains("time limit: "), "{said}");
}

#[test]
fn a_full_disk_is_told_once_and_nothing_is_sent_again() {
    let cluster = Cluster::new();
    let full = "FAILED error: result.json: cannot write: No space left on device\n";
    cluster.fault("end-0", full);
    cluster.fault("end-1", full);
    let said = cluster.run(1);
    assert_eq!(said.matches("No space left on device").count(), 1, "{said}");
    assert!(said.contains("the disk is full"), "{said}");
    assert_eq!(cluster.submissions(), 1);
}

/// SIGXFSZ ended the process without a word. The limit counts blocks of 512 bytes.
#[test]
fn a_file_that_may_not_be_that_large_is_an_error_in_one_line() {
    let lab = Lab::new();
    let mut limited = Command::new("sh");
    limited
        .args([
            "-c",
            "ulimit -f 8; exec \"$0\" data twin --materials 3 --steps 200 --out \"$1\"",
        ])
        .arg(tactnet([] as [&str; 0]).get_program())
        .arg(lab.path("large.npz"));
    let said = stderr(&expect(1, limited));
    assert!(said.contains("File too large"), "{said}");
    assert_eq!(said.trim().lines().count(), 1, "{said}");

    // Every task of an experiment hits the limit; the first ends the run, and none is tried again.
    let mut limited = Command::new("sh");
    limited
        .args(["-c", "ulimit -f 200; exec \"$0\" experiment run crossval_baselines --set data=\"$1\" --set models=minirocket --set 'probes=[]' --jobs 1 --out \"$2\""])
        .arg(tactnet([] as [&str; 0]).get_program())
        .arg(lab.path("twin.h5"))
        .arg(lab.path("out"));
    let said = stderr(&expect(1, limited));
    assert!(said.contains("files may not be that large"), "{said}");
    assert!(!said.contains("attempt"), "{said}");
}
