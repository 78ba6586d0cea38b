//! Bodies that are not measured as the others are: computed from the joints, or seen in another frame.

use std::collections::BTreeMap;

use calib_checks::structural::{
    BodyIndex, Measured, Outcome, by_rounding_alone, registration_residual,
};
use calib_finding::{Fact, Finding, Subject, catalog};

use super::layout::Layout;
use super::without::DIVIDED;
use crate::prepare::tracks::BodyTrack;

/// Rows that leave a residual of a point on a link: 3 coordinates each, for a frame and the point.
const ROWS: usize = 8;
/// A body that moves less does not show what its coordinates follow, m.
const MOVED: f64 = 0.02;

/// A body, and what its registration alone leaves, rms, m.
#[derive(Clone, Copy)]
pub(super) struct Alone {
    /// Its index in the layout.
    pub body: usize,
    rms: f64,
    /// Of the other body that fits worst.
    beside: (usize, f64),
}

/// Bodies that follow the nominal robot closer than the tracker's noise lets any measured body, while another one shows that the robot is not that close to
/// its drawing. The noise is what the markers of the other bodies show, not what is stated: a body on a single joint fits any robot as closely as a good
/// tracker measures.
pub(super) fn computed(layout: &Layout<'_>, tracks: &BTreeMap<String, BodyTrack>) -> Vec<Alone> {
    /// m: what is written with two decimals of a millimeter, and joints with three of a degree.
    const COMPUTED: f64 = 5e-5;
    /// Part of the noise, and of what another body leaves.
    const BELOW: f64 = 0.1;
    let alone = alone(layout);
    let found = alone.iter().enumerate().filter_map(|(body, rms)| {
        let others = layout.bodies.iter().filter(|b| **b != layout.bodies[body]);
        let noise = others.filter_map(|other| tracks[*other].marker_sigma);
        let noise = noise.min_by(f64::total_cmp);
        let limit = noise.map_or(super::COMPUTED, |noise| COMPUTED.min(BELOW * noise));
        let exact = Some((*rms)?).filter(|rms| *rms < limit);
        let rms = exact.or_else(|| by_rounding_alone(&layout.data, BodyIndex(body)))?;
        let others = alone.iter().enumerate().filter(|(b, _)| *b != body);
        let others = others.filter_map(|(b, rms)| Some((b, (*rms)?)));
        let beside = others.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let one = Alone { body, rms, beside };
        (rms < BELOW * beside.1).then_some(one)
    });
    found.collect()
}

impl Alone {
    /// What is said of it.
    pub(super) fn finding(self, layout: &Layout<'_>) -> Finding {
        let name = layout.bodies[self.body];
        Finding::of_kind(catalog::NOT_MEASURED, "body", Subject::body(name))
            .with("body", Fact::name(name))
            .with("none", Fact::meters(self.rms))
            .with("other", Fact::name(layout.bodies[self.beside.0]))
            .with("next", Fact::meters(self.beside.1))
    }
}

/// The body that does not fit together with the others, though it fits alone, and the others do without it.
pub(super) fn in_another_frame(layout: &Layout<'_>, outcome: &Outcome) -> Option<Finding> {
    let limit = outcome.expected?.limit;
    let fits = |rms: &f64| *rms > 0.0 && *rms <= limit && *rms * DIVIDED < outcome.rms;
    let alone = alone(layout).into_iter().enumerate();
    let alone = alone.filter_map(|(body, rms)| Some((body, rms.filter(fits)?)));
    let of_all = alone.filter_map(|(body, rms)| {
        let others: Vec<usize> = (0..layout.bodies.len()).filter(|b| *b != body).collect();
        Some((body, rms, residual(layout, &others).filter(fits)?))
    });
    // Of two, the one that follows the nominal robot more closely is none that a tracker measured.
    let (body, rms, rest) = of_all.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let name = layout.bodies[body];
    Some(
        Finding::of_kind(catalog::MODEL_DISAGREES, "frames", Subject::body(name))
            .with("body", Fact::name(name))
            .with("none", Fact::meters(outcome.rms))
            .with("limit", Fact::meters(limit))
            .with("alone", Fact::meters(rms))
            .with("rest", Fact::meters(rest)),
    )
}

/// What the registration of each body alone leaves; `None` of one that hardly moves or is seldom seen, and where there is one body only.
fn alone(layout: &Layout<'_>) -> Vec<Option<f64>> {
    let count = layout.bodies.len();
    let of = |body: usize| {
        let moves = count > 1 && is_moved(&layout.data.bodies[body].measured);
        moves.then(|| residual(layout, &[body])).flatten()
    };
    (0..count).map(of).collect()
}

fn residual(layout: &Layout<'_>, bodies: &[usize]) -> Option<f64> {
    let mut data = layout.data.clone();
    data.bodies = bodies
        .iter()
        .map(|b| layout.data.bodies[*b].clone())
        .collect();
    registration_residual(&data).ok()
}

fn is_moved(measured: &Measured) -> bool {
    let places: Vec<[f64; 3]> = match measured {
        Measured::Markers(rows) => {
            let first = rows.iter().filter_map(|row| row.iter().flatten().next());
            first.map(|p| p.coords.into()).collect()
        }
        Measured::Poses {
            tracker_from_body, ..
        } => {
            let seen = tracker_from_body.iter().flatten();
            seen.map(|pose| pose.translation.vector.into()).collect()
        }
    };
    let range = |axis: usize| {
        let all = places.iter().map(|p| p[axis]);
        let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        });
        high - low
    };
    places.len() >= ROWS && (0..3).any(|axis| range(axis) > MOVED)
}
