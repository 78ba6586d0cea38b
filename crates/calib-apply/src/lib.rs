//! A calibration result put into the robot's own files, and taken out again.
