//! How far a body must slip on its link to be noticed.
//!
//! ```text
//! power(d) = Φ(d/s − 6),   s by maximum likelihood over trials with slips of different length              (1)
//! ```
//!
//! 6: the scan for changes asks for about six standard deviations of a jump, since it looks at all moments and directions. The interval of s holds
//! the likelihoods that are at least e^−1.92 of the largest.

use calib_pipeline::estimated::Estimated;
use calib_pipeline::prepare::inputs::Loaded;
use calib_profile::{BodyKind, Usage};
use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

use crate::fault::Fault;
use crate::session::Session;
use crate::trial::Injected;
use crate::truth::is_moved;

/// Standard deviations of a jump that a scan asks for.
const ASKED: f64 = 6.0;
/// Rows of a recording that a slip can be seen in, at least.
const ROWS: usize = 12;
/// Sizes that are tried: from this part of what is expected to this multiple.
const TRIED: [f64; 2] = [0.25, 4.0];

/// How far a body must slip to be noticed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SlipPower {
    /// The body.
    pub body: String,
    /// Trials with a slip of different lengths.
    pub tried: u32,
    /// In how many something was noticed.
    pub noticed: u32,
    /// In how many the body was named.
    pub named: u32,
    /// Length that is noticed in 80 %, m; null: none of the lengths tried was noticed, or all were.
    pub size_m: Option<f64>,
    /// Its 95 % interval, m.
    pub interval_m: Option<[f64; 2]>,
    /// Shortest and longest that was tried, m.
    pub tried_m: [f64; 2],
}

/// Bodies that can slip: those that joints move, seen often enough in a recording that is fitted.
#[must_use]
pub fn bodies(session: &Session) -> Vec<String> {
    let bodies = session.rows.robot.profile.bodies.iter();
    let can = bodies.filter(|(name, body)| {
        is_moved(&session.rows, body.link) && !recordings(session, name).is_empty()
    });
    can.map(|(name, _)| name.clone()).collect()
}

/// Rows that show a body.
fn seen(session: &Session, loaded: &Loaded, body: &str) -> Vec<usize> {
    let shown = |row: usize| match session.rows.robot.profile.bodies.get(body).map(|b| &b.kind) {
        Some(BodyKind::Markers { names, .. }) => {
            let track = |name: &String| loaded.poses.markers.get(name)?.get(row).copied()?;
            names.iter().any(|name| track(name).is_some())
        }
        _ => {
            let track = loaded.poses.bodies.get(body);
            track.is_some_and(|track| track.get(row).is_some_and(Option::is_some))
        }
    };
    (0..loaded.poses.len()).filter(|row| shown(*row)).collect()
}

/// The fitted recordings that show a body often enough, with the rows.
fn recordings<'a>(session: &'a Session, body: &str) -> Vec<(&'a String, Vec<usize>)> {
    let fitted = session.rows.recordings.iter();
    let fitted = fitted.filter(|(_, r)| r.spec.usage != Usage::Validation);
    let with_rows = fitted.map(|(name, loaded)| (name, seen(session, loaded, body)));
    with_rows.filter(|(_, rows)| rows.len() >= ROWS).collect()
}

/// A slip of random length and direction in the middle third of a recording.
#[must_use]
pub fn draw(session: &Session, body: &str, rng: &mut ChaCha12Rng) -> Option<(Fault, f64)> {
    let recordings = recordings(session, body);
    let (recording, rows) = recordings.get(rng.random_range(0..recordings.len().max(1)))?;
    let third = rows.len() / 3;
    let row = rows[third + rng.random_range(0..third.max(1))];
    let direction = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
    let [low, high] = lengths(session, body)?;
    let length = low * (high / low).powf(rng.random::<f64>());
    let by = direction.try_normalize(f64::MIN_POSITIVE)? * length;
    let fault = Fault::Slip {
        body: body.to_owned(),
        recording: (*recording).clone(),
        row,
        by,
    };
    Some((fault, length))
}

/// Lengths that are tried, m: about where ASKED σ of the difference of two means are.
fn lengths(session: &Session, body: &str) -> Option<[f64; 2]> {
    let rms = residual(&session.own, session, body)?;
    let rows: usize = recordings(session, body).iter().map(|r| r.1.len()).sum();
    // Two means of half of the rows each: σ of their difference is 2 rms/√n per coordinate.
    let expected = (ASKED + 1.0) * 2.0 * rms / 3.0_f64.sqrt() / (rows as f64).sqrt();
    Some(TRIED.map(|times| times * expected))
}

