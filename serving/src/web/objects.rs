//! Objects that were touched: predicted material, true material if known, and the score.

use std::collections::VecDeque;

use serde::Serialize;

/// Number of outcomes kept for the page.
const KEPT_OUTCOMES: usize = 24;

/// Predicted material of an object.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Prediction {
    /// Predicted material; `None` if unknown.
    pub(super) material: Option<String>,
    /// The most probable trained material; equal to `material` unless that is `None`.
    pub(super) nearest: String,
    /// Probability of `nearest`, 0 to 1.
    pub(super) probability: f32,
}

/// The object under the finger, from one reset to the next.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(super) struct Object {
    /// Number of the object, from 1.
    number: u64,
    /// True material, if a command names it.
    truth: Option<String>,
    /// True if the network was trained on that material.
    taught: bool,
    /// True if the commands since the reset name more than one material.
    several: bool,
    /// Number of classified sweeps.
    sweeps: u32,
    /// Prediction after the newest complete sweep.
    answer: Option<Prediction>,
    /// True if the prediction is correct; `None` without a true material or prediction.
    right: Option<bool>,
}

/// Number of correct predictions of finished objects with a known material.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(super) struct Score {
    right: u64,
    all: u64,
    /// Number of objects of untrained materials, and of those predicted unknown; included in the totals above.
    new_right: u64,
    new_all: u64,
    /// The newest outcomes, oldest first.
    marks: VecDeque<bool>,
}

/// The current object, and the score of those before it.
#[derive(Debug, Default)]
pub(super) struct Objects {
    pub(super) object: Object,
    pub(super) score: Score,
}

impl Objects {
    /// Records the start of a sweep over a known material.
    ///
    /// - `taught`: trained materials of the network
    pub(super) fn start_sweep(&mut self, material: &str, taught: &[String]) {
        let object = &mut self.object;
        if material.is_empty() {
            return;
        }
        object.number = object.number.max(1);
        object.several |= object
            .truth
            .as_deref()
            .is_some_and(|truth| truth != material);
        object.truth = Some(material.into());
        object.taught = taught.iter().any(|name| name == material);
    }

    /// Records the prediction of a complete sweep.
    ///
    /// - `answer`: prediction from all sweeps of the object
    pub(super) fn judge(&mut self, answer: Prediction) {
        let object = &mut self.object;
        object.number = object.number.max(1);
        object.sweeps += 1;
        object.right = object
            .truth
            .as_ref()
            .filter(|_| !object.several)
            .map(|truth| match &answer.material {
                Some(material) => material == truth,
                None => !object.taught,
            });
        object.answer = Some(answer);
    }

    /// Starts the next object. Returns the finished one if it was classified.
    pub(super) fn next(&mut self) -> Option<Object> {
        if self.object.sweeps == 0 {
            // An object without a prediction is not counted.
            self.object.truth = None;
            self.object.several = false;
            return None;
        }
        let next = Object {
            number: self.object.number + 1,
            ..Object::default()
        };
        let object = std::mem::replace(&mut self.object, next);
        if let Some(right) = object.right {
            let score = &mut self.score;
            score.all += 1;
            score.right += u64::from(right);
            if !object.taught {
                score.new_all += 1;
                score.new_right += u64::from(right);
            }
            score.marks.push_back(right);
            if score.marks.len() > KEPT_OUTCOMES {
                score.marks.pop_front();
            }
        }
        Some(object)
    }
}

impl Object {
    /// Returns true if the prediction is correct; `None` without a true material or prediction.
    pub(super) fn right(&self) -> Option<bool> {
        self.right
    }

    /// Returns the number of classified sweeps.
    pub(super) fn sweeps(&self) -> u32 {
        self.sweeps
    }

    /// Returns the true material, if a command names it.
    pub(super) fn truth(&self) -> Option<&str> {
        self.truth.as_deref()
    }

    /// Returns one line of text, such as `object 3: said cork (97 %) after 3 sweeps, it was wood`.
    pub(super) fn line(&self) -> String {
        let said = match &self.answer {
            Some(answer) => answer.line(),
            None => "nothing".into(),
        };
        let was = match &self.truth {
            Some(_) if self.several => ", several materials were touched".into(),
            Some(truth) => format!(", it was {truth}"),
            None => String::new(),
        };
        let plural = if self.sweeps == 1 { "" } else { "s" };
        format!(
            "object {}: said {said} after {} sweep{plural}{was}",
            self.number, self.sweeps
        )
    }
}

impl Prediction {
    /// Returns `cork (97 %)`, or `unknown material`.
    pub(super) fn line(&self) -> String {
        match &self.material {
            Some(material) => format!("{material} ({:.0} %)", 100.0 * self.probability),
            None => "unknown material".into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn says(material: Option<&str>) -> Prediction {
        Prediction {
            material: material.map(Into::into),
            nearest: material.unwrap_or("cork").into(),
            probability: 0.974,
        }
    }

    fn touch(objects: &mut Objects, truth: &str, said: Option<&str>) -> Option<Object> {
        let taught = ["cork".to_string(), "wood".to_string()];
        for _ in 0..3 {
            objects.start_sweep(truth, &taught);
            objects.judge(says(said));
        }
        objects.next()
    }

    #[test]
    fn an_object_counts_once_and_unknown_is_right_for_what_was_not_taught() {
        let mut objects = Objects::default();
        assert_eq!(objects.next(), None);
        let first = touch(&mut objects, "cork", Some("cork")).unwrap();
        assert_eq!(
            first.line(),
            "object 1: said cork (97 %) after 3 sweeps, it was cork"
        );
        assert_eq!(first.right(), Some(true));
        touch(&mut objects, "cork", Some("wood"));
        touch(&mut objects, "cork", None);
        touch(&mut objects, "metal", None);
        touch(&mut objects, "metal", Some("wood"));
        let Score {
            right,
            all,
            new_right,
            new_all,
            marks,
        } = &objects.score;
        assert_eq!((*right, *all, *new_right, *new_all), (2, 5, 1, 2));
        assert_eq!(*marks, [true, false, false, true, false]);
    }

    #[test]
    fn without_one_truth_nothing_is_scored() {
        let mut objects = Objects::default();
        let taught = ["cork".to_string(), "wood".to_string()];
        objects.judge(says(Some("cork")));
        assert_eq!(
            objects.next().unwrap().line(),
            "object 1: said cork (97 %) after 1 sweep"
        );
        // The reset command for the second object is missing.
        objects.start_sweep("cork", &taught);
        objects.start_sweep("wood", &taught);
        objects.judge(says(Some("wood")));
        assert_eq!(objects.next().unwrap().right(), None);
        assert_eq!(objects.score, Score::default());
    }
}
