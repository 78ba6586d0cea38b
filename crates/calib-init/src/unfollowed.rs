//! Joints whose values change while no body moves with them: nothing is learned of them, and a body may be on a link beyond one that stood still.

use calib_urdf::{JointId, LinkId};

use crate::fact::{About, Fact, Place};
use crate::links::Scene;
use crate::robot;

/// What is said of such joints. `on`: body and link; `stated`: bodies whose links a person named.
#[must_use]
pub fn fact(scene: &Scene<'_>, on: &[(usize, LinkId)], stated: &[usize]) -> Option<Fact> {
    let model = scene.model;
    let is_followed = |joint: &JointId| {
        on.iter()
            .any(|(_, link)| robot::movers(model, *link).contains(joint))
    };
    let mut joints = scene.moving();
    joints.retain(|joint| !is_followed(joint));
    joints.sort_by_key(|joint| model.chain_to_root(model.joint(*joint).child).len());
    // A body on the link that carries the first of them would not move with it either if the joint stood.
    let carriers: Vec<LinkId> = joints
        .iter()
        .map(|joint| robot::group(model, model.joint(*joint).parent))
        .collect();
    let may_be_beyond = |(body, link): &&(usize, LinkId)| {
        let moves = !robot::movers(model, *link).is_empty();
        let is_before = carriers.contains(&robot::group(model, *link));
        moves && is_before && !stated.contains(body)
    };
    let body = on.iter().find(may_be_beyond);
    let names = robot::names(model, &joints).into_iter();
    let about = About::Unfollowed {
        joints: names.map(str::to_owned).collect(),
        body: body.map(|(body, _)| scene.bodies[*body].name.clone()),
    };
    (!joints.is_empty()).then(|| Fact::new(Place::Recordings, about))
}
