//! The likeliest mistake beside errors of the robot.
//!
//! A robot whose drawing is off by degrees and centimeters leaves a residual at registration level that no mistake divides by 1.5. What
//! tells then is how much of the residual errors within the priors explain, with the mistake and without: the restricted
//! likelihood of the linear model at the geometry that fits best ([`linear`](super::linear)),
//!
//! ```text
//! L_h = −½ (ν ln χ²_h + ln|V| + ln|N_h| − ln|P|),   gain_h = L_h − L_none on the rows that h has                  (1)
//! named where gain_h ≥ 14, σ_none/σ_h ≥ 1.5, σ_h ≤ 5 σ, and nothing else comes within 14 of it                     (2)
//! ```
//!
//! e¹⁴ is a million: a mistake has one chance in some hundreds before the data are seen, and its likelihood is only as good as
//! the priors. What is left must be noise: a mistake that stands in for physics that is missing leaves more, and so do two
//! mistakes. Hypotheses with a frame, a mount or readings of their own have other unknowns and are no candidates, but rivals.

use super::apply::apply;
use super::candidates::candidates;
use super::data::{Data, DataError};
use super::hypothesis::{Hypothesis, Scoped};
use super::ids::{BodyIndex, SampleIndex};
use super::linear::{Model, solve};
use super::naming::Asked;
use super::nonlinear::{Noise, fewer, noise_ratio, relinearized};
use super::outcome::{Allowing, Named, Options};
use super::ranking::{Ranking, distinct};
use super::scan::{Scan, Scored};

/// Hypotheses with a residual of up to this many times that of the data as they are can be the likeliest.
const WITHIN: f64 = 1.2;
/// Leaders that are fitted, and rivals beside them.
const LEADERS: usize = 10;
/// The gain that is asked for, and how far behind everything else must be.
const DECISIVE: f64 = 14.0;
/// How many times larger the noise must be without the mistake.
const QUIETER: f64 = 1.5;
/// What is left may be this many times the stated noise.
const NOISE: f64 = 5.0;
/// Relinearizations: from degrees and centimeters to a tenth of the noise.
const ROUNDS: usize = 6;

/// What the likelihood says of the leading hypotheses.
pub(super) enum Opinion {
    /// One is by far the likeliest: (2).
    Likelier(Named),
    /// The one that was named is less likely than the data as they are, or far less than another one.
    Against,
    /// Neither.
    Open,
}

/// Asks the leading hypotheses, and the one that the residual of a registration `named`.
pub(super) fn opinion(asked: &Asked<'_>, named: Option<&Named>, invisible: &[Scoped]) -> Opinion {
    let judged = judged(asked, invisible, named.is_some());
    if let Some(best) = judged
        .first()
        .filter(|_| stands_out(&judged, asked.options))
    {
        let mut likelier = asked.name(best.scored);
        // Everything else is a million times less likely.
        likelier.alternatives.clear();
        likelier.allowing = Some(best.allowing);
        return Opinion::Likelier(likelier);
    }
    let own = |named: &&Named| {
        let is = |j: &&Judged<'_>| named.correction == [j.scored.scoped];
        judged.iter().find(is)
    };
    let first = judged
        .first()
        .filter(|first| !has_unknowns(&first.scored.scoped.hypothesis));
    let first = first.map_or(0.0, |first| first.gain - DECISIVE);
    match named.as_ref().and_then(own) {
        Some(own) if own.gain < first.max(0.0) && !has_unknowns(&own.scored.scoped.hypothesis) => {
            Opinion::Against
        }
        _ => Opinion::Open,
    }
}

/// Whether errors of the robot within the priors leave no more than noise of the data as they are.
pub(super) fn errors_explain(asked: &Asked<'_>) -> bool {
    let without = fitted(asked.data, asked.screened, asked.options);
    without.is_some_and(|without| without.sigma <= QUIETER * asked.options.sigma)
}

/// The leaders with what they gain, the likeliest first. None where errors of the robot leave no more than noise of the data as they are,
/// and no mistake was named that might be worse.
fn judged<'a>(asked: &Asked<'a>, invisible: &[Scoped], named: bool) -> Vec<Judged<'a>> {
    let ranking: &'a Ranking = asked.ranking;
    let most = WITHIN * ranking.none.score;
    let near = |s: &&Scored| s.score.score < most && !invisible.contains(&s.scoped);
    let mut leaders: Vec<&'a Scored> = distinct(&ranking.scored, usize::MAX)
        .filter(near)
        .take(LEADERS)
        .collect();
    // A cloud of points in a wrong unit of length looks like a body on a link that does not move.
    let link = |s: &&Scored| matches!(s.scoped.hypothesis, Hypothesis::WrongLink { .. });
    if leaders.iter().any(link) {
        let unit = |s: &&Scored| s.scoped.hypothesis.log_scale() != 0.0 && !near(s);
        leaders.extend(ranking.scored.iter().filter(unit));
    }
    let without = (!leaders.is_empty()).then(|| fitted(asked.data, asked.screened, asked.options));
    let Some(without) = without.flatten() else {
        return Vec::new();
    };
    if !named && without.sigma <= QUIETER * asked.options.sigma {
        return Vec::new();
    }
    let leaders = leaders.into_iter();
    let mut judged: Vec<Judged<'a>> = leaders
        .filter_map(|s| Judged::of(asked, s, without))
        .collect();
    judged.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    judged
}

