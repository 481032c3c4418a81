//! Baselines: features followed by a classical classifier. Each method of classification has its own file.

pub(crate) mod extra_trees;
pub(crate) mod fit;
pub(crate) mod fitted;
pub(crate) mod knn;
pub(crate) mod lda;
pub(crate) mod method;
pub(crate) mod recipe;
pub(crate) mod ridge;
pub(crate) mod svm;
#[cfg(test)]
mod tests;
