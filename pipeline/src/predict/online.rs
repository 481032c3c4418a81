//! The online classifier: frame in, belief out; no clock, no threads.
//!
//! ```text
//! frame -> Normalizer -> StreamingNet --plain----------> probabilities of the sweep so far ─┐
//!                                     └─Monte Carlo────> probabilities, strangeness ────────┴─> fused belief
//! ```
//!
//! Normaliser, dropout masks, softmax, fusion and verdict are those of the offline [`Classifier`]; only the network is another form of the same weights,
//! and gives the same numbers (to 1e-4, tested over whole data sets). Nothing allocates after [`OnlineClassifier::new`].

use tactnet_models::{
    Belief, StreamingNet, entropy, log_mean_exp_into, log_softmax_into, mutual_information,
};

use crate::{Calibration, Classifier, ClassifierConfig, Normalizer, NoveltyScore, PipelineError};

/// Follows one sweep at a time, and fuses the sweeps of one object.
#[derive(Debug)]
pub struct OnlineClassifier {
    config: ClassifierConfig,
    calibration: Option<Calibration>,
    normalizer: Normalizer,
    net: StreamingNet,
    /// `[taxels]`
    frame: Vec<f32>,
    /// `[materials]`: the newest belief
    log_probability: Vec<f64>,
    /// `[mc_samples][materials]`
    mc_samples: Vec<f64>,
    /// Minus the energy of the newest belief.
    log_total: f64,
    /// NoveltyScorer by the plain scores of this sweep.
    plain_strangeness: Option<f64>,
    /// Of the newest belief.
    strangeness: Option<f64>,
    /// Sum over the whole sweeps of this object, and their number.
    object_strangeness: (f64, usize),
    fused: Belief,
}

/// What one sweep, or its beginning, says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SweepBelief<'a> {
    /// `[materials]`, natural log; the exponentials sum to one.
    pub log_probability: &'a [f64],
    /// Of those probabilities, nats.
    pub entropy: f64,
    /// Larger for stranger sweeps; absent without a calibration, and in a plain belief whose calibration asks for dropout masks.
    pub strangeness: Option<f64>,
    /// What the strangeness is compared with; absent without a calibration.
    pub threshold: Option<f64>,
    /// True if the material is none that the classifier knows, where the strangeness is there to tell.
    pub unknown: Option<bool>,
}

impl OnlineClassifier {
    /// For sweeps of the shape and rate of `classifier`'s.
    ///
    /// - `calibration`: tells unknown materials, see [`Calibration`]
    /// - `mc_samples`: Monte Carlo dropout masks, the first so many of the offline classifier's; 0: plain beliefs only
    ///
    /// # Errors
    /// A model that needs the whole sweep (a baseline, a network without levels); a strangeness that cannot be had online.
    pub fn new(
        classifier: &Classifier,
        calibration: Option<Calibration>,
        mc_samples: usize,
    ) -> Result<Self, PipelineError> {
        let incompatible = |expected: &str, found: &str| PipelineError::Incompatible {
            item: "online classification".into(),
            expected: expected.into(),
            found: found.into(),
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
            calibration,
            config,
        })
    }

    /// Materials, shape and rate.
    pub fn config(&self) -> &ClassifierConfig {
        &self.config
    }

    /// Number of dropout masks.
    pub fn mc_samples(&self) -> usize {
        self.net.mc_samples()
    }

    /// Forgets the sweep that is going on; the next frame is the first of a new one.
    pub fn begin(&mut self) {
        self.plain_strangeness = None;
        self.net.restart();
    }

    /// Takes the next frame of the window.
    ///
    /// - `digits`: `[taxels]`, as recorded
    ///
    /// # Panics
    /// With another number of taxels; after the last frame.
    pub fn push(&mut self, digits: &[f32]) {
        self.frame.copy_from_slice(digits);
        self.normalizer.apply_to_frame(&mut self.frame);
        self.net.push(&self.frame);
    }

    /// Frames of this sweep so far.
    pub fn frames(&self) -> usize {
        self.net.frames()
    }

    /// Returns true if the sweep is whole.
    pub fn is_complete(&self) -> bool {
        self.net.is_complete()
    }

    /// Returns the belief from the sweep so far, without dropout. After the last frame these are the offline classifier's probabilities.
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

    /// Returns the belief from the sweep so far, by Monte Carlo dropout.
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
        // All but the mutual information are defined on the plain scores, and hold for the sweep.
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

    /// Counts the strangeness of the newest belief for the object; to be called once for every whole sweep, of unknown materials, too.
    pub fn end_sweep(&mut self) {
        if let Some(strangeness) = self.strangeness {
            self.object_strangeness.0 += strangeness;
            self.object_strangeness.1 += 1;
        }
    }

    /// Returns whether the object is none of the materials, by the mean strangeness of its whole sweeps; `None` before the first, and
    /// without thresholds for objects, see [`Calibration::object_thresholds`].
    pub fn object_is_unknown(&self) -> Option<bool> {
        let (sum, sweeps) = self.object_strangeness;
        let calibration = self.calibration.as_ref()?;
        calibration.object_is_unknown(sum / sweeps as f64, sweeps)
    }

    /// Adds the newest belief to what former sweeps of the same object said.
    pub fn fuse(&mut self) {
        self.fused.fuse(&self.log_probability);
    }

    /// Returns true if it can tell unknown materials.
    pub fn tells_unknown(&self) -> bool {
        self.calibration.as_ref().is_some_and(|calibration| {
            calibration.score != NoveltyScore::MutualInformation || self.mc_samples() > 0
        })
    }

    /// Takes over what was fused, where the materials are the same; gives whether that was possible.
    pub fn take_fused(&mut self, former: &Self) -> bool {
        let same = self.config.labels == former.config.labels;
        if same {
            self.fused = former.fused.clone();
        }
        same
    }

    /// Returns the belief from the fused sweeps together.
    pub fn fused(&self) -> &Belief {
        &self.fused
    }

    /// The next sweep is of another object.
    pub fn reset(&mut self) {
        self.fused.reset();
        self.object_strangeness = (0.0, 0);
    }
}
