//! A robot as processes: hub, simulated skin and the online classifier with a small network.

use std::io::{BufReader, Read};
use std::process::{Child, Command, Stdio};

use tactnet_channel::{Bus, Domain, GetPort, Start, remove_bus};
use tactnet_data::SweepView;
use tactnet_models::Compute;
use tactnet_pipeline::{Classifier, PredictionMethod, RunDir};
use tactnet_skin::packets::{TactileBelief, TactileStatus};
use tactnet_skin::{SegmenterConfig, ServeConfig};

use crate::command::{Lab, signal, tactnet};

pub(crate) const STEPS: usize = 120;

/// A bus, a small network, and its data set.
pub(crate) struct Robot {
    pub(crate) lab: Lab,
    table: tactnet_channel::Table,
}

/// A process that is killed when dropped, as by `kill -9`.
pub(crate) struct Running(pub(crate) Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Running {
    /// Starts a process and waits until it prints `ready`.
    pub(crate) fn start(mut command: Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let out = child.stdout.as_mut().unwrap();
        let mut said = Vec::new();
        while !said.ends_with(b"ready\n") {
            let mut byte = [0];
            assert_eq!(out.read(&mut byte).unwrap(), 1, "{command:?} ended");
            said.push(byte[0]);
        }
        Self(child)
    }

    /// Asks the process to end and returns its output.
    pub(crate) fn end(mut self) -> String {
        signal("TERM", self.0.id());
        let mut said = String::new();
        let mut out = BufReader::new(self.0.stdout.take().unwrap());
        out.read_to_string(&mut said).unwrap();
        assert!(self.0.wait().unwrap().success());
        said
    }
}

impl Robot {
    pub(crate) fn new(name: &str) -> Self {
        let lab = Lab::new();
        lab.recipe_for(4);
        let size = format!("--materials 4 --sweeps 40 --steps {STEPS}");
        lab.twin("data.h5", &size);
        lab.run("train --calibrate --data @data.h5 --recipe @small.toml --out @models/1");
        let config = ServeConfig {
            anytime_ms: 40.0,
            segmenter: SegmenterConfig {
                skip: 20.into(),
                ..SegmenterConfig::default()
            },
            ..ServeConfig::default()
        };
        let table = config.table(&format!("{name}{}", std::process::id()));
        std::fs::write(lab.path("robot.toml"), toml::to_string(&table).unwrap()).unwrap();
        Self { lab, table }
    }

    pub(crate) fn start(&self, arguments: &[&str]) -> Running {
        let mut command = tactnet(arguments);
        command.arg("--table").arg(self.lab.path("robot.toml"));
        Running::start(command)
    }

    pub(crate) fn serve(&self, model: &str) -> Running {
        let path = self.lab.path(model).display().to_string();
        let which = if model == "models" {
            "--models"
        } else {
            "--run"
        };
        self.start(&["serve", "--json", "--metrics", "off", which, &path])
    }

    pub(crate) fn skin(&self, sweeps: &str) -> Running {
        let data = self.lab.path("data.h5").display().to_string();
        let objects = ["--sweeps-per-object", "none"];
        let skin = ["simulate", "skin", "--data", &data, "--sweeps", sweeps];
        self.start(&[&skin[..], &objects].concat())
    }

    pub(crate) fn bus(&self) -> Bus {
        Bus::open(Domain::Host, &self.table).unwrap()
    }

    pub(crate) fn status(&self) -> GetPort<TactileStatus> {
        self.bus().get_port("tactile/status", Start::Now).unwrap()
    }

    pub(crate) fn beliefs(&self) -> GetPort<TactileBelief> {
        self.bus().get_port("tactile/belief", Start::Now).unwrap()
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        remove_bus(&self.table).unwrap();
    }
}

/// Returns the offline classifier of a run.
pub(crate) fn classifier(robot: &Robot, run: &str) -> Classifier {
    let run = RunDir::open(&robot.lab.path(run)).unwrap();
    let (config, weights) = (run.config().unwrap().classifier, run.weights().unwrap());
    Classifier::new(config, &weights, &Compute::Cpu.open().unwrap()).unwrap()
}

/// Returns the offline prediction of a run for a sweep: `[materials]` probabilities.
pub(crate) fn offline(robot: &Robot, run: &str, sweep: usize) -> Vec<f64> {
    let classifier = classifier(robot, run);
    let dataset = tactnet_data::format::read(&robot.lab.path("data.h5")).unwrap();
    let view = SweepView::new(&dataset, vec![sweep]);
    let found = classifier.predict(&view, PredictionMethod::Plain).unwrap();
    let log_p = &found.sweeps[0].log_probability;
    log_p.iter().map(|log_p| log_p.exp()).collect()
}
