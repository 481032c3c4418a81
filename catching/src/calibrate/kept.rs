//! Calibration file: a TOML file with the robot's identity, the parameters and their covariance.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::RobotDescription;

use super::identity::{identity_of, robot_identity};
use super::parameters::Calibration;
use super::unknowns::{UNKNOWNS, Unknowns, name};
use crate::robot::Robot;

/// Number of entries in the lower triangle of the covariance.
const TRIANGLE: usize = UNKNOWNS * (UNKNOWNS + 1) / 2;

/// Reason why a text is not a valid calibration of a robot.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum KeptError {
    /// Invalid TOML, or a missing, unknown or mistyped setting.
    #[error("invalid calibration file, line {line}: {reason}")]
    Syntax {
        /// Line number, from 1.
        line: usize,
        /// Error message of the parser.
        reason: String,
    },
    /// A parameter is not finite.
    #[error("{unknown}: expected a number, found {found}")]
    NotFinite {
        /// Name of the parameter.
        unknown: String,
        /// Value of the parameter.
        found: f64,
    },
    /// The covariance is invalid.
    #[error(
        "certainty.covariance: expected {} numbers, the lower triangle of a positive definite matrix, found {found}",
        TRIANGLE
    )]
    Covariance {
        /// Description of the actual value.
        found: String,
    },
    /// The calibration belongs to another robot.
    #[error(
        "calibration of another robot: expected robot {expected} (the described one), found {found}; this robot needs its own calibration"
    )]
    OtherRobot {
        /// Identity of the described robot.
        expected: String,
        /// Identity in the file.
        found: String,
    },
}

/// Calibration with the identity of its robot and the covariance of its parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptCalibration {
    /// Identity of the robot, see [`robot_identity`].
    pub robot: String,
    /// Estimated parameters.
    pub parameters: Calibration,
    certainty: Certainty,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Certainty {
    /// Lower triangle of the covariance of all unknowns, row by row.
    covariance: Vec<f64>,
}

impl KeptCalibration {
    /// Creates the file content of a solution.
    ///
    /// - `robot`: as described
    /// - `covariance`: `[UNKNOWNS][UNKNOWNS]`
    ///
    /// # Panics
    /// Panics if the covariance is smaller.
    pub fn new(robot: &Robot, unknowns: &Unknowns, covariance: &DMatrix<f64>) -> Self {
        let rows = (0..UNKNOWNS).flat_map(|row| (0..=row).map(move |column| (row, column)));
        Self {
            robot: robot_identity(robot.description()),
            parameters: Calibration::of(unknowns),
            certainty: Certainty {
                covariance: rows.map(|place| covariance[place]).collect(),
            },
        }
    }

    /// Parses and validates the text of a file.
    ///
    /// - `robot`: description of the robot to which the calibration must belong
    ///
    /// # Errors
    /// Returns an error if a setting is missing, unknown, mistyped or not finite, or if the robot is a different one.
    pub fn parse(text: &str, robot: &RobotDescription) -> Result<Self, KeptError> {
        let kept: Self = toml::from_str(text).map_err(|error| {
            let before = error
                .span()
                .and_then(|span| text.get(..span.start))
                .unwrap_or_default();
            KeptError::Syntax {
                line: 1 + before.matches('\n').count(),
                reason: error.message().replace('\n', ", "),
            }
        })?;
        let unknowns = kept.parameters.unknowns();
        if let Some(unknown) = unknowns.iter().position(|x| !x.is_finite()) {
            return Err(KeptError::NotFinite {
                unknown: name(unknown),
                found: unknowns[unknown],
            });
        }
        kept.check_covariance()?;
        let expected = robot_identity(robot);
        if kept.robot != expected {
            return Err(KeptError::OtherRobot {
                expected,
                found: kept.robot,
            });
        }
        Ok(kept)
    }

