//! How long a row of alike tasks will still take, said in the name of its stage.

use std::time::Duration;

use indicatif::HumanDuration;

/// The stage with how many of all tasks are done and the time left, as far as the tasks that are done tell it.
pub fn with_remaining(stage: &str, done: usize, all: usize, elapsed: Duration) -> String {
    if all == 0 {
        return stage.to_owned();
    }
    match remaining(done, all, elapsed) {
        Some(left) => format!(
            "{stage} [{done} of {all} done, about {} left]",
            HumanDuration(left)
        ),
        None => format!("{stage} [{done} of {all} done]"),
    }
}

/// The mean time of those done for each one to come; `None` before the first and after the last.
fn remaining(done: usize, all: usize, elapsed: Duration) -> Option<Duration> {
    let to_come = all.checked_sub(done).filter(|n| *n > 0)?;
    let share = u32::try_from(done).ok().filter(|n| *n > 0)?;
    Some((elapsed / share).saturating_mul(u32::try_from(to_come).ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_follows_from_what_is_done() {
        let twelve = Duration::from_secs(12);
        assert_eq!(remaining(0, 8, twelve), None);
        assert_eq!(remaining(2, 8, twelve), Some(Duration::from_secs(36)));
        assert_eq!(remaining(8, 8, twelve), None);
        assert_eq!(remaining(9, 8, twelve), None);
        assert_eq!(remaining(1, 3, Duration::MAX), Some(Duration::MAX));
    }

    #[test]
    fn the_stage_says_it() {
        let said = |done, all| with_remaining("fit: + gains", done, all, Duration::from_secs(12));
        assert_eq!(said(0, 0), "fit: + gains");
        assert_eq!(said(0, 8), "fit: + gains [0 of 8 done]");
        assert_eq!(
            said(2, 8),
            "fit: + gains [2 of 8 done, about 36 seconds left]"
        );
        assert_eq!(said(8, 8), "fit: + gains [8 of 8 done]");
    }
}
