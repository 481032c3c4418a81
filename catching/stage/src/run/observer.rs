//! Observer of a run: follows outcomes and states on the bus.

use std::time::Instant;

use tactnet_catching_packets::packets::{
    ArmPath, CalibrationState, CatchOutcome, CatchPhase, CatchStatus, ControllerMode,
    ControllerState, HandState, ThrowStatus, ThrownBack,
};
use tactnet_catching_roles::{channels, drain};
use tactnet_channel::{Bus, GetPort};

use super::RunEvent;
use crate::StageError;
use crate::run_report::HeardCatches;
use crate::throw_report::HeardThrows;

/// Packets received during a run.
pub(super) struct RunObserver {
    outcomes: GetPort<CatchOutcome>,
    paths: GetPort<ArmPath>,
    states: GetPort<ControllerState>,
    status: GetPort<CatchStatus>,
    hands: GetPort<HandState>,
    throw_states: GetPort<ThrowStatus>,
    backs: GetPort<ThrownBack>,
    holds: GetPort<CalibrationState>,
    pub catches: HeardCatches,
    pub throws: HeardThrows,
    /// Time of the last held ball or finished throw.
    pub busy: Instant,
    mode: Option<ControllerMode>,
    phase: CatchStatus,
}

impl RunObserver {
    /// Opens the channels of outcomes and states.
    pub fn open(bus: &Bus) -> Result<Self, StageError> {
        Ok(Self {
            outcomes: channels::CATCH_OUTCOME.get(bus)?,
            paths: channels::ARM_PATH.get(bus)?,
            states: channels::CONTROLLER_STATE.get(bus)?,
            status: channels::CATCH_STATE.get(bus)?,
            hands: channels::HAND_STATE.get(bus)?,
            throw_states: channels::THROW_STATE.get(bus)?,
            backs: channels::THROW_OUTCOME.get(bus)?,
            holds: channels::CALIBRATION_STATE.get(bus)?,
            catches: HeardCatches::default(),
            throws: HeardThrows::default(),
            busy: Instant::now(),
            mode: None,
            phase: bytemuck::Zeroable::zeroed(),
        })
    }

    /// Takes all waiting packets. Returns true if a throw finished.
    pub fn look(&mut self, on_event: &mut dyn FnMut(RunEvent)) -> Result<bool, StageError> {
        let before = self.finished();
        while let Some(packet) = self.paths.try_get()? {
            let put_ns = packet.header().put_ns;
            packet
                .iter()
                .for_each(|path| self.catches.times.path(put_ns, path));
        }
        drain(&self.states, |state| {
            let mode = state.mode();
            if mode == Some(ControllerMode::Braking) && self.mode != mode {
                let why = state.reason.as_str().to_string();
                *self.catches.brakes.entry(why.clone()).or_default() += 1;
                on_event(RunEvent::Braked(why));
            }
            self.catches.refused(state.refused, state.reason.as_str());
            self.mode = mode;
        })?;
        drain(&self.status, |status| {
            self.phase = *status;
            self.catches.no_plans = self.catches.no_plans.max(status.no_plans);
        })?;
        drain(&self.outcomes, |outcome| {
            self.catches.outcome(outcome);
            let outcomes = &self.catches.outcomes;
            on_event(RunEvent::Thrown {
                throws: outcomes.len() as u64,
                caught: outcomes.iter().filter(|o| o.caught == 1).count() as u64,
                outcome: *outcome,
            });
        })?;
        drain(&self.throw_states, |status| {
            let why = self.throws.status(status);
            why.into_iter()
                .map(RunEvent::NotThrown)
                .for_each(&mut *on_event);
        })?;
        drain(&self.backs, |thrown| {
            self.throws.thrown.push(*thrown);
            on_event(RunEvent::ThrownBack(*thrown));
        })?;
        let throws = self.catches.outcomes.len() as u64;
        drain(&self.holds, |state| {
            if self.catches.hold.take(state, throws) {
                on_event(RunEvent::NoLongerCalibrated(*state));
            }
        })?;
        let over = self.finished() > before;
        let mut holds = false;
        drain(&self.hands, |hand| holds |= hand.holds == 1)?;
        if over || holds {
            self.busy = Instant::now();
        }
        Ok(over)
    }

    /// Returns the number of finished throws, of the world and of the robot.
    fn finished(&self) -> usize {
        self.catches.outcomes.len() + self.throws.thrown.len()
    }

    /// Returns the error of a run without a throw for `seconds`, with the phase that the robot is in.
    pub fn no_throw(&self, seconds: u64) -> StageError {
        let phase = match self.phase.phase() {
            None | Some(CatchPhase::Starting) => "is starting",
            Some(CatchPhase::Armed) => "waits",
            Some(CatchPhase::Tracking) => "sees a ball",
            Some(CatchPhase::Reaching) => "reaches",
            Some(CatchPhase::Closed) => "has closed its hands",
            Some(CatchPhase::GoingBack) => "goes back",
            Some(CatchPhase::Braking) => "brakes",
            Some(CatchPhase::Stuck) => "is stuck",
            Some(CatchPhase::Throwing) => "throws",
        };
        StageError::NoThrow {
            seconds,
            phase,
            reason: self.phase.reason.as_str().into(),
        }
    }
}
