//! The whole twin: trials, what they say, and trials with faults that check it.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use calib_urdf::sha256_hex;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::curve::{Curve, curve};
use crate::error::TwinError;
use crate::fault::Fault;
use crate::likeness::{Resemblance, resemblance};
use crate::note::Note;
use crate::power::{Power, TRIED, correct, effects, factor, powers, verify};
use crate::session::Session;
use crate::slip::{self, SlipPower};
use crate::source::Source;
use crate::state::{Settings, State};
use crate::summary::{Promise, promises};
use crate::trial::{Done, Injected, Trial};
use crate::truth::About;
use crate::words;

/// How a twin is made.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Trials without faults.
    pub trials: u64,
    /// Seed.
    pub seed: u64,
    /// The noise of the trials times this.
    pub noise: f64,
    /// σ of the tool that is asked for, m.
    pub sigma: Option<f64>,
    /// Threads; `None`: as many as there are processors.
    pub threads: Option<usize>,
    /// Folder of the file of finished trials; `None`: nothing is kept.
    pub out: Option<PathBuf>,
    /// Keep the finished trials of an earlier twin with the same settings.
    pub resume: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            trials: 200,
            seed: 1,
            noise: 1.0,
            sigma: None,
            threads: None,
            out: None,
            resume: true,
        }
    }
}

/// What a session can and cannot tell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Twin {
    /// Version of this format: 1.
    pub calib_twin: u32,
    /// Version of the program.
    pub version: String,
    /// The robot.
    pub robot: String,
    /// The profile.
    pub profile: String,
    /// What the session was taken from.
    pub source: Source,
    /// Where true robots were drawn.
    pub about: About,
    /// Seed.
    pub seed: u64,
    /// Trials.
    pub trials: usize,
    /// Trials that were calibrated as a run does it, with data checks and choice of the noise; the others take the statement that the session's own
    /// calibration chose.
    pub whole: usize,
    /// Trials that the pipeline refused, and the message of the first.
    pub refused: usize,
    /// See `refused`.
    pub first_refusal: Option<String>,
    /// Trials that did not converge.
    pub not_converged: usize,
    /// Trials without a fault in which something was named as wrong.
    pub false_alarms: usize,
    /// Whether the trials resemble the recordings; null where nothing is recorded.
    pub resemblance: Option<Resemblance>,
    /// σ promised and reached.
    pub promises: Vec<Promise>,
    /// How large effects must be to be found.
    pub powers: Vec<Power>,
    /// What the sizes of effects that follow from the tests were multiplied by, with its 95 % interval: from trials that have effects; null:
    /// too few trials, and the sizes are those of the tests.
    pub size_factor: Option<[f64; 3]>,
    /// How far bodies must slip to be found.
    pub slips: Vec<SlipPower>,
    /// σ of the tool against the number of postures.
    pub curve: Option<Curve>,
    /// What was assumed.
    pub notes: Vec<Note>,
}

/// Trials with effects: one for so many without, at the most.
const EFFECTS_PER: u64 = 5;
/// They are made in rounds of so many, a multiple of the sizes that are tried.
const ROUND: u64 = 5 * TRIED.len() as u64;
/// A round is the last where the 95 % interval of the factor ends below so many times where it begins: the sizes that it corrects are not known better.
const KNOWN: f64 = 1.2;
/// Trials with slips of each body: one for so many without, and no more than [`SLIPS`].
const SLIPS_PER: u64 = 10;
/// See [`SLIPS_PER`].
const SLIPS: u64 = 24;

