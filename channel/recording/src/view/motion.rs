//! Moving bodies: capsules, balls and curves over time.
//!
//! | entity | content |
//! |---|---|
//! | `world/bodies/NAME` | a capsule, m |
//! | `world/balls/NAME` | a ball while it exists, m |
//! | `world/paths/NAME` | its whole path |
//! | `world/points/NAME`, `world/lines/NAME` | static points and lines, m |
//! | `curves/NAME` | lines of numbers |

use nalgebra::{UnitQuaternion, Vector3};
use re_sdk::RecordingStreamBuilder;
use re_sdk::blueprint::{
    Blueprint, BlueprintPanel, ContainerLike, Horizontal, SelectionPanel, Spatial3DView, TimePanel,
    TimeSeriesView, Vertical,
};
use re_sdk::log::TimeColumn;
use re_sdk_types::archetypes::{
    Capsules3D, LineStrips3D, Points3D, Scalars, SeriesLines, ViewCoordinates,
};
use re_sdk_types::blueprint::components::{PanelState, PlayState};
use re_sdk_types::components::{Color, FillMode};

use super::Play;
use super::Target;
use super::scene::{Stream, TimeOrigin};
use crate::RecordingError;

/// Color of balls.
const BRIGHT: u32 = 0xf0_8c_00_ff;
/// Color of the balls' paths.
const FAINT: u32 = 0xf0_8c_00_60;
/// Alternating colors of capsules.
const BODIES: [u32; 3] = [0x3b_82_c4_ff, 0x6f_b4_f0_ff, 0x2a_5f_94_ff];
/// Alternating colors of static points and lines.
const STILL: [u32; 4] = [0xc0_50_50_ff, 0x4f_9d_69_ff, 0xd0_a0_30_ff, 0x80_80_80_ff];

/// Motion of bodies. All lists over time have the length of `times_ns`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Motion {
    /// Times since the beginning, ascending, in nanoseconds.
    pub times_ns: Vec<i64>,
    /// Links of a robot.
    pub capsules: Vec<Capsule>,
    /// Thrown balls.
    pub balls: Vec<Ball>,
    /// Static points.
    pub points: Vec<Points>,
    /// Static lines.
    pub lines: Vec<Lines>,
    /// Curves below the picture, one plot each.
    pub curves: Vec<Curves>,
}

/// Static points.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    /// Name in the viewer, without spaces.
    pub name: String,
    /// Radius, in m.
    pub radius: f32,
    /// Positions in m, z up.
    pub places: Vec<[f64; 3]>,
}

/// Static lines.
#[derive(Debug, Clone, PartialEq)]
pub struct Lines {
    /// Name in the viewer, without spaces.
    pub name: String,
    /// Corners of each line in m, z up.
    pub strips: Vec<Vec<[f64; 3]>>,
}

/// A cylinder with round ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Capsule {
    /// Name in the viewer, without spaces.
    pub name: String,
    /// Radius, in m.
    pub radius: f32,
    /// Centers of both ends at each time, in m, z up.
    pub ends: Vec<[[f64; 3]; 2]>,
}

/// A ball that exists for a part of the time.
#[derive(Debug, Clone, PartialEq)]
pub struct Ball {
    /// Name in the viewer, without spaces.
    pub name: String,
    /// Radius, in m.
    pub radius: f32,
    /// Position at each time in m, z up; `None` while it does not exist.
    pub places: Vec<Option<[f64; 3]>>,
}

/// Curves over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Curves {
    /// Name in the viewer, with the unit.
    pub name: String,
    /// Name of each line, with its times and values.
    pub lines: Vec<(String, Vec<(i64, f64)>)>,
}

