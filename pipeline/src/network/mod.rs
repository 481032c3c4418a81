//! Training of TactNet-II and of small networks on its features, embeddings, novelty scores.

pub(crate) mod adam;
#[cfg(any(feature = "vulkan", feature = "cuda"))]
pub(crate) mod adam_state;
pub(crate) mod batch_report;
pub(crate) mod batches;
pub(crate) mod checkpoint;
pub(crate) mod embedding;
pub(crate) mod fit_mlp;
pub(crate) mod in_pool;
pub(crate) mod measured;
pub(crate) mod network_scorer;
pub(crate) mod novelty;
pub(crate) mod objective;
pub(crate) mod pairs_pass;
pub(crate) mod resident;
pub(crate) mod soft_targets;
#[cfg(any(feature = "vulkan", feature = "cuda"))]
pub(crate) mod stacked;
pub(crate) mod train_embeddings;
pub(crate) mod train_network;
pub(crate) mod training;
