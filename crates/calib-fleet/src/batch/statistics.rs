//! What many robots say together.
//!
//! ```text
//! one robot     alarm where p < α                                                              (1)
//! the fleet     p_(1) ≤ … ≤ p_(m), each times m − i, none less than one before it: < α         (2)  Holm 1979
//! a series      K robots of n whose joint has p < α:  P(K ≥ k) = Σ_{j≥k} C(n,j) αʲ (1−α)ⁿ⁻ʲ    (3)
//!               for every joint of every series, (2) over all of them
//! ```
//!
//! α = 1 %. Alarms of (1) are expected in 1 % of unchanged robots; in a fleet of unchanged robots (2) says anything with a probability of
//! at most 1 %, and so does (3). Robots are taken for independent: one tracker that is out of adjustment changes all of them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use statrs::distribution::{Binomial, DiscreteCDF as _};

use super::row::Robot;

/// α
pub const FALSE_ALARMS: f64 = 0.01;

/// A joint of a series.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SeriesJoint {
    /// The series.
    pub series: String,
    /// The joint.
    pub joint: String,
    /// Robots in which it was compared.
    pub robots: u64,
    /// Robots in which it changed, (1), those among them by chance included: [`Statistics::by_chance`].
    pub changed: u64,
    /// Probability of so many where nothing changed, (3).
    pub p_value: f64,
    /// The same among all joints of all series, (2).
    pub p_adjusted: f64,
    /// Said to drift in the series.
    pub drifts: bool,
}

/// A robot's alarms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Alarm {
    /// The robot.
    pub name: String,
    /// Its series.
    pub series: String,
    /// The joint that changed most certainly.
    pub joint: Option<String>,
    /// Probability where nothing changed.
    pub p_value: f64,
    /// The same among all robots, (2).
    pub p_adjusted: f64,
    /// Whether the fleet's test says so too.
    pub familywise: bool,
}

/// What a fleet's changes say.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// α
    pub false_alarms: f64,
    /// Robots that were compared with last time.
    pub compared: u64,
    /// Names of those that have an earlier result and could not be compared with it.
    #[serde(default)]
    pub not_compared: Vec<String>,
    /// Robots with an alarm, (1), most certain first.
    pub alarms: Vec<Alarm>,
    /// Joints of series in which any robot changed, most certain first.
    pub series: Vec<SeriesJoint>,
}

impl Statistics {
    /// Robots of a series in which the joint would be said to change if none had: α of them.
    #[must_use]
    pub fn by_chance(&self, joint: &SeriesJoint) -> f64 {
        self.false_alarms * joint.robots as f64
    }
}

/// What is kept of each robot while the others are read.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    /// Those that could not be compared.
    not_compared: Vec<String>,
    /// Of each robot that was compared, the probability of its change without one.
    robots: Vec<f64>,
    /// Those that are alarms: place in the list, name, series, joint that changed most.
    alarms: Vec<(usize, String, String, Option<String>)>,
    /// Robots and changed ones, by series and joint.
    joints: BTreeMap<(String, String), (u64, u64)>,
}

impl Tally {
    /// Adds a robot.
    pub fn add(&mut self, robot: &Robot) {
        let Some(drift) = &robot.drift else {
            let name = robot.not_compared.as_ref().map(|_| robot.name.clone());
            self.not_compared.extend(name);
            return;
        };
        if drift.p_value < FALSE_ALARMS {
            let most = robot.most_changed();
            self.alarms.push((
                self.robots.len(),
                robot.name.clone(),
                robot.series.clone(),
                most.map(|joint| joint.joint.clone()),
            ));
        }
        self.robots.push(drift.p_value);
        for joint in &drift.joints {
            let key = (robot.series.clone(), joint.joint.clone());
            let (robots, changed) = self.joints.entry(key).or_default();
            *robots += 1;
            *changed += u64::from(joint.p_value < FALSE_ALARMS);
        }
    }

