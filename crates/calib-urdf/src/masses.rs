//! Masses for a robot whose description has none, and masses that are mounted on it.

use nalgebra::{Point3, Vector3};

use crate::model::{Inertial, JointKind, LinkId, RobotModel};

/// A moved link is as heavy as a rod of this length at least, m: the joints of a wrist that lie in one point have motors too, and
/// the last link has a flange. What the rods to the next joints lack lies at the link's origin.
const SHORTEST: f64 = 0.1;

impl RobotModel {
    /// Whether any link has a mass.
    #[must_use]
    pub fn has_masses(&self) -> bool {
        self.total_mass() > 0.0
    }

    /// Mass of all links, kg.
    #[must_use]
    pub fn total_mass(&self) -> f64 {
        let inertials = self.links.iter().filter_map(|l| l.inertial);
        inertials.map(|i| i.mass).sum()
    }

    /// Whether every link has a mass, of its own or of one that it is fixed to. Simulators drop links without.
    #[must_use]
    pub fn every_link_has_mass(&self) -> bool {
        let mut mass = vec![0.0; self.links.len()];
        for id in self.link_ids() {
            let own = self.links[id.index()].inertial.map_or(0.0, |i| i.mass);
            mass[self.carrier(id).index()] += own;
        }
        self.link_ids()
            .all(|id| mass[self.carrier(id).index()] > 0.0)
    }

    /// The link that `link` is fixed to: the first above it, or itself, that a joint can move or that is the root.
    fn carrier(&self, mut link: LinkId) -> LinkId {
        while let Some(joint) = self.link(link).parent_joint {
            let joint = self.joint(joint);
            if joint.kind != JointKind::Fixed {
                break;
            }
            link = joint.parent;
        }
        link
    }

    /// The same robot with uniform rods for links: from each link's origin to every place where a joint that moves, or
    /// leads to one, hangs on it, with this mass per length, kg/m. At the end of a chain the rod leads to the farthest
    /// fixed link. A link that a joint moves weighs as much as 0.1 m of rod at least.
    #[must_use]
    pub fn with_rods(mut self, mass_per_length: f64) -> Self {
        for id in self.link_ids().collect::<Vec<_>>() {
            let ends = self.rods_of(id);
            let mass: f64 = ends.iter().map(|end| mass_per_length * end.norm()).sum();
            let moment: Vector3<f64> = ends
                .iter()
                .map(|end| end * (0.5 * mass_per_length * end.norm()))
                .sum();
            let least = if self.is_moved(id) {
                SHORTEST * mass_per_length
            } else {
                0.0
            };
            let mass = mass.max(least);
            self.links[id.index()].inertial = (mass > 0.0).then(|| Inertial {
                mass,
                center_of_mass: Point3::from(moment / mass),
            });
        }
        self
    }

    /// The same robot with masses `factor` times as large.
    #[must_use]
    pub fn with_masses_scaled(mut self, factor: f64) -> Self {
        for link in &mut self.links {
            if let Some(inertial) = &mut link.inertial {
                inertial.mass *= factor;
            }
        }
        self
    }

    /// The same robot with another mass on a link (a payload): kg, center in the link's frame.
    #[must_use]
    pub fn with_payload(mut self, link: LinkId, payload: Inertial) -> Self {
        let own = self.links[link.index()].inertial;
        let (mass, moment) = own.map_or((0.0, Vector3::zeros()), |i| {
            (i.mass, i.center_of_mass.coords * i.mass)
        });
        let together = mass + payload.mass;
        if together > 0.0 {
            let moment = moment + payload.center_of_mass.coords * payload.mass;
            self.links[link.index()].inertial = Some(Inertial {
                mass: together,
                center_of_mass: Point3::from(moment / together),
            });
        }
        self
    }

    /// Ends of a link's rods, in its frame.
    fn rods_of(&self, id: LinkId) -> Vec<Vector3<f64>> {
        let mut ends: Vec<Vector3<f64>> = Vec::new();
        let joints = &self.links[id.index()].child_joints;
        let leading = joints.iter().filter(|j| {
            let child = self.joint(**j).child;
            self.joint(**j).kind.axis().is_some() || self.leads_on(child)
        });
        for joint in leading {
            let place = self.joint(*joint).parent_link_from_joint.translation.vector;
            // Joints that hang at one place hang on one rod.
            if ends.iter().all(|end| *end != place) {
                ends.push(place);
            }
        }
        if ends.is_empty() {
            let places = joints
                .iter()
                .map(|j| self.joint(*j).parent_link_from_joint.translation.vector);
            ends.extend(places.max_by(|a, b| a.norm().total_cmp(&b.norm())));
        }
        ends
    }

    /// Whether a joint that moves is mounted on the link, or on what is fixed to it.
    fn leads_on(&self, id: LinkId) -> bool {
        self.links[id.index()].child_joints.iter().any(|j| {
            let joint = self.joint(*j);
            joint.kind.axis().is_some() || self.leads_on(joint.child)
        })
    }

    /// Whether a joint that moves carries the link itself.
    fn is_moved(&self, id: LinkId) -> bool {
        let joint = self.links[id.index()].parent_joint;
        joint.is_some_and(|j| self.joint(j).kind.axis().is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two joints at one place, a forearm of 0.4 m, a hand with a flange 0.2 m further.
    const ARM: &str = r#"<robot name="arm">
      <link name="base"/><link name="pan"/><link name="upper"/><link name="hand"/><link name="flange"/>
      <joint name="j1" type="revolute"><parent link="base"/><child link="pan"/><origin xyz="0 0 0.5"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
      <joint name="j2" type="revolute"><parent link="pan"/><child link="upper"/><axis xyz="0 1 0"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
      <joint name="j3" type="revolute"><parent link="upper"/><child link="hand"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
      <joint name="j4" type="fixed"><parent link="hand"/><child link="flange"/><origin xyz="0.2 0 0"/></joint>
    </robot>"#;

    #[test]
    fn rods_lie_between_the_joints() {
        let arm = RobotModel::from_urdf_text(ARM, "arm").expect("a robot");
        assert!(!arm.has_masses());
        let arm = arm.with_rods(10.0);
        let of = |name: &str| arm.link(arm.link_id(name).expect("there")).inertial;
        let rod = |mass: f64, x: f64, z: f64| {
            Some(Inertial {
                mass,
                center_of_mass: Point3::new(x, 0.0, z),
            })
        };
        assert_eq!(of("base"), rod(5.0, 0.0, 0.25));
        assert_eq!(of("pan"), rod(1.0, 0.0, 0.0));
        assert_eq!(of("upper"), rod(4.0, 0.2, 0.0));
        assert_eq!(of("hand"), rod(2.0, 0.1, 0.0));
        assert_eq!(of("flange"), None);
        assert!((arm.total_mass() - 12.0).abs() < 1e-12);
        let scaled = arm.clone().with_masses_scaled(2.0);
        assert!((scaled.total_mass() - 24.0).abs() < 1e-12);
        let hand = arm.link_id("hand").expect("there");
        let load = Inertial {
            mass: 2.0,
            center_of_mass: Point3::new(0.3, 0.0, 0.1),
        };
        let held = arm.with_payload(hand, load).link(hand).inertial;
        let held = held.expect("a mass");
        assert!((held.mass - 4.0).abs() < 1e-12);
        assert!((held.center_of_mass - Point3::new(0.2, 0.0, 0.05)).norm() < 1e-12);
    }
}
