//! Hand-eye and robot-world calibration, AX = ZB, with a certificate of optimality.
