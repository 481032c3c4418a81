//! A load like that of the catching stack (thesis, figure 3.2): cameras, inertial unit, tracker, planner and the 1 kHz loop of the arm.
//!
//! ```text
//! sensors ── camera/left, camera/right (2 MB, 25 Hz) ──> tracker ── ball/prediction (25 Hz) ──> planner ── arm/path (25 Hz) ──┐
//!    └────── imu (512 Hz) ──────────────────────────────────┘                                                               │
//! controller ── joint/command (1 kHz) ──> drives ── joint/state ──> controller  <────────────────────────────────────────────┘
//! ```
//!
//! Packets travel as on the robot; what the components compute is left out, but for one pass over every picture.

use std::collections::BTreeMap;
use std::time::Duration;

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use tactnet_channel::{Bus, ChannelConfig, Packet, Priority, Start, Table, Ticker, Wait, now_ns};

use crate::SimulationError;

/// Pixels of a camera.
const PIXELS: usize = 1600 * 1250;
/// Joints of arms, torso, neck and platform.
const JOINTS: usize = 24;
/// Steps of a joint path.
const PATH: usize = 100;
const PATIENCE: Wait = Wait::Block {
    timeout: Duration::from_millis(100),
};

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Imu {
    acceleration: [f32; 3],
    rate: [f32; 3],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Joints {
    number: u64,
    position: [f32; JOINTS],
    torque: [f32; JOINTS],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Prediction {
    position: [f32; 3],
    velocity: [f32; 3],
    covariance: [f32; 36],
}

macro_rules! packets {
    ($($packet:ident)*) => { $(
        impl Packet for $packet {
            const NAME: &'static str = stringify!($packet);
            const VERSION: u32 = 1;
        }
    )* };
}
packets!(Imu Joints Prediction);

/// A process of the stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LoadRole {
    /// Cameras and inertial unit.
    Sensors,
    /// Pictures in, predictions out.
    Tracker,
    /// Predictions in, joint paths out.
    Planner,
    /// Joint commands in, joint states out.
    Drives,
    /// Commands joints at 1 kHz and waits for their state.
    Controller,
}

impl LoadRole {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Drives,
        Self::Planner,
        Self::Tracker,
        Self::Sensors,
        Self::Controller,
    ];

    /// Returns its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sensors => "sensors",
            Self::Tracker => "tracker",
            Self::Planner => "planner",
            Self::Drives => "drives",
            Self::Controller => "controller",
        }
    }
}

impl std::str::FromStr for LoadRole {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|role| role.name() == name);
        found.ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("expected one of {names}, found `{name}`")
        })
    }
}

/// Adds the stack's channels to a table.
pub fn load_table(table: Table) -> Table {
    let deep = |config: ChannelConfig| ChannelConfig {
        depth: 64,
        ..config
    };
    table
        .with(
            "camera/left",
            ChannelConfig {
                depth: 2,
                ..ChannelConfig::of::<u8>(PIXELS)
            },
        )
        .with(
            "camera/right",
            ChannelConfig {
                depth: 2,
                ..ChannelConfig::of::<u8>(PIXELS)
            },
        )
        .with("imu", deep(ChannelConfig::of::<Imu>(1)))
        .with("ball/prediction", ChannelConfig::of::<Prediction>(2))
        .with("arm/path", ChannelConfig::of::<Joints>(PATH))
        .with("joint/command", deep(ChannelConfig::of::<Joints>(1)))
        .with("joint/state", deep(ChannelConfig::of::<Joints>(1)))
}

/// Counts and times of one process.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadReport {
    /// Its role.
    pub role: LoadRole,
    /// Packets it got, by channel.
    pub got: BTreeMap<String, u64>,
    /// Packets that were put and it never got.
    pub lost: u64,
    /// The controller's round trips, with the time they ended.
    pub trips: Vec<Trip>,
}

/// A round trip of the 1 kHz loop.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trip {
    /// When the state came, nanoseconds of the host's monotonic clock.
    pub at_ns: u64,
    /// From the command's put to the state, nanoseconds; for a state that never came, as long as it was waited for.
    pub round_ns: u32,
}

impl LoadReport {
    fn new(role: LoadRole) -> Self {
        Self {
            role,
            got: BTreeMap::new(),
            lost: 0,
            trips: Vec::new(),
        }
    }
}

/// Runs one process of the stack until `stopped` returns true.
///
/// # Errors
/// The channels have broken down.
pub fn run_role(
    role: LoadRole,
    bus: &Bus,
    stopped: &dyn Fn() -> bool,
) -> Result<LoadReport, SimulationError> {
    match role {
        LoadRole::Sensors => sensors(bus, stopped),
        LoadRole::Tracker => tracker(bus, stopped),
        LoadRole::Planner => planner(bus, stopped),
        LoadRole::Drives => drives(bus, stopped),
        LoadRole::Controller => controller(bus, stopped),
    }
}

