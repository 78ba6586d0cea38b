//! Center-of-rotation estimators.
