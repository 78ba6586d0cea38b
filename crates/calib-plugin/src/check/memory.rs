//! Does the process grow with every call?

use std::time::Duration;

/// Calls before and while memory is watched.
const CALLS: (usize, usize) = (50, 400);
/// Growth that 400 calls may show: an allocator's own movements stay far below.
const LIMIT_KIB: u64 = 8 * 1024;
/// Other threads of the program grow too, for a while; a leak grows every time.
const ROUNDS: usize = 8;
/// Between two rounds the others may come to an end.
const PAUSE: Duration = Duration::from_millis(200);

/// Resident memory of this process, KiB.
fn resident_kib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

/// # Errors
/// Why it cannot be measured.
pub(super) fn growth(call: impl Fn()) -> Result<Result<(), String>, &'static str> {
    const UNKNOWN: &str = "this system does not say how much memory a process has";
    let mut least = u64::MAX;
    for round in 0..ROUNDS {
        if round > 0 {
            std::thread::sleep(PAUSE);
        }
        (0..CALLS.0).for_each(|_| call());
        let before = resident_kib().ok_or(UNKNOWN)?;
        (0..CALLS.1).for_each(|_| call());
        let after = resident_kib().ok_or(UNKNOWN)?;
        least = least.min(after.saturating_sub(before));
        if least <= LIMIT_KIB {
            return Ok(Ok(()));
        }
    }
    Ok(Err(format!(
        "grew by {} MiB in {} calls",
        least / 1024,
        CALLS.1
    )))
}
