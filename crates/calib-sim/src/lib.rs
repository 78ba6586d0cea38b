//! Recordings with known truth, from a profile.
