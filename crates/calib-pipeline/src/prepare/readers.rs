//! Readers and report writers by name: built-in ones and those of plugins in one table.

use std::collections::BTreeMap;

use calib_plugin::{
    BodyPose, BodyTrack, ByFn, Call, Control, Entry, Failure, JointTrack, JointUnit, Kind,
    MarkerSample, MarkerTrack, Offer, Origin, PluginError, ReportFile, ReportInput, Source,
    Streams, Timeline, TorqueTrack, Value,
};
use calib_recording::readers::Reader;
use calib_recording::{
    BodyStream, JointStream, MarkerStream, ReadOptions, Recording, TorqueStream,
};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, Vector3};

use crate::error::{DataProblem, PipelineError};

/// A built-in reader as an entry of the table.
#[must_use]
pub fn built_in_reader(reader: &'static Reader) -> Entry<dyn calib_plugin::Reader> {
    let offer = Offer::new(Kind::Reader, reader.id, reader.name);
    Entry::built_in_reader(ByFn::new(
        offer,
        move |source: &Source<'_>, _: &Call<'_>| {
            let options = ReadOptions {
                format: Some(reader.id.to_owned()),
                ..ReadOptions::default()
            };
            let recording = calib_recording::read_bytes(source.name, source.bytes, &options)
                .map_err(|e| Failure::BadInput(e.to_string()))?;
            Ok(streams(&recording))
        },
    ))
}

/// Reads a file with a reader of the table; `shown` names the file in messages.
///
/// # Errors
/// [`PipelineError::Plugin`] for parameters that it does not have, and for files that it refuses.
pub fn read(
    entry: &Entry<dyn calib_plugin::Reader>,
    parameters: &BTreeMap<String, Value>,
    shown: &str,
    bytes: &[u8],
) -> Result<Recording, PipelineError> {
    let source = Source { name: shown, bytes };
    let streams = entry.with(parameters)?.read(&source, &Control::default());
    let streams = streams.map_err(|error| match (&error, entry.origin()) {
        // A reader of the program names the file itself.
        (
            PluginError::Call {
                failure: Failure::BadInput(_),
                ..
            },
            Origin::Plugin { .. },
        ) => PipelineError::data(shown, DataProblem::Unread(Box::new(error))),
        _ => error.into(),
    })?;
    Ok(recording(streams, shown, &entry.offer().name))
}

/// The built-in report writers: what `calib run` writes, from `report.json` alone.
#[must_use]
pub fn built_in_reports() -> Vec<Entry<dyn calib_plugin::ReportWriter>> {
    type Render = fn(&calib_report::Report) -> Result<String, calib_report::ReportError>;
    let writers: [(&str, &str, &str, Render); 3] = [
        ("markdown", "the report as Markdown", "report.md", |r| {
            Ok(calib_report::markdown::markdown(r))
        }),
        (
            "html",
            "the report as a page, without the 3-D view",
            "report.html",
            |r| calib_report::html::html(r, None),
        ),
        (
            "summary",
            "what the terminal shows in full",
            "summary.txt",
            |r| {
                use calib_report::terminal::{Look, Places, full};
                Ok(full(r, Look::default(), Places::default()))
            },
        ),
    ];
    writers
        .into_iter()
        .map(|(name, what, path, render)| {
            let offer = Offer::new(Kind::Report, name, what);
            Entry::built_in_report(ByFn::new(
                offer,
                move |input: &ReportInput<'_>, _: &Call<'_>| {
                    let text = std::str::from_utf8(input.report_json)
                        .map_err(|e| Failure::BadInput(e.to_string()))?;
                    let report = calib_report::json::read_report(text)
                        .map_err(|e| Failure::BadInput(e.to_string()))?;
                    let rendered = render(&report).map_err(|e| Failure::BadInput(e.to_string()))?;
                    Ok(vec![ReportFile {
                        path: path.to_owned(),
                        bytes: rendered.into_bytes(),
                    }])
                },
            ))
        })
        .collect()
}