/// rms of the kept residuals of a body, m.
fn residual(own: &Estimated, session: &Session, body: &str) -> Option<f64> {
    let fit = session.fit()?;
    let tracks = &own.checked.tracks;
    let robot = &fit.calibration;
    let rows =
        calib_pipeline::verify::residuals::residual_rows(&own.inputs, tracks, robot, Some(fit));
    let names: Vec<&String> = match &own.inputs.robot.profile.bodies.get(body)?.kind {
        BodyKind::Markers { names, .. } => names.iter().collect(),
        BodyKind::Pose => Vec::new(),
    };
    let of = |r: &&calib_report::ResidualRow| {
        r.used && (&*r.subject == body || names.iter().any(|n| **n == *r.subject))
    };
    let squares = rows.iter().filter(of);
    let squares: Vec<f64> = squares
        .map(|r| r.residual_m.iter().map(|x| x * x).sum())
        .collect();
    let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    (!squares.is_empty() && mean > 0.0).then(|| mean.sqrt())
}

/// Equation (1).
#[must_use]
pub fn power(session: &Session, body: &str, injected: &[Injected]) -> Option<SlipPower> {
    let tried_m = lengths(session, body)?;
    let of: Vec<&Injected> = injected.iter().filter(|i| i.what == body).collect();
    let count = |is: fn(&Injected) -> bool| of.iter().filter(|i| is(i)).count() as u32;
    let outcomes: Vec<(f64, bool)> = of.iter().map(|i| (i.size, i.noticed)).collect();
    let found = likeliest(&outcomes);
    Some(SlipPower {
        body: body.to_owned(),
        tried: of.len() as u32,
        noticed: count(|i| i.noticed),
        named: count(|i| i.named),
        size_m: found.map(|f| f[1]),
        interval_m: found.map(|f| [f[0], f[2]]),
        tried_m,
    })
}

/// Length that is noticed in 80 %, between the ends of its interval; `None` where all were noticed, or none.
fn likeliest(outcomes: &[(f64, bool)]) -> Option<[f64; 3]> {
    /// Half of the 95 % quantile of χ² with one degree of freedom.
    const DROP: f64 = 1.92;
    /// Lengths in 1 % steps.
    const STEP: f64 = 1.01;
    /// Something else can hide a slip, or show one.
    const LAPSE: f64 = 0.01;
    let normal = Normal::standard();
    let some = |wanted: bool| outcomes.iter().any(|o| o.1 == wanted);
    if !some(true) || !some(false) {
        return None;
    }
    let to_80 = ASKED + normal.inverse_cdf(0.8);
    let likelihood = |s: f64| -> f64 {
        let one = |(d, noticed): &(f64, bool)| {
            let p = normal.cdf(d / s - ASKED) * (1.0 - 2.0 * LAPSE) + LAPSE;
            if *noticed { p.ln() } else { (1.0 - p).ln() }
        };
        outcomes.iter().map(one).sum()
    };
    let (low, high) = outcomes.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), o| {
        (l.min(o.0), h.max(o.0))
    });
    let mut all = Vec::new();
    let mut s = low / to_80 / 4.0;
    while s < high / ASKED * 4.0 {
        all.push((s, likelihood(s)));
        s *= STEP;
    }
    let best = all.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let inside = || all.iter().filter(|a| a.1 > best.1 - DROP).map(|a| a.0);
    let ends = [inside().next()?, best.0, inside().next_back()?];
    Some(ends.map(|s| s * to_80))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn the_interval_holds_the_length_that_is_noticed_in_80_percent() {
        let normal = Normal::standard();
        let s = 0.3e-3;
        let real = s * (ASKED + normal.inverse_cdf(0.8));
        let mut held = 0;
        for seed in 0..200 {
            let mut rng = ChaCha12Rng::seed_from_u64(seed);
            let outcomes: Vec<(f64, bool)> = (0..24)
                .map(|_| {
                    let d = 0.5e-3 * 16.0_f64.powf(rng.random::<f64>());
                    (d, rng.random::<f64>() < normal.cdf(d / s - ASKED))
                })
                .collect();
            let [low, _, high] = likeliest(&outcomes).expect("both");
            held += u32::from(low <= real && real <= high);
        }
        // 190 of 200 expected; 99.9 % are above 180. The lapse makes it a little wider.
        assert!(held >= 180, "{held}");
        assert!(likeliest(&[(1.0, true), (2.0, true)]).is_none());
    }
}