/// Makes the trials and says what follows. `progress(done, total)` counts trials and is called from any thread.
///
/// # Errors
/// [`TwinError`] for no trials, and for a state file that cannot be used. A trial that the pipeline refuses is a result, not an error.
pub fn twin(
    session: &Session,
    source: Source,
    options: &Options,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<Twin, TwinError> {
    twin_of(session, source, options, Vec::new(), progress)
}

/// As [`twin`], with trials without faults that were made elsewhere, each by [`Session::trial`] with the seed and noise of `options`.
///
/// # Errors
/// As [`twin`].
pub fn twin_of(
    session: &Session,
    source: Source,
    options: &Options,
    made: Vec<Trial>,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<Twin, TwinError> {
    if options.trials == 0 {
        return Err(TwinError::NoTrials);
    }
    let threads = options.threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|source| TwinError::Threads { threads, source })?;
    let settings = settings(session, options);
    let mut state = State::open(options.out.as_deref(), &settings, options.resume)?;
    state.take(made);
    let bodies = slip::bodies(session);
    let slips = (options.trials / SLIPS_PER).min(SLIPS) * bodies.len() as u64;
    let with_effects = options.trials / EFFECTS_PER;
    let run = Run {
        session,
        options,
        state: Mutex::new(state),
        done: AtomicU64::new(0),
        total: options.trials + slips + with_effects,
        progress,
    };
    let trials = pool.install(|| run.trials())?;
    let done: Vec<&Done> = trials.iter().filter_map(|t| t.done.as_ref()).collect();
    let model = &session.rows.robot.model;
    let mut powers = powers(model, &done);
    let slipped = with_slip(session, &bodies, slips, options.seed, with_effects);
    let mut injected = pool.install(|| run.injected(&slipped))?;
    let mut size_factor = None;
    for round in rounds(with_effect(session, &powers, with_effects)) {
        injected.extend(pool.install(|| run.injected(&round))?);
        size_factor = factor(&powers, &injected);
        if size_factor.is_some_and(|[_, low, high]| high <= KNOWN * low) {
            break;
        }
    }
    run.end();
    injected.sort_by_key(|one| one.number);
    verify(&mut powers, &injected);
    if let Some([factor, ..]) = size_factor {
        correct(&mut powers, factor);
    }
    let state = run
        .state
        .into_inner()
        .unwrap_or_else(PoisonError::into_inner);
    state.close(&trials, &injected)?;
    let likes: Vec<_> = done.iter().map(|d| &d.likeness).collect();
    let mut notes = session.notes.clone();
    if options.noise != 1.0 {
        let percent = (options.noise * 100.0).round() as u32;
        notes.push(Note::NoiseScaled { percent });
    }
    let refused = || trials.iter().filter_map(|t| t.refused.as_ref());
    let of_slips = bodies
        .iter()
        .filter_map(|b| slip::power(session, b, &injected));
    Ok(Twin {
        calib_twin: 1,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        robot: session.rows.robot.profile.robot.clone(),
        profile: session.rows.robot.file.clone(),
        source,
        about: session.about,
        seed: options.seed,
        trials: trials.len(),
        whole: trials.iter().filter(|t| t.whole).count(),
        refused: refused().count(),
        first_refusal: refused().next().cloned(),
        not_converged: done.iter().filter(|d| !d.converged).count(),
        false_alarms: done.iter().filter(|d| d.alarm).count(),
        resemblance: (source == Source::Recordings).then(|| resemblance(&session.likeness, &likes)),
        promises: promises(&session.promised, &done),
        powers,
        size_factor,
        slips: of_slips.collect(),
        curve: curve(session, options.seed, options.sigma),
        notes,
    })
}

/// Everything that the trials depend on besides their number, as one text.
///
/// # Errors
/// [`TwinError::Unwritable`].
pub fn settings_text(session: &Session, options: &Options) -> Result<String, TwinError> {
    Ok(serde_json::to_string(&settings(session, options))?)
}

fn settings(session: &Session, options: &Options) -> Settings {
    // The rows as the fit saw them: whatever they were read from.
    let rows = session.rows.recordings.iter().map(|(name, r)| {
        let poses = format!("{:?} {:?} {:?}", r.q, r.poses.markers, r.poses.bodies);
        (words::rows_of(name), sha256_hex(poses.as_bytes()))
    });
    let files = session.rows.robot.digests.iter();
    let files = files.map(|d| (format!("`{}`", d.path), d.sha256.clone()));
    Settings {
        calib_twin: 3,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        inputs: files.chain(rows).collect(),
        seed: options.seed,
        how: format!("{:?}, noise times {}", session.about, options.noise),
    }
}

/// Trials of one twin.
struct Run<'a> {
    session: &'a Session,
    options: &'a Options,
    state: Mutex<State>,
    done: AtomicU64,
    total: u64,
    progress: &'a (dyn Fn(u64, u64) + Sync),
}

/// A fault, its name and its size.
type Planned = (u64, Fault, String, f64);

