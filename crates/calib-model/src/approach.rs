//! From which side each joint came: what backlash depends on.
//!
//! ```text
//! |q − anchor| > threshold:   direction = sign(q − anchor),   anchor = q                                (1)
//! ```
//!
//! Slow motion counts as well as fast: the anchor stays until the joint has moved by the threshold. With a threshold of
//! [`Model::approach_threshold`], rows of a recording give what the fit used.

use crate::error::ModelError;
use crate::model::Model;

/// Directions of approach, remembered from call to call. Feed it commanded positions: the noise of an encoder that
/// is larger than the threshold would flip the direction.
#[derive(Debug, Clone, PartialEq)]
pub struct Approach {
    direction: Vec<f64>,
    anchor: Vec<f64>,
    threshold: f64,
    begun: bool,
}

impl Approach {
    /// Nothing is known yet: every joint stands in the middle of its backlash until it moves.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let dof = model.joints().len();
        Self {
            direction: vec![0.0; dof],
            anchor: vec![0.0; dof],
            threshold: model.approach_threshold(),
            begun: false,
        }
    }

    /// The same with another threshold, rad or m: larger than the noise of the positions that are fed.
    #[must_use]
    pub fn with_threshold(self, threshold: f64) -> Self {
        Self { threshold, ..self }
    }

    /// Takes the next position of every joint.
    ///
    /// # Errors
    /// [`ModelError::Length`], [`ModelError::NotFinite`]; nothing is changed then.
    pub fn update(&mut self, model: &Model, q: &[f64]) -> Result<(), ModelError> {
        model.checked("q", q)?;
        if q.len() != self.anchor.len() {
            return Err(ModelError::ForeignWork);
        }
        if !self.begun {
            self.anchor.copy_from_slice(q);
            self.begun = true;
        }
        let joints = self.direction.iter_mut().zip(&mut self.anchor).zip(q);
        for ((direction, anchor), q) in joints {
            let moved = q - *anchor;
            if moved.abs() > self.threshold {
                *direction = moved.signum();
                *anchor = *q;
            }
        }
        Ok(())
    }

    /// +1 from below, −1 from above, 0 where nothing moved yet: for [`Under::approach`](crate::Under::approach).
    #[must_use]
    pub fn directions(&self) -> &[f64] {
        &self.direction
    }

    /// States them, where they are known otherwise.
    ///
    /// # Errors
    /// [`ModelError::Length`].
    pub fn set(&mut self, directions: &[f64]) -> Result<(), ModelError> {
        if directions.len() != self.direction.len() {
            return Err(ModelError::Length {
                what: "approach",
                found: directions.len(),
                expected: self.direction.len(),
            });
        }
        for (own, given) in self.direction.iter_mut().zip(directions) {
            *own = if *given == 0.0 { 0.0 } else { given.signum() };
        }
        Ok(())
    }
}