fn sensors(bus: &Bus, stopped: &dyn Fn() -> bool) -> Result<LoadReport, SimulationError> {
    let cameras = [
        bus.put_port::<u8>("camera/left", Priority::Bulk)?,
        bus.put_port::<u8>("camera/right", Priority::Bulk)?,
    ];
    let imu = bus.put_port::<Imu>("imu", Priority::High)?;
    let mut ticker = Ticker::new(512.0);
    let mut beat = 0u64;
    while !stopped() {
        ticker.wait();
        beat += 1;
        imu.put_copy(&[Imu {
            acceleration: [0.0, 0.0, 9.81],
            rate: [beat as f32; 3],
        }])?;
        // 25 of 512 beats.
        if beat * 25 / 512 != (beat - 1) * 25 / 512 {
            for camera in &cameras {
                let mut picture = camera.loan(PIXELS)?;
                picture.fill(beat as u8);
                camera.put(picture)?;
            }
        }
    }
    Ok(LoadReport::new(LoadRole::Sensors))
}

fn tracker(bus: &Bus, stopped: &dyn Fn() -> bool) -> Result<LoadReport, SimulationError> {
    let left = bus.get_port::<u8>("camera/left", Start::Now)?;
    let right = bus.get_port::<u8>("camera/right", Start::Now)?;
    let imu = bus.get_port::<Imu>("imu", Start::Now)?;
    let predictions = bus.put_port::<Prediction>("ball/prediction", Priority::High)?;
    let mut group = bus.sync_group(&[&left, &right, &imu])?;
    let mut report = LoadReport::new(LoadRole::Tracker);
    let (mut pictures, mut turns) = (0u64, 0u64);
    while !stopped() {
        match group.wait(PATIENCE)? {
            Some(2) => {
                turns += u64::from(imu.try_get()?.is_some());
            }
            Some(side) => {
                let camera = [&left, &right][side];
                let Some(picture) = camera.try_get()? else {
                    continue;
                };
                pictures += 1;
                let sum: u64 = picture.iter().map(|pixel| u64::from(*pixel)).sum();
                if side == 1 {
                    let ball = Prediction {
                        position: [sum as f32; 3],
                        velocity: [turns as f32; 3],
                        covariance: [0.0; 36],
                    };
                    predictions.put_copy(&[ball; 2])?;
                }
            }
            None => {}
        }
    }
    report.got = [("camera".to_string(), pictures), ("imu".into(), turns)].into();
    report.lost = left.lost() + right.lost() + imu.lost();
    Ok(report)
}

fn planner(bus: &Bus, stopped: &dyn Fn() -> bool) -> Result<LoadReport, SimulationError> {
    let predictions = bus.get_port::<Prediction>("ball/prediction", Start::Now)?;
    let paths = bus.put_port::<Joints>("arm/path", Priority::High)?;
    let mut report = LoadReport::new(LoadRole::Planner);
    let mut got = 0;
    while !stopped() {
        let Some(balls) = predictions.get(PATIENCE)? else {
            continue;
        };
        got += 1;
        let mut path = paths.loan(PATH)?;
        for (step, joints) in path.iter_mut().enumerate() {
            *joints = Joints {
                number: step as u64,
                position: [balls[0].position[0]; JOINTS],
                torque: [0.0; JOINTS],
            };
        }
        paths.put(path)?;
    }
    report.got = [("ball/prediction".to_string(), got)].into();
    report.lost = predictions.lost();
    Ok(report)
}

fn drives(bus: &Bus, stopped: &dyn Fn() -> bool) -> Result<LoadReport, SimulationError> {
    let commands = bus.get_port::<Joints>("joint/command", Start::Now)?;
    let states = bus.put_port::<Joints>("joint/state", Priority::RealTime)?;
    let mut report = LoadReport::new(LoadRole::Drives);
    let mut got = 0;
    while !stopped() {
        let Some(command) = commands.get(PATIENCE)? else {
            continue;
        };
        got += 1;
        states.put_copy(&[Joints {
            torque: command[0].position,
            ..command[0]
        }])?;
    }
    report.got = [("joint/command".to_string(), got)].into();
    report.lost = commands.lost();
    Ok(report)
}

fn controller(bus: &Bus, stopped: &dyn Fn() -> bool) -> Result<LoadReport, SimulationError> {
    let states = bus.get_port::<Joints>("joint/state", Start::Now)?;
    let paths = bus.get_port::<Joints>("arm/path", Start::Now)?;
    let commands = bus.put_port::<Joints>("joint/command", Priority::RealTime)?;
    let mut report = LoadReport::new(LoadRole::Controller);
    report.trips.reserve(3_600_000);
    let mut ticker = Ticker::new(1000.0);
    let (mut number, mut got_paths, mut missing) = (0u64, 0, 0);
    while !stopped() {
        ticker.wait();
        while paths.try_get()?.is_some() {
            got_paths += 1;
        }
        // States that came too late for their own beat.
        while states.try_get()?.is_some() {}
        number += 1;
        let begun = now_ns();
        commands.put_copy(&[Joints {
            number,
            position: [number as f32; JOINTS],
            torque: [0.0; JOINTS],
        }])?;
        let state = loop {
            match states.get(Wait::Block {
                timeout: Duration::from_millis(10),
            })? {
                Some(state) if state[0].number != number => continue,
                other => break other.is_some(),
            }
        };
        let now = now_ns();
        missing += u64::from(!state);
        // A state that never came took at least as long as was waited for it.
        report.trips.push(Trip {
            at_ns: now,
            round_ns: (now - begun).min(u64::from(u32::MAX)) as u32,
        });
    }
    report.got = [
        ("joint/state".to_string(), report.trips.len() as u64),
        ("arm/path".into(), got_paths),
    ]
    .into();
    report.lost = missing + paths.lost();
    Ok(report)
}
