//! The robots of a case study one by one, for those who divide it.

use calib_pipeline::prepare::load::{RobotProfile, load_robot};
use serde::Serialize;

use super::{CaseError, CaseOptions, CaseResult, RobotResult, one_robot};

/// The robots of a case study. Each depends on its number, the options and what was read, not on the others.
#[derive(Debug)]
pub struct Units<'a> {
    pub(super) options: &'a CaseOptions,
    pub(super) robot: RobotProfile,
}

/// What must be the same for robots to belong together. Their number is not: a longer study continues a shorter one.
#[derive(Serialize)]
struct Settings<'a> {
    calib_case_study: u32,
    study: &'a str,
    recorded: u64,
    /// Digests of profile and URDF.
    inputs: Vec<&'a str>,
    version: &'a str,
}

impl<'a> Units<'a> {
    /// Reads the profile and draws the first robot.
    ///
    /// # Errors
    /// [`CaseError`] for no robots, and for a profile that cannot be read or simulated.
    pub fn new(options: &'a CaseOptions) -> Result<Self, CaseError> {
        if options.robots == 0 {
            return Err(CaseError::NoRobots);
        }
        let robot = load_robot(&options.profile)?;
        let drawn = calib_sim::simulate_again(&robot.profile, &robot.model, Some(options.seed), 0);
        drawn.map_err(|source| CaseError::Simulation {
            file: robot.file.clone(),
            source: Box::new(source),
        })?;
        Ok(Self { options, robot })
    }

    /// How many.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.options.robots
    }

    /// Everything that the results depend on besides the seed, as one text.
    ///
    /// # Errors
    /// [`CaseError::Unwritable`], which settings do not have.
    pub fn settings(&self) -> Result<String, CaseError> {
        let digests = self.robot.digests.iter();
        let text = serde_json::to_string(&Settings {
            calib_case_study: 3,
            study: &self.options.name,
            recorded: self.options.recorded,
            inputs: digests.map(|d| d.sha256.as_str()).collect(),
            version: env!("CARGO_PKG_VERSION"),
        });
        Ok(text?)
    }

    /// Seed of a robot, counted from 0.
    #[must_use]
    pub fn seed(&self, number: u64) -> u64 {
        self.options.seed.wrapping_add(number)
    }

    /// A robot, counted from 0, by both methods. One that cannot be simulated or calibrated is a result that says why.
    #[must_use]
    pub fn one(&self, number: u64) -> Vec<RobotResult> {
        one_robot(&self.robot, self.seed(number), self.options)
    }

    /// The study of all robots, in their order.
    #[must_use]
    pub fn result(&self, robots: Vec<Vec<RobotResult>>) -> CaseResult {
        CaseResult {
            study: self.options.name.clone(),
            robots: self.options.robots,
            recorded: self.options.recorded,
            seed: self.options.seed,
            results: robots.into_iter().flatten().collect(),
        }
    }
}
