//! Conversions between packets and the types of the stack.

use bytemuck::Zeroable;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use tactnet_catching::coordinate::{BodyMotion, PlanRequest, Planned};
use tactnet_catching::flight::Flight;
use tactnet_catching::plan::{
    CatchPlan, CatchPoint, CatchRequest, Effort, NoPlan, Objective, OtherArm, Violation,
};
use tactnet_catching::ramp::Ramp;
use tactnet_catching_packets::ARM_JOINTS;
use tactnet_catching_packets::packets::{
    self, BodyPath, FlightPacket, HeadPose, PlanFailure, PlanObjective, RampPacket,
};

/// Measurements behind a plan request.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Origin {
    pub call: u64,
    pub exposure_ns: u64,
    pub head_ns: u64,
}

pub(crate) fn flight_packet(t_ns: u64, flight: &Flight) -> FlightPacket {
    FlightPacket {
        t_ns,
        p: flight.p.into(),
        v: flight.v.into(),
        k: flight.k,
        lift: flight.lift.into(),
    }
}

fn flight(packet: &FlightPacket) -> Flight {
    Flight {
        p: packet.p.into(),
        v: packet.v.into(),
        k: packet.k,
        lift: packet.lift.into(),
    }
}

pub(crate) fn request_packet(request: &PlanRequest, origin: Origin) -> packets::PlanRequest {
    let (last_q, last_t) = request
        .last
        .map_or(([0.0; ARM_JOINTS], 0.0), |last| (last.q, last.t));
    packets::PlanRequest {
        call: origin.call,
        exposure_ns: origin.exposure_ns,
        head_ns: origin.head_ns,
        ball: request.ball,
        arm: request.arm as u64,
        start_ns: request.start_ns,
        flight: flight_packet(request.start_ns, &request.catch.ball),
        q0: request.catch.q0,
        w0: request.catch.w0,
        earliest: request.catch.earliest,
        latest: request.catch.latest,
        objective: match request.catch.objective {
            Objective::Soft => PlanObjective::Soft,
            Objective::Latest => PlanObjective::Latest,
            Objective::Cool => PlanObjective::Cool,
        } as u64,
        has_last: u64::from(request.last.is_some()),
        last_q,
        last_t,
        has_other: u64::from(request.catch.other.is_some()),
        other_start_ns: request.catch.other.map_or(0, |other| {
            request
                .start_ns
                .saturating_add_signed(-(other.since * 1e9).round() as i64)
        }),
        other: request.catch.other.map_or_else(
            || [RampPacket::zeroed(); ARM_JOINTS],
            |other| other.ramps.each_ref().map(Ramp::packet),
        ),
    }
}

/// Returns `None` if the arm or the objective of the packet is unknown.
pub(crate) fn request(packet: &packets::PlanRequest) -> Option<PlanRequest> {
    Some(PlanRequest {
        ball: packet.ball,
        arm: usize::try_from(packet.arm).ok().filter(|arm| *arm < 2)?,
        start_ns: packet.start_ns,
        last: (packet.has_last == 1).then_some(CatchPoint {
            q: packet.last_q,
            t: packet.last_t,
        }),
        catch: CatchRequest {
            ball: flight(&packet.flight),
            q0: packet.q0,
            w0: packet.w0,
            earliest: packet.earliest,
            latest: packet.latest,
            objective: match packet.objective()? {
                PlanObjective::Soft => Objective::Soft,
                PlanObjective::Latest => Objective::Latest,
                PlanObjective::Cool => Objective::Cool,
            },
            other: (packet.has_other == 1).then(|| OtherArm {
                ramps: packet.other.each_ref().map(Ramp::of),
                since: (packet.start_ns as f64 - packet.other_start_ns as f64) * 1e-9,
            }),
        },
    })
}

pub(crate) fn result_packet(
    request: &packets::PlanRequest,
    plan: &Result<CatchPlan, NoPlan>,
) -> packets::PlanResult {
    let mut packet = packets::PlanResult {
        request: *request,
        ..packets::PlanResult::zeroed()
    };
    match plan {
        Ok(plan) => {
            packet.q = plan.q;
            packet.t = plan.t;
            packet.cost = plan.cost;
            packet.position_error = plan.violation.position;
            packet.angle_error = plan.violation.angle;
            packet.ramps = plan.ramps.each_ref().map(Ramp::packet);
            packet.starts = plan.effort.starts as u32;
            packet.iterations = plan.effort.iterations as u32;
        }
        Err(no_plan) => packet.failure = failure(no_plan) as u64,
    }
    packet
}

