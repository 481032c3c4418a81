//! What the words of a study's page mean.

use super::super::text::escape;
use crate::Study;

/// For one kind of study or for all: word and meaning.
const TERMS: [(Option<Study>, &str, &str); 18] = [
    (
        None,
        "95 % interval",
        "Of the mean over tasks. Where tasks share training sweeps it is widened for that (Nadeau and Bengio, 2003). Draws of new materials all come from one data set: their interval says nothing about other data sets.",
    ),
    (
        None,
        "Shots",
        "Sweeps of every new material that are learnt from.",
    ),
    (
        Some(Study::Nshot),
        "OL, OL-FCL, OL-mean",
        "The network learnt on the known materials stays as it is but for its output layer; or its last two layers; or the output layer is drawn towards the known materials' weights (thesis, section 4.6). As a prior mean that all classes share changes no softmax, OL-mean differs from OL by the strength of the prior alone.",
    ),
    (
        Some(Study::Nshot),
        "NK",
        "No pre-knowledge: a whole network learns the new materials alone. It is trained in one fold of every draw (or in as many as the recipe says), the other methods in all five.",
    ),
    (
        Some(Study::Nshot),
        "SimpleShot, LDA, whitened OL, tuned OL",
        "Nearest class mean of centred, normalised features (Wang et al., 2019); nearest class mean, and an output layer, on features whitened with the known materials' covariance; an output layer on plain features. Strengths are chosen on known materials.",
    ),
    (
        Some(Study::Unknown),
        "AUROC",
        "Chance that a sweep of an unknown material looks stranger than one of a known material.",
    ),
    (
        Some(Study::Unknown),
        "False alarms, detected",
        "Share of known and of unknown sweeps above a threshold that sweeps of known materials, which nothing was trained on, set for 5 % false alarms.",
    ),
    (
        Some(Study::Unknown),
        "Conformal set",
        "All labels whose probability is above a calibrated bound; it holds the true one as often as its target says.",
    ),
    (
        Some(Study::Enrolment),
        "Known, before, after, lost",
        "Accuracy on test sweeps of the known materials before and after one more was added, and the difference.",
    ),
    (
        Some(Study::FeatureMaps),
        "Purity",
        "Share of the five nearest sweeps that are of the same material, in the whole space or in the plane that t-SNE makes of it.",
    ),
    (
        Some(Study::Sequential),
        "Until 0.99, fixed 3",
        "Sweeps are fused until the most probable material has this probability, at most ten. Fixed 3: three sweeps in any case.",
    ),
    (
        Some(Study::Nshot),
        "NN, Siamese",
        "Nearest neighbour in the embedding; the same after the dense layer (not, as in the thesis, the whole network) was trained on pairs of known sweeps, so that sweeps of one material come close (contrastive loss).",
    ),
    (
        Some(Study::Nshot),
        "OL-FCL",
        "150 steps of Adam from the network's own dense layer; unlike the output layers alone, this has no end at which a gradient vanishes.",
    ),
    (
        Some(Study::Differentiate),
        "Siamese",
        "Two frozen networks, the Euclidean distance between their outputs, and a small network from it to the answer: as published. Every output: the small network sees the difference of every output instead.",
    ),
    (
        Some(Study::Differentiate),
        "Posterior, threshold",
        "Chance that two labels drawn from both sweeps' probabilities differ; logistic regression on the distance of embeddings.",
    ),
    (
        Some(Study::Differentiate),
        "Hard pairs",
        "Seven pairs of TactMat's materials that humans were asked about (thesis, section 4.5.3); questions with the answer 'same' come from the same eleven materials.",
    ),
    (
        Some(Study::Unknown),
        "Energy, largest probability, mutual information, whitened distance",
        "Four scores that grow with strangeness: minus the log of the summed exponentials of the outputs; minus the log of the largest probability; how much dropout masks disagree; distance to the nearest class mean, whitened with the known sweeps' covariance.",
    ),
    (
        Some(Study::Enrolment),
        "Knowledge prior; a tenth of it; knowledge mean, weak",
        "The new row is drawn towards the mean of the known rows, with the precision of their spread; with a tenth of that precision; with the strength of the network's own L2.",
    ),
];

pub(super) fn terms(kind: Study) -> String {
    let terms: String = TERMS
        .iter()
        .filter(|(own, _, _)| own.is_none_or(|own| own == kind))
        .map(|(_, term, meaning)| {
            format!(
                "<div><dt>{}</dt><dd>{}</dd></div>\n",
                escape(term),
                escape(meaning)
            )
        })
        .collect();
    format!("<dl class=\"glossary\">\n{terms}</dl>\n")
}