/// A recording as the plain streams that cross the border.
#[must_use]
pub fn streams(recording: &Recording) -> Streams {
    let pose = |p: &Isometry3<f64>| {
        let r = p.rotation.to_rotation_matrix();
        BodyPose {
            rotation: std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)])),
            translation_m: p.translation.vector.into(),
        }
    };
    let sample = |s: &calib_recording::MarkerSample| match s {
        calib_recording::MarkerSample::Lost => MarkerSample::Lost,
        calib_recording::MarkerSample::Measured(p) => MarkerSample::Measured(p.coords.into()),
        calib_recording::MarkerSample::Filled(p) => MarkerSample::Filled(p.coords.into()),
    };
    Streams {
        timelines: recording
            .timelines
            .iter()
            .map(|t| Timeline {
                clock: t.clock.clone(),
                rows: t.rows.clone(),
                t_s: t.t.clone(),
                labels: t.labels.clone().into_iter().collect(),
            })
            .collect(),
        markers: recording
            .markers
            .iter()
            .map(|m| MarkerTrack {
                name: m.name.clone(),
                timeline: m.timeline,
                samples: m.samples.iter().map(sample).collect(),
            })
            .collect(),
        bodies: recording
            .bodies
            .iter()
            .map(|b| BodyTrack {
                name: b.name.clone(),
                timeline: b.timeline,
                samples: b
                    .tracker_from_body
                    .iter()
                    .map(|p| p.as_ref().map(pose))
                    .collect(),
            })
            .collect(),
        joints: recording
            .joints
            .iter()
            .map(|j| JointTrack {
                name: j.name.clone(),
                timeline: j.timeline,
                unit: match j.unit {
                    calib_recording::JointUnit::Angle => JointUnit::Angle,
                    calib_recording::JointUnit::Length => JointUnit::Length,
                },
                samples: j.q.clone(),
            })
            .collect(),
        torques: recording
            .torques
            .iter()
            .map(|t| TorqueTrack {
                name: t.name.clone(),
                timeline: t.timeline,
                samples: t.torque.clone(),
            })
            .collect(),
        notes: recording.meta.conversions.clone(),
    }
}

/// The recording that a plugin's streams describe; `source` is the file, `reader` who read it.
#[must_use]
pub fn recording(streams: Streams, source: &str, reader: &str) -> Recording {
    let pose = |p: &BodyPose| {
        let r = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|i, j| p.rotation[i][j]));
        Isometry3::from_parts(
            Translation3::from(Vector3::from(p.translation_m)),
            calib_geometry::so3::quaternion_of(&r),
        )
    };
    let sample = |s: &MarkerSample| match s {
        MarkerSample::Lost => calib_recording::MarkerSample::Lost,
        MarkerSample::Measured(p) => calib_recording::MarkerSample::Measured(Point3::from(*p)),
        MarkerSample::Filled(p) => calib_recording::MarkerSample::Filled(Point3::from(*p)),
    };
    Recording {
        meta: calib_recording::Meta {
            source: source.to_owned(),
            format: reader.to_owned(),
            conversions: streams.notes,
            ..calib_recording::Meta::default()
        },
        timelines: streams
            .timelines
            .into_iter()
            .map(|t| calib_recording::Timeline {
                clock: t.clock,
                rows: t.rows,
                t: t.t_s,
                labels: t.labels.into_iter().collect(),
                ..calib_recording::Timeline::default()
            })
            .collect(),
        joints: streams
            .joints
            .into_iter()
            .map(|j| JointStream {
                name: j.name,
                timeline: j.timeline,
                unit: match j.unit {
                    JointUnit::Angle => calib_recording::JointUnit::Angle,
                    JointUnit::Length => calib_recording::JointUnit::Length,
                },
                q: j.samples,
            })
            .collect(),
        torques: streams
            .torques
            .into_iter()
            .map(|t| TorqueStream {
                name: t.name,
                timeline: t.timeline,
                torque: t.samples,
            })
            .collect(),
        temperatures: Vec::new(),
        bodies: streams
            .bodies
            .into_iter()
            .map(|b| BodyStream {
                name: b.name,
                timeline: b.timeline,
                tracker_from_body: b.samples.iter().map(|p| p.as_ref().map(pose)).collect(),
                quality: Vec::new(),
                covariance: Vec::new(),
            })
            .collect(),
        markers: streams
            .markers
            .into_iter()
            .map(|m| MarkerStream {
                name: m.name,
                body: None,
                unlabeled: false,
                timeline: m.timeline,
                samples: m.samples.iter().map(sample).collect(),
            })
            .collect(),
    }
}
