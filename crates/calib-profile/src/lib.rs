//! Robot profiles: YAML to a checked profile in SI units.
