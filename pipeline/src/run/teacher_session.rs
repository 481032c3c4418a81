//! Probabilities of a network's teacher in a run directory: written after every part, so that an interrupted run keeps them.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::session::Begun;
use crate::network::soft_targets::{SoftTargets, TaughtPart};
use crate::{ModelRecipe, PipelineError, RunDir, Session, TrainEvent};

/// File of the teacher's probabilities.
const FILE: &str = "teacher.json";

/// Content of `teacher.json`.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Taught {
    /// Time spent on the teacher, in seconds.
    seconds: f64,
    /// Finished parts, in order.
    parts: Vec<TaughtPart>,
}

impl Session {
    /// Returns the targets of a network with a teacher, and the seconds that the teacher took; `None` if stopped.
    pub(super) fn soft_targets(
        &self,
        run: &RunDir,
        teacher: &ModelRecipe,
        begun: &Begun<'_>,
        on_event: &mut impl FnMut(TrainEvent<'_>),
        stop: &impl Fn() -> bool,
    ) -> Result<Option<(SoftTargets, f64)>, PipelineError> {
        let (train, seed) = (&begun.fitted.train, begun.config.spec.seed);
        let device = self.device(&begun.config)?;
        let mut taught: Taught = match run.file(FILE).exists() {
            true => run.read_json(FILE)?,
            false => Taught::default(),
        };
        let parts = train.inner_folds();
        for part in taught.parts.len()..parts {
            on_event(TrainEvent::Teacher {
                name: teacher.name(),
                number: part + 1,
                parts,
            });
            let start = Instant::now();
            let go_on = &mut |_: &_| !stop();
            let Some(finished) = TaughtPart::of(teacher, train, part, seed, device, go_on)? else {
                return Ok(None);
            };
            taught.parts.push(finished);
            taught.seconds += start.elapsed().as_secs_f64();
            run.write_json(FILE, &taught)?;
            if stop() {
                return Ok(None);
            }
        }
        let targets = SoftTargets::new(train, &taught.parts)?;
        Ok(Some((targets, taught.seconds)))
    }
}
