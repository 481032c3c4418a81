//! The catching stack in stepped time: perception, coordinator and plans, with their delays.

use std::collections::VecDeque;
use std::time::Instant;

use tactnet_catching::coordinate::{CatchState, Coordinator, PlanRequest, Planned};
use tactnet_catching::map::DistanceField;
use tactnet_catching::plan::{NoPlan, PlanConditions, Planner, Surroundings};
use tactnet_catching_packets::ARMS;
use tactnet_catching_world::{Sensed, Truth};

use crate::ablation::Ablation;
use crate::error::TrialError;
use crate::look_ahead::TimedPrediction;
use crate::perception::Perception;
use crate::stepped_time::nanoseconds;
use crate::throw_config::ThrowConfig;

/// Stack of a robot that waits for a throw.
pub(crate) struct SteppedStack {
    pub perception: Perception,
    pub coordinator: Coordinator,
    /// All predictions so far.
    pub said: Vec<TimedPrediction>,
    /// Number of requests without a collision-free plan.
    pub obstructed: u64,
    /// Computation time of the first plans, in s.
    pub first_plan: Option<f64>,
    /// Plans on their way to the coordinator.
    answers: VecDeque<Answers>,
    to_path_ns: u64,
    near_misses: bool,
}

struct Answers {
    due_ns: u64,
    answers: Vec<Planned>,
}

impl SteppedStack {
    /// - `seed`: seed of the world, for pictures
    pub fn new(
        config: &ThrowConfig,
        coordinator: Coordinator,
        seed: u64,
    ) -> Result<Self, TrialError> {
        Ok(Self {
            perception: Perception::new(config, seed)?,
            coordinator,
            said: Vec::new(),
            obstructed: 0,
            first_plan: None,
            answers: VecDeque::new(),
            to_path_ns: nanoseconds(config.timing.to_path()),
            near_misses: !config.is_without(Ablation::NearMiss),
        })
    }

    /// Hands plans that are due to the coordinator; `on_plans` is called after each call's plans.
    pub fn take_plans(&mut self, now_ns: u64, mut on_plans: impl FnMut(&[Planned], &Coordinator)) {
        while let Some(due) = self.answers.pop_front_if(|answer| answer.due_ns <= now_ns) {
            self.coordinator.planned(&due.answers);
            on_plans(&due.answers, &self.coordinator);
        }
    }

    /// Takes predictions that are due and plans for them.
    ///
    /// - `field`: map of obstacles, if there is one
    pub fn plan(
        &mut self,
        now_ns: u64,
        planners: &[Planner; ARMS],
        field: Option<&DistanceField>,
    ) -> Result<(), TrialError> {
        while let Some(seen) = self.perception.predictions(now_ns)? {
            self.said.extend(seen.said());
            let requests = self
                .coordinator
                .predictions(now_ns, &seen.predictions, &seen.chest);
            let begun = Instant::now();
            let answers: Vec<Planned> = requests
                .iter()
                .flatten()
                .map(|request| {
                    let among = field.map(|field| Surroundings {
                        field,
                        chest: self.coordinator.chest_way(request.start_ns),
                    });
                    self.answer(planners, request, among)
                })
                .collect();
            if !answers.is_empty() {
                self.first_plan
                    .get_or_insert_with(|| begun.elapsed().as_secs_f64());
                let none = |answer: &&Planned| answer.plan == Err(NoPlan::Obstructed);
                self.obstructed += answers.iter().filter(none).count() as u64;
                self.answers.push_back(Answers {
                    due_ns: now_ns + self.to_path_ns,
                    answers,
                });
            }
        }
        Ok(())
    }

    fn answer(
        &self,
        planners: &[Planner; ARMS],
        request: &PlanRequest,
        surroundings: Option<Surroundings<'_>>,
    ) -> Planned {
        let planner = &planners[request.arm];
        let conditions = PlanConditions {
            surroundings,
            last: request.last,
            ..PlanConditions::default()
        };
        let plan = planner.plan(&request.catch, &conditions, || false);
        Planned {
            request: *request,
            plan: plan.or_else(|no_plan| {
                if !self.near_misses {
                    return Err(no_plan);
                }
                let miss = planner.plan(&request.catch, &conditions.nearest_miss(), || false);
                // With a map, the reason of the exact plan is reported.
                miss.map_err(|missed| match surroundings {
                    Some(_) => no_plan,
                    None => missed,
                })
            }),
        }
    }

    /// Takes the sensor values of a tick.
    pub fn sense(&mut self, sensed: &Sensed, truth: &Truth) -> Result<(), TrialError> {
        let waits = self.coordinator.state() == CatchState::Armed;
        self.perception.sense(sensed, truth, waits)
    }
}
