//! How consecutive axes lie to each other, on an arm whose geometry is known by construction.

use calib_urdf::{AxisRelation, RobotModel};

#[test]
fn the_axes_of_an_elbow_arm() {
    let joint = |n: usize, kind: &str, xyz: &str, axis: &str| {
        format!(
            "<link name=\"l{}\"/><joint name=\"j{n}\" type=\"{kind}\"><parent link=\"l{n}\"/><child link=\"l{}\"/><origin xyz=\"{xyz}\"/><axis xyz=\"{axis}\"/></joint>",
            n + 1,
            n + 1
        )
    };
    let text = format!(
        "<robot name=\"r\"><link name=\"l0\"/>{}{}{}{}{}{}</robot>",
        joint(0, "continuous", "0 0 0.1", "0 0 1"),
        joint(1, "continuous", "0.2 0 0.3", "0 1 0"),
        joint(2, "continuous", "0.4 0 0", "0 -1 0"),
        joint(3, "fixed", "0 0 0.1", "1 0 0"),
        joint(4, "continuous", "0 0 -0.1", "1 0 0"),
        joint(5, "prismatic", "0.1 0 0", "-1 0 0"),
    );
    let model = RobotModel::from_urdf_text(&text, "r.urdf").unwrap();
    let ends = (model.link_id("l0").unwrap(), model.link_id("l6").unwrap());
    let expected = [
        ("j0", "j1", AxisRelation::Skew, 0.2),
        ("j1", "j2", AxisRelation::Parallel, 0.4),
        ("j2", "j4", AxisRelation::Intersecting, 0.0),
        ("j4", "j5", AxisRelation::Coincident, 0.0),
    ];
    for q in [vec![0.0; 6], vec![0.3, -1.0, 2.0, 0.0, 0.7, 0.1]] {
        let pairs = model.axis_pairs(&q, ends.0, ends.1, 1e-9, 1e-9);
        assert_eq!(pairs.len(), expected.len());
        for (pair, (first, second, relation, distance)) in pairs.iter().zip(expected) {
            assert_eq!(
                (
                    model.joint(pair.first).name.as_str(),
                    model.joint(pair.second).name.as_str()
                ),
                (first, second)
            );
            assert_eq!(pair.relation, relation, "{pair:?}");
            assert!((pair.distance - distance).abs() < 1e-12, "{pair:?}");
        }
        // The other way round the same pairs.
        let back = model.axis_pairs(&q, ends.1, ends.0, 1e-9, 1e-9);
        assert!(
            back.iter()
                .rev()
                .zip(&pairs)
                .all(|(b, p)| b.relation == p.relation && b.first == p.second)
        );
    }
}
