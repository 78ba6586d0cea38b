//! Joint columns whose values are those of other joints: several columns in another order than their names.

use serde::Serialize;

use super::chain::{Chain, Motion};
use super::data::Data;
use super::ids::{JointIndex, LinkIndex};

/// An order of joint columns that is not the one their names say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub enum ColumnOrder {
    /// The columns hold the values from the last joint to the first.
    Reversed(Columns),
    /// Each column holds the values of the joint before it, the first those of the last.
    Before(Columns),
    /// Each column holds the values of the joint after it, the last those of the first.
    After(Columns),
    /// Names in the robot's order, values in the alphabetical order of the joints' names.
    Alphabetical(Columns),
    /// Names in alphabetical order, values in the robot's order.
    Robots(Columns),
    /// The columns of two limbs are exchanged.
    Limbs {
        /// The first joint of the one, and all behind it.
        first: JointIndex,
        /// The first joint of the other.
        second: JointIndex,
    },
}

/// Which columns are in another order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub enum Columns {
    /// Those of all joints.
    All,
    /// Those of the joints between the root and a link.
    Above(LinkIndex),
}

impl ColumnOrder {
    /// For each joint of the chain the one under whose name its values are.
    #[must_use]
    pub fn columns(self, chain: &Chain) -> Vec<JointIndex> {
        let mut columns: Vec<JointIndex> = (0..chain.joints.len()).map(JointIndex).collect();
        let mut put = |joints: &[JointIndex], at: &dyn Fn(usize) -> usize| {
            for (k, joint) in joints.iter().enumerate() {
                columns[joint.0] = joints[at(k)];
            }
        };
        match self {
            Self::Reversed(of) => {
                let joints = of.joints(chain);
                put(&joints, &|k| joints.len() - 1 - k);
            }
            Self::Before(of) => {
                let joints = of.joints(chain);
                put(&joints, &|k| (k + 1) % joints.len());
            }
            Self::After(of) => {
                let joints = of.joints(chain);
                put(&joints, &|k| (k + joints.len() - 1) % joints.len());
            }
            Self::Alphabetical(of) => {
                let joints = of.joints(chain);
                let sorted = sorted(&joints, chain);
                // The k-th column has the k-th name of the alphabet's values.
                let at = |k: usize| sorted.iter().position(|s| *s == k).unwrap_or(k);
                put(&joints, &at);
            }
            Self::Robots(of) => {
                let joints = of.joints(chain);
                let sorted = sorted(&joints, chain);
                put(&joints, &|k| sorted[k]);
            }
            Self::Limbs { first, second } => {
                let pairs = limb(chain, first).into_iter().zip(limb(chain, second));
                for (a, b) in pairs {
                    columns[a.0] = b;
                    columns[b.0] = a;
                }
            }
        }
        columns
    }

    /// Those that the data may have, each another order of three columns or more: of two, it is an exchange.
    pub(crate) fn of(data: &Data) -> Vec<Self> {
        let chain = &data.chain;
        let recorded: Vec<bool> = (0..chain.joints.len())
            .map(|j| data.readings.iter().any(|row| row[j].is_some()))
            .collect();
        let mut among = vec![Columns::All];
        let mut links: Vec<LinkIndex> = data.bodies.iter().map(|body| body.link).collect();
        links.sort_unstable();
        links.dedup();
        among.extend(links.into_iter().map(Columns::Above));
        let mut all: Vec<Self> = limbs(chain);
        for of in among {
            all.extend([
                Self::Alphabetical(of),
                Self::Robots(of),
                Self::Reversed(of),
                Self::Before(of),
                Self::After(of),
            ]);
        }
        let mut known: Vec<Vec<JointIndex>> = Vec::new();
        all.retain(|order| {
            let columns = order.columns(chain);
            let moved = columns.iter().enumerate().filter(|(j, c)| c.0 != *j);
            let possible = moved.clone().count() > 2
                && moved.clone().all(|(j, c)| {
                    recorded[j] && recorded[c.0] && chain.turns(j) == chain.turns(c.0)
                });
            let new = possible && !known.contains(&columns);
            if new {
                known.push(columns);
            }
            new
        });
        all
    }
}

