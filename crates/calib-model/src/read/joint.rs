//! A joint of the file with its effects.

use std::collections::BTreeMap;

use nalgebra::{Unit, Vector3};

use super::{Names, UNIT, finite, pose, value};
use crate::axis::Axis;
use crate::effect::{Drives, EFFECTS, EffectKind, HARMONICS, LATERAL, OF_STATE, Source, Term};
use crate::error::ModelError;
use crate::file::{ModelEffect, ModelJoint, ModelMotion};
use crate::model::{FindOutside, Joint, JointTerm};
use crate::origin::Origin;

fn unit(place: &str, v: [f64; 3]) -> Result<Unit<Vector3<f64>>, ModelError> {
    let v = Vector3::from(v);
    let norm = v.norm();
    if norm.is_nan() || (norm - 1.0).abs() >= UNIT {
        return Err(value(place.to_owned(), norm, "a vector of length 1"));
    }
    // One that is a unit vector to rounding stays as it was fitted, to the bit.
    Ok(match (norm - 1.0).abs() < 1e-12 {
        true => Unit::new_unchecked(v),
        false => Unit::new_normalize(v),
    })
}

/// The term that a file names. Those of a recording (clock offset) and of a caller are no part of a robot.
fn term(kind: &str) -> Option<&'static Term> {
    let mut terms = EFFECTS.iter().flat_map(|e| e.terms);
    terms.find(|t| t.name == kind && !matches!(t.source, Source::Velocity | Source::Caller))
}

/// The term that an effect of a joint names, in the table or outside of it.
fn known(
    joint: &ModelJoint,
    effect: &ModelEffect,
    outside: FindOutside<'_>,
) -> Result<Option<&'static Term>, ModelError> {
    let Some(plugin) = &effect.plugin else {
        return Ok(term(&effect.kind));
    };
    let found = outside(joint, effect).ok_or_else(|| ModelError::Plugin {
        joint: joint.name.clone(),
        effect: effect.kind.clone(),
        plugin: plugin.name.clone(),
        version: plugin.version.clone(),
    })?;
    Ok(Some(EffectKind::Outside(found).term()))
}

/// The joint with all names resolved; `entries`: places in q by joint.
pub(super) fn joint(
    i: usize,
    j: &ModelJoint,
    names: &Names,
    entries: &BTreeMap<usize, usize>,
    outside: FindOutside<'_>,
) -> Result<Joint, ModelError> {
    let place = |what: &str| format!("joints[{i}].{what}");
    let (source, multiplier, offset) = match &j.mimic {
        None => (i, 1.0, 0.0),
        Some(m) => {
            finite(&place("mimic"), &[m.multiplier, m.offset])?;
            (
                names.joint(&place("mimic.joint"), &m.joint)?,
                m.multiplier,
                m.offset,
            )
        }
    };
    let moves = j.motion != ModelMotion::Fixed;
    let axis = axis_of(&place, j, moves)?;
    let entry = match (moves, entries.get(&source)) {
        (false, _) => 0,
        (true, Some(entry)) => *entry,
        (true, None) => {
            let found = j.mimic.as_ref().map_or("", |m| m.joint.as_str());
            return Err(value(
                place("mimic.joint"),
                found,
                "a joint that moves by itself",
            ));
        }
    };
    let mut out = Joint {
        parent: names.link(&place("parent"), &j.parent)?,
        origin: Origin::of(
            pose(&place("parent_from_joint"), &j.parent_from_joint)?,
            axis,
        ),
        nominal: Origin::of(pose(&place("load_origin"), &j.load_origin)?, axis),
        axis,
        across: axis.map_or([Vector3::zeros(); 2], |a| a.across()),
        source: entry,
        multiplier,
        offset,
        own: moves && j.mimic.is_none(),
        gear_ratio: 0.0,
        friction: 0.0,
        terms: Vec::new(),
        harmonics: [0.0; 8],
        of_state: [0.0; 5],
        lateral: [0.0; 2],
        flank: 0.0,
        couplings: Vec::new(),
        growth: Vector3::zeros(),
        grows: false,
        direct: Vec::new(),
        yields: false,
        turns: false,
        geared: false,
        moment: Vector3::zeros(),
        mass: 0.0,
        carried: 0.0,
    };
    for (k, effect) in j.effects.iter().enumerate() {
        let place = |what: &str| format!("joints[{i}].effects[{k}].{what}");
        let Some(axis) = axis else {
            return Err(value(
                place("kind"),
                &effect.kind,
                "none: the joint is fixed",
            ));
        };
        let known = known(j, effect, outside)?;
        let term = joint_term(&place, effect, known, axis, names)?;
        if let Some(other) = term.other
            && !entries.contains_key(&other)
        {
            let found = effect.other.clone().unwrap_or_default();
            return Err(value(place("other"), found, "a joint that moves by itself"));
        }
        add(&mut out, effect, term);
    }
    Ok(out)
}

