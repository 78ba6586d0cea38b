//! From the file to a [`Model`]: names become indices, and whatever cannot be computed with is refused with its place.

mod joint;

use std::collections::{BTreeMap, BTreeSet};

use calib_geometry::so3;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::effect::Source;
use crate::effect::thermal_expansion::REFERENCE_TEMPERATURE_C;
use crate::error::ModelError;
use crate::file::{FormatVersion, ModelMotion, ModelNumber, ModelPose, RobotModelFile, VERSION};
use crate::model::{FindOutside, Fixed, Joint, JointInfo, JointTerm, Model, Number};
use crate::pose::Pose;

/// Unit vectors and quaternions of a file may be off by this, m/m: they are normalized.
const UNIT: f64 = 1e-6;

/// No length (m), angle (rad), mass (kg), acceleration or coefficient of a robot is as large.
const LARGEST: f64 = 1e9;

/// Chains are kept for each link, so memory grows with the square: no robot has as many joints.
const MOST_JOINTS: usize = 500;

fn value(place: String, found: impl ToString, expected: &'static str) -> ModelError {
    ModelError::Value {
        place,
        found: found.to_string(),
        expected,
    }
}

fn finite(place: &str, numbers: &[f64]) -> Result<(), ModelError> {
    let bad = numbers.iter().find(|x| x.is_nan() || x.abs() >= LARGEST);
    bad.map_or(Ok(()), |x| {
        Err(value(place.to_owned(), x, "numbers below 1e9 in size"))
    })
}

fn pose(place: &str, p: &ModelPose) -> Result<Pose, ModelError> {
    finite(&format!("{place}.xyz_m"), &p.xyz_m)?;
    let [x, y, z, w] = p.quat_xyzw;
    let q = Quaternion::new(w, x, y, z);
    if q.norm().is_nan() || (q.norm() - 1.0).abs() >= UNIT {
        let place = format!("{place}.quat_xyzw");
        return Err(value(place, q.norm(), "a quaternion of length 1"));
    }
    let rotation = match (q.norm() - 1.0).abs() < 1e-12 {
        true => UnitQuaternion::new_unchecked(q),
        false => UnitQuaternion::new_normalize(q),
    };
    Ok(Pose {
        r: *rotation.to_rotation_matrix().matrix(),
        t: Vector3::from(p.xyz_m),
    })
}

fn by_load(t: &JointTerm) -> bool {
    matches!(t.term.source, Source::Load | Source::Friction)
}

impl Model {
    /// Reads `<robot>.calibrated.model.json`.
    ///
    /// # Errors
    /// [`ModelError::Syntax`], [`ModelError::Version`] or [`ModelError::Value`], each with its place.
    pub fn from_json(bytes: &[u8]) -> Result<Self, ModelError> {
        Self::new(&RobotModelFile::from_json(bytes)?)
    }

    /// From the contents of a file.
    ///
    /// # Errors
    /// [`ModelError::Value`] with its place; [`ModelError::Plugin`] where a plugin computes an effect.
    pub fn new(file: &RobotModelFile) -> Result<Self, ModelError> {
        Self::with_outside(file, &|_, _| None)
    }

    /// The same with the effects that plugins compute: `outside` gives what computes an effect of a joint of the file.
    ///
    /// # Errors
    /// [`ModelError::Value`] with its place; [`ModelError::Plugin`] where `outside` gives nothing.
    pub fn with_outside(
        file: &RobotModelFile,
        outside: FindOutside<'_>,
    ) -> Result<Self, ModelError> {
        finite("gravity_m_s2", &file.gravity_m_s2)?;
        if file.approach_threshold.is_nan() || file.approach_threshold < 0.0 {
            let place = "approach_threshold".to_owned();
            return Err(value(place, file.approach_threshold, "a number from 0 up"));
        }
        let temperature = file.reference_temperature_c;
        finite(
            "reference_temperature_c",
            &[temperature.unwrap_or_default()],
        )?;
        if file.joints.len() > MOST_JOINTS {
            let found = file.joints.len();
            return Err(value("joints".to_owned(), found, "at most 500 joints"));
        }
        let names = Names::of(file)?;
        let mut model = Self {
            name: file.robot.clone(),
            links: names.ordered(),
            joints: Vec::new(),
            moved: Vec::new(),
            gravity: Vector3::from(file.gravity_m_s2),
            loaded: false,
            threshold: file.approach_threshold,
            reference_temperature: file
                .reference_temperature_c
                .unwrap_or(REFERENCE_TEMPERATURE_C),
            tracker_from_root: pose("tracker_from_root", &file.tracker_from_root)?,
            bodies: Vec::new(),
            points: Vec::new(),
            renamed: Vec::new(),
            chains: vec![Vec::new()],
            leading: Vec::new(),
            movers: Vec::new(),
            numbers: Vec::new(),
            root: Vec::new(),
            columns: 0,
        };
        model.add_joints(file, &names, outside)?;
        model.add_masses(file, &names)?;
        model.add_fixed(file, &names)?;
        model.add_movers();
        model.add_uncertainty(file, &names)?;
        model.rename_like_links();
        Ok(model)
    }

