//! Novelty scores of a committee.

use tactnet_data::SweepView;
use tactnet_models::mutual_information;

use super::fitted::{Committee, by_sweep};
use crate::predict::judged_sweeps::JudgedSweeps;
use crate::{NoveltyScore, PipelineError, PredictionMethod};

impl Committee {
    /// Scores sweeps by the plain posteriors of the members.
    ///
    /// The mutual information is that of material and member: how much the members disagree (Lakshminarayanan et al., 2017).
    ///
    /// # Errors
    /// Sweeps of another shape or rate; a score that needs the layers of a network.
    pub(crate) fn judge(
        &self,
        score: NoveltyScore,
        view: &SweepView<'_>,
    ) -> Result<JudgedSweeps, PipelineError> {
        let novelty = match score {
            NoveltyScore::MutualInformation => mutual_information,
            NoveltyScore::LargestProbability => largest_probability,
            NoveltyScore::Energy | NoveltyScore::WhitenedDistance => {
                let expected = "a score of its members' probabilities";
                let error = PipelineError::incompatible("novelty score", expected, score.name());
                return Err(error);
            }
        };
        let of_members = self.member_log_probabilities(view, PredictionMethod::Plain)?;
        let judged = by_sweep(&of_members, |members, mean| (novelty(members, &mean), mean));
        let (scores, log_probabilities) = judged.into_iter().unzip();
        Ok(JudgedSweeps {
            scores,
            log_probabilities,
            labels: view.labels().collect(),
        })
    }
}

/// Returns the negative logarithm of the largest mean probability.
fn largest_probability(_members: &[f64], mean: &[f64]) -> f64 {
    -mean.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_that_contradict_each_other_are_novel_and_those_that_agree_are_not() {
        let logs = |p: [f64; 2]| vec![p.map(f64::ln).to_vec()];
        let scores = |members: &[Vec<Vec<f64>>]| {
            let of = |members: &[f64], mean: Vec<f64>| {
                let largest = largest_probability(members, &mean);
                (mutual_information(members, &mean), largest)
            };
            by_sweep(members, of)[0]
        };
        let entropy = -(0.9 * 0.9_f64.ln() + 0.1 * 0.1_f64.ln());
        let (disagreement, largest) = scores(&[logs([0.9, 0.1]), logs([0.1, 0.9])]);
        assert!((disagreement - (2.0_f64.ln() - entropy)).abs() < 1e-12);
        assert!((largest - 2.0_f64.ln()).abs() < 1e-12, "{largest}");
        let (disagreement, largest) = scores(&[logs([0.9, 0.1]), logs([0.9, 0.1])]);
        assert!(disagreement.abs() < 1e-12, "{disagreement}");
        assert!((largest + 0.9_f64.ln()).abs() < 1e-12, "{largest}");
    }
}
