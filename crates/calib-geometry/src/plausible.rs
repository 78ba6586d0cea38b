//! Whether numbers can be in the unit that they are said to be in.

/// Why readings of a joint are hardly SI.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Unlikely {
    /// A reading is larger than any that an ordinary joint has: degrees in place of radians, or mm in place of m.
    Large {
        /// The largest magnitude.
        largest: f64,
    },
    /// All readings are whole or half numbers, and one is beyond half a turn: degrees as somebody typed them.
    HalfNumbers {
        /// The largest magnitude.
        largest: f64,
        /// How many different readings.
        distinct: usize,
    },
}

/// Three turns, rad: cables let few joints turn so far.
const TURNS: f64 = 6.0 * std::f64::consts::PI;
/// Longer than the rails of robots, m.
const RAIL: f64 = 100.0;
/// So many different readings are not all whole or half numbers of radians by chance.
const DISTINCT: usize = 4;

/// Why these readings are hardly radians; `None` where they may well be. Wheels and tables that turn without end are named too.
#[must_use]
pub fn unlikely_radians(readings: &[f64]) -> Option<Unlikely> {
    let largest = largest(readings);
    if largest > TURNS {
        return Some(Unlikely::Large { largest });
    }
    let halves = readings.iter().all(|q| (2.0 * q).fract() == 0.0);
    if !halves || largest <= std::f64::consts::PI {
        return None;
    }
    let mut values = readings.to_vec();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let distinct = values.len();
    (distinct >= DISTINCT).then_some(Unlikely::HalfNumbers { largest, distinct })
}

/// Why these readings are hardly meters; `None` where they may well be.
#[must_use]
pub fn unlikely_meters(readings: &[f64]) -> Option<Unlikely> {
    let largest = largest(readings);
    (largest > RAIL).then_some(Unlikely::Large { largest })
}

fn largest(readings: &[f64]) -> f64 {
    readings.iter().fold(0.0, |most, q| most.max(q.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_are_distinguished_from_radians() {
        let radians: Vec<f64> = (-30..=30).map(|k| 0.1 * f64::from(k)).collect();
        assert_eq!(unlikely_radians(&radians), None);
        let degrees: Vec<f64> = radians.iter().map(|q| q.to_degrees()).collect();
        assert!(matches!(
            unlikely_radians(&degrees),
            Some(Unlikely::Large { .. })
        ));
        // Small angles that somebody typed.
        let typed = [0.0, 2.5, 5.0, 7.5, 10.0];
        let found = Unlikely::HalfNumbers {
            largest: 10.0,
            distinct: 5,
        };
        assert_eq!(unlikely_radians(&typed), Some(found));
        // A grid of half radians within half a turn, three readings, and nothing.
        assert_eq!(unlikely_radians(&[-3.0, -1.5, 0.0, 0.5, 3.0]), None);
        assert_eq!(unlikely_radians(&[0.0, 5.0, 0.0, 10.0]), None);
        assert_eq!(unlikely_radians(&[]), None);
        // Two turns and a half of a wrist.
        assert_eq!(unlikely_radians(&[-15.7, 15.7]), None);
    }

    #[test]
    fn millimeters_are_distinguished_from_meters() {
        assert_eq!(unlikely_meters(&[0.0, 30.0]), None);
        assert!(unlikely_meters(&[0.0, 350.0]).is_some());
    }
}