    /// A body or point with the name of a link gets another one, as in the scene: a pose under that name is the link's.
    fn rename_like_links(&mut self) {
        let fixed = self.bodies.iter().chain(&self.points);
        let mut taken: BTreeSet<String> = fixed.map(|f| f.name.clone()).collect();
        taken.extend(self.links.iter().cloned());
        for fixed in self.bodies.iter_mut().chain(&mut self.points) {
            if self.links.contains(&fixed.name) {
                let mut name = format!("{}_body", fixed.name);
                while !taken.insert(name.clone()) {
                    name.push_str("_body");
                }
                let own = std::mem::replace(&mut fixed.name, name.clone());
                self.renamed.push((own, name));
            }
        }
    }

    fn add_joints(
        &mut self,
        file: &RobotModelFile,
        names: &Names,
        outside: FindOutside<'_>,
    ) -> Result<(), ModelError> {
        let mut entries = BTreeMap::new();
        for (i, j) in file.joints.iter().enumerate() {
            if j.motion == ModelMotion::Fixed || j.mimic.is_some() {
                continue;
            }
            entries.insert(i, self.moved.len());
            for (what, range) in [("limits", j.limits), ("fitted_range", j.fitted_range)] {
                // Limits of a continuous joint may be as wide as numbers go, but they are in order.
                if range.is_some_and(|[low, high]| low.is_nan() || high.is_nan() || low > high) {
                    let place = format!("joints[{i}].{what}");
                    return Err(value(place, format!("{range:?}"), "two numbers in order"));
                }
            }
            self.moved.push(JointInfo {
                name: j.name.clone(),
                prismatic: j.motion == ModelMotion::Prismatic,
                limits: j.limits,
                fitted_range: j.fitted_range,
            });
        }
        for (i, j) in file.joints.iter().enumerate() {
            let joint = joint::joint(i, j, names, &entries, outside)?;
            let mut chain = self.chains[joint.parent].clone();
            chain.push(i);
            self.chains.push(chain);
            self.joints.push(joint);
        }
        self.loaded = self.joints.iter().flat_map(|j| &j.terms).any(by_load);
        Ok(())
    }

    fn add_masses(&mut self, file: &RobotModelFile, names: &Names) -> Result<(), ModelError> {
        let mut listed = BTreeSet::new();
        for (i, link) in file.links.iter().enumerate() {
            if !listed.insert(link.name.as_str()) {
                let place = format!("links[{i}].name");
                return Err(value(place, &link.name, "a name that no link before has"));
            }
            finite(&format!("links[{i}].mass_kg"), &[link.mass_kg])?;
            let place = format!("links[{i}].first_moment_kg_m");
            finite(&place, &link.first_moment_kg_m)?;
            if link.mass_kg < 0.0 {
                let place = format!("links[{i}].mass_kg");
                return Err(value(place, link.mass_kg, "a number from 0 up"));
            }
            let k = names.link(&format!("links[{i}].name"), &link.name)?;
            if let Some(joint) = k.checked_sub(1).map(|k| &mut self.joints[k]) {
                joint.mass = link.mass_kg;
                joint.moment = Vector3::from(link.first_moment_kg_m);
            }
        }
        let mut carried: Vec<f64> = self.joints.iter().map(|j| j.mass).collect();
        for (i, joint) in self.joints.iter_mut().enumerate().rev() {
            joint.carried = carried[i];
            if let Some(parent) = joint.parent.checked_sub(1) {
                carried[parent] += carried[i];
            }
        }
        Ok(())
    }

