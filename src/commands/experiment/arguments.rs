//! Arguments of `tactnet experiment`.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::{Args, ValueEnum};

use crate::commands::choices::DeviceChoice;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet experiment run crossval_baselines                           on the twin\n  \
    tactnet experiment run crossval_tactnet2 --set data=sweeps.h5       on recorded sweeps\n  \
    tactnet experiment run crossval_baselines --set folds=2 --set 'models=[\"minirocket\"]'\n  \
    tactnet experiment run nshot --set splits=3 --set 'shots=[1,10]'    n-shot transfer\n  \
    tactnet experiment run public --set data=DIR                        all data sets of a folder\n  \
    tactnet experiment run my.toml --engine slurm --out /shared/my      on a cluster\n\n\
    The same command resumes a stopped experiment, and so does the command with its folder alone. Finished tasks are not run again.\n\n\
    Fields for --set: data, models, levels, steps (a value or a list), seed, epochs, device, search.trials, and those of the question. \
    Cross-validation: split, probes (a value or a list), folds (number of trained folds out of five random ones), runs (1 or 2), groups, \
    shots (numbers of sweeps of each material that models are trained on as well). \
    Other questions: splits (number of draws of new materials, or of the 2 x 5 folds), shots (support sweeps of nshot and enrolment, sweeps \
    per decision of the others), new_materials, methods (nshot: nk, ol, ol-fcl, ol-mean, nn, siamese, siamese-full, simpleshot, lda, \
    tuned-ol, whitened-ol). `tactnet experiment show NAME` prints a complete recipe.\n\n\
    With --engine slurm, every node must see the folder and the program under the same path.")]
pub struct RunArgs {
    /// A built-in experiment (see `tactnet experiment list`), a TOML file, or the folder of an experiment to resume
    #[arg(value_name = "NAME|FILE|DIR")]
    pub recipe: String,
    /// Folder for tasks and report [default: experiments-out/NAME, with a number if another experiment is there]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Data set, same as `--set data=FILE`
    #[arg(long, value_name = "FILE|twin")]
    pub data: Option<String>,
    /// Set a field of the recipe; repeatable. `models` takes the same recipes as `train --recipe`: `models=fast,lda`
    /// (`fast` is TactNet-II)
    #[arg(long = "set", value_name = "FIELD=VALUE")]
    pub settings: Vec<String>,
    /// Confirm the order of the axes although there are more taxels than time steps
    #[arg(long)]
    pub axes_are_right: bool,
    /// Device of all tasks [default: the recipe's]
    #[arg(long, value_enum)]
    pub device: Option<DeviceChoice>,
    /// Number of networks that a GPU trains together [default: as many as its memory allows]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100))]
    pub at_once: Option<u32>,
    /// Engine that runs the tasks
    #[arg(long, value_enum, default_value_t)]
    pub engine: Engine,
    /// Number of parallel tasks [default: one per core, one on a GPU; with Slurm: 100]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub jobs: Option<u32>,
    /// With Slurm: cores per task
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub cores: u32,
    /// With Slurm: additional argument of sbatch, such as --partition=gpu; repeatable
    #[arg(long = "sbatch", value_name = "ARG", allow_hyphen_values = true)]
    pub sbatch: Vec<String>,
    /// Print summary.json instead of a table
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
pub struct DirArgs {
    /// Folder of an experiment
    #[arg(value_name = "DIR")]
    pub dir: PathBuf,
    /// Print one JSON document instead of a table
    #[arg(long)]
    pub json: bool,
}

#[derive(Args)]
#[command(after_help = "Example:\n  tactnet experiment show crossval_baselines > my.toml")]
pub struct ShowArgs {
    /// A built-in experiment, or a file
    #[arg(value_name = "NAME")]
    pub name: String,
}

#[derive(Args)]
#[command(after_help = "Example:\n  \
    tactnet experiment export experiments-out/crossval_baselines --mlflow mlruns\n  \
    mlflow ui --backend-store-uri mlruns")]
pub struct ExportArgs {
    /// Folder of an experiment
    #[arg(value_name = "DIR")]
    pub dir: PathBuf,
    /// New folder in the layout of MLflow's tracking store
    #[arg(long, value_name = "DIR")]
    pub mlflow: PathBuf,
}

#[derive(Args)]
pub struct TaskArgs {
    pub dir: PathBuf,
    pub index: usize,
    #[arg(long, default_value_t = 1)]
    pub threads: usize,
}

/// Engine that runs the tasks.
#[derive(Clone, Copy, Default, ValueEnum)]
pub enum Engine {
    /// Processes on this machine
    #[default]
    Local,
    /// A Slurm array job
    Slurm,
}

impl RunArgs {
    /// Returns the folder if the argument names an existing experiment instead of a recipe.
    ///
    /// # Errors
    /// Additional settings, since those of a started experiment are fixed.
    pub fn started(&self) -> anyhow::Result<Option<&Path>> {
        let dir = Path::new(&self.recipe);
        if !dir.join("experiment.json").exists() {
            return Ok(None);
        }
        if self.out.is_some() || !self.settings().is_empty() {
            bail!(
                "{}: an experiment resumes with the settings that it was started with; leave out --set, --data, --device and --out, or name a \
                 recipe",
                dir.display()
            );
        }
        Ok(Some(dir))
    }

    /// Checks that the data set is named once.
    ///
    /// # Errors
    /// Both `--data` and `--set data=`.
    pub fn check(&self) -> anyhow::Result<()> {
        let set = self.settings.iter().find(|set| {
            let field = set.split_once('=').map(|(field, _)| field.trim());
            field == Some("data")
        });
        if let (Some(data), Some(set)) = (&self.data, set) {
            bail!(
                "`--data {data}` and `--set {set}` both name the data set; leave one of them out"
            );
        }
        Ok(())
    }

    /// Returns all settings of the recipe, including those of `--data` and `--device`.
    pub fn settings(&self) -> Vec<String> {
        let device = self
            .device
            .and_then(|device| device.to_possible_value())
            .map(|device| format!("device={}", device.get_name()));
        let data = self.data.as_ref().map(|data| format!("data={data}"));
        let settings = self.settings.iter().cloned();
        settings.chain(data).chain(device).collect()
    }

    /// Returns the command that repeats the experiment, with file names instead of paths.
    pub fn command_line(&self) -> String {
        let name = |path: &str| {
            Path::new(path).file_name().map_or_else(
                || path.to_string(),
                |name| name.to_string_lossy().into_owned(),
            )
        };
        let mut line = format!("tactnet experiment run {}", name(&self.recipe));
        for setting in &self.settings() {
            let shown = match setting.split_once('=') {
                Some(("data", value)) if !value.starts_with(['[', '"']) => {
                    format!("data={}", name(value))
                }
                _ => setting
                    .split('"')
                    .map(|part| {
                        if part.contains('/') {
                            name(part)
                        } else {
                            part.to_string()
                        }
                    })
                    .collect::<Vec<_>>()
                    .join("\""),
            };
            line.push_str(&format!(" --set '{shown}'"));
        }
        line
    }
}