impl Columns {
    /// The joints with readings of their own, in the robot's order.
    fn joints(self, chain: &Chain) -> Vec<JointIndex> {
        match self {
            Self::All => (0..chain.joints.len())
                .map(JointIndex)
                .filter(|joint| has_column(chain, *joint))
                .collect(),
            Self::Above(link) => {
                let path = chain.path(link).into_iter();
                path.filter(|joint| has_column(chain, *joint)).collect()
            }
        }
    }
}

/// Places among these joints, in the alphabetical order of their names.
fn sorted(joints: &[JointIndex], chain: &Chain) -> Vec<usize> {
    let mut places: Vec<usize> = (0..joints.len()).collect();
    places.sort_by_key(|k| chain.alphabet[joints[*k].0]);
    places
}

/// A joint that moves by its own reading.
fn has_column(chain: &Chain, joint: JointIndex) -> bool {
    let own = &chain.joints[joint.0];
    own.motion != Motion::Fixed && own.law.iter().any(|(source, _)| *source == joint)
}

/// The joints with columns from this one outward, in the robot's order.
fn limb(chain: &Chain, root: JointIndex) -> Vec<JointIndex> {
    let all = (0..chain.joints.len()).map(JointIndex);
    all.filter(|joint| has_column(chain, *joint))
        .filter(|joint| chain.path(chain.joints[joint.0].child).contains(&root))
        .collect()
}

/// Pairs of limbs on one rigid body with joints of the same kinds one after the other.
fn limbs(chain: &Chain) -> Vec<ColumnOrder> {
    let roots: Vec<JointIndex> = (0..chain.joints.len())
        .map(JointIndex)
        .filter(|joint| has_column(chain, *joint))
        .collect();
    let base = |joint: JointIndex| chain.rigid_group(chain.joints[joint.0].parent);
    let kinds = |joint: JointIndex| -> Vec<Option<bool>> {
        let limb = limb(chain, joint).into_iter();
        limb.map(|j| chain.turns(j.0)).collect()
    };
    let mut pairs = Vec::new();
    for (n, &first) in roots.iter().enumerate() {
        for &second in &roots[n + 1..] {
            if base(first) == base(second) && kinds(first) == kinds(second) {
                pairs.push(ColumnOrder::Limbs { first, second });
            }
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};

    use super::super::chain::ChainJoint;
    use super::*;

    /// A turning trunk with two arms of three joints, the last of one of them sliding or not.
    fn robot(slides: bool) -> Chain {
        let parents = [0, 1, 2, 3, 1, 5, 6];
        let joint = |(j, parent): (usize, usize)| ChainJoint {
            parent: LinkIndex(parent),
            child: LinkIndex(j + 1),
            parent_from_joint: Isometry3::identity(),
            motion: match slides && j == 6 {
                true => Motion::Prismatic(Vector3::z_axis()),
                false => Motion::Revolute(Vector3::z_axis()),
            },
            law: vec![(JointIndex(j), 1.0)],
            offset: 0.0,
        };
        let joints = parents.into_iter().enumerate().map(joint).collect();
        Chain::new(8, joints).expect("a tree")
    }

    #[test]
    fn limbs_of_the_same_build_are_exchanged_joint_by_joint() {
        let alike = limbs(&robot(false));
        let (first, second) = (JointIndex(1), JointIndex(4));
        assert_eq!(alike, [ColumnOrder::Limbs { first, second }]);
        let columns: Vec<usize> = alike[0]
            .columns(&robot(false))
            .iter()
            .map(|c| c.0)
            .collect();
        assert_eq!(columns, [0, 4, 5, 6, 1, 2, 3]);
        assert!(limbs(&robot(true)).is_empty());
    }

    #[test]
    fn orders_by_name_undo_each_other() {
        let mut chain = robot(false);
        chain.alphabet = vec![3, 0, 6, 1, 5, 2, 4];
        let there = ColumnOrder::Alphabetical(Columns::All).columns(&chain);
        let back = ColumnOrder::Robots(Columns::All).columns(&chain);
        assert!((0..7).all(|j| back[there[j].0] == JointIndex(j)));
        // The column with the k-th name holds the values of the k-th joint of the alphabet.
        assert_eq!(there[1], JointIndex(0));
    }
}
