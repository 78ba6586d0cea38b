//! The sentences of a twin. Nothing reads them back.

use calib_finding::Unit;
use calib_report::number;

use crate::likeness::Mark;
use crate::note::{NoiseOf, Note};
use crate::power::Power;
use crate::quantity::Quantity;
use crate::source::Source;
use crate::truth::About;

/// What a quantity is called.
#[must_use]
pub fn quantity(of: &Quantity) -> String {
    match of {
        Quantity::Position { body } => format!("position of {body}"),
        Quantity::Transform { name, direction } => {
            let axis = ["x", "y", "z"][usize::from(direction % 3)];
            if *direction < 3 {
                format!("{name}, rotation about {axis}")
            } else {
                format!("{name}, translation along {axis}")
            }
        }
        Quantity::Parameter { name } => name.clone(),
    }
}

/// What of the residuals is compared.
#[must_use]
pub fn mark(mark: Mark) -> &'static str {
    match mark {
        Mark::Level => "the rms of the position residuals",
        Mark::Orientation => "the rms of the orientation residuals",
        Mark::HeldOut => "the error on the validation recordings",
        Mark::JointNoise => "the noise of the joints",
        Mark::Goodness => "χ² per degree of freedom",
        Mark::LargestTest => "the largest test for a missing effect",
        Mark::LargestChange => "the largest sign of a change while recording",
        Mark::Memory => "the correlation of successive residuals",
        Mark::Bodies => "the ratio of the bodies' residuals",
        Mark::Tails => "the tails of the residuals",
    }
}

/// What the session is taken from.
#[must_use]
pub fn source(source: Source) -> &'static str {
    match source {
        Source::Recordings => "the recordings",
        Source::Plan => "the plan",
        Source::Simulation => "the profile's `simulate` section",
    }
}

/// Where true robots are drawn.
#[must_use]
pub fn about(about: About) -> &'static str {
    match about {
        About::Found => "about the robot that was found, as far as it is known",
        About::Prior => "from the priors of the profile",
    }
}

/// How the trials were calibrated.
#[must_use]
pub fn calibrated(whole: usize, trials: usize) -> String {
    if whole == trials {
        return "Each was calibrated as `calib run` does it.".to_owned();
    }
    format!(
        "{whole} of the {trials} trials, and all with an effect that the model lacks, were calibrated as `calib run` does it; the others without the checks for mistakes in the data, with the noise model that was chosen for the session."
    )
}

/// What the settings of trials are called that do not go together.
pub(crate) const SEED: &str = "`--seed`";
/// See [`SEED`].
pub(crate) const HOW: &str = "`--truth` or `--noise-times`";
/// See [`SEED`].
pub(crate) const VERSION: &str = "the version of the program";

/// What the rows of a recording, or of a plan in its place, are called.
pub(crate) fn rows_of(recording: &str) -> String {
    format!("the postures of `{recording}` (recorded or planned)")
}

/// A note as a sentence.
#[must_use]
pub fn note(note: &Note) -> String {
    match note {
        Note::StreamsAsRows { recordings } => format!(
            "The rows of {} are taken as postures: that the clocks go together is not tried again.",
            recordings.join(", ")
        ),
        Note::RejectedAreGaps { count } => {
            format!("{count} measurements that the fit rejected are gaps in the trials.")
        }
        Note::FromSimulation => {
            "Nothing is recorded: one draw of the `simulate` section stands for the recordings."
                .to_owned()
        }
        Note::FromPlan {
            postures,
            beside,
            noise,
            joint_sigma,
            joint_noise,
        } => {
            let beside = match beside {
                0 => String::new(),
                rows => format!(", recorded beside the {rows} rows that exist"),
            };
            let noise = match noise {
                NoiseOf::Recordings => "the tracker noise that the recordings show",
                NoiseOf::Profile | NoiseOf::Simulation => {
                    "the tracker noise that the profile states"
                }
                NoiseOf::Program => {
                    "the tracker noise that the program takes where none is stated or recorded"
                }
            };
            let of_joints = match joint_noise {
                NoiseOf::Recordings => "as the recordings show it",
                NoiseOf::Profile => "`solve.noise.joint_deg`",
                NoiseOf::Simulation => "`simulate.noise.joint_deg`",
                NoiseOf::Program => "assumed: state `solve.noise.joint_deg` if you know it",
            };
            let joints = number::plain(*joint_sigma, Unit::Radian);
            format!(
                "The postures are the {postures} of the plan{beside}, with {noise}; joints have a noise of {joints} ({of_joints})."
            )
        }
        Note::OriginsWithoutSweep { origins } => format!(
            "Left out, because their sweeps are not recorded: {}.",
            origins.join(", ")
        ),
        Note::NoiseScaled { percent } => {
            format!("The noise of the trials is {percent} % of that of the session.")
        }
    }
}

/// A size of an effect.
#[must_use]
pub fn size(value: Option<f64>, unit: Unit) -> String {
    value.map_or_else(|| "no size".to_owned(), |size| small(size, unit))
}

/// A size with three digits, also where it is small in the usual unit.
fn small(size: f64, unit: Unit) -> String {
    /// Ratios are read as parts of a million where they are less than a thousandth.
    const RATIO: f64 = 1e-3;
    match unit {
        Unit::One if size < RATIO => format!("{:.0} ppm", size * 1e6),
        Unit::One => format!("{:.2} %", 100.0 * size),
        _ => number::sigma(Some(size), unit),
    }
}

/// What a power is of.
#[must_use]
pub fn of_power(power: &Power) -> String {
    match &power.other {
        Some(other) => format!("{} with {other}", power.joint),
        None => match power.name.rsplit('_').next() {
            // Which phase it has decides how well it is seen.
            Some(part @ ("sin" | "cos")) => format!("{}, {part} part", power.joint),
            _ => power.joint.clone(),
        },
    }
}

/// A part of a number.
#[must_use]
pub fn share(part: usize, of: usize) -> String {
    format!("{part} of {of}")
}
