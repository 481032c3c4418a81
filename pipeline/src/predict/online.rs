//! Online classifier: frames in, beliefs out, without clock or threads.
//!
//! ```text
//! frame -> Normalizer -> StreamingNet --plain----------> probabilities of the sweep so far ─┐
//!                                     └─Monte Carlo────> probabilities, strangeness ────────┴─> fused belief
//! ```
//!
//! Normaliser, dropout masks, softmax, fusion and thresholds are those of the offline [`Classifier`]. Only the network is another implementation
//! with the same weights; its results agree to 1e-4, tested over whole data sets. Nothing allocates after [`OnlineClassifier::new`].

use tactnet_models::{
    Belief, StreamingNet, entropy, log_mean_exp_into, log_softmax_into, mutual_information,
};

use super::long_online::{LongSweep, add_log, mean_log};
use crate::{
    Calibration, Classifier, ClassifierConfig, DeadTaxels, Normalizer, NoveltyScore, PipelineError,
};

/// Classifies one sweep at a time and fuses the sweeps of one object.
#[derive(Debug)]
pub struct OnlineClassifier {
    config: ClassifierConfig,
    calibration: Option<Calibration>,
    normalizer: Normalizer,
    /// Masked taxels of the offline classifier.
    dead: DeadTaxels,
    net: StreamingNet,
    /// Windows of a sweep that is longer than the training sweeps.
    long: LongSweep,
    /// `[taxels]`
    frame: Vec<f32>,
    /// Plain scores of the newest window, then their mean over the windows; `[materials]`.
    scores: Vec<f32>,
    /// Logarithms of the probabilities by these scores, `[materials]`.
    novelty_log_p: Vec<f64>,
    /// Latest belief, `[materials]`.
    log_probability: Vec<f64>,
    /// `[mc_samples][materials]`
    mc_samples: Vec<f64>,
    /// Novelty score from the plain scores of this sweep.
    plain_strangeness: Option<f64>,
    /// Novelty score of the latest belief.
    strangeness: Option<f64>,
    /// Sum of the novelty scores of the complete sweeps of this object, and their number.
    object_strangeness: (f64, usize),
    fused: Belief,
}

/// Belief from one sweep or its beginning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SweepBelief<'a> {
    /// Natural logarithms of the probabilities, `[materials]`.
    pub log_probability: &'a [f64],
    /// Entropy of the probabilities, in nats.
    pub entropy: f64,
    /// Novelty score; absent without a calibration, and in a plain belief if the calibration uses dropout masks.
    pub strangeness: Option<f64>,
    /// Threshold of the novelty score; absent without a calibration.
    pub threshold: Option<f64>,
    /// True if the material is unknown; absent without a novelty score.
    pub unknown: Option<bool>,
}

impl OnlineClassifier {
    /// Creates an online classifier for sweeps of the same shape and rate as `classifier`'s.
    ///
    /// - `calibration`: thresholds for unknown materials
    /// - `mc_samples`: number of Monte Carlo dropout masks, the first ones of the offline classifier; 0: plain beliefs only
    ///
    /// # Errors
    /// A model that needs the complete sweep (a baseline, a network without levels); a novelty score that has no online form.
    pub fn new(
        classifier: &Classifier,
        calibration: Option<Calibration>,
        mc_samples: usize,
    ) -> Result<Self, PipelineError> {
        let incompatible = |expected: &str, found: &str| {
            PipelineError::incompatible("online classification", expected, found)
        };
        let scorer = classifier.scorer()?;
        scorer.check_masks(mc_samples)?;
        let normalizer = scorer.normalizer().clone();
        if normalizer.needs_whole_sweep() {
            return Err(incompatible(
                "levels to be kept",
                "to remove a sweep's levels, which are known only when it has ended",
            ));
        }
        match calibration.as_ref().map(|calibration| calibration.score) {
            Some(NoveltyScore::WhitenedDistance) => {
                return Err(incompatible(
                    "another measure of strangeness",
                    "the whitened distance",
                ));
            }
            Some(NoveltyScore::MutualInformation)
                if mc_samples != 0 && mc_samples != crate::network::novelty::MC_SAMPLES =>
            {
                return Err(incompatible(
                    "as many dropout masks as its calibration, 100, or none",
                    &mc_samples.to_string(),
                ));
            }
            _ => {}
        }
        let config = classifier.config().clone();
        let materials = config.labels.len();
        Ok(Self {
            net: scorer.streaming(mc_samples),
            long: LongSweep::new(config.longest_trained(), normalizer.taxels(), materials),
            scores: vec![0.0; materials],
            novelty_log_p: vec![0.0; materials],
            frame: vec![0.0; normalizer.taxels()],
            log_probability: vec![0.0; materials],
            mc_samples: vec![0.0; mc_samples * materials],
            plain_strangeness: None,
            strangeness: None,
            object_strangeness: (0.0, 0),
            fused: Belief::flat(materials),
            normalizer,
            dead: classifier.dead().clone(),
            calibration,
            config,
        })
    }

