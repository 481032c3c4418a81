//! Message load of the catching stack (thesis, figure 3.2): cameras, inertial unit, tracker, planner and the 1 kHz loop
//! of the arm.
//!
//! ```text
//! sensors ── camera/left, camera/right (2 MB, 25 Hz) ──> tracker ── ball/prediction (25 Hz) ──> planner ── arm/path (25 Hz) ──┐
//!    └────── imu (512 Hz) ──────────────────────────────────┘                                                               │
//! controller ── joint/command (1 kHz) ──> drives ── joint/state ──> controller  <────────────────────────────────────────────┘
//! ```
//!
//! Packets have the sizes and rates of the robot. The computation is left out, except for one pass over every image.

use std::collections::BTreeMap;
use std::time::Duration;

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use tactnet_channel::{Bus, ChannelConfig, Packet, Priority, Start, Table, Ticker, Wait, now_ns};

use crate::SimulationError;

/// Number of pixels of a camera image.
const PIXELS: usize = 1600 * 1250;
/// Number of joints of arms, torso, neck and platform.
const JOINTS: usize = 24;
/// Number of steps of a joint path.
const PATH: usize = 100;
/// Timeout of one wait for a packet, which bounds the reaction time to a stop.
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

/// Role of a process in the stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LoadRole {
    /// Sends camera images and inertial data.
    Sensors,
    /// Receives images, sends predictions.
    Tracker,
    /// Receives predictions, sends joint paths.
    Planner,
    /// Receives joint commands, sends joint states.
    Drives,
    /// Sends joint commands at 1 kHz and waits for the states.
    Controller,
}

impl LoadRole {
    /// All roles, in the order of their start.
    pub const ALL: [Self; 5] = [
        Self::Drives,
        Self::Planner,
        Self::Tracker,
        Self::Sensors,
        Self::Controller,
    ];

    /// Returns the role's name.
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
    /// Role of the process.
    pub role: LoadRole,
    /// Number of received packets, by channel.
    pub got: BTreeMap<String, u64>,
    /// Number of packets that were sent but not received.
    pub lost: u64,
    /// Round trips of the controller, with the time at which they ended.
    pub trips: Vec<Trip>,
}

/// A round trip of the 1 kHz loop.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trip {
    /// Time at which the state arrived, in ns of the host's monotonic clock.
    pub at_ns: u64,
    /// Time from the command to the state, in ns. For a state that never arrived, it is the waiting time.
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
/// Fails if the channels break down.
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
        // One image per 20 or 21 ticks: 25 of 512 per second.
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
        // Discard states that arrived after their own tick.
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
        // A state that never arrived counts with the waiting time.
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