/// (2) for the first.
fn stands_out(judged: &[Judged<'_>], options: &Options) -> bool {
    let Some(best) = judged.first() else {
        return false;
    };
    let next = judged.get(1).map_or(0.0, |next| next.gain.max(0.0));
    best.gain - next >= DECISIVE
        && best.allowing.none >= QUIETER * best.allowing.best
        && best.allowing.best <= NOISE * options.sigma
        && !has_unknowns(&best.scored.scoped.hypothesis)
}

/// A frame, a mount or readings of its own, or another density of what was measured.
pub(super) fn has_unknowns(hypothesis: &Hypothesis) -> bool {
    matches!(
        hypothesis,
        Hypothesis::TrackerMoved
            | Hypothesis::Remounted { .. }
            | Hypothesis::MissingColumn { .. }
            | Hypothesis::StoodAt { .. }
            | Hypothesis::Zero { .. }
            | Hypothesis::Gain { .. }
            | Hypothesis::TrackerUnit { .. }
    )
}

/// A hypothesis with what it gains.
struct Judged<'s> {
    scored: &'s Scored,
    gain: f64,
    allowing: Allowing,
}

impl<'s> Judged<'s> {
    fn of(asked: &Asked<'_>, scored: &'s Scored, without: Noise) -> Option<Self> {
        let (data, screened, options) = (asked.data, asked.screened, asked.options);
        let corrected = apply(&scored.scoped, data);
        let with = fitted(&corrected, screened, options)?;
        let lost = lost(data, &corrected);
        // A row without a partner takes part on neither side.
        let without = if lost.is_empty() {
            without
        } else {
            let all: Vec<SampleIndex> = screened.iter().copied().chain(lost).collect();
            fitted(data, &all, options)?
        };
        Some(Self {
            scored,
            gain: with.log_likelihood - without.log_likelihood
                + with.coordinates * log_scale(scored),
            allowing: Allowing {
                none: without.sigma,
                best: with.sigma,
            },
        })
    }
}

/// ln of the scale of a coordinate: the density is that of what was measured, not of what was corrected.
fn log_scale(scored: &Scored) -> f64 {
    match scored.scoped.hypothesis.log_scale() {
        0.0 => 0.0,
        _ => scored.score.rms.ln() - scored.score.score.max(f64::MIN_POSITIVE).ln(),
    }
}

/// The noise at the geometry that fits best.
fn fitted(data: &Data, screened: &[SampleIndex], options: &Options) -> Option<Noise> {
    let (part, screened) = fewer(data, screened);
    let (part, deviation, sigma) = relinearized(part, &screened, options, ROUNDS)?;
    noise_ratio(&part, &deviation, sigma, &screened, options)
}

/// Samples of the rows that the corrected data do not have.
fn lost(data: &Data, corrected: &Data) -> Vec<SampleIndex> {
    let (before, after) = (Scan::new(data, &[]), Scan::new(corrected, &[]));
    let rows = (0..data.readings.len()).filter(|&row| before.usable[row] && !after.usable[row]);
    let bodies = || data.bodies.iter().enumerate();
    let samples = rows.flat_map(|row| {
        bodies().flat_map(move |(b, body)| {
            (0..body.measured.markers()).map(move |marker| SampleIndex {
                row,
                body: BodyIndex(b),
                marker,
            })
        })
    });
    samples.collect()
}

/// Noise that is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownNoise {
    /// Of a coordinate of a marker or a position, m.
    pub sigma: f64,
    /// Of the joints from pose to pose, rad.
    pub joint: f64,
}

/// ln of how many times likelier the data are than as they are under each of the `leaders` hypotheses with the smallest residuals, and under those that are
/// `wanted` beside them, the noise known and the robot off as the priors of the options say. No test that knows less has more to go by.
///
/// # Errors
/// [`DataError`] when the input contradicts itself.
pub fn log_odds(
    data: &Data,
    noise: KnownNoise,
    leaders: usize,
    wanted: &dyn Fn(&Scoped) -> bool,
    options: &Options,
) -> Result<Vec<(Scoped, f64)>, DataError> {
    data.check()?;
    let ranking = Ranking::of(data, &candidates(data), &[]);
    let Some(without) = known(data, &[], noise, options) else {
        return Ok(Vec::new());
    };
    let odds = |s: &Scored| {
        let corrected = apply(&s.scoped, data);
        let with = known(&corrected, &[], noise, options)?;
        let lost = lost(data, &corrected);
        let without = if lost.is_empty() {
            without
        } else {
            known(data, &lost, noise, options)?
        };
        Some((
            s.scoped,
            with.log - without.log + with.coordinates * log_scale(s),
        ))
    };
    let leading: Vec<Scoped> = distinct(&ranking.scored, leaders)
        .map(|s| s.scoped)
        .collect();
    let asked = ranking.scored.iter();
    let asked = asked.filter(|s| leading.contains(&s.scoped) || wanted(&s.scoped));
    Ok(asked.filter_map(odds).collect())
}

/// ln of the likelihood at a known noise, and of how many coordinates.
#[derive(Clone, Copy)]
struct Known {
    log: f64,
    coordinates: f64,
}

fn known(
    data: &Data,
    screened: &[SampleIndex],
    noise: KnownNoise,
    options: &Options,
) -> Option<Known> {
    let lambda = (noise.joint / noise.sigma).powi(2);
    let (data, deviation, _) = relinearized(data.clone(), screened, options, ROUNDS)?;
    let model = Model::new(&data, &[], screened);
    let sums = model.sums(lambda);
    let map = solve(&model, &sums, noise.sigma, &deviation, options)?;
    // −½ (χ²/σ² + ln|V| + ln|N| − ln|P|): the restricted likelihood with σ known
    let nu = (sums.observations - model.registration as f64).max(1.0);
    let determinants = map.log_likelihood + 0.5 * nu * map.chi2.ln();
    Some(Known {
        log: determinants - 0.5 * map.chi2 / (noise.sigma * noise.sigma),
        coordinates: sums.observations,
    })
}
