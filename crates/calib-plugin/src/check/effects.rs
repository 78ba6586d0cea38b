//! What a regressor has to be: a function of one state alone, without jumps in the reading.

use super::subject::{Input, Reply, text};

/// Steps of the readings, and their width, rad: from −4 to 4. The width is not a round number, so that a jump at one lies inside a step.
const STEPS: i32 = 800;
const STEP: f64 = 0.010_03;
/// Steps with the largest changes; each is searched for a jump.
const LARGEST: usize = 40;
/// Readings that are so near have nearly the same regressor, rad.
const NEAR: f64 = 1e-7;
/// Largest slope, in the range of the regressor per rad: that of the second harmonic of a motor of 500 turns is 1000.
const STEEPEST: f64 = 3e3;

/// Readings of a turning joint, rad.
pub(super) fn readings() -> Vec<f64> {
    let grid = -STEPS / 2..=STEPS / 2;
    grid.map(|k| STEP * (f64::from(k) + 0.5)).collect()
}

/// Calls a regressor.
type Ask<'a> = dyn Fn(Input) -> Result<Reply, String> + 'a;

pub(super) fn regressors(reply: &Reply) -> Result<&[f64], String> {
    match reply {
        Reply::Regressors(values) => Ok(values),
        other => Err(text(other)),
    }
}

/// The regressors of a list of states and of the same list backwards.
pub(super) fn mirrored(values: &[f64]) -> Result<(), String> {
    let back = values.iter().rev();
    let mut pairs = values.iter().zip(back);
    match pairs.find(|(a, b)| a.to_bits() != b.to_bits()) {
        None => Ok(()),
        Some((a, b)) => Err(format!(
            "the regressor of one state is {a} at one place and {b} at another"
        )),
    }
}

/// The regressor of a state is the same whichever other states are asked for with it: a run asks for one at a time.
pub(super) fn alone(ask: &Ask<'_>) -> Result<(), String> {
    let asked = readings();
    let together = ask(Input::Readings(asked.clone()))?;
    let alone = ask(Input::OneByOne(asked.clone()))?;
    let (together, alone) = (regressors(&together)?, regressors(&alone)?);
    let mut all = asked.iter().zip(together.iter().zip(alone));
    match all.find(|(_, (a, b))| a.to_bits() != b.to_bits()) {
        None => Ok(()),
        Some((q, (a, b))) => Err(format!(
            "at the reading {q} the regressor is {b} alone and {a} beside other samples"
        )),
    }
}

/// Halves the steps with the largest changes until only a jump is left of them.
pub(super) fn smooth(ask: &Ask<'_>) -> Result<(), String> {
    let at = |q: Vec<f64>| ask(Input::Held(q)).and_then(|r| regressors(&r).map(<[f64]>::to_vec));
    let q = readings();
    let f = at(q.clone())?;
    let low = f.iter().copied().fold(f64::INFINITY, f64::min);
    let range = f.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low;
    let mut steps: Vec<[(f64, f64); 2]> = q
        .windows(2)
        .zip(f.windows(2))
        .map(|(q, f)| [(q[0], f[0]), (q[1], f[1])])
        .collect();
    let change = |[a, b]: &[(f64, f64); 2]| (b.1 - a.1).abs();
    steps.sort_by(|a, b| change(b).total_cmp(&change(a)));
    steps.truncate(LARGEST);
    while steps.first().is_some_and(|[a, b]| b.0 - a.0 > NEAR) {
        let middle: Vec<f64> = steps.iter().map(|[a, b]| 0.5 * (a.0 + b.0)).collect();
        let f = at(middle.clone())?;
        for (step, m) in steps.iter_mut().zip(middle.into_iter().zip(f)) {
            let halves = [[step[0], m], [m, step[1]]];
            *step = match change(&halves[0]) > change(&halves[1]) {
                true => halves[0],
                false => halves[1],
            };
        }
    }
    let most = |[a, b]: &[(f64, f64); 2]| STEEPEST * (b.0 - a.0) * range;
    match steps.iter().find(|step| change(step) > most(step)) {
        None => Ok(()),
        Some([a, b]) => Err(format!(
            "the regressor jumps from {} to {} at the reading {:.6}",
            a.1, b.1, a.0
        )),
    }
}