fn failure(no_plan: &NoPlan) -> PlanFailure {
    match no_plan {
        NoPlan::Request(_) => PlanFailure::Request,
        NoPlan::OutOfReach => PlanFailure::OutOfReach,
        NoPlan::NoCatch => PlanFailure::NoCatch,
        NoPlan::OutOfTime => PlanFailure::OutOfTime,
        NoPlan::Obstructed => PlanFailure::Obstructed,
    }
}

/// Returns `None` if the request of the packet is invalid or a number is not finite.
pub(crate) fn planned(packet: &packets::PlanResult) -> Option<Planned> {
    let request = request(&packet.request)?;
    let numbers = packet
        .ramps
        .iter()
        .flat_map(|ramp| [ramp.q0, ramp.w0, ramp.a, ramp.t1, ramp.t2, ramp.end]);
    let finite = numbers
        .chain(packet.q)
        .chain([packet.t, packet.cost])
        .all(f64::is_finite);
    let plan = match packet.failure()? {
        PlanFailure::NotFailed if finite && (0.0..10.0).contains(&packet.t) => Ok(CatchPlan {
            q: packet.q,
            t: packet.t,
            ramps: std::array::from_fn(|i| Ramp::of(&packet.ramps[i])),
            cost: packet.cost,
            violation: Violation {
                position: packet.position_error,
                angle: packet.angle_error,
                limits: 0.0,
            },
            effort: Effort {
                starts: packet.starts as usize,
                iterations: packet.iterations as usize,
                ..Effort::default()
            },
        }),
        PlanFailure::OutOfReach => Err(NoPlan::OutOfReach),
        PlanFailure::NoCatch => Err(NoPlan::NoCatch),
        PlanFailure::OutOfTime => Err(NoPlan::OutOfTime),
        PlanFailure::Obstructed => Err(NoPlan::Obstructed),
        PlanFailure::NotFailed | PlanFailure::Request => return None,
    };
    Some(Planned { request, plan })
}

pub(crate) fn body_packet(motion: &BodyMotion) -> BodyPath {
    BodyPath {
        start_ns: motion.start_ns,
        platform: motion.platform.packet(),
        turn: motion.turn.packet(),
    }
}

pub(crate) fn isometry(pose: &HeadPose) -> Isometry3<f64> {
    let [x, y, z, w] = pose.quaternion;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(pose.position), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ORIGIN: Origin = Origin {
        call: 3,
        exposure_ns: 40,
        head_ns: 90,
    };

    fn asked() -> PlanRequest {
        PlanRequest {
            ball: 7,
            arm: 1,
            start_ns: 1_000_000_123,
            last: Some(CatchPoint {
                q: [0.1; 7],
                t: 0.4,
            }),
            catch: CatchRequest {
                ball: Flight {
                    p: [1.0, 2.0, 3.0].into(),
                    v: [-5.0, 0.1, 1.0].into(),
                    k: 0.03,
                    lift: [0.0, 0.01, 0.0].into(),
                },
                q0: [0.2; 7],
                w0: [0.3; 7],
                earliest: 0.05,
                latest: 1.8,
                objective: Objective::Cool,
                other: Some(OtherArm {
                    ramps: [Ramp::braking(0.1, -0.4, 8.0); 7],
                    since: 0.25,
                }),
            },
        }
    }

    #[test]
    fn plan_requests_survive_the_way() {
        let asked = asked();
        let packet = request_packet(&asked, ORIGIN);
        assert_eq!(request(&packet), Some(asked));
        let mut alone = asked;
        alone.catch.other = None;
        assert_eq!(request(&request_packet(&alone, ORIGIN)), Some(alone));
        let mut nobody = packet;
        nobody.arm = 2;
        assert_eq!(request(&nobody), None);
    }

    #[test]
    fn plan_results_survive_the_way() {
        let asked = asked();
        let packet = request_packet(&asked, ORIGIN);
        for failure in [
            NoPlan::OutOfReach,
            NoPlan::NoCatch,
            NoPlan::OutOfTime,
            NoPlan::Obstructed,
        ] {
            let answer = planned(&result_packet(&packet, &Err(failure))).unwrap();
            assert_eq!((answer.request, answer.plan), (asked, Err(failure)));
        }
        let plan = CatchPlan {
            q: [0.5; 7],
            t: 0.6,
            ramps: [Ramp::braking(0.2, 0.3, 9.0); 7],
            cost: 1.5,
            violation: Violation {
                position: 0.01,
                angle: 0.02,
                limits: 0.0,
            },
            effort: Effort {
                starts: 4,
                iterations: 33,
                ..Effort::default()
            },
        };
        let answer = planned(&result_packet(&packet, &Ok(plan))).unwrap();
        assert_eq!(answer.plan, Ok(plan));
        let mut spoilt = result_packet(&packet, &Ok(plan));
        spoilt.ramps[6].a = f64::NAN;
        assert_eq!(planned(&spoilt), None);
    }
}
