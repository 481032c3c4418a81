//! What the words and numbers of the page mean.

const TERMS: [(&str, &str); 12] = [
    (
        "1 sweep",
        "The material is told from one stroke of the sensor over it.",
    ),
    (
        "3 sweeps",
        "Three sweeps of one material are judged one by one, and their scores are fused by Bayes' rule as if independent.",
    ),
    (
        "sd and 95 % interval",
        "The standard deviation is that over folds. The interval is the mean's, widened because training sets of different folds \
         overlap (Nadeau and Bengio, 2003).",
    ),
    (
        "\u{3c3}<sub>test</sub>",
        "How much one fold's accuracy would scatter merely because its test sweeps are finite in number: \
         \u{221a}(a (1 \u{2212} a) / n). An sd near it says that folds differ by little else.",
    ),
    (
        "Random draws",
        "Every fold of every model starts from the same seed: initial weights, order of sweeps, dropout and random kernels are drawn alike \
         in all folds. Means and intervals hold for these draws; another seed would move them a little.",
    ),
    (
        "Corrected resampled t-test",
        "A paired t-test over folds whose variance is widened in the same way. A small p says that a difference this large would be \
         rare if the two were equally good.",
    ),
    (
        "MC dropout",
        "Dropout stays on while predicting; the scores are the mean over many random passes.",
    ),
    (
        "NLL",
        "Negative log-likelihood of the true material, in nats, mean over sweeps. Confident mistakes cost most.",
    ),
    (
        "ECE",
        "Expected calibration error: the mean gap between confidence and accuracy over 15 bins of confidence, weighted by sweeps.",
    ),
    (
        "Brier",
        "Squared distance between the scores and the truth, summed over materials, 0 to 2, mean over sweeps.",
    ),
    (
        "Levels kept, removed",
        "Whether the mean of each taxel stays in a sweep. With levels removed each taxel's mean is subtracted from every sweep; \
         what goes with the level, such as how strongly it fluctuates, stays.",
    ),
    (
        "Probe",
        "A deliberately poor classifier, or one trained on permuted labels: it shows what a score is worth on this data set.",
    ),
];

pub(super) fn section() -> String {
    let terms: String = TERMS
        .iter()
        .map(|(term, meaning)| format!("<div><dt>{term}</dt><dd>{meaning}</dd></div>\n"))
        .collect();
    format!("<dl class=\"glossary\">\n{terms}</dl>\n")
}
