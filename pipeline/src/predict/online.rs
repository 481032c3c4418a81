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
    /// `[taxels]`
    frame: Vec<f32>,
    /// Latest belief, `[materials]`.
    log_probability: Vec<f64>,
    /// `[mc_samples][materials]`
    mc_samples: Vec<f64>,
    /// Negative energy of the latest belief.
    log_total: f64,
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
            frame: vec![0.0; normalizer.taxels()],
            log_probability: vec![0.0; materials],
            mc_samples: vec![0.0; mc_samples * materials],
            log_total: 0.0,
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
    }

    /// Adds the next frame of the window.
    ///
    /// - `digits`: one value per taxel, as recorded; a value for each condition of the training sweeps may follow, otherwise they are
    ///   unknown
    ///
    /// # Panics
    /// If the number of taxels differs, or after the last frame.
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
        self.net.push(&self.frame);
    }

    /// Returns the number of frames of this sweep so far.
    pub fn frames(&self) -> usize {
        self.net.frames()
    }

    /// Returns true if the sweep has as many frames as the longest training sweep.
    pub fn is_complete(&self) -> bool {
        self.frames() >= self.config.longest_trained()
    }

    /// Returns the belief from the sweep so far, without dropout. After the last frame it equals the offline classifier's prediction, also of a
    /// sweep that ends early, if the classifier was trained on sweeps of unequal length.
    ///
    /// # Panics
    /// Before the first frame.
    pub fn classify(&mut self) -> SweepBelief<'_> {
        let Self {
            net,
            log_probability,
            log_total,
            ..
        } = self;
        net.scores(|scores| {
            log_softmax_into(scores, log_probability);
            *log_total = f64::from(scores[0]) - log_probability[0];
        });
        let largest = self.log_probability.iter().copied();
        let largest = largest.fold(f64::NEG_INFINITY, f64::max);
        self.plain_strangeness = match self.calibration.as_ref().map(|c| c.score) {
            Some(NoveltyScore::Energy) => Some(-self.log_total),
            Some(NoveltyScore::LargestProbability) => Some(-largest),
            _ => None,
        };
        self.belief(None)
    }

    /// Returns the belief from the sweep so far by Monte Carlo dropout.
    ///
    /// # Panics
    /// Before the first frame; without masks.
    pub fn classify_by_dropout(&mut self) -> SweepBelief<'_> {
        let materials = self.log_probability.len();
        let mut rows = self.mc_samples.chunks_exact_mut(materials);
        self.net.monte_carlo_scores(|scores| {
            if let Some(row) = rows.next() {
                log_softmax_into(scores, row);
            }
        });
        log_mean_exp_into(&self.mc_samples, &mut self.log_probability);
        let information = mutual_information(&self.mc_samples, &self.log_probability);
        self.belief(Some(information))
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
