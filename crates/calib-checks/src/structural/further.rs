//! Candidates that are asked beside those of every recording, where something speaks for them.

use super::candidates::{Candidate, of_still};
use super::data::Data;
use super::hypothesis::{Hypothesis, Scope};
use super::ids::{RecordingIndex, SampleIndex};
use super::outcome::Options;
use super::scan::Scan;
use super::sized;
use super::special;

/// The hypothesis that leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Leads {
    /// The tracker or a body seems to have moved.
    Frame,
    /// A joint seems to have another axis.
    Axis,
    Other,
}

/// What speaks for more candidates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Signs {
    /// Nominal errors do not explain the residual.
    pub wrong: bool,
    pub leads: Leads,
}

/// Joints that never moved, since no other data say where they stood, in all recordings or in one that is unlike the others; where something is wrong,
/// in any, zeros, gains and couplings, which are also rivals of an axis that leads; those of single recordings also of a frame that leads.
pub(super) fn further(
    data: &Data,
    screened: &[SampleIndex],
    options: &Options,
    Signs { wrong, leads }: Signs,
) -> Vec<Candidate> {
    let suspects = &options.suspects;
    let mut more = of_still(data);
    let single = |scope: &Scope| matches!(scope, Scope::Recording(_));
    let parts = more.iter().any(|(_, scopes)| scopes.iter().any(single));
    let odd = match parts && !wrong {
        true => odd_recordings(data, screened),
        false => Vec::new(),
    };
    let asked = |scope: &Scope| match scope {
        Scope::Recording(r) => {
            (suspects.is_empty() || suspects.contains(r)) && (wrong || odd.contains(r))
        }
        _ => suspects.is_empty(),
    };
    for (hypothesis, scopes) in &mut more {
        scopes.retain(asked);
        // Where all seems right, only readings that explain something at once are worth a search.
        if let Hypothesis::MissingColumn { joint } = *hypothesis
            && !wrong
        {
            scopes.retain(|scope| special::explains_at_once(*scope, joint, data));
        }
    }
    more.retain(|(_, scopes)| !scopes.is_empty());
    if wrong || leads != Leads::Other {
        let everywhere = wrong || leads == Leads::Axis;
        let of_sizes = sized::of_sizes(data, screened, options);
        let asked = |scope: &Scope| match scope {
            // One that only the suspects show may be everywhere.
            Scope::All => everywhere,
            Scope::Recording(r) => suspects.is_empty() || suspects.contains(r),
            Scope::AllExcept(_) => wrong && suspects.is_empty(),
        };
        let of_sizes = of_sizes.into_iter();
        more.extend(of_sizes.filter(|(_, scopes)| scopes.iter().all(asked)));
    }
    more
}

/// Recordings that the registration of all fits far worse than it fits the others.
fn odd_recordings(data: &Data, screened: &[SampleIndex]) -> Vec<RecordingIndex> {
    /// So many times worse.
    const FAR: f64 = 3.0;
    let scan = Scan::new(data, screened);
    let fit = scan.fit(None);
    let n = scan.channels.len();
    let mut sums = vec![(0.0, 0.0); scan.recordings];
    for (i, recording) in data.recording.iter().enumerate() {
        for k in (0..n).filter(|k| scan.weights[i * n + k] > 0.0) {
            let (squares, count) = &mut sums[recording.0];
            *squares += scan.residual(&fit, i, k).norm_squared();
            *count += 1.0;
        }
    }
    let all: (f64, f64) = sums
        .iter()
        .fold((0.0, 0.0), |all, one| (all.0 + one.0, all.1 + one.1));
    let is_odd = |(squares, count): &(f64, f64)| {
        let others = (all.0 - squares) / (all.1 - count).max(1.0);
        *count > 0.0 && all.1 > *count && squares / count > FAR * FAR * others
    };
    let odd = sums.iter().enumerate().filter(|(_, one)| is_odd(one));
    odd.map(|(r, _)| RecordingIndex(r)).collect()
}
