//! One offer of any kind, called with any input.

use std::collections::BTreeMap;

use crate::{
    answer::{Answer, AorFit, CorFit},
    host::{Control, LoadedPlugin, PluginError},
    kinds::{Aor, Cor, Reader, ReportWriter},
    motion::MotionData,
    offer::{Offer, Value},
    registry::Bound,
    streams::{ReportFile, ReportInput, Source, Streams},
};

#[derive(Debug, Clone)]
pub(super) enum Input {
    Motion(Box<MotionData>),
    Bytes(Vec<u8>),
}

#[derive(Debug)]
pub(super) enum Reply {
    Cor(Box<Answer<CorFit>>),
    Aor(Box<Answer<AorFit>>),
    Streams(Streams),
    Files(Vec<ReportFile>),
    /// Refused, with a reason.
    Refused(String),
}

enum Callable {
    Cor(Bound<dyn Cor>),
    Aor(Bound<dyn Aor>),
    Reader(Bound<dyn Reader>),
    Report(Bound<dyn ReportWriter>),
}

pub(super) struct Subject {
    pub title: String,
    pub offer: Offer,
    callable: Callable,
}

/// Values for required parameters: their examples.
fn examples(offer: &Offer) -> BTreeMap<String, Value> {
    let required = offer.parameters.iter().filter(|p| p.required);
    required
        .map(|p| (p.name.clone(), p.value.clone()))
        .collect()
}

impl Subject {
    /// Everything that a plugin offers. Defaults and examples were checked when it was loaded.
    pub(super) fn all(plugin: &LoadedPlugin) -> Vec<Self> {
        let mut out = Vec::new();
        let mut push = |offer: &Offer, callable: Result<Callable, PluginError>| {
            if let Ok(callable) = callable {
                out.push(Self {
                    title: format!("{} {}", offer.kind.id(), offer.name),
                    offer: offer.clone(),
                    callable,
                });
            }
        };
        for entry in plugin.cors() {
            push(
                entry.offer(),
                entry.with(&examples(entry.offer())).map(Callable::Cor),
            );
        }
        for entry in plugin.aors() {
            push(
                entry.offer(),
                entry.with(&examples(entry.offer())).map(Callable::Aor),
            );
        }
        for entry in plugin.readers() {
            push(
                entry.offer(),
                entry.with(&examples(entry.offer())).map(Callable::Reader),
            );
        }
        for entry in plugin.reports() {
            push(
                entry.offer(),
                entry.with(&examples(entry.offer())).map(Callable::Report),
            );
        }
        out
    }

    pub(super) fn call(&self, input: &Input, control: &Control<'_>) -> Result<Reply, PluginError> {
        let nothing = MotionData::points(&[]);
        let (motion, bytes): (&MotionData, &[u8]) = match input {
            Input::Motion(motion) => (motion, &[]),
            Input::Bytes(bytes) => (&nothing, bytes),
        };
        Ok(match &self.callable {
            Callable::Cor(it) => Reply::Cor(Box::new(it.fit(&motion.view(), control)?)),
            Callable::Aor(it) => Reply::Aor(Box::new(it.fit(&motion.view(), control)?)),
            Callable::Reader(it) => {
                // Its own business: here it must only return.
                let _ = it.entry().recognizes(bytes);
                Reply::Streams(it.read(
                    &Source {
                        name: "check",
                        bytes,
                    },
                    control,
                )?)
            }
            Callable::Report(it) => Reply::Files(it.write(
                &ReportInput {
                    report_json: bytes,
                    scene_json: None,
                },
                control,
            )?),
        })
    }
}
