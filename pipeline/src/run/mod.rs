//! Run directories and the sessions that fill them.

mod average;
mod committee_session;
mod enroll_run;
pub(crate) mod evaluate_run;
mod free_folder;
pub(crate) mod provenance;
pub(crate) mod random_fold;
pub(crate) mod read_sweeps;
pub(crate) mod reevaluate;
pub(crate) mod result;
pub(crate) mod run_config;
pub(crate) mod run_dir;
pub(crate) mod session;
mod set_aside;
mod teacher_session;
pub(crate) mod test_sweeps;
pub(crate) mod together;
pub(crate) mod training_record;
pub(crate) mod training_steps;
pub(crate) mod write_whole;
