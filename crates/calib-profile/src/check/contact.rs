//! Contacts: the touching point, what it touches, and which of both is known.

use nalgebra::UnitQuaternion;

use super::*;
use crate::profile::{ByRow, Contact, ContactBase, Spots, Tip};
use crate::raw::RawContact;
use crate::touched::{RawTouched, Touched};

impl Checker<'_> {
    pub(super) fn contacts(&mut self) -> BTreeMap<String, Contact> {
        let raw = self.raw;
        raw.contacts
            .iter()
            .filter_map(|(name, c)| Some((name.clone(), self.contact(name, c)?)))
            .collect()
    }

    pub(super) fn tips(&mut self) -> BTreeMap<String, Tip> {
        let raw = self.raw;
        let mut tips = BTreeMap::new();
        for (name, tip) in &raw.points {
            if let Some(sigma) = tip.sigma_mm {
                self.positive(&["points", name, "sigma_mm"], sigma);
            }
            if let Some(link) = self.link(&["points", name, "link"], &tip.link) {
                let tip = Tip {
                    link,
                    at: Point3::from(Vector3::from(tip.at_mm) * MM),
                    sigma: tip.sigma_mm.map(|s| s * MM),
                };
                tips.insert(name.clone(), tip);
            }
        }
        tips
    }

    fn contact(&mut self, name: &str, raw: &RawContact) -> Option<Contact> {
        if raw.recordings.is_empty() {
            self.key_problem(
                &["contacts", name],
                format!("contact `{name}` names no recording"),
                "add `recordings: [<name>]`: the poses in which the point touches",
            );
        }
        for (i, recording) in raw.recordings.iter().enumerate() {
            self.known(
                "recording",
                &["contacts", name, "recordings", &i.to_string()],
                recording,
                self.raw.recordings.keys(),
            );
        }
        self.known(
            "point",
            &["contacts", name, "point"],
            &raw.point,
            self.raw.points.keys(),
        );
        let on = match &raw.on {
            None => Some(ContactBase::Link(self.robot.root())),
            Some(on) if *on == self.raw.tracker.frame => Some(ContactBase::Tracker),
            Some(on) => self
                .link(&["contacts", name, "on"], on)
                .map(ContactBase::Link),
        };
        let carrier = self.raw.points.get(&raw.point).map(|p| p.link.as_str());
        if let (Some(ContactBase::Link(base)), Some(carrier)) = (on, carrier)
            && let Ok(link) = self.robot.link_id(carrier)
            && self.rigidly_joined(base, link)
        {
            self.problem(
                &["contacts", name, "point"],
                format!("no joint lies between `{carrier}` and what it touches"),
                "name a point of the link that moves, and under `on` the link that is touched",
            );
        }
        self.positive(&["contacts", name, "sigma_mm"], raw.sigma_mm);
        for (key, value) in [
            ("place_sigma_mm", raw.place_sigma_mm),
            ("place_sigma_deg", raw.place_sigma_deg),
        ] {
            if let Some(value) = value {
                self.positive(&["contacts", name, key], value);
            }
        }
        let (base_from_place, touched) = self.touched(name, &raw.touches);
        let (turns, _) = touched.seen();
        if touched == Touched::Unknown {
            self.nothing_known(name, raw);
        } else if raw.place_sigma_deg.is_some() && turns == [false; 3] {
            self.problem(
                &["contacts", name, "place_sigma_deg"],
                "a point has no orientation",
                "remove the key",
            );
        }
        let by_row = self.by_row(name, &raw.touches);
        let place = match (&raw.place, &by_row) {
            (Some(_), None) => {
                self.key_problem(
                    &["contacts", name, "place"],
                    "`touches` states where the thing is already",
                    "remove the key: `place` belongs to `coordinates` and `spots`",
                );
                Isometry3::identity()
            }
            (Some(place), Some(_)) => pose(place),
            (None, _) => Isometry3::identity(),
        };
        let base_from_place = place * base_from_place;
        Some(Contact {
            recordings: raw.recordings.clone(),
            point: raw.point.clone(),
            on: on?,
            by_row,
            touched,
            base_from_place,
            place_sigma: raw.place_sigma_mm.map(|s| s * MM),
            place_sigma_rad: raw.place_sigma_deg.map(|s| s * DEG),
            sigma: raw.sigma_mm * MM,
        })
    }

    /// Spots that are all unknown have no frame of their own.
    fn nothing_known(&mut self, name: &str, raw: &RawContact) {
        let given = [
            ("place", raw.place.is_some()),
            ("place_sigma_mm", raw.place_sigma_mm.is_some()),
            ("place_sigma_deg", raw.place_sigma_deg.is_some()),
        ];
        for (key, _) in given.iter().filter(|(_, given)| *given) {
            self.key_problem(
                &["contacts", name, key],
                "the spots have no stated coordinates, so each is unknown already",
                "remove the key, or state where the spots are under `at_mm`",
            );
        }
    }

    /// What the rows say of the touched point.
    fn by_row(&mut self, name: &str, touches: &RawTouched) -> Option<ByRow> {
        match touches {
            RawTouched::Coordinates { columns } => Some(ByRow::Coordinates(columns.clone())),
            RawTouched::Spots {
                named_in,
                at_mm,
                sigma_mm,
            } => {
                let path = ["contacts", name, "touches", "spots", "sigma_mm"];
                if let Some(sigma) = sigma_mm {
                    self.positive(&path, *sigma);
                    if at_mm.is_empty() {
                        self.problem(
                            &path,
                            "no coordinates are stated that this could be the standard deviation of",
                            "state them under `at_mm`, or remove the key: the spots are unknown then",
                        );
                    }
                }
                let point = |at: &[f64; 3]| Point3::from(Vector3::from(*at) * MM);
                let at = at_mm.iter().map(|(spot, at)| (spot.clone(), point(at)));
                Some(ByRow::Spots(Spots {
                    named_in: named_in.clone(),
                    at: at.collect(),
                    sigma: sigma_mm.map(|s| s * MM),
                }))
            }
            _ => None,
        }
    }

    /// What is touched, and the pose of its frame in what carries it.
    fn touched(&mut self, name: &str, touches: &RawTouched) -> (Isometry3<f64>, Touched) {
        let parts = touches.parts();
        if let Some(length) = parts.length
            && !(length.mm > 0.0 || self.named_already(length.mm))
        {
            let (what, at_zero) = (length.what, length.at_zero);
            self.problem(
                &["contacts", name, "touches"],
                format!("{} is not a {what}", length.mm),
                format!("give a number above 0; for {what} 0 use `{at_zero}`"),
            );
        }
        let along = parts
            .along
            .map_or_else(UnitQuaternion::identity, |(key, v)| {
                self.direction_of(name, key, v)
            });
        let place = Translation3::from(Vector3::from(parts.at_mm) * MM);
        (Isometry3::from_parts(place, along), parts.touched)
    }

    /// Rotation whose z axis is along `v`.
    fn direction_of(&mut self, name: &str, key: &str, v: [f64; 3]) -> UnitQuaternion<f64> {
        /// Shorter vectors have no direction worth the name.
        const SHORTEST: f64 = 1e-9;
        let Some(along) = Unit::try_new(Vector3::from(v), SHORTEST) else {
            self.problem(
                &["contacts", name, "touches"],
                format!("`{key}` has no length"),
                "give a vector that is not zero, e.g. [0, 0, 1]",
            );
            return UnitQuaternion::identity();
        };
        UnitQuaternion::rotation_between(&Vector3::z(), &along).unwrap_or_else(|| {
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
        })
    }
}
