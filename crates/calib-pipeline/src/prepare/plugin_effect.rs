//! An effect of a joint that a plugin computes, as the solver takes it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::{Arc, OnceLock};

use calib_core::JointState;
use calib_core::effect::{Outside, Quantity, Source, Stated};
use calib_plugin::{
    Bound, Coefficient, Control, DependsOn, Entry, JointEffect, JointStates, PluginError, Value,
};

/// An effect of a plugin, ready to be evaluated at any state.
#[derive(Debug, Clone)]
pub struct PluginEffect {
    /// What the solver and the model take.
    pub outside: &'static Outside,
    /// The first call that failed; it and all later ones count as 0 until somebody asks.
    failure: Arc<OnceLock<PluginError>>,
}

impl PluginEffect {
    /// An effect with these parameters at a turning or a sliding joint.
    ///
    /// # Errors
    /// [`PluginError::Parameter`].
    pub fn new(
        entry: &Entry<dyn JointEffect>,
        parameters: &BTreeMap<String, Value>,
        prismatic: bool,
    ) -> Result<Self, PluginError> {
        let bound = entry.with(parameters)?;
        let term = entry.term();
        let name = entry.offer().name.clone();
        let mut key = format!("{name} {}", if prismatic { "slides" } else { "turns" });
        for value in bound.values() {
            let _ = write!(key, " {value}");
        }
        let failure = Arc::new(OnceLock::new());
        let failed = Arc::clone(&failure);
        let regressor = move |state: &JointState| {
            // It is refused anyway: its author does not need the message of every row.
            if failed.get().is_some() {
                return 0.0;
            }
            one(&bound, term.depends_on, prismatic, state).unwrap_or_else(|error| {
                failed.get_or_init(|| error);
                0.0
            })
        };
        let outside = Outside::new(Stated {
            key,
            physics: entry.offer().summary.clone(),
            formula: format!("{name}*F, F by {}", entry.title()),
            name,
            quantity: match term.coefficient {
                Coefficient::Position => Quantity::Position,
                Coefficient::Ratio => Quantity::Ratio,
                Coefficient::Compliance => Quantity::Compliance,
            },
            source: match term.depends_on {
                DependsOn::Reading => Source::Reading,
                DependsOn::Motor => Source::Motor,
                DependsOn::Load => Source::Load,
                DependsOn::Approach => Source::Approach,
            },
            revolute_only: term.revolute_only,
            regressor: Box::new(regressor),
        });
        Ok(Self { outside, failure })
    }

    /// Whether every evaluation so far gave a regressor.
    ///
    /// # Errors
    /// What the first call that failed ended with.
    pub fn evaluated(&self) -> Result<(), PluginError> {
        self.failure.get().cloned().map_or(Ok(()), Err)
    }
}

/// The regressor at one state.
fn one(
    bound: &Bound<dyn JointEffect>,
    on: DependsOn,
    prismatic: bool,
    state: &JointState,
) -> Result<f64, PluginError> {
    let (readings, motor, loads, approaches) =
        ([state.q], [state.motor], [state.torque], [state.approach]);
    let mut states = JointStates::of_readings(&readings);
    states.prismatic = prismatic;
    match on {
        DependsOn::Reading => {}
        DependsOn::Motor => states.motor_rad = &motor,
        DependsOn::Load => states.loads = &loads,
        DependsOn::Approach => states.approaches = &approaches,
    }
    let values = bound.regressors(&states, &Control::default())?;
    Ok(values.first().copied().unwrap_or_default())
}
