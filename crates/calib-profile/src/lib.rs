//! Robot profiles: from the YAML a person writes to a checked profile in SI units.
//!
//! ```text
//! robots/x.yaml ── parse ──► RawProfile ── check (against the robot's links and joints) ──► Profile
//! ```
//!
//! [`raw::RawProfile`] is what was written: units in key names, unknown keys refused.
//! [`Profile`] is what the program needs: m, rad, ids of the robot model, every cross reference resolved.
//! Neither stage opens another file. Every problem is reported with file, line and caret, what was found and
//! what was expected; the check collects all of them rather than stopping at the first.
//!
//! This crate does not check whether the recordings hold what the profile asks of them.
//!
//! ```
//! let text = "calib: 1\nrobot: {name: arm, urdf: arm.urdf}\ntracker: {frame: world, marker_sigma: 1}\n";
//! let error = calib_profile::parse(text, "arm.yaml").unwrap_err();
//! assert!(error.to_string().contains("marker_sigma_mm"), "{error}");
//! ```

mod check;
pub mod edit;
mod error;
mod locate;
mod profile;
pub mod raw;
mod schema;
mod slip;
mod touched;
mod units;

pub use check::check;
pub use error::{Problem, ProfileError};
pub use locate::Place;
pub use nalgebra;
pub use profile::{
    Body, BodyKind, ByRow, Camera, Clocks, Contact, ContactBase, Error3, Facing, Free, FreeEffect,
    FromRoot, JointException, JointFree, JointFreeSet, KeepOut, Limits, LinkTransform, Load, Loop,
    Method, Noise, Orientation, Origin, OriginFreeSet, Outputs, ParameterValue, PlanSpec, Plugin,
    PointChoice, Prior, Profile, Protocol, RecordingSpec, RobotLoad, RobotLog, SharedWidth,
    SightSigma, SimErrors, SimMount, SimNoise, Simulation, Solve, Split, Spots, StartFrom, Steps,
    SweptAxis, TimedPoses, Timing, Tip, Touched, Tracker, UpAxis, Usage,
};
pub use schema::json_schema;

use error::from_yaml;
use raw::RawProfile;

/// Reads the YAML text of a profile; `file` is its name in messages.
///
/// # Errors
/// [`ProfileError`] with line, caret and the nearest valid word.
pub fn parse(text: &str, file: &str) -> Result<RawProfile, ProfileError> {
    /// A profile is written by hand; anything larger is another kind of file.
    const LARGEST: usize = 1 << 20;
    if text.len() > LARGEST {
        let problem = Problem::new(
            None,
            format!("a file of {} bytes is not a profile", text.len()),
            "give the YAML profile, not a recording; profiles have at most 1 MiB",
        );
        return Err(ProfileError::new(file, "", vec![problem]));
    }
    serde_saphyr::from_str(text).map_err(|error| from_yaml(&error, text, file))
}
