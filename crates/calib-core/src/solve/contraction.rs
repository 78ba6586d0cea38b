//! How steps near a minimum contract.

/// Decrements below this are near enough to the minimum…
const NEAR: f64 = 10.0;
/// …down to this, where rounding begins to count.
const ROUNDING: f64 = 1e-7;
/// So many times as much as was left elsewhere is expected to be left…
const MARGIN: f64 = 10.0;
/// …after steps from so many times as far.
const FARTHER: f64 = 10.0;

/// What steps near the minimum leave of the decrement, as those of a minimization showed. Less damping leaves no more.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Contraction {
    /// The largest part that was left.
    part: f64,
    /// The largest decrement that a step was followed from.
    from: f64,
    /// The largest damping of those steps.
    damping: f64,
}

impl Contraction {
    /// Of a step from this decrement that left another; `None` where it says nothing.
    pub(crate) fn of(from: f64, left: f64, damping: f64) -> Option<Self> {
        let part = left / from;
        let told = (ROUNDING..NEAR).contains(&from) && part.is_finite();
        told.then_some(Self {
            part,
            from,
            damping,
        })
    }

    /// What holds for both.
    pub(crate) fn and(self, other: Self) -> Self {
        Self {
            part: self.part.max(other.part),
            from: self.from.max(other.from),
            damping: self.damping.max(other.damping),
        }
    }

    /// At most what a step from this decrement leaves; `None` where it is farther out or more damped than those that are known.
    pub(crate) fn left(self, decrement: f64, damping: f64) -> Option<f64> {
        let known = decrement <= (FARTHER * self.from).min(NEAR) && damping <= self.damping;
        known.then_some(MARGIN * self.part * decrement)
    }
}

/// What holds for both, or for the one that is known.
pub(crate) fn both(a: Option<Contraction>, b: Option<Contraction>) -> Option<Contraction> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.and(b)),
        (a, b) => a.or(b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_expected_beyond_what_was_seen() {
        let seen = Contraction::of(0.1, 1e-7, 1e-4).unwrap();
        assert!((seen.left(0.2, 1e-6).unwrap() - 2e-6).abs() < 1e-15);
        // Farther out, and more damped.
        assert_eq!(seen.left(1.1, 1e-6), None);
        assert_eq!(seen.left(0.2, 1e-3), None);
        let wider = seen.and(Contraction::of(4.0, 1e-3, 1e-3).unwrap());
        assert!((wider.left(2.0, 1e-3).unwrap() - 5e-3).abs() < 1e-15);
        assert_eq!(wider.left(11.0, 1e-3), None);
        for (from, left) in [(1e3, 1.0), (1e-9, 1e-15), (0.0, 0.0), (1.0, f64::NAN)] {
            assert_eq!(Contraction::of(from, left, 1e-3), None);
        }
        assert_eq!(both(None, Some(seen)), Some(seen));
    }
}
