//! What the reader should do now: one imperative sentence per step.

use super::prose::full_stop;
use crate::NextStep;

impl NextStep {
    /// The step as an imperative sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        match self {
            Self::Use { urdf, effects } => {
                let with = effects.as_ref();
                let with =
                    with.map_or_else(String::new, |file| format!(" with the effects in `{file}`"));
                format!("Use `{urdf}`{with}, and keep this folder: `calib revert` needs it.")
            }
            Self::UseModel { model, alone } => {
                let alone = alone.as_ref();
                let alone = alone.map_or_else(String::new, |file| {
                    format!(" Where a program reads only a URDF, use `{file}`, which was fitted to be used without them.")
                });
                format!(
                    "Use the model file `{model}` (`calib predict`, `calib correct`), not the calibrated URDF: without the joint effects that a URDF cannot hold it predicts new poses hardly better than the untouched one.{alone}"
                )
            }
            Self::KeepUrdf { scene } => format!(
                "Keep the URDF: nothing of the robot itself was estimated. `{scene}` has where bodies and tracker are."
            ),
            Self::NothingGained => {
                "Keep the URDF: with bodies and tracker placed, no difference between its errors on new poses and those of the calibrated one could be shown. More held-out poses show smaller differences."
                    .to_owned()
            }
            Self::FixProblems => {
                "Do not use this result until the problems above are fixed.".to_owned()
            }
            Self::AddValidation { poses, limits } => {
                let what = match (poses, limits) {
                    (true, true) => "Record validation poses, set `solve.limits` in the profile,",
                    (true, false) => "Record validation poses,",
                    (false, _) => "Set `solve.limits` in the profile,",
                };
                format!("{what} and run again.")
            }
            Self::EnableEffect { missing } => format!(
                "Enable the missing effect in the profile: {}",
                full_stop(&missing.evidence())
            ),
            Self::Resolve {
                subject,
                finding,
                remedy,
            } => format!("{subject} (`{finding}`): {}", full_stop(remedy)),
            Self::SolveJointly => {
                "Solve with `method: ml` to use all recordings at once.".to_owned()
            }
        }
    }
}