    /// (1), (2) and (3).
    pub fn statistics(self) -> Statistics {
        let compared = self.robots.len() as u64;
        let adjusted = holm(&self.robots);
        let mut alarms: Vec<Alarm> = self
            .alarms
            .into_iter()
            .map(|(place, name, series, joint)| Alarm {
                name,
                series,
                joint,
                p_value: self.robots[place],
                p_adjusted: adjusted[place],
                familywise: adjusted[place] < FALSE_ALARMS,
            })
            .collect();
        // The order of the fleet where they are equal: the sort is stable.
        alarms.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
        let p = |(n, k): &(u64, u64)| at_least(*n, *k);
        let all: Vec<f64> = self.joints.values().map(p).collect();
        let joints = self.joints.into_iter().zip(holm(&all)).zip(&all);
        let joints = joints.map(
            |((((series, joint), (robots, changed)), p_adjusted), p_value)| SeriesJoint {
                series,
                joint,
                robots,
                changed,
                p_value: *p_value,
                p_adjusted,
                drifts: p_adjusted < FALSE_ALARMS,
            },
        );
        let mut series: Vec<SeriesJoint> = joints.filter(|j| j.changed > 0).collect();
        series.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
        Statistics {
            false_alarms: FALSE_ALARMS,
            compared,
            not_compared: self.not_compared,
            alarms,
            series,
        }
    }
}

/// Equation (2).
fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut adjusted = vec![1.0; p.len()];
    let mut least = 0.0_f64;
    for (i, &place) in order.iter().enumerate() {
        least = least.max(p[place] * (p.len() - i) as f64).min(1.0);
        adjusted[place] = least;
    }
    adjusted
}

/// Equation (3).
fn at_least(n: u64, k: u64) -> f64 {
    match (k, Binomial::new(FALSE_ALARMS, n)) {
        (0, _) | (_, Err(_)) => 1.0,
        (k, Ok(chance)) => chance.sf(k - 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::row::{Drifted, JointDrift};
    use calib_report::Unit;

    #[test]
    fn holm_is_the_textbooks() {
        // Five tests; by hand: 0.05, 0.04 → 0.05, 0.06, 0.06, 0.2.
        let found = holm(&[0.02, 0.01, 0.2, 0.01, 0.03]);
        let expected = [0.06, 0.05, 0.2, 0.05, 0.06];
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-15, "{found:?}");
        }
    }

    #[test]
    fn the_tail_is_that_of_the_sum() {
        // 1 − 0.99¹⁰ and 1 − 0.99¹⁰ − 10·0.01·0.99⁹
        let none = 0.99_f64.powi(10);
        assert!((at_least(10, 1) - (1.0 - none)).abs() < 1e-12);
        let one = 10.0 * 0.01 * 0.99_f64.powi(9);
        assert!((at_least(10, 2) - (1.0 - none - one)).abs() < 1e-12);
        assert_eq!((at_least(10, 0), at_least(0, 0)), (1.0, 1.0));
    }

    fn robot(k: usize, p: f64, wrist: f64) -> Robot {
        let joint = |name: &str, p_value| JointDrift {
            joint: name.to_owned(),
            p_value,
            change: 1e-3,
            sigma: 1e-4,
            unit: Unit::Radian,
        };
        Robot {
            name: format!("r{k}"),
            series: ["a", "b"][k % 2].to_owned(),
            drift: Some(Drifted {
                p_value: p,
                joints: vec![joint("elbow", 0.5), joint("wrist", wrist)],
            }),
            ..Robot::default()
        }
    }

    #[test]
    fn one_robot_is_an_alarm_and_a_share_is_an_effect_of_the_series() {
        let mut tally = Tally::default();
        for k in 0..200 {
            // One robot of a hundred by chance; in series b every tenth wrist drifts.
            let drifts = k % 20 == 1;
            let p = if drifts {
                1e-9
            } else if k == 50 {
                0.005
            } else {
                0.4
            };
            tally.add(&robot(k, p, if drifts { 1e-9 } else { 0.3 }));
        }
        tally.add(&Robot::default());
        let found = tally.statistics();
        assert_eq!((found.compared, found.alarms.len()), (200, 11));
        let familywise = found.alarms.iter().filter(|a| a.familywise);
        assert!(
            familywise
                .clone()
                .all(|a| a.joint.as_deref() == Some("wrist"))
        );
        assert_eq!(familywise.count(), 10);
        assert_eq!(found.series.len(), 1);
        let effect = &found.series[0];
        assert_eq!((&*effect.series, &*effect.joint), ("b", "wrist"));
        assert_eq!(
            (effect.robots, effect.changed, effect.drifts),
            (100, 10, true)
        );
        assert_eq!(found.by_chance(effect), 1.0);
    }

    #[test]
    fn chance_is_no_effect() {
        let mut tally = Tally::default();
        for k in 0..200 {
            tally.add(&robot(k, 0.3, if k == 7 { 0.004 } else { 0.3 }));
        }
        let found = tally.statistics();
        assert!(!found.series[0].drifts, "{:?}", found.series);
        assert!(found.alarms.is_empty());
    }
}