    /// Returns the configuration: materials, shape and rate.
    pub fn config(&self) -> &ClassifierConfig {
        &self.config
    }

    /// Returns the masked taxels with their readings.
    pub fn dead(&self) -> &DeadTaxels {
        &self.dead
    }

    /// Returns the number of dropout masks.
    pub fn mc_samples(&self) -> usize {
        self.net.mc_samples()
    }

    /// Discards the current sweep; the next frame is the first of a new one.
    pub fn begin(&mut self) {
        self.plain_strangeness = None;
        self.net.restart();
        self.long.restart();
    }

    /// Adds the next frame of the sweep. A sweep may be longer than all training sweeps: beliefs are then means over windows of their
    /// length, as those of [`Classifier::log_probabilities`]. Such a sweep takes the time of a whole window once every half window.
    ///
    /// - `digits`: one value per taxel, as recorded; a value for each condition of the training sweeps may follow, otherwise they are
    ///   unknown
    ///
    /// # Panics
    /// If the number of taxels differs.
    pub fn push(&mut self, digits: &[f32]) {
        let given = digits.len();
        let skin = self.frame.len() - self.normalizer.conditions();
        assert!(
            given == skin || given == self.frame.len(),
            "taxels of a frame"
        );
        self.frame[..given].copy_from_slice(digits);
        self.frame[given..].copy_from_slice(&self.normalizer.offset()[given..]);
        self.dead.apply(&mut self.frame, self.normalizer.taxels());
        self.normalizer.apply_to_frame(&mut self.frame);
        if self.long.ends_window() {
            self.sum_window();
        }
        self.long.push(&mut self.net, &self.frame);
    }

    /// Adds the window that ends with the newest frame to the sums of the sweep.
    fn sum_window(&mut self) {
        self.long.load_newest(&mut self.net);
        self.classify_window();
        for (sum, score) in self.long.scores.iter_mut().zip(&self.scores) {
            *sum += score;
        }
        add_log(&mut self.long.plain, &self.log_probability);
        if self.mc_samples() > 0 {
            self.long.information += self.classify_window_by_dropout();
            add_log(&mut self.long.dropout, &self.log_probability);
        }
        self.long.windows += 1;
    }

    /// Sets scores and belief to those of the window in the network, without dropout.
    fn classify_window(&mut self) {
        let (scores, log_probability) = (&mut self.scores, &mut self.log_probability);
        self.net.scores(|of_window| {
            scores.copy_from_slice(of_window);
            log_softmax_into(of_window, log_probability);
        });
    }

    /// Sets the belief to that of the window in the network by Monte Carlo dropout, and returns its mutual information.
    fn classify_window_by_dropout(&mut self) -> f64 {
        let mut rows = self.mc_samples.chunks_exact_mut(self.log_probability.len());
        self.net.monte_carlo_scores(|scores| {
            if let Some(row) = rows.next() {
                log_softmax_into(scores, row);
            }
        });
        log_mean_exp_into(&self.mc_samples, &mut self.log_probability);
        mutual_information(&self.mc_samples, &self.log_probability)
    }

    /// Returns the number of frames of this sweep so far.
    pub fn frames(&self) -> usize {
        self.long.frames()
    }

    /// Returns true if the sweep has at least as many frames as the longest training sweep.
    pub fn is_complete(&self) -> bool {
        self.frames() >= self.config.longest_trained()
    }