/// Adds a term to those of a joint.
fn add(out: &mut Joint, effect: &ModelEffect, term: JointTerm) {
    // Both are of the joint; its effects repeat them.
    out.gear_ratio = effect.gear_ratio.unwrap_or(out.gear_ratio);
    out.friction = effect.friction.unwrap_or(out.friction);
    if let Some((n, about)) = term.across {
        out.across[n] = about;
        out.yields = true;
    }
    let among = |kinds: &[EffectKind]| kinds.iter().position(|k| *k == term.term.kind);
    if let Some(k) = among(&HARMONICS) {
        out.harmonics[k] += term.value;
        out.geared |= term.term.source == Source::Motor;
        out.turns |= term.term.source == Source::Reading;
    } else if let Some(k) = among(&OF_STATE) {
        out.of_state[k] += term.value;
    } else if let Some(k) = among(&LATERAL) {
        out.lateral[k] += term.value;
    } else if let Some(reach) = term.along {
        out.growth += reach * term.value;
        out.grows = true;
    } else if let Some(other) = term.other {
        out.couplings.push((other, term.value));
    } else if term.jumps {
        out.flank += term.value;
    } else {
        out.direct.push(term);
    }
    out.terms.push(term);
}

/// The axis of a joint that moves.
fn axis_of(
    place: &dyn Fn(&str) -> String,
    j: &ModelJoint,
    moves: bool,
) -> Result<Option<Axis>, ModelError> {
    let axis = match (j.axis, moves) {
        (Some(a), true) => unit(&place("axis"), a)?,
        (None, true) => return Err(value(place("axis"), "null", "a vector of length 1")),
        (_, false) => return Ok(None),
    };
    Ok(Some(match j.motion {
        ModelMotion::Prismatic => Axis::Prismatic(axis),
        _ => Axis::Revolute(axis),
    }))
}

fn joint_term(
    place: &dyn Fn(&str) -> String,
    effect: &ModelEffect,
    known: Option<&'static Term>,
    axis: Axis,
    names: &Names,
) -> Result<JointTerm, ModelError> {
    let term = known.ok_or_else(|| value(place("kind"), &effect.kind, "an effect of version 1"))?;
    finite(&place("value"), &[effect.value])?;
    for (what, x) in [
        ("gear_ratio", effect.gear_ratio),
        ("friction", effect.friction),
    ] {
        finite(&place(what), &[x.unwrap_or(0.0)])?;
    }
    if !term.kind.effect().applies_to(&axis) {
        return Err(value(
            place("kind"),
            &effect.kind,
            "an effect of sliding joints",
        ));
    }
    let across = match (term.drives, effect.about) {
        (Drives::About | Drives::Along, None) => None,
        (Drives::Across(n), Some(about)) => Some((n, unit(&place("about"), about)?.into_inner())),
        (Drives::About | Drives::Along, Some(_)) => {
            return Err(value(
                place("about"),
                "a vector",
                "null: this effect does not turn across the axis",
            ));
        }
        (Drives::Across(_), None) => {
            return Err(value(
                place("about"),
                "null",
                "the axis across that it is about",
            ));
        }
    };
    let along = match (term.drives, effect.along) {
        (Drives::Along, Some(along)) => {
            finite(&place("along"), &along)?;
            Some(Vector3::from(along))
        }
        (Drives::Along, None) => {
            return Err(value(place("along"), "null", "the length that grows"));
        }
        (_, Some(_)) => {
            let expected = "null: this effect changes no length";
            return Err(value(place("along"), "a vector", expected));
        }
        (_, None) => None,
    };
    let other = match (term.kind, &effect.other) {
        (EffectKind::Coupling, Some(name)) => Some(names.joint(&place("other"), name)?),
        (EffectKind::Coupling, None) => {
            return Err(value(place("other"), "null", "the joint that it follows"));
        }
        _ => None,
    };
    Ok(JointTerm {
        term,
        value: effect.value,
        across,
        along,
        other,
        jumps: term.kind == EffectKind::FlankBacklash,
    })
}