    fn add_fixed(&mut self, file: &RobotModelFile, names: &Names) -> Result<(), ModelError> {
        for (name, body) in &file.bodies {
            let place = format!("bodies.{name}");
            let link = names.link(&format!("{place}.link"), &body.link)?;
            if let Some(mount) = &body.link_from_body {
                self.bodies.push(Fixed {
                    name: name.clone(),
                    link,
                    link_from_it: pose(&format!("{place}.link_from_body"), mount)?,
                });
            }
        }
        for (name, point) in &file.points {
            let place = format!("points.{name}");
            finite(&format!("{place}.xyz_m"), &point.xyz_m)?;
            self.points.push(Fixed {
                name: name.clone(),
                link: names.link(&format!("{place}.link"), &point.link)?,
                link_from_it: Pose {
                    t: Vector3::from(point.xyz_m),
                    ..Pose::identity()
                },
            });
        }
        Ok(())
    }

    /// Entries of q that each link's pose depends on: of its own chain, of joints that these are coupled to, and of joints
    /// further out whose masses load it.
    fn add_movers(&mut self) {
        let moving = |j: &&Joint| j.axis.is_some();
        // By link: of everything that hangs on it.
        let mut beyond = vec![BTreeSet::new(); self.links.len()];
        for (i, joint) in self.joints.iter().enumerate().rev() {
            let mut own = beyond[i + 1].clone();
            own.extend(Some(joint).filter(moving).map(|j| j.source));
            beyond[joint.parent].append(&mut own);
        }
        for chain in &self.chains {
            let mut found = BTreeSet::new();
            let joints = chain.iter().map(|j| &self.joints[*j]);
            found.extend(joints.filter(moving).map(|j| j.source));
            self.leading.push(found.iter().copied().collect());
            for &j in chain {
                let joint = &self.joints[j];
                let others = joint.terms.iter().filter_map(|t| t.other);
                found.extend(others.map(|o| self.joints[o].source));
                if joint.terms.iter().any(by_load) {
                    // Equation (1): the load follows the whole posture between the root and what is carried.
                    found.extend(&beyond[0]);
                }
            }
            self.movers.push(found.into_iter().collect());
        }
    }

    fn add_uncertainty(&mut self, file: &RobotModelFile, names: &Names) -> Result<(), ModelError> {
        let Some(uncertainty) = &file.uncertainty else {
            return Ok(());
        };
        let columns = uncertainty.root.first().map_or(0, Vec::len);
        if uncertainty.root.len() != uncertainty.numbers.len() {
            let found = format!("{} rows", uncertainty.root.len());
            let place = "uncertainty.root".to_owned();
            return Err(value(place, found, "one row for each of numbers"));
        }
        let rows = uncertainty.numbers.iter().zip(&uncertainty.root);
        for (i, (number, row)) in rows.enumerate() {
            let place = format!("uncertainty.root[{i}]");
            if row.len() != columns {
                let found = format!("{} numbers", row.len());
                return Err(value(place, found, "rows of one length"));
            }
            finite(&place, row)?;
            self.numbers.push(self.number(i, number, names)?);
            self.root.extend(row);
        }
        self.columns = columns;
        Ok(())
    }

    /// What a row of the root of the covariance moves.
    fn number(&self, i: usize, n: &ModelNumber, names: &Names) -> Result<Number, ModelError> {
        let place = |what: &str| format!("uncertainty.numbers[{i}].{what}");
        let coordinate = ["rx", "ry", "rz", "x", "y", "z"]
            .iter()
            .position(|c| *c == n.number);
        let unknown = || value(place("number"), &n.number, "a number of this model");
        let linear = || {
            coordinate
                .and_then(|c| c.checked_sub(3))
                .ok_or_else(unknown)
        };
        let within = |of: &[Fixed]| of.iter().position(|f| f.name == n.name);
        Ok(match n.of.as_str() {
            "tracker" => Number::Tracker(coordinate.ok_or_else(unknown)?),
            "joint" => {
                let found = names.joints.get(n.name.as_str()).copied();
                let j = found.ok_or_else(|| value(place("name"), &n.name, "a joint"))?;
                match coordinate {
                    Some(c) => Number::Origin(j, c),
                    None => {
                        let t = self.term_of(j, &n.number, names);
                        Number::Coefficient(j, t.ok_or_else(unknown)?)
                    }
                }
            }
            "body" => match within(&self.bodies) {
                Some(body) => Number::Mount(body, coordinate.ok_or_else(unknown)?),
                None => Number::Unused,
            },
            "point" => {
                let found = within(&self.points);
                let point = found.ok_or_else(|| value(place("name"), &n.name, "a point"))?;
                Number::Point(point, linear()?)
            }
            "link" => Number::Moment(names.link(&place("name"), &n.name)?, linear()?),
            "marker" => Number::Unused,
            _ => {
                let expected = "joint, tracker, body, marker, point or link";
                return Err(value(place("of"), &n.of, expected));
            }
        })
    }

