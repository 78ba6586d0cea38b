//! All rows read: streams, timeline and findings.

use super::Rows;
use crate::error::Placed;
use crate::model::{
    BodyStream, JointStream, MarkerSample, MarkerStream, Meta, Recording, TemperatureStream,
    TorqueStream,
};
use crate::placeholder::{equal, repeated, repeated_finding, without_identities};
use calib_finding::{Fact, Finding, Subject, catalog};
use std::collections::{BTreeMap, BTreeSet};

impl Rows<'_> {
    /// The recording of all rows.
    pub(in crate::table) fn finish(mut self) -> Placed<Recording> {
        let n = self.timeline.rows.len();
        if self.layout.entity.is_some() {
            let lengths = self
                .markers
                .iter()
                .map(Vec::len)
                .chain(self.bodies.iter().map(Vec::len));
            self.dense += lengths.map(|length| n - length).sum::<usize>();
            self.not_too_sparse(self.timeline.rows.last().copied().unwrap_or_default())?;
            self.markers
                .iter_mut()
                .for_each(|stream| stream.resize(n, MarkerSample::Lost));
            self.bodies
                .iter_mut()
                .for_each(|stream| stream.resize(n, None));
        }
        let mut findings = self.findings();
        for (column, zoned) in &self.dates {
            let name = &self.layout.names[*column];
            let of = if *zoned { "" } else { ", taken as UTC" };
            self.layout
                .conversions
                .push(format!("dates of `{name}`{of} as seconds since 1970"));
        }
        let timed = self.layout.time.is_some();
        self.timeline.clock = if timed { "t_s" } else { "static poses" }.to_string();
        self.timeline.t = timed.then_some(self.times);
        self.timeline.received = self.layout.received.map(|_| self.received);
        self.timeline.labels = self
            .layout
            .labels
            .iter()
            .cloned()
            .zip(self.labels)
            .collect();
        let long = self.layout.entity.is_some();
        let names = |plans: Vec<String>| if long { self.long_names.clone() } else { plans };
        let marker_names = names(
            self.layout
                .markers
                .iter()
                .map(|plan| plan.name.clone())
                .collect(),
        );
        let body_names = names(
            self.layout
                .bodies
                .iter()
                .map(|plan| plan.name.clone())
                .collect(),
        );
        let codes = repeated(&self.markers);
        for (name, track) in marker_names.iter().zip(&mut self.markers) {
            for code in &codes {
                let mut rows = Vec::new();
                for (sample, row) in track.iter_mut().zip(&self.timeline.rows) {
                    if equal(sample) == Some(*code) {
                        *sample = MarkerSample::Lost;
                        rows.push(*row);
                    }
                }
                if !rows.is_empty() {
                    findings.push(repeated_finding(name, *code, rows));
                }
            }
        }
        if !self.map.is_some_and(|map| map.zero_is_a_point) {
            for (name, track) in body_names.iter().zip(&mut self.bodies) {
                let rows = without_identities(track, &self.timeline.rows);
                if !rows.is_empty() {
                    findings.push(all_zero(name, rows));
                }
            }
        }
        Ok(Recording {
            meta: Meta {
                joint_columns: self.layout.joint_columns(),
                inverse_bodies: self.layout.inverse_bodies(),
                conversions: self.layout.conversions,
                findings,
                ..Meta::default()
            },
            timelines: vec![self.timeline],
            joints: self
                .layout
                .joints
                .into_iter()
                .zip(self.joints)
                .map(|((name, unit, _), q)| JointStream {
                    name,
                    timeline: 0,
                    unit,
                    q,
                })
                .collect(),
            torques: self
                .layout
                .torques
                .into_iter()
                .zip(self.torques)
                .map(|((name, _), torque)| TorqueStream {
                    name,
                    timeline: 0,
                    torque,
                })
                .collect(),
            temperatures: self
                .layout
                .temperatures
                .into_iter()
                .zip(self.temperatures)
                .map(|((name, _), celsius)| TemperatureStream {
                    name,
                    timeline: 0,
                    celsius,
                })
                .collect(),
            bodies: body_names
                .into_iter()
                .zip(self.bodies)
                .map(|(name, tracker_from_body)| BodyStream {
                    name,
                    timeline: 0,
                    tracker_from_body,
                    quality: Vec::new(),
                    covariance: Vec::new(),
                })
                .collect(),
            markers: marker_names
                .into_iter()
                .zip(self.markers)
                .map(|(name, samples)| MarkerStream {
                    name,
                    body: None,
                    unlabeled: false,
                    timeline: 0,
                    samples,
                })
                .collect(),
        })
    }

    /// What was read as lost without saying so.
    fn findings(&mut self) -> Vec<Finding> {
        let zeros = std::mem::take(&mut self.zeros)
            .into_iter()
            .map(|(name, rows)| all_zero(&name, rows));
        let halves = std::mem::take(&mut self.halves)
            .into_iter()
            .map(|(name, rows)| half_a_pose(&name, rows));
        let placeholders = self.placeholders.findings();
        zeros
            .chain(placeholders)
            .chain(halves)
            .chain(not_numbers(&self.nans))
            .collect()
    }
}

/// The finding about samples that are all zeros, or a body's pose that is none.
fn all_zero(name: &str, rows: Vec<u64>) -> Finding {
    Finding::of_kind(catalog::ALL_ZERO_TRIPLET, "lost", Subject::marker(name))
        .with("samples", Fact::count(rows.len()))
        .at_rows(rows)
}

/// The finding about poses without a position, or without an orientation.
fn half_a_pose(name: &str, rows: Vec<u64>) -> Finding {
    Finding::new(catalog::HALF_A_POSE, Subject::body(name))
        .with("samples", Fact::count(rows.len()))
        .at_rows(rows)
}

/// The finding about cells of the tracker that say that they hold no number: one for all columns.
fn not_numbers(nans: &BTreeMap<String, Vec<u64>>) -> Option<Finding> {
    let subject = match nans.keys().next() {
        Some(column) if nans.len() == 1 => Subject::column(column),
        _ => Subject::default(),
    };
    let cells: usize = nans.values().map(Vec::len).sum();
    let rows: BTreeSet<u64> = nans.values().flatten().copied().collect();
    (cells > 0).then(|| {
        Finding::of_kind(catalog::NOT_A_NUMBER, "cells", subject)
            .with("count", Fact::count(cells))
            .at_rows(rows)
    })
}
