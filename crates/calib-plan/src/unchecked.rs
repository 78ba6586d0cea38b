//! What a plan does not look at: links without shapes, pairs that are not compared, what the cameras do not say.

use calib_pipeline::output::shapes::Unread;
use calib_urdf::{JointId, LinkId};

use crate::joints::JointBox;
use crate::known::Known;
use crate::note::Note;
use crate::scene::Scene;

/// Notes of a robot among its surroundings.
pub(crate) fn notes(
    known: &Known,
    joints: &JointBox,
    scene: &Scene,
    unread: &[Unread],
) -> Vec<Note> {
    let spec = &known.robot.profile.plan;
    let mut notes = of_joints(known, joints);
    notes.extend(of_shapes(known, joints, scene, unread));
    notes.extend(of_pairs(known, scene));
    if spec.cameras.is_empty() {
        notes.push(Note::EverythingSeen);
        if !spec.facing.is_empty() {
            notes.push(Note::FacingUnused);
        }
    }
    notes
}

fn of_joints(known: &Known, joints: &JointBox) -> Vec<Note> {
    let model = &known.robot.model;
    let name = |id: &JointId| model.joint(*id).name.clone();
    let mut notes = Vec::new();
    if !joints.fixed.is_empty() {
        let joints = joints.fixed.iter().map(name).collect();
        notes.push(Note::NoRoom { joints });
    }
    if !joints.narrowed.is_empty() {
        let of = |id: &JointId| {
            let mut all = calib_urdf::range::followers(model, *id);
            let follower = all.next().map_or_else(String::new, |f| f.name.clone());
            [name(id), follower]
        };
        let joints = joints.narrowed.iter().map(of).collect();
        notes.push(Note::NarrowedByFollower { joints });
    }
    notes
}

/// Links that move and have no shape, or one that could not be read, and links that stand in what is stated.
fn of_shapes(known: &Known, joints: &JointBox, scene: &Scene, unread: &[Unread]) -> Vec<Note> {
    let model = &known.robot.model;
    let spec = &known.robot.profile.plan;
    let moved = |link: LinkId| !joints.movers(model, link).is_empty();
    let name = |link: LinkId| model.link(link).name.clone();
    let has_shape = |link: LinkId| scene.capsules.iter().any(|c| c.link == link);
    let is_unread = |link: LinkId| unread.iter().any(|u| u.link == model.link(link).name);
    let without = model.link_ids().filter(|l| moved(*l));
    let without = without.filter(|l| !has_shape(*l) && !is_unread(*l));
    let links: Vec<String> = without.map(name).collect();
    let moves = |u: &&Unread| model.link_id(&u.link).is_ok_and(moved);
    let shapes = unread.iter().filter(moves);
    let shapes: Vec<(String, Option<String>)> =
        shapes.map(|u| (u.link.clone(), u.file.clone())).collect();
    let ground = spec.ground.map(|_| "plan.ground_mm".to_owned());
    let boxes = spec.keep_outs.keys().map(|k| format!("plan.keep_outs.{k}"));
    let stated: Vec<String> = ground.into_iter().chain(boxes).collect();
    let mut notes = Vec::new();
    let any = !links.is_empty() || !shapes.is_empty();
    if any && !stated.is_empty() {
        notes.push(Note::SurroundingsUnchecked {
            stated: stated.clone(),
            links: links.clone(),
            unread: shapes.clone(),
        });
    }
    if !links.is_empty() {
        notes.push(Note::NoShape { links });
    }
    if !shapes.is_empty() {
        notes.push(Note::ShapeUnread { shapes });
    }
    let standing = scene.standing(model, &joints.base);
    if !standing.is_empty() {
        let links = standing.into_iter().map(name).collect();
        notes.push(Note::StandsThere { stated, links });
    }
    notes
}

fn of_pairs(known: &Known, scene: &Scene) -> Vec<Note> {
    let model = &known.robot.model;
    let name = |part: usize| {
        let of = scene.capsules.iter().find(|c| c.body == part);
        of.map_or_else(String::new, |c| model.link(c.link).name.clone())
    };
    let named = |pairs: &[(usize, usize)]| -> Vec<[String; 2]> {
        pairs.iter().map(|(a, b)| [name(*a), name(*b)]).collect()
    };
    let mut notes = Vec::new();
    if !scene.always.is_empty() {
        let pairs = named(&scene.always);
        notes.push(Note::PairsNotCompared { pairs });
    }
    if !scene.close.is_empty() {
        let pairs = named(&scene.close);
        notes.push(Note::PairsAlwaysClose { pairs });
    }
    notes
}
