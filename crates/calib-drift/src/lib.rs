//! Two calibrations of one robot compared by quantities that no choice of frames changes.
