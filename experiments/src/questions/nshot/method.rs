//! Transfer methods that learn new materials from few sweeps.

use serde::{Deserialize, Serialize};

/// A transfer method that learns new materials from few sweeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TransferMethod {
    /// A network trained from scratch, without prior knowledge (thesis, section 4.6.1).
    Nk,
    /// Fine-tuning of the output layer (4.6.1): softmax regression on the embedding, with the network's own L2.
    Ol,
    /// Fine-tuning of the dense and the output layer (4.6.1).
    OlFcl,
    /// Output layer with the prior of the known classes (4.6.3; Bauer et al., 2017).
    OlMean,
    /// Nearest neighbour in the embedding (4.6.2).
    Nn,
    /// Nearest neighbour in an embedding whose dense layer was trained on pairs.
    Siamese,
    /// Nearest neighbour in the embedding of a network trained on pairs only (4.6.2; Koch et al., 2015).
    SiameseFull,
    /// Nearest class mean, centred and normalised (Wang et al., 2019).
    Simpleshot,
    /// Nearest class mean after whitening with the covariance of the known classes (linear discriminant analysis).
    Lda,
    /// Output layer on whitened features, with a prior strength selected on known classes.
    WhitenedOl,
    /// Output layer on plain features, with a prior strength selected on known classes.
    TunedOl,
}

impl TransferMethod {
    /// All methods, those of the thesis first.
    pub const ALL: [Self; 11] = [
        Self::Nk,
        Self::Ol,
        Self::OlFcl,
        Self::OlMean,
        Self::Nn,
        Self::Siamese,
        Self::SiameseFull,
        Self::Simpleshot,
        Self::Lda,
        Self::TunedOl,
        Self::WhitenedOl,
    ];

    /// Returns the name in recipes and results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nk => "nk",
            Self::Ol => "ol",
            Self::OlFcl => "ol-fcl",
            Self::OlMean => "ol-mean",
            Self::Nn => "nn",
            Self::Siamese => "siamese",
            Self::SiameseFull => "siamese-full",
            Self::Simpleshot => "simpleshot",
            Self::Lda => "lda",
            Self::WhitenedOl => "whitened-ol",
            Self::TunedOl => "tuned-ol",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_called_in_results_what_recipes_call_them() {
        for method in TransferMethod::ALL {
            assert_eq!(serde_json::to_value(method).unwrap(), method.name());
        }
    }
}