/// Shows a motion, and waits until the viewer has received it.
///
/// - `title`: title in the viewer
///
/// # Errors
/// No viewer can be reached; the file exists.
pub fn show_motion(target: &Target, title: &str, motion: &Motion) -> Result<(), RecordingError> {
    let builder = RecordingStreamBuilder::new("tactnet")
        .recording_name(title)
        .with_blueprint(blueprint(&motion.curves));
    let stream = Stream::new(
        target.open(builder, Play::FromBeginning)?,
        TimeOrigin::Begin,
    );
    stream.send_static("world", &ViewCoordinates::RIGHT_HAND_Z_UP())?;
    let times = || [stream.times(motion.times_ns.clone())];
    for (number, capsule) in motion.capsules.iter().enumerate() {
        send_capsule(&stream, times(), capsule, BODIES[number % BODIES.len()])?;
    }
    for ball in &motion.balls {
        send_ball(&stream, times(), ball)?;
    }
    for (number, points) in motion.points.iter().enumerate() {
        let cloud = Points3D::new(points.places.iter().map(single))
            .with_radii([points.radius])
            .with_colors([Color::from_u32(STILL[number % STILL.len()])]);
        stream.send_static(format!("world/points/{}", points.name), &cloud)?;
    }
    for (number, lines) in motion.lines.iter().enumerate() {
        let strips = lines.strips.iter();
        let strips =
            LineStrips3D::new(strips.map(|strip| strip.iter().map(single).collect::<Vec<_>>()))
                .with_colors([Color::from_u32(STILL[number % STILL.len()])])
                .with_radii([0.003]);
        stream.send_static(format!("world/lines/{}", lines.name), &strips)?;
    }
    for (number, curves) in motion.curves.iter().enumerate() {
        for (line, (name, values)) in curves.lines.iter().enumerate() {
            let entity = format!("curves/{number}/{line}");
            stream.send_static(
                entity.as_str(),
                &SeriesLines::new().with_names([name.as_str()]),
            )?;
            let scalars = Scalars::update_fields()
                .with_scalars(values.iter().map(|(_, value)| *value))
                .columns_of_unit_batches();
            let times_ns = values.iter().map(|(time_ns, _)| *time_ns).collect();
            stream.send(entity, [stream.times(times_ns)], scalars)?;
        }
    }
    stream.finish(target)
}

fn send_capsule(
    stream: &Stream,
    times: [TimeColumn; 1],
    capsule: &Capsule,
    colour: u32,
) -> Result<(), RecordingError> {
    let entity = format!("world/bodies/{}", capsule.name);
    let fixed = Capsules3D::update_fields()
        .with_radii([capsule.radius])
        .with_colors([Color::from_u32(colour)])
        .with_fill_mode(FillMode::Solid);
    stream.send_static(entity.as_str(), &fixed)?;
    let along = |[a, b]: &[[f64; 3]; 2]| Vector3::from(*b) - Vector3::from(*a);
    let turns = capsule.ends.iter().map(|ends| {
        // The viewer's capsules are upright.
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &along(ends));
        let turn = turn.unwrap_or(UnitQuaternion::from_axis_angle(
            &Vector3::x_axis(),
            std::f64::consts::PI,
        ));
        let [x, y, z, w]: [f64; 4] = turn.coords.into();
        re_sdk_types::datatypes::Quaternion::from_xyzw([x, y, z, w].map(|part| part as f32))
    });
    let moving = Capsules3D::update_fields()
        .with_lengths(capsule.ends.iter().map(|ends| along(ends).norm() as f32))
        .with_translations(capsule.ends.iter().map(|[a, _]| a.map(|part| part as f32)))
        .with_quaternions(turns)
        .columns_of_unit_batches();
    stream.send(entity, times, moving)
}

fn send_ball(stream: &Stream, times: [TimeColumn; 1], ball: &Ball) -> Result<(), RecordingError> {
    let entity = format!("world/balls/{}", ball.name);
    let fixed = Points3D::update_fields()
        .with_radii([ball.radius])
        .with_colors([Color::from_u32(BRIGHT)]);
    stream.send_static(entity.as_str(), &fixed)?;
    let way: Vec<[f32; 3]> = ball.places.iter().flatten().map(single).collect();
    let moving = Points3D::update_fields()
        .with_positions(way.clone())
        .columns(
            ball.places
                .iter()
                .map(|place| usize::from(place.is_some()))
                .collect::<Vec<_>>(),
        );
    stream.send(entity, times, moving)?;
    let way = LineStrips3D::new([way])
        .with_colors([Color::from_u32(FAINT)])
        .with_radii([0.004]);
    stream.send_static(format!("world/paths/{}", ball.name), &way)
}

fn single(place: &[f64; 3]) -> [f32; 3] {
    place.map(|part| part as f32)
}

fn blueprint(curves: &[Curves]) -> Blueprint {
    let scene = Spatial3DView::new("world").with_origin("world");
    let pictures: Vec<ContainerLike> = curves
        .iter()
        .enumerate()
        .map(|(number, curves)| {
            TimeSeriesView::new(curves.name.as_str())
                .with_origin(format!("curves/{number}"))
                .into()
        })
        .collect();
    let rows: Vec<ContainerLike> = if pictures.is_empty() {
        vec![scene.into()]
    } else {
        vec![scene.into(), Horizontal::new(pictures).into()]
    };
    Blueprint::new(Vertical::new(rows).with_row_shares(vec![2.0, 1.0]))
        .with_auto_layout(false)
        .with_auto_views(false)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Hidden))
        .with_time_panel(
            TimePanel::new()
                .with_state(PanelState::Collapsed)
                .with_timeline("time")
                .with_play_state(PlayState::Playing),
        )
}
