//! The objects that were touched: what was said of each, what it was where somebody says so, and how often the two agree.

use std::collections::VecDeque;

use serde::Serialize;

/// Objects whose outcome is remembered.
const MARKS: usize = 24;

/// What the classifier says of an object.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Answer {
    /// `None`: none of the materials that the network was taught.
    pub(super) material: Option<String>,
    /// The taught material that is most probable; the same as `material` where there is one.
    pub(super) nearest: String,
    /// Of `nearest`, 0 to 1.
    pub(super) probability: f32,
}

/// The object under the finger, from one reset to the next.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(super) struct Object {
    /// From 1.
    number: u64,
    /// Its material, where somebody says so.
    truth: Option<String>,
    /// False if the network was not taught that material.
    taught: bool,
    /// True if more than one material was swept over since the reset.
    several: bool,
    /// Whole sweeps that were judged.
    sweeps: u32,
    /// After the newest whole sweep.
    answer: Option<Answer>,
    /// Whether the answer is the truth, where both are there.
    right: Option<bool>,
}

/// How many answers were right, of finished objects with a truth.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(super) struct Score {
    right: u64,
    all: u64,
    /// Objects of materials that the network was not taught, and how many of them were called unknown; counted above, too.
    new_right: u64,
    new_all: u64,
    /// The newest outcomes, oldest first.
    marks: VecDeque<bool>,
}

/// The object under the finger, and the score of those before it.
#[derive(Debug, Default)]
pub(super) struct Objects {
    pub(super) object: Object,
    pub(super) score: Score,
}

impl Objects {
    /// A sweep begins over a material that is known to whoever commands it.
    ///
    /// - `taught`: materials of the network
    pub(super) fn sweep_over(&mut self, material: &str, taught: &[String]) {
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

    /// A whole sweep was judged.
    ///
    /// - `answer`: given all sweeps of the object
    pub(super) fn judge(&mut self, answer: Answer) {
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

    /// The next sweep is of another object. Returns the one before, if it was judged.
    pub(super) fn next(&mut self) -> Option<Object> {
        if self.object.sweeps == 0 {
            // What was touched without being judged is the same object as before.
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
            if score.marks.len() > MARKS {
                score.marks.pop_front();
            }
        }
        Some(object)
    }
}

impl Object {
    /// Returns whether the answer is the truth, where both are there.
    pub(super) fn right(&self) -> Option<bool> {
        self.right
    }

    /// Returns how many whole sweeps were judged.
    pub(super) fn sweeps(&self) -> u32 {
        self.sweeps
    }

    /// Returns the material under the finger, where somebody says so.
    pub(super) fn truth(&self) -> Option<&str> {
        self.truth.as_deref()
    }

    /// Returns one line for people, such as `object 3: said cork (97 %) after 3 sweeps, it was wood`.
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

impl Answer {
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

    fn says(material: Option<&str>) -> Answer {
        Answer {
            material: material.map(Into::into),
            nearest: material.unwrap_or("cork").into(),
            probability: 0.974,
        }
    }

    fn touch(objects: &mut Objects, truth: &str, said: Option<&str>) -> Option<Object> {
        let taught = ["cork".to_string(), "wood".to_string()];
        for _ in 0..3 {
            objects.sweep_over(truth, &taught);
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
        // Nobody said that the object is another one.
        objects.sweep_over("cork", &taught);
        objects.sweep_over("wood", &taught);
        objects.judge(says(Some("wood")));
        assert_eq!(objects.next().unwrap().right(), None);
        assert_eq!(objects.score, Score::default());
    }
}
