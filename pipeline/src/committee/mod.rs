//! Committees: several models whose probabilities are averaged.

pub(crate) mod enroll;
pub(crate) mod fitted;
pub(crate) mod novelty;
pub(crate) mod recipe;
pub(crate) mod training;