    /// Returns the belief from the sweep so far, without dropout. After the last frame it equals the offline classifier's prediction, also of a
    /// sweep that ends early, if the classifier was trained on sweeps of unequal length.
    ///
    /// # Panics
    /// Before the first frame.
    pub fn classify(&mut self) -> SweepBelief<'_> {
        self.long.load_newest(&mut self.net);
        self.classify_window();
        self.plain_strangeness = self.plain_novelty();
        mean_log(
            &self.long.plain,
            self.long.windows,
            &mut self.log_probability,
        );
        self.belief(None)
    }

    /// Returns the novelty score of the mean scores of all windows; `None` if the calibration uses none of them.
    fn plain_novelty(&mut self) -> Option<f64> {
        let score = self.calibration.as_ref()?.score;
        let windows = (self.long.windows + 1) as f32;
        for (score, sum) in self.scores.iter_mut().zip(&self.long.scores) {
            *score = (*score + sum) / windows;
        }
        let log_p = &mut self.novelty_log_p;
        log_softmax_into(&self.scores, log_p);
        match score {
            NoveltyScore::Energy => Some(log_p[0] - f64::from(self.scores[0])),
            NoveltyScore::LargestProbability => {
                Some(-log_p.iter().copied().fold(f64::NEG_INFINITY, f64::max))
            }
            NoveltyScore::MutualInformation | NoveltyScore::WhitenedDistance => None,
        }
    }

    /// Returns the belief from the sweep so far by Monte Carlo dropout.
    ///
    /// # Panics
    /// Before the first frame; without masks.
    pub fn classify_by_dropout(&mut self) -> SweepBelief<'_> {
        self.long.load_newest(&mut self.net);
        let windows = self.long.windows;
        let information = self.classify_window_by_dropout() + self.long.information;
        mean_log(&self.long.dropout, windows, &mut self.log_probability);
        self.belief(Some(information / (windows + 1) as f64))
    }

    fn belief(&mut self, information: Option<f64>) -> SweepBelief<'_> {
        // All scores except the mutual information are defined on the plain scores.
        let strangeness = match self.calibration.as_ref().map(|c| c.score) {
            Some(NoveltyScore::MutualInformation) => information,
            _ => self.plain_strangeness,
        };
        self.strangeness = strangeness;
        let log_p = &self.log_probability;
        let threshold = self.calibration.as_ref().map(|c| c.threshold);
        SweepBelief {
            log_probability: log_p,
            entropy: entropy(log_p),
            strangeness,
            threshold,
            unknown: strangeness
                .zip(threshold)
                .map(|(strangeness, threshold)| strangeness > threshold),
        }
    }

    /// Adds the novelty score of the latest belief to the object's. Call it once for every complete sweep, also of an unknown material.
    pub fn end_sweep(&mut self) {
        if let Some(strangeness) = self.strangeness {
            self.object_strangeness.0 += strangeness;
            self.object_strangeness.1 += 1;
        }
    }

    /// Returns true if the object is of an unknown material, by the mean novelty score of its complete sweeps; `None` before the first, and without
    /// [`Calibration::object_thresholds`].
    pub fn object_is_unknown(&self) -> Option<bool> {
        let (sum, sweeps) = self.object_strangeness;
        let calibration = self.calibration.as_ref()?;
        calibration.object_is_unknown(sum / sweeps as f64, sweeps)
    }

    /// Fuses the latest belief with the earlier sweeps of the same object.
    pub fn fuse(&mut self) {
        self.fused.fuse(&self.log_probability);
    }

    /// Returns true if the classifier can detect unknown materials.
    pub fn tells_unknown(&self) -> bool {
        self.calibration.as_ref().is_some_and(|calibration| {
            calibration.score != NoveltyScore::MutualInformation || self.mc_samples() > 0
        })
    }

    /// Copies the fused belief of `former` if the materials are the same; returns true if so.
    pub fn take_fused(&mut self, former: &Self) -> bool {
        let same = self.config.labels == former.config.labels;
        if same {
            self.fused = former.fused.clone();
        }
        same
    }

    /// Returns the fused belief of the object's sweeps.
    pub fn fused(&self) -> &Belief {
        &self.fused
    }

    /// Discards the fused belief, for the next object.
    pub fn reset(&mut self) {
        self.fused.reset();
        self.object_strangeness = (0.0, 0);
    }
}
