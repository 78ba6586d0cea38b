//! Robot model and forward kinematics from a URDF; edits of the URDF's text.
