//! A joint effect: one regressor per sample, and what is known of its coefficient before any data.
//!
//! ```text
//! φ_s = q_s + c F_s,   c ~ N(0, σ²)                                                          (1)
//! ```

/// What a regressor depends on, beside the kind of joint. The host gives nothing else.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DependsOn {
    /// The reading alone.
    Reading = 1,
    /// The angle of the motor: gear ratio times reading.
    Motor = 2,
    /// The load that gravity exerts about (along) the axis.
    Load = 3,
    /// The direction that the joint came from.
    Approach = 4,
}

impl DependsOn {
    /// The one with this number of the contract.
    #[must_use]
    pub fn from_number(number: i32) -> Option<Self> {
        [Self::Reading, Self::Motor, Self::Load, Self::Approach]
            .into_iter()
            .find(|on| *on as i32 == number)
    }
}

/// What a coefficient measures; its unit follows with the joint's kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coefficient {
    /// Same as the reading: rad or m.
    Position = 1,
    /// A ratio.
    Ratio = 2,
    /// Motion per load: rad/(N·m) or m/N.
    Compliance = 3,
}

impl Coefficient {
    /// The one with this number of the contract.
    #[must_use]
    pub fn from_number(number: i32) -> Option<Self> {
        [Self::Position, Self::Ratio, Self::Compliance]
            .into_iter()
            .find(|c| *c as i32 == number)
    }
}

/// What is stated of the one term of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectTerm {
    /// What F of equation (1) depends on.
    pub depends_on: DependsOn,
    /// What c of equation (1) measures.
    pub coefficient: Coefficient,
    /// σ of equation (1): how large the effect is on an ordinary joint, rad, m, 1, rad/(N·m) or m/N.
    pub prior_sigma: f64,
    /// Defined for turning joints only.
    pub revolute_only: bool,
}

/// States of one joint, one per sample. What the effect does not depend on is empty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointStates<'a> {
    /// The joint slides: readings are m, not rad.
    pub prismatic: bool,
    /// Readings, rad or m; always given.
    pub readings: &'a [f64],
    /// Angles of the motor, rad.
    pub motor_rad: &'a [f64],
    /// What gravity exerts about (along) the axis, N·m (N): minus what the joint holds.
    pub loads: &'a [f64],
    /// +1: came from below, −1: from above, 0: not known.
    pub approaches: &'a [f64],
}

impl<'a> JointStates<'a> {
    /// Of a turning joint, by its readings alone.
    #[must_use]
    pub fn of_readings(readings: &'a [f64]) -> Self {
        Self {
            prismatic: false,
            readings,
            motor_rad: &[],
            loads: &[],
            approaches: &[],
        }
    }

    /// How many samples.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.readings.len()
    }
}
