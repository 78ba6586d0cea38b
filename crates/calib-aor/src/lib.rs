//! Axis-of-rotation estimators.
