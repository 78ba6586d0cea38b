//! Gear ratios that the profile does not state, looked for where effects are selected.

use calib_core::GearRatio;
use calib_finding::{About, Fact, Finding, catalog};

use crate::formulate::formulation::MlFit;

/// Turns of a motor per turn of its joint: planetary gears of two stages to strain wave gears of one.
const RATIOS: (f64, f64) = (20.0, 200.0);

/// Joints that err once per turn of a motor whose ratio nobody stated.
pub(crate) fn searched(fit: &MlFit) -> Vec<Finding> {
    let found = fit.solution.gear_ratios(RATIOS.0, RATIOS.1);
    let clear = found
        .into_iter()
        .flatten()
        .filter(GearRatio::is_significant);
    clear.map(|gear| finding(&gear)).collect()
}

fn finding(gear: &GearRatio) -> Finding {
    Finding::new(catalog::GEAR_RATIO_FOUND, About::Fit)
        .with("joint", Fact::name(gear.name.clone()))
        .with("ratio", Fact::ratio(gear.ratio))
        .with("sigma", Fact::ratio(gear.sigma))
        .with("whole", Fact::count(gear.ratio.round() as usize))
        .with("amplitude", Fact::radians(gear.amplitude))
        .with("chance", Fact::ratio(gear.p_corrected))
}
