//! Settings of the stack, section `[components.catching]` of a robot's table.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tactnet_catching::Robot;
use tactnet_catching::calibrate::{Corrections, KeptCalibration, SlipConfig};
use tactnet_catching::control::ControlConfig;
use tactnet_catching::coordinate::{Coordinator, CoordinatorConfig, NextPose, PhaseConfig};
use tactnet_catching::plan::PlanConfig;
use tactnet_catching::throw_back::ThrowBack;
use tactnet_catching::track::TrackConfig;
use tactnet_catching_packets::RobotDescription;
use tactnet_channel::Table;

use crate::RoleError;

const SECTION: &str = "catching";

tactnet_catching_packets::settings! {
    /// Settings shared by the processes of the stack. Missing fields have the values of `Default`.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct RoleSettings {
        /// File with the robot's description; the nominal robot if absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub robot: Option<PathBuf> = None,
        /// File with a calibration of this robot; if absent, the robot matches its description.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub calibration: Option<PathBuf> = None,
        /// Catching arms, ball limits and start times of plans.
        pub coordinator: CoordinatorConfig = CoordinatorConfig::default(),
        /// Settings of the planners.
        pub planner: PlanConfig = PlanConfig::default(),
        /// Delay of the drives, from a cycle of the controller to the time that its command applies to, in s.
        pub drives: f64 = 0.0025,
        /// Timeout without verdicts of the safety monitor after which the controller brakes, in s.
        pub safety_patience: f64 = 0.05,
        /// Makes the controller brake if the monitor predicts a collision; otherwise collisions are only reported.
        pub brakes: bool = true,
        /// Expected number of false detections per picture, for the tracker.
        pub clutter: f64 = 1.0,
        /// Probability of a material at which the exploration of a caught ball ends, from 0 to 1.
        pub sure: f64 = 0.95,
        /// Maximum number of sweeps per ball.
        pub most_sweeps: u32 = 3,
        /// Time after a catch or a lost ball at which the robot returns to its waiting pose, in s.
        pub after_catch: f64 = 0.4,
        /// Settings of throwing back.
        pub throw: ThrowBack = ThrowBack::default(),
        /// Limits of the slip watch.
        pub slip: SlipConfig = SlipConfig::default(),
    }
}

impl RoleSettings {
    /// Reads the section of a table, or returns the defaults if there is none.
    ///
    /// # Errors
    /// An unknown setting, or a value of the wrong type.
    pub fn of(table: &Table) -> Result<Self, RoleError> {
        match table.components.get(SECTION) {
            Some(section) => Ok(section.clone().try_into()?),
            None => Ok(Self::default()),
        }
    }

    /// Writes the section into a table.
    #[must_use]
    pub fn into_table(&self, mut table: Table) -> Table {
        if let Ok(section) = toml::Value::try_from(self) {
            table.components.insert(SECTION.into(), section);
        }
        table
    }

    /// Returns the settings of the tracker.
    pub fn track(&self) -> TrackConfig {
        TrackConfig {
            clutter: self.clutter,
            ..TrackConfig::default()
        }
    }

    /// Returns the settings of the coordinator's phases.
    pub fn phases(&self) -> PhaseConfig {
        PhaseConfig {
            drives: self.drives,
            after_catch: self.after_catch,
            next: NextPose::Waiting,
            looks_at_hand: self.calibration.is_some(),
        }
    }

    /// Returns the settings of the controller.
    pub fn control(&self) -> ControlConfig {
        ControlConfig {
            drives_ns: (self.drives * 1e9) as u64,
            patience_ns: (self.safety_patience * 1e9) as u64,
            brakes: self.brakes,
        }
    }

    /// Returns a coordinator with these settings.
    ///
    /// # Errors
    /// Same as [`RoleSettings::kept`].
    pub fn new_coordinator(&self) -> Result<Coordinator, RoleError> {
        let corrections = self.corrections()?;
        let (config, phases) = (self.coordinator, self.phases());
        Ok(Coordinator::new(corrections, config, phases))
    }

    /// Returns the robot from its description.
    ///
    /// # Errors
    /// A description that cannot be read.
    pub fn robot(&self) -> Result<Robot, RoleError> {
        let Some(path) = &self.robot else {
            return Ok(Robot::nominal());
        };
        read(path, RobotDescription::parse).map(Robot::new)
    }

    /// Returns the calibration if the settings name one.
    ///
    /// # Errors
    /// A description or a calibration that cannot be read, an invalid calibration, or one of another robot.
    pub fn kept(&self) -> Result<Option<KeptCalibration>, RoleError> {
        let Some(path) = &self.calibration else {
            return Ok(None);
        };
        let robot = self.robot()?;
        read(path, |text| {
            KeptCalibration::parse(text, robot.description())
        })
        .map(Some)
    }

    /// Returns the corrections between sensors, stack and drives, together with the robot model.
    ///
    /// # Errors
    /// Same as [`RoleSettings::kept`].
    pub fn corrections(&self) -> Result<Corrections, RoleError> {
        let kept = self.kept()?;
        let parameters = kept.as_ref().map(|kept| &kept.parameters);
        Ok(Corrections::new(&self.robot()?, parameters))
    }
}

/// Reads a file. Bytes that are not text fail in `parse`, whose error names the line.
fn read<T, E: ToString>(
    path: &Path,
    parse: impl FnOnce(&str) -> Result<T, E>,
) -> Result<T, RoleError> {
    let failed = |reason: String| RoleError::File {
        path: path.into(),
        reason,
    };
    let bytes = std::fs::read(path).map_err(|error| failed(error.to_string()))?;
    parse(&String::from_utf8_lossy(&bytes)).map_err(|error| failed(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibration_that_cannot_be_used_is_named_with_its_file() {
        let at = |name: &str| RoleSettings {
            calibration: Some(name.into()),
            ..RoleSettings::default()
        };
        assert_eq!(RoleSettings::default().kept().unwrap(), None);
        let missing = at("/nowhere/calibration.toml").kept().unwrap_err();
        let another = at(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"));
        let another = another.corrections().unwrap_err();
        for (error, named) in [
            (missing, "/nowhere/calibration.toml"),
            (another, "invalid calibration file"),
        ] {
            let said = error.to_string();
            assert!(error.is_usage() && said.contains(named), "{said}");
            assert_eq!(said.lines().count(), 1, "{said}");
        }
    }

    #[test]
    fn settings_go_through_a_table_and_unknown_ones_are_refused() {
        let settings = RoleSettings {
            clutter: 24.0,
            brakes: false,
            ..RoleSettings::default()
        };
        let table = settings.into_table(Table::new("t"));
        assert_eq!(RoleSettings::of(&table).unwrap(), settings);
        let empty = RoleSettings::of(&Table::new("t")).unwrap();
        assert_eq!(empty, RoleSettings::default());
        let text = "bus = \"t\"\n[channels]\n[components.catching]\nclutte = 3.0\n";
        let error = RoleSettings::of(&toml::from_str(text).unwrap()).unwrap_err();
        assert!(error.is_usage());
        assert!(error.to_string().contains("clutte"), "{error}");
    }
}