    /// Returns the text of a file.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("tables of numbers can be written")
    }

    /// Returns the identity of the calibration, a hash of robot identity and parameters.
    pub fn identity(&self) -> String {
        let unknowns = self.parameters.unknowns();
        let of = self.robot.bytes().map(f64::from);
        identity_of(of.chain(unknowns.iter().copied()))
    }

    /// Returns the covariance of all unknowns, `[UNKNOWNS][UNKNOWNS]`.
    pub fn covariance(&self) -> DMatrix<f64> {
        DMatrix::from_fn(UNKNOWNS, UNKNOWNS, |row, column| {
            let (row, column) = (row.max(column), row.min(column));
            self.certainty.covariance[row * (row + 1) / 2 + column]
        })
    }

    fn check_covariance(&self) -> Result<(), KeptError> {
        let values = &self.certainty.covariance;
        let found = if values.len() != TRIANGLE {
            format!("{} numbers", values.len())
        } else if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            value.to_string()
        } else if self.covariance().cholesky().is_none() {
            "another matrix".into()
        } else {
            return Ok(());
        };
        Err(KeptError::Covariance { found })
    }
}

#[cfg(test)]
mod tests {
    use super::super::unknowns::Priors;
    use super::*;
    use proptest::prelude::*;

    /// Covariance with a tenth of the prior standard deviations.
    fn covariance() -> DMatrix<f64> {
        let sigmas = Priors::default().sigmas().unwrap() * 0.1;
        DMatrix::from_diagonal(&sigmas.component_mul(&sigmas))
    }

    fn kept(unknowns: &Unknowns) -> KeptCalibration {
        KeptCalibration::new(&Robot::nominal(), unknowns, &covariance())
    }

    proptest! {
        #[test]
        fn calibrations_survive_the_file(values in proptest::collection::vec(-1.0..1.0f64, UNKNOWNS)) {
            let (robot, unknowns) = (Robot::nominal(), Unknowns::from_vec(values));
            let mut covariance = covariance();
            (covariance[(3, 1)], covariance[(1, 3)]) = (1e-7, 1e-7);
            let kept = KeptCalibration::new(&robot, &unknowns, &covariance);
            let read = KeptCalibration::parse(&kept.to_toml(), robot.description()).unwrap();
            prop_assert_eq!(read.parameters.unknowns(), unknowns);
            prop_assert_eq!(read.covariance(), covariance);
            prop_assert_eq!(read.identity(), kept.identity());
            prop_assert_eq!(read, kept);
        }
    }

    #[test]
    fn invalid_calibrations_are_rejected_in_one_line() {
        let robot = Robot::nominal();
        let kept = kept(&Unknowns::zeros(UNKNOWNS));
        let good = kept.to_toml();
        let half = &good[..good.len() / 2];
        let of = kept.robot.as_str();
        let cases = [
            (
                good.replacen("camera_imu = 0.0", "camera_imu = nan", 1),
                "clock of cameras after inertial unit",
            ),
            (good.replace("neck", "nek"), "nek"),
            (half.into(), "line "),
            (String::new(), "`robot`"),
            ("bus = \"robot\"\n[channels]\n".into(), "bus"),
            (
                good.replace(of, "0123456789abcdef"),
                "calibration of another robot",
            ),
            (
                good.replacen("covariance = [", "covariance = [1.0, ", 1),
                "found 3161 numbers",
            ),
            (
                good.replacen("covariance = [", "covariance = [-", 1),
                "another matrix",
            ),
        ];
        for (text, named) in cases {
            let error = KeptCalibration::parse(&text, robot.description()).unwrap_err();
            let said = error.to_string();
            assert!(said.contains(named), "{named}: {said}");
            assert_eq!(said.lines().count(), 1, "{said}");
        }
        let mut other = robot.description().clone();
        other.arms[0].position[1] += 0.01;
        let error = KeptCalibration::parse(&good, &other).unwrap_err();
        assert!(matches!(error, KeptError::OtherRobot { .. }), "{error}");
    }

    #[test]
    fn calibrations_with_other_numbers_have_other_identities() {
        let mut unknowns = Unknowns::zeros(UNKNOWNS);
        let first = kept(&unknowns).identity();
        unknowns[40] = 1e-9;
        let second = kept(&unknowns).identity();
        assert_ne!(first, second);
        assert_eq!(first.len(), 16);
    }
}
