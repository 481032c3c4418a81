//! Integration tests, one binary.

#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should say where"
)]

mod adapt;
mod arrays;
mod attacks;
mod baselines;
mod build_script;
mod catch;
mod catch_calibration;
mod catch_run;
mod channel;
#[cfg(feature = "zenoh")]
mod channel_hosts;
mod cli_reference;
mod command;
mod command_line;
mod committee;
mod data_command;
mod devices;
mod enroll;
mod experiment;
mod experiment_runners;
mod facade;
mod golden;
mod host_attacks;
mod interrupted;
mod lengths;
mod newcomer;
mod own_skin;
mod public;
mod recording;
mod robot;
mod runtimes;
mod serve;
mod service;
mod sessions;
mod slurm;
mod study;
#[cfg(feature = "recording")]
mod topics;
mod training;
mod tutorial;
mod unlabelled;
mod view;
#[cfg(feature = "vulkan")]
mod vulkan;
