//! Settings of the stack, `[components.catching]` of a robot's table.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use tactnet_catching::Robot;
use tactnet_catching::calibrate::{Corrections, KeptCalibration, SlipConfig};
use tactnet_catching::coordinate::CoordinatorConfig;
use tactnet_catching::plan::PlanConfig;
use tactnet_catching_packets::RobotDescription;
use tactnet_channel::Table;

use crate::{RoleError, ThrowBack};

/// Name of the section.
const SECTION: &str = "catching";

/// Settings that the stack's processes share; what is not given is as in `Default`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RoleSettings {
    /// File with the robot's description; left out: the nominal one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot: Option<PathBuf>,
    /// File with what `tactnet catch calibrate` found of this robot; left out: it is as described.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<PathBuf>,
    /// Who catches what, and when plans are to begin.
    pub coordinator: CoordinatorConfig,
    /// The planners.
    pub planner: PlanConfig,
    /// From the controller's beat to the moment that its command is for, s: what the drives take.
    pub drives: f64,
    /// The controller brakes if it has not heard the monitor of self-collisions for so long, s.
    pub safety_patience: f64,
    /// The controller brakes where the monitor says so; otherwise it is only reported.
    pub brakes: bool,
    /// Circles of a picture that are no balls, as the tracker expects them.
    pub clutter: f64,
    /// The free hand sweeps over a caught ball until a material is so probable, 0 to 1.
    pub sure: f64,
    /// Or until it has swept so often.
    pub most_sweeps: u32,
    /// A robot that has closed its hands, or whose ball is gone, goes back after so long, s.
    pub after_catch: f64,
    /// Throwing back.
    pub throw: ThrowBack,
    /// When the calibration no longer holds.
    pub slip: SlipConfig,
}

impl Default for RoleSettings {
    fn default() -> Self {
        Self {
            robot: None,
            calibration: None,
            coordinator: CoordinatorConfig::default(),
            planner: PlanConfig::default(),
            drives: 0.0025,
            safety_patience: 0.05,
            brakes: true,
            clutter: 1.0,
            sure: 0.95,
            most_sweeps: 3,
            after_catch: 0.4,
            throw: ThrowBack::default(),
            slip: SlipConfig::default(),
        }
    }
}

impl RoleSettings {
    /// Reads the section of a table; defaults where it has none.
    ///
    /// # Errors
    /// An unknown setting, or a value of another type.
    pub fn of(table: &Table) -> Result<Self, RoleError> {
        match table.components.get(SECTION) {
            Some(section) => Ok(section.clone().try_into()?),
            None => Ok(Self::default()),
        }
    }

    /// Puts the section into a table.
    #[must_use]
    pub fn into_table(&self, mut table: Table) -> Table {
        if let Ok(section) = toml::Value::try_from(self) {
            table.components.insert(SECTION.into(), section);
        }
        table
    }

    /// Returns the robot as described.
    ///
    /// # Errors
    /// A description that cannot be read.
    pub fn robot(&self) -> Result<Robot, RoleError> {
        let Some(path) = &self.robot else {
            return Ok(Robot::new(RobotDescription::nominal()));
        };
        let failed = |reason: String| RoleError::Robot {
            path: path.clone(),
            reason,
        };
        let text = std::fs::read_to_string(path).map_err(|error| failed(error.to_string()))?;
        let description =
            RobotDescription::parse(&text).map_err(|error| failed(error.to_string()))?;
        Ok(Robot::new(description))
    }

    /// Returns the calibration, where the settings name one.
    ///
    /// # Errors
    /// A description that cannot be read; a file that cannot be read, is no calibration, or that of another robot.
    pub fn kept(&self) -> Result<Option<KeptCalibration>, RoleError> {
        let Some(path) = &self.calibration else {
            return Ok(None);
        };
        let failed = |reason: String| RoleError::Calibration {
            path: path.clone(),
            reason,
        };
        let robot = self.robot()?;
        let bytes = std::fs::read(path).map_err(|error| failed(error.to_string()))?;
        // What is no text is no calibration, and the line that is wrong says so.
        KeptCalibration::parse(&String::from_utf8_lossy(&bytes), robot.description())
            .map(Some)
            .map_err(|error| failed(error.to_string()))
    }

    /// Returns what stands between sensors, stack and drives, with the robot that the stack knows behind it.
    ///
    /// # Errors
    /// As [`RoleSettings::kept`].
    pub fn corrections(&self) -> Result<Corrections, RoleError> {
        let kept = self.kept()?;
        let parameters = kept.as_ref().map(|kept| &kept.parameters);
        Ok(Corrections::new(&self.robot()?, parameters))
    }
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
            (another, "no calibration"),
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
        assert_eq!(
            RoleSettings::of(&Table::new("t")).unwrap(),
            RoleSettings::default()
        );
        let text = "bus = \"t\"\n[channels]\n[components.catching]\nclutte = 3.0\n";
        let error = RoleSettings::of(&toml::from_str(text).unwrap()).unwrap_err();
        assert!(
            error.is_usage() && error.to_string().contains("clutte"),
            "{error}"
        );
    }
}