impl Run<'_> {
    fn count(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        (self.progress)(done, self.total);
    }

    /// Trials that are not needed count as done.
    fn end(&self) {
        (self.progress)(self.total, self.total);
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn trials(&self) -> Result<Vec<Trial>, TwinError> {
        let numbers: Vec<u64> = (0..self.options.trials).collect();
        let numbers = numbers.par_iter().with_max_len(1);
        let one = |&number: &u64| {
            let known = self.state().trial(number);
            let trial = match known {
                Some(trial) => trial,
                None => {
                    let (seed, scale) = (self.options.seed, self.options.noise);
                    let trial = self.session.trial(seed, number, scale);
                    self.state().append(&trial)?;
                    trial
                }
            };
            self.count();
            Ok(trial)
        };
        numbers.map(one).collect()
    }

    fn injected(&self, faults: &[Planned]) -> Result<Vec<Injected>, TwinError> {
        let one = |(number, fault, what, size): &Planned| {
            let known = self.state().injected(*number, what, *size);
            let injected = match known {
                Some(injected) => injected,
                None => {
                    let of = (fault, what.as_str(), *size);
                    let injected = self.session.injected(self.options.seed, *number, of);
                    self.state().append_injected(&injected)?;
                    injected
                }
            };
            self.count();
            Ok(injected)
        };
        faults.par_iter().with_max_len(1).map(one).collect()
    }
}

/// Trials that have one effect at about its 80 % size, the effects taking turns.
fn with_effect(session: &Session, powers: &[Power], count: u64) -> Vec<Planned> {
    let known = effects(&session.rows.robot.model);
    let sized: Vec<(&Power, f64)> = powers.iter().filter_map(|p| Some((p, p.size()?))).collect();
    let n = sized.len() as u64;
    let planned = (0..count.min(n * SLIPS)).filter_map(|k| {
        // Evenly over the list where it is longer than there are trials.
        let place = if count < n { k * n / count } else { k % n };
        let (power, size) = sized[place as usize];
        let size = size * TRIED[k as usize % TRIED.len()];
        let fault = known.get(&power.name)?.fault(size);
        Some((k, fault, power.name.clone(), size))
    });
    planned.collect()
}

/// Trials with effects in rounds, each with all sizes and with effects from the whole list.
fn rounds(all: Vec<Planned>) -> Vec<Vec<Planned>> {
    let sizes = TRIED.len() as u64;
    let count = (all.len() as u64).div_ceil(ROUND).max(1);
    let mut rounds = vec![Vec::new(); count as usize];
    for planned in all {
        rounds[(planned.0 / sizes % count) as usize].push(planned);
    }
    rounds
}

/// Trials in which a body slips.
fn with_slip(
    session: &Session,
    bodies: &[String],
    count: u64,
    seed: u64,
    first: u64,
) -> Vec<Planned> {
    /// Streams of random numbers of the slips.
    const SLIPPED: u64 = 1 << 33;
    let planned = (0..count).filter_map(|k| {
        let body = &bodies[k as usize % bodies.len()];
        let mut rng = Session::numbers(seed, SLIPPED + k);
        let (fault, length) = slip::draw(session, body, &mut rng)?;
        Some((first + k, fault, body.clone(), length))
    });
    planned.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_divide_the_trials_and_each_tries_all_sizes() {
        for count in [0, 3, 20, 40, 66, 200] {
            let one = |k: u64| {
                let fault = Fault::Slip {
                    body: String::new(),
                    recording: String::new(),
                    row: 0,
                    by: nalgebra::Vector3::zeros(),
                };
                (k, fault, String::new(), TRIED[k as usize % TRIED.len()])
            };
            let rounds = rounds((0..count).map(one).collect());
            let mut numbers: Vec<u64> = rounds.iter().flatten().map(|p| p.0).collect();
            numbers.sort_unstable();
            assert_eq!(numbers, (0..count).collect::<Vec<_>>());
            for round in &rounds {
                assert!(round.len() as u64 <= ROUND, "{count}");
                let of = |size: f64| round.iter().filter(|p| p.3 == size).count();
                let counts = TRIED.map(of);
                let (most, least) = (counts.iter().max(), counts.iter().min());
                assert!(most.zip(least).is_some_and(|(m, l)| m - l <= 1), "{count}");
            }
        }
    }
}
