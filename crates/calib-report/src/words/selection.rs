//! How a model was chosen.

use super::prose::code;
use crate::{ModelPart, PartKind, Selection, SelectionOutcome, SelectionStep, Unit, number};

impl ModelPart {
    /// "compliance of `elbow`", "axes of all joints".
    #[must_use]
    pub fn words(&self) -> String {
        if self.kind == PartKind::Masses {
            return "masses of all links".to_owned();
        }
        let effect = self.effect.as_deref().unwrap_or_default();
        let noun = match (self.kind, effect) {
            (PartKind::Axis, _) if self.joint.is_none() => "axes".to_owned(),
            (PartKind::Axis, _) => "axis".to_owned(),
            (PartKind::Origin, _) => "origin".to_owned(),
            (PartKind::Coupling, _) => "coupling".to_owned(),
            (PartKind::Masses, _) => "masses".to_owned(),
            (PartKind::Effect, id) => self::effect(id),
        };
        let joint = match &self.joint {
            Some(joint) => code(joint),
            None => "all joints".to_owned(),
        };
        match &self.other {
            Some(other) => format!("{noun} of {joint} to {}", code(other)),
            None => format!("{noun} of {joint}"),
        }
    }
}

/// An effect of the table of effects as a noun.
pub(crate) fn effect(id: &str) -> String {
    match id {
        "offset" => "zero offset".to_owned(),
        "eccentricity_2" => "second harmonic".to_owned(),
        id => id.replace('_', " "),
    }
}

impl SelectionStep {
    /// How it ended.
    #[must_use]
    pub fn short_ending(&self) -> &'static str {
        match self.outcome {
            SelectionOutcome::Added => "added",
            SelectionOutcome::NoBetter => "predicts no better",
            SelectionOutcome::Removed => "removed later: not needed",
            SelectionOutcome::NotSignificant => "not significant",
        }
    }

    /// Whether more is to be said than how it ended.
    #[must_use]
    pub fn has_remarks(&self) -> bool {
        let added = self.outcome == SelectionOutcome::Added;
        self.replaced_by.is_some() || (added && !(self.members.is_empty() && self.alike.is_empty()))
    }

    /// How it ended, and what it cannot be distinguished from.
    #[must_use]
    pub fn ending(&self) -> String {
        let mut text = self.short_ending().to_owned();
        let added = self.outcome == SelectionOutcome::Added;
        if !self.members.is_empty() && added {
            text += &format!(" for {}", joints(&self.members));
        }
        if let Some(other) = &self.replaced_by {
            text += &format!("; later replaced by {}", other.words());
        }
        if !self.alike.is_empty() && added {
            text += &format!("; not distinguishable from {}", list(&self.alike));
        }
        text
    }
}

/// "`a`, `b`".
fn joints(parts: &[ModelPart]) -> String {
    let names = parts.iter().filter_map(|p| p.joint.as_deref());
    names.map(code).collect::<Vec<_>>().join(", ")
}

fn list(parts: &[ModelPart]) -> String {
    let words: Vec<String> = parts.iter().map(ModelPart::words).collect();
    words.join(", ")
}

/// What was done and what came of it.
pub(crate) fn summary(selection: &Selection) -> Vec<String> {
    let length = |m| number::plain(m, Unit::Meter);
    let mut lines = vec![if selection.added.is_empty() {
        format!(
            "Starting from what the profile frees, {} further effects, axes and origins were tested; none was added. Left-out poses are predicted to {} rms.",
            selection.tested,
            length(selection.first_rms_m)
        )
    } else {
        format!(
            "Starting from what the profile frees, {} further effects, axes and origins were tested. Added: {}. Left-out poses are predicted to {} rms instead of {}, with {} parameters instead of {}.",
            selection.tested,
            list(&selection.added),
            length(selection.chosen_rms_m),
            length(selection.first_rms_m),
            selection.chosen_parameters,
            selection.first_parameters
        )
    }];
    if let Some(nested) = &selection.nested {
        lines.push(format!(
            "These poses were used to select the model. In {}-fold cross-validation of the selection the error is {} rms (profile's model: {}): quote this value.",
            nested.folds,
            length(nested.rms_m),
            length(nested.first_rms_m)
        ));
    }
    if let Some(factor) = selection.sigma_factor {
        lines.push(format!(
            "All standard deviations are {} times those of the same model without a choice: the folds show what is uncertain because the model was chosen.",
            number::fixed(factor, 2)
        ));
    }
    if !selection.unsupported.is_empty() {
        lines.push(format!(
            "Freed by the profile, but not needed to predict left-out poses: {}.",
            list(&selection.unsupported)
        ));
    }
    lines
}

/// Heading of the part of the summary.
pub(crate) const HEADING: &str = "Choice of the model";

/// Caption of the table of what was tried.
pub(crate) const STEPS: &str = "Tried in this order; errors of left-out poses, rms, mm:";

/// Caption of the same in a terminal.
pub(crate) const TRIED: &str = "Tried in this order; rms error of left-out poses, mm; share of the squared error that is saved:";

/// What to do with the block.
pub(crate) const PASTE: &str =
    "The chosen model, to replace `free` and `joints` under `solve` in the profile:";

/// "12 ± 3 %".
pub(crate) fn saved(step: &SelectionStep) -> String {
    format!(
        "{:.1} ± {:.1} %",
        100.0 * step.saved,
        100.0 * step.saved_error
    )
}

/// "0.02", "3e−8".
pub(crate) fn p_value(p: f64) -> String {
    if p >= 0.001 {
        number::fixed(p, 3)
    } else {
        format!("{:.0e}", p.max(1e-300)).replace('-', "−")
    }
}
