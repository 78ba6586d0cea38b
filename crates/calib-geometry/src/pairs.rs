//! Which distances between the points of a body are looked at.

/// Up to so many points, all distances are.
pub const ALL: usize = 24;

/// Whether the distance between two of `count` points is looked at: with more than [`ALL`] of them, that of each to those 1, 2, 4, 8, … places
/// before and behind it. These are five or more, enough to tell a point that is out of place, and what they cost
/// grows little faster than the number of points.
#[must_use]
pub fn is_compared(first: usize, second: usize, count: usize) -> bool {
    first != second && (count <= ALL || first.abs_diff(second).is_power_of_two())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_compared_with_several_others() {
        for count in [2, 3, ALL] {
            for point in 0..count {
                let others = (0..count).filter(|k| is_compared(point, *k, count));
                assert_eq!(others.count(), count - 1);
            }
        }
        for count in [ALL + 1, 200] {
            for point in 0..count {
                let others = (0..count).filter(|k| is_compared(point, *k, count));
                assert!((5..=16).contains(&others.count()));
            }
        }
    }
}
