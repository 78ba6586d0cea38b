//! The proposal where nothing was recorded yet.

use calib_urdf::{LinkId, RobotModel};

use crate::bodies;
use crate::error::InitError;
use crate::fact::{About, Fact, Place};
use crate::proposal::{Body, Proposal, Recording, Table};
use crate::robot;
use crate::session::Use;
use crate::skeleton;

/// A body at the end of the longest chain, and postures to record: tables in `folder`. `urdf`: the robot's file in messages.
pub(crate) fn propose(
    model: &RobotModel,
    (folder, urdf): (&str, &str),
    stated: Option<LinkId>,
    longest: &robot::Tip,
    proposal: &mut Proposal,
) -> Result<(), InitError> {
    let body = bodies::unlike_links(model, "tool".to_owned());
    let link = stated.unwrap_or(longest.link);
    let named = |link: LinkId| model.link(link).name.clone();
    let about = match stated {
        Some(link) => About::LinkStated {
            link: named(link),
            rms: None,
            better: None,
        },
        None => About::TipOfChain {
            link: named(link),
            joints: longest.joints.len(),
            others: robot::tips(model)
                .iter()
                .skip(1)
                .map(|tip| named(tip.link))
                .collect(),
        },
    };
    proposal
        .facts
        .push(Fact::new(Place::Body(body.clone()), about));
    let joints = robot::movers(model, link);
    if joints.is_empty() {
        return Err(InitError::StillLink {
            link: named(link),
            tips: robot::ends(model),
        });
    }
    let skeleton = skeleton::skeleton(model, &joints);
    if skeleton.random.is_empty() {
        let joints = robot::names(model, &joints).into_iter();
        return Err(InitError::NoRange {
            file: urdf.to_owned(),
            joints: joints.map(str::to_owned).collect(),
        });
    }
    proposal.bodies.push(Body {
        markers: (1..=4).map(|i| format!("{body}_{i}")).collect(),
        name: body,
        link,
    });
    // A robot that only slides has no axis to sweep.
    let sweep = (!skeleton.sweep.is_empty()).then(|| ("sweep", Use::Sweep(skeleton.sweep.clone())));
    let poses = [("poses", Use::Static), ("checks", Use::Validation)];
    for (name, usage) in sweep.into_iter().chain(poses) {
        proposal.recordings.push(Recording {
            name: name.to_owned(),
            table: Table {
                path: format!("{folder}/{name}.csv"),
                columns: None,
            },
            log: None,
            stream: None,
            max_offset: None,
            usage,
            hold: Vec::new(),
        });
    }
    proposal.skeleton = Some(skeleton);
    proposal
        .facts
        .push(Fact::new(Place::Tracker, About::SigmaUnknown));
    proposal
        .facts
        .push(Fact::new(Place::Simulate, About::Invented));
    Ok(())
}
