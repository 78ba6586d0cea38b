//! Joint speeds of a table whose rows were taken while the robot moved, from its own times.

use std::collections::BTreeMap;

use calib_recording::Poses;

/// Rows farther apart in the median, s, are poses with a date, not samples of a motion.
const APART: f64 = 0.5;
/// Share of the squared way between the neighbors of a row by which a motion bends at most; a row of a stop, or of a
/// pose chosen without regard to the last one, bends by a quarter of it and more.
const BEND: f64 = 0.02;

/// Speed of every joint in every row, rad/s or m/s, by central differences; empty where the rows have no times or are
/// not samples of a smooth motion.
pub(crate) fn speeds(poses: &Poses) -> BTreeMap<String, Vec<Option<f64>>> {
    let Some(t) = poses.t.as_ref().filter(|t| is_dense(t)) else {
        return BTreeMap::new();
    };
    let (mut bends, mut ways) = (0.0, 0.0);
    for values in poses.joints.values() {
        for i in 1..t.len().saturating_sub(1) {
            if let (Some(before), Some(q), Some(after)) = (values[i - 1], values[i], values[i + 1])
            {
                let share = (t[i] - t[i - 1]) / (t[i + 1] - t[i - 1]);
                bends += (q - before - share * (after - before)).powi(2);
                ways += (after - before).powi(2);
            }
        }
    }
    if ways <= 0.0 || bends > BEND * ways {
        return BTreeMap::new();
    }
    let of = |values: &Vec<Option<f64>>| -> Vec<Option<f64>> {
        let at = |i: usize| {
            let (a, b) = (i.checked_sub(1)?, i + 1);
            let way = (*values.get(b)?)? - values[a]?;
            Some(way / (t[b] - t[a]))
        };
        (0..values.len()).map(at).collect()
    };
    let joints = poses.joints.iter();
    joints
        .map(|(name, values)| (name.clone(), of(values)))
        .collect()
}

/// Times that grow from row to row, close together.
fn is_dense(t: &[f64]) -> bool {
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    let middle = steps.get(steps.len() / 2);
    steps.first().is_some_and(|s| *s > 0.0) && middle.is_some_and(|s| *s <= APART)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(t: Vec<f64>, q: impl Fn(f64) -> f64) -> Poses {
        let values = t.iter().map(|t| Some(q(*t))).collect();
        let mut poses = Poses::default();
        poses.joints.insert("elbow".to_owned(), values);
        poses.t = Some(t);
        poses
    }

    #[test]
    fn a_motion_has_speeds_and_poses_have_none() {
        let every = |dt: f64| (0..50).map(|i| dt * f64::from(i)).collect::<Vec<_>>();
        let moving = speeds(&table(every(0.1), |t| (0.8 * t).sin()));
        let at = moving["elbow"][20].expect("known");
        assert!((at - 0.8 * 1.6_f64.cos()).abs() < 2e-3, "{at}");
        assert_eq!(moving["elbow"][0], None);
        // Slow poses, stops between jumps, poses in any order, times that stand still.
        assert!(speeds(&table(every(5.0), |t| 0.01 * t)).is_empty());
        assert!(speeds(&table(every(0.1), |t| (2.0 * t).floor())).is_empty());
        assert!(speeds(&table(every(0.1), |t| (1e4 * t * t).sin())).is_empty());
        assert!(speeds(&table(vec![0.0; 50], |_| 0.0)).is_empty());
    }
}
