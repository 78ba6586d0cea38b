use crate::number;

/// An axis: values `from..to` onto pixels `at..at + length`; `length` is negative for an upward axis.
pub(super) struct Scale {
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) at: f64,
    pub(super) length: f64,
    pub(super) log: bool,
}

impl Scale {
    pub(super) fn new(values: impl Iterator<Item = f64>, at: f64, length: f64, log: bool) -> Self {
        let usable = values.filter(|x| x.is_finite() && (!log || *x > 0.0));
        let (mut from, mut to) = usable
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(from, to), x| {
                (from.min(x), to.max(x))
            });
        if from > to {
            (from, to) = (1.0, 1.0);
        }
        if log {
            return Self {
                from: from / 1.3,
                to: to * 1.3,
                at,
                length,
                log,
            };
        }
        if to - from < 1e-12 * to.abs().max(1e-6) {
            let room = if from == 0.0 { 1.0 } else { 0.5 * from.abs() };
            (from, to) = (from - room, to + room);
        }
        let room = 0.04 * (to - from);
        // An axis that starts at zero starts at zero.
        Self {
            from: if from == 0.0 { 0.0 } else { from - room },
            to: if to == 0.0 { 0.0 } else { to + room },
            at,
            length,
            log,
        }
    }

    pub(super) fn place(&self, x: f64) -> f64 {
        let share = if self.log {
            (x.max(self.from) / self.from).ln() / (self.to / self.from).ln()
        } else {
            (x - self.from) / (self.to - self.from)
        };
        self.at + share.clamp(0.0, 1.0) * self.length
    }

    /// About `count` round numbers and their labels, at least two.
    pub(super) fn ticks(&self, count: f64) -> Vec<(f64, String)> {
        let by_decade = if self.log { self.decades() } else { Vec::new() };
        if by_decade.len() >= 2 {
            return by_decade;
        }
        // Each try halves the step or more: the second already finds two round numbers almost always.
        let tries = (0..4).map(|k| self.even(count * 2f64.powi(k)));
        let mut found = tries.skip_while(|ticks| ticks.len() < 2);
        found.next().unwrap_or_default()
    }

    /// 1, 2 and 5 of each decade; the decades alone where there are many.
    fn decades(&self) -> Vec<(f64, String)> {
        let (low, high) = (
            self.from.log10().floor() as i32,
            self.to.log10().ceil() as i32,
        );
        let steps: &[f64] = if high - low > 3 {
            &[1.0]
        } else {
            &[1.0, 2.0, 5.0]
        };
        let all = (low..=high).flat_map(|decade| {
            steps
                .iter()
                .map(move |step| (step * 10f64.powi(decade), decade))
        });
        all.filter(|(x, _)| (self.from..=self.to).contains(x))
            .map(|(x, decade)| (x, number::fixed(x, (-decade).max(0) as usize)))
            .collect()
    }

    /// Multiples of a round step.
    fn even(&self, count: f64) -> Vec<(f64, String)> {
        let raw = (self.to - self.from) / count;
        let decade = 10f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .iter()
            .map(|m| m * decade)
            .find(|step| *step >= raw * 0.999)
            .unwrap_or(raw);
        let decimals = (-(step * 1.001).log10().floor()).max(0.0) as usize;
        let first = (self.from / step).ceil() as i64;
        let last = (self.to / step).floor() as i64;
        (first..=last)
            .map(|i| i as f64 * step)
            .map(|x| (x, number::fixed(x, decimals)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_inside_and_not_too_many() {
        for (from, to) in [
            (0.0, 1.0),
            (-3.7, 12.2),
            (1e-6, 3e-6),
            (-1e5, 1e5),
            (5.0, 5.0),
            (0.0, 0.0),
        ] {
            let scale = Scale::new([from, to].into_iter(), 0.0, 100.0, false);
            let ticks = scale.ticks(4.0);
            assert!((2..=9).contains(&ticks.len()), "{from} {to}: {ticks:?}");
            for (x, label) in ticks {
                assert!((0.0..=100.0).contains(&scale.place(x)));
                assert!(
                    (label.replace('−', "-").parse::<f64>().expect("a number") - x).abs()
                        <= 1e-9 * x.abs().max(1e-9),
                    "{label} {x}"
                );
            }
        }
    }

    #[test]
    fn a_logarithmic_axis_survives_zero_and_nothing() {
        let scale = Scale::new([0.0, 0.5, 40.0].into_iter(), 0.0, 100.0, true);
        assert_eq!(scale.place(0.0), 0.0);
        assert!(scale.ticks(4.0).iter().any(|tick| tick.1 == "10"));
        let empty = Scale::new(std::iter::empty(), 0.0, 100.0, true);
        assert!(empty.place(1.0).is_finite());
    }
}
