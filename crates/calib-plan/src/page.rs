//! `plan.html`: the plan as one page that needs no other file.

use calib_report::ReportError;
use calib_report::gallery::{self, Grid};
use calib_report::plots::{Plot, PlotKind, PlotRow, Series};
use calib_urdf::RobotModel;

use crate::joints::shown;
use crate::list::{Plan, Why};
use crate::words;

/// The page.
///
/// # Errors
/// [`ReportError::Json`] for a view with numbers that are not finite.
pub fn page(plan: &Plan, model: &RobotModel, profile: &str) -> Result<String, ReportError> {
    let measured = plan
        .postures
        .iter()
        .filter(|p| p.why != Why::Detour)
        .count();
    let mut lines = vec![
        format!(
            "Profile: {profile}. Postures to record: {measured}; to validate with: {}.",
            plan.held_out.len()
        ),
        format!("Chosen for {}.", words::goal(plan.goal)),
        format!(
            "Expected σ of the tool's position in the tracker's frame: {} (before: {}). It holds for the errors that the profile frees and for the stated or found noise; effects that the model does not have come on top. Look for missing effects first: choosing postures cannot replace them.",
            words::length(plan.sigma),
            words::length(plan.sigma_before)
        ),
        format!(
            "The postures chosen by information reach at least {:.1} % of the best possible {} (certified).",
            (plan.efficiency * 1000.0).floor() / 10.0,
            words::efficiency_of(plan.goal)
        ),
        format!(
            "{} of {} candidates are possible: {}.",
            plan.counts.feasible,
            plan.counts.tried,
            words::removed(&plan.counts)
        ),
    ];
    lines.extend(plan.notes.iter().map(words::note));
    let reasons = [
        Why::Information,
        Why::SpaceFilling,
        Why::Approach,
        Why::OtherSide,
        Why::Detour,
    ];
    let used = |why: &Why| plan.postures.iter().any(|p| p.why == *why);
    lines.extend(
        reasons
            .into_iter()
            .filter(used)
            .map(|why| format!("Reason `{}`: {}.", words::why(why), words::why_in_full(why))),
    );
    let title = format!("Plan for {}", plan.robot);
    let tables = [postures(plan, model)];
    gallery::page_with_view(&title, &lines, &plan.view, &plots(plan), &tables)
}

/// The postures in their order.
fn postures(plan: &Plan, model: &RobotModel) -> Grid {
    let joints = plan.joints.moved.iter();
    let heads = joints.map(|m| format!("`{}` [{}]", model.joint(m.joint).name, shown(m.turns).1));
    let mut header = vec!["pose".to_owned(), "why".to_owned()];
    header.extend(heads);
    header.push("expected σ after it".to_owned());
    let rows = plan.postures.iter().enumerate().map(|(i, p)| {
        let repeats = p
            .repeats
            .and_then(|place| plan.pose(place))
            .map_or_else(String::new, |k| format!(" of pose {k}"));
        let mut cells = vec![
            plan.pose(i)
                .map_or_else(|| "on the way".to_owned(), |k| k.to_string()),
            format!("{}{repeats}", words::why(p.why)),
        ];
        cells.extend(plan.joints.moved.iter().map(|m| {
            let value = p.q[m.joint.index()] * shown(m.turns).0;
            format!("{value:.2}").replace('-', "−")
        }));
        cells.push(words::length(p.sigma));
        cells
    });
    Grid {
        title: "Postures".to_owned(),
        header,
        rows: rows.collect(),
    }
}

/// σ against the number of postures, and what is left of the priors.
fn plots(plan: &Plan) -> Vec<Plot> {
    let mut plots = Vec::new();
    let measured = plan.postures.iter().filter(|p| p.why != Why::Detour);
    let points = measured.enumerate().filter_map(|(i, p)| {
        let sigma = p.sigma.filter(|s| *s > 0.0)?;
        Some([(i + 1) as f64, sigma * 1e3])
    });
    let points: Vec<[f64; 2]> = points.collect();
    if points.len() > 1 {
        plots.push(Plot {
            id: "sigma".to_owned(),
            section: "plan",
            title: "Expected σ of the tool's position".to_owned(),
            description: "After each posture, in the planned order: stop where it is small enough. The number of postures cannot reduce what the model does not describe.".to_owned(),
            kind: PlotKind::Xy {
                x: "postures recorded".to_owned(),
                y: "σ [mm]".to_owned(),
                log_y: true,
                band: None,
                series: vec![Series {
                    name: "plan".to_owned(),
                    style: 0,
                    line: true,
                    points,
                }],
            },
        });
    }
    let with_prior = plan.parameters.iter().filter_map(|p| {
        let ratio = p.after? / p.prior?;
        Some(PlotRow {
            label: p.name.clone(),
            bar: Some(100.0 * ratio),
            text: format!(
                "{} of {}",
                words::parameter_sigma(p.after, p.unit),
                words::parameter_sigma(p.prior, p.unit)
            ),
            ..PlotRow::default()
        })
    });
    let rows: Vec<PlotRow> = with_prior.collect();
    if !rows.is_empty() {
        plots.push(Plot {
            id: "priors".to_owned(),
            section: "plan",
            title: "What remains of the priors".to_owned(),
            description: "σ of each parameter after the plan in percent of the σ of its prior. Near 100 %: the postures do not show it, or predictions depend on it only together with others (a convention).".to_owned(),
            kind: PlotKind::Rows {
                axis: "% of the prior σ".to_owned(),
                rows,
            },
        });
    }
    plots
}