    /// The term of a joint that a number names: an effect, or `coupling:other`.
    fn term_of(&self, joint: usize, number: &str, names: &Names) -> Option<usize> {
        let terms = &self.joints[joint].terms;
        match number.strip_prefix("coupling:") {
            None => terms
                .iter()
                .position(|t| t.other.is_none() && t.term.name == number),
            Some(other) => {
                let other = names.joints.get(other).copied()?;
                terms.iter().position(|t| t.other == Some(other))
            }
        }
    }
}

impl RobotModelFile {
    /// The contents of a file.
    ///
    /// # Errors
    /// [`ModelError::Syntax`] or [`ModelError::Version`].
    pub fn from_json(bytes: &[u8]) -> Result<Self, ModelError> {
        /// What is the same in every version.
        #[derive(serde::Deserialize)]
        struct Head {
            calib_model: FormatVersion,
        }
        let syntax = |e: serde_json::Error| ModelError::Syntax {
            line: e.line(),
            column: e.column(),
            problem: e.to_string(),
        };
        let head: Head = serde_json::from_slice(bytes).map_err(syntax)?;
        let FormatVersion(found) = head.calib_model;
        if found != VERSION {
            return Err(ModelError::Version {
                found,
                expected: VERSION,
            });
        }
        serde_json::from_slice(bytes).map_err(syntax)
    }
}

/// Indices by name: 0 is the root, i + 1 the child of joint i.
struct Names<'a> {
    links: BTreeMap<&'a str, usize>,
    joints: BTreeMap<&'a str, usize>,
}

impl<'a> Names<'a> {
    /// Every joint after the one that carries it, every link with one parent.
    fn of(file: &'a RobotModelFile) -> Result<Self, ModelError> {
        let mut links = BTreeMap::from([(file.root.as_str(), 0)]);
        let mut joints = BTreeMap::new();
        for (i, j) in file.joints.iter().enumerate() {
            if !links.contains_key(j.parent.as_str()) {
                let place = format!("joints[{i}].parent");
                return Err(value(
                    place,
                    &j.parent,
                    "the root or the child of a joint before",
                ));
            }
            if links.insert(&j.child, i + 1).is_some() {
                let place = format!("joints[{i}].child");
                return Err(value(place, &j.child, "a link that no joint before moves"));
            }
            if joints.insert(j.name.as_str(), i).is_some() {
                let place = format!("joints[{i}].name");
                return Err(value(place, &j.name, "a name that no joint before has"));
            }
        }
        Ok(Self { links, joints })
    }

    fn ordered(&self) -> Vec<String> {
        let mut names = vec![String::new(); self.links.len()];
        for (name, k) in &self.links {
            names[*k] = (*name).to_owned();
        }
        names
    }

    fn link(&self, place: &str, name: &str) -> Result<usize, ModelError> {
        let found = self.links.get(name).copied();
        found.ok_or_else(|| value(place.to_owned(), name, "a link of this robot"))
    }

    fn joint(&self, place: &str, name: &str) -> Result<usize, ModelError> {
        let found = self.joints.get(name).copied();
        found.ok_or_else(|| value(place.to_owned(), name, "a joint of this robot"))
    }
}

/// Rotation vector from one pose to another of one frame, rad, in the axes of the first.
pub(crate) fn rotation_between(a: &Pose, b: &Pose) -> Vector3<f64> {
    let r = a.r.tr_mul(&b.r);
    so3::log(&so3::quaternion_of(
        &nalgebra::Rotation3::from_matrix_unchecked(r),
    ))
}
