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

/// The ratio to state: the whole number that agrees with what was found, else what was found, to a fifth of its σ.
fn stated(ratio: f64, sigma: f64) -> String {
    let whole = ratio.round();
    if (ratio - whole).abs() <= 2.0 * sigma {
        return format!("{whole}");
    }
    let digits = (-(sigma / 2.0).log10()).ceil().clamp(1.0, 6.0);
    format!("{:.*}", digits as usize, ratio)
}

fn finding(gear: &GearRatio) -> Finding {
    Finding::new(catalog::GEAR_RATIO_FOUND, About::Fit)
        .with("joint", Fact::name(gear.name.clone()))
        .with("ratio", Fact::ratio(gear.ratio))
        .with("sigma", Fact::ratio(gear.sigma))
        .with("stated", Fact::name(stated(gear.ratio, gear.sigma)))
        .with("amplitude", Fact::radians(gear.amplitude))
        .with("chance", Fact::ratio(gear.p_corrected))
}

#[cfg(test)]
mod tests {
    use super::stated;

    #[test]
    fn a_whole_ratio_is_stated_where_it_agrees() {
        assert_eq!(stated(101.04, 0.09), "101");
        assert_eq!(stated(160.479, 0.086), "160.48");
        assert_eq!(stated(100.3, 0.02), "100.30");
    }
}
