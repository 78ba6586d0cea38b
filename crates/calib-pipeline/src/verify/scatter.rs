//! A joint that scatters, and what remains of other causes beside it.

use calib_core::{GoodnessOfFit, Suspect};
use calib_finding::Finding;

use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::Inputs;
use crate::verify::changes;
use crate::verify::readings::{OWN, scattered_readings};
use crate::verify::suspects::{RELEVANT, SIGNIFICANT, suspected_before};

/// What a joint that scatters leaves of other causes.
#[derive(Debug, Clone, Default)]
pub(super) struct Scattering {
    /// The tests, with the effects that are missing beside it.
    pub goodness: Option<GoodnessOfFit>,
    /// The joint that scatters.
    pub finding: Option<Finding>,
    /// Findings from before the fit that it explains.
    pub explained: Vec<Finding>,
}

/// A joint that scatters, and which of the suspects hold beside it.
type Found = (Finding, Vec<bool>);

/// Looks for a joint that scatters: in its readings, then in its stops. `before`: findings from before the fit.
pub(super) fn beside_scatter(
    inputs: &Inputs,
    fit: &MlFit,
    before: &[Finding],
    goodness: Option<GoodnessOfFit>,
) -> Scattering {
    let mut out = Scattering {
        goodness,
        ..Scattering::default()
    };
    for look in [in_readings, in_stops] {
        let Some(mut goodness) = out.goodness.take() else {
            break;
        };
        let open = before.iter().filter(|f| !out.explained.contains(f));
        let (findings, suspects) = suspected(inputs, fit, open, &goodness);
        let found = look(inputs, fit, &goodness, &suspects);
        drop(suspects);
        if let Some((finding, holds)) = found {
            let (tests, others) = holds.split_at(goodness.missing.len());
            let explained = findings
                .into_iter()
                .zip(others)
                .filter(|(_, holds)| !**holds);
            out.explained
                .extend(explained.map(|(finding, _)| finding.clone()));
            let gone: Vec<String> = goodness
                .missing
                .iter()
                .zip(tests)
                .filter(|(_, holds)| !**holds)
                .map(|(test, _)| test.name.clone())
                .collect();
            goodness.missing.retain(|test| !gone.contains(&test.name));
            let same = |f: &&Finding| {
                let named = suspected_before(inputs, fit, f, &goodness);
                named.is_some_and(|(code, _)| gone.contains(&code))
            };
            let same: Vec<Finding> = before.iter().filter(same).cloned().collect();
            out.explained.extend(same);
            out.finding.get_or_insert(finding);
        }
        out.goodness = Some(goodness);
    }
    out
}

/// The missing effects, then the findings from before the fit that are about other effects.
fn suspected<'a, 'b>(
    inputs: &Inputs,
    fit: &MlFit,
    before: impl Iterator<Item = &'b Finding>,
    goodness: &'a GoodnessOfFit,
) -> (Vec<&'b Finding>, Vec<Suspect<'a>>) {
    let missing = goodness.missing.iter();
    let mut suspects: Vec<Suspect<'a>> = missing.map(|t| Suspect::Tested(&t.name)).collect();
    let mut findings = Vec::new();
    for finding in before {
        let Some((code, suspect)) = suspected_before(inputs, fit, finding, goodness) else {
            continue;
        };
        // Named by a test as well: one suspect.
        if goodness.missing.iter().all(|test| test.name != code) {
            findings.push(finding);
            suspects.push(suspect);
        }
    }
    (findings, suspects)
}

/// Chance of one false name in so many analyses, for each test.
fn chance(goodness: &GoodnessOfFit) -> f64 {
    SIGNIFICANT / goodness.tests.len().max(1) as f64
}

fn in_readings(
    inputs: &Inputs,
    fit: &MlFit,
    goodness: &GoodnessOfFit,
    suspects: &[Suspect<'_>],
) -> Option<Found> {
    let found = scattered_readings(inputs, fit, suspects, chance(goodness))?;
    Some((found.finding, found.holds))
}

fn in_stops(
    inputs: &Inputs,
    fit: &MlFit,
    goodness: &GoodnessOfFit,
    suspects: &[Suspect<'_>],
) -> Option<Found> {
    let borders = fit.formulation.borders();
    let found = fit.solution.suspects_beside_scatter(suspects, &borders)?;
    let finding = changes::scatter(inputs, fit, found.scatter)?;
    let chance = chance(goodness);
    let holds = |k: usize| {
        // Those beyond what was looked at are smaller than what the scatter explains.
        let Some(left) = found.left.get(k) else {
            return false;
        };
        let matters = goodness.missing.get(k).is_none_or(|test| {
            test.explains * left.part > RELEVANT || test.moves * left.part > GoodnessOfFit::MOVES
        });
        left.part > OWN && left.is_significant(chance) && matters
    };
    Some((finding, (0..suspects.len()).map(holds).collect()))
}
