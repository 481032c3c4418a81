//! A calibration as it is kept: a TOML file with the robot that it is of, its parameters, and how sure they are.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::RobotDescription;

use super::identity::{identity_of, robot_identity};
use super::parameters::Calibration;
use super::unknowns::{UNKNOWNS, Unknowns, name};
use crate::robot::Robot;

/// Numbers of a lower triangle.
const TRIANGLE: usize = UNKNOWNS * (UNKNOWNS + 1) / 2;

/// Why a text is no calibration of a robot.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum KeptError {
    /// Not TOML; a setting that is missing, unknown or of another kind.
    #[error(
        "no calibration, or not a whole one: line {line}: {reason}; `tactnet catch calibrate --out FILE` writes one"
    )]
    Syntax {
        /// Counted from 1.
        line: usize,
        /// What is wrong there.
        reason: String,
    },
    /// A parameter that is no number.
    #[error("{unknown}: expected a number, found {found}")]
    NotFinite {
        /// Its name.
        unknown: String,
        /// What it is.
        found: f64,
    },
    /// A covariance that is none.
    #[error(
        "certainty.covariance: expected {} numbers, the lower triangle of a positive definite matrix, found {found}",
        TRIANGLE
    )]
    Covariance {
        /// What it is.
        found: String,
    },
    /// The calibration of another robot.
    #[error(
        "a calibration of another robot: expected one of {expected}, which is described, found one of {found}; `tactnet catch calibrate` finds this one's"
    )]
    OtherRobot {
        /// Identity of the robot as described.
        expected: String,
        /// Identity in the file.
        found: String,
    },
}

/// A calibration with what it is of and how sure it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptCalibration {
    /// What the robot is known by, see [`robot_identity`].
    pub robot: String,
    /// What was found.
    pub parameters: Calibration,
    certainty: Certainty,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Certainty {
    /// Of all unknowns in their order, lower triangle, row by row.
    covariance: Vec<f64>,
}

impl KeptCalibration {
    /// Returns a solution with what it is of.
    ///
    /// - `robot`: as described
    /// - `covariance`: `[UNKNOWNS][UNKNOWNS]`
    ///
    /// # Panics
    /// Where there are not that many numbers.
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

    /// Reads a file's text.
    ///
    /// - `robot`: that it has to be of, as described
    ///
    /// # Errors
    /// Where a setting is missing, unknown, of another kind or no number, and where it is of another robot.
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

    /// Returns what it is known by: calibrations of one robot with the same numbers are the same.
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

    /// As sure as a tenth of the priors.
    fn covariance() -> DMatrix<f64> {
        let sigmas = Priors::default().sigmas().unwrap() * 0.1;
        DMatrix::from_diagonal(&sigmas.component_mul(&sigmas))
    }

    fn kept(unknowns: &Unknowns) -> KeptCalibration {
        KeptCalibration::new(&robot(), unknowns, &covariance())
    }

    fn robot() -> Robot {
        Robot::new(RobotDescription::nominal())
    }

    proptest! {
        #[test]
        fn calibrations_survive_the_file(values in proptest::collection::vec(-1.0..1.0f64, UNKNOWNS)) {
            let (robot, unknowns) = (robot(), Unknowns::from_vec(values));
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
    fn what_is_no_whole_calibration_of_this_robot_is_refused_in_a_line() {
        let robot = robot();
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
            (good.replace(of, "0123456789abcdef"), "of another robot"),
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
            assert!(
                said.contains(named) && said.lines().count() == 1,
                "{named}: {said}"
            );
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
