//! Where joints may stand: their limits and those of the joints that follow them.

use calib_urdf::RobotModel;
use calib_urdf::range::{range, resting_positions};

/// `lead` (±2) with followers, and `bent`, whose range leaves 0 out.
fn model() -> RobotModel {
    let joint = |name: &str, parent: &str, limits: &str, mimic: &str| {
        format!(
            "<link name=\"{name}_l\"/><joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{name}_l\"/>\
             <axis xyz=\"0 0 1\"/><limit {limits} effort=\"1\" velocity=\"1\"/>{mimic}</joint>"
        )
    };
    let text = [
        "<robot name=\"r\"><link name=\"base\"/>".to_owned(),
        joint("lead", "base", "lower=\"-2\" upper=\"2\"", ""),
        joint(
            "back",
            "lead_l",
            "lower=\"-0.7\" upper=\"0.5\"",
            "<mimic joint=\"lead\" multiplier=\"-1\"/>",
        ),
        joint(
            "twice",
            "back_l",
            "lower=\"-3\" upper=\"1\"",
            "<mimic joint=\"back\" multiplier=\"-2\" offset=\"0.2\"/>",
        ),
        joint("bent", "base", "lower=\"-2.3\" upper=\"-0.5\"", ""),
        joint("free", "base", "", ""),
        "</robot>".to_owned(),
    ]
    .concat();
    RobotModel::from_urdf_text(&text, "r.urdf").expect("a robot")
}

#[test]
fn the_limits_of_a_follower_bound_the_joint_that_it_follows() {
    let model = model();
    let of = |name: &str| range(&model, model.joint_id(name).expect("a joint"));
    // back = -lead in [-0.7, 0.5]: lead in [-0.5, 0.7]. twice = 2 lead + 0.2 in [-3, 1]: lead in [-1.6, 0.4].
    let (low, high) = of("lead").expect("limits");
    assert!(
        (low + 0.5).abs() < 1e-12 && (high - 0.4).abs() < 1e-12,
        "{low} {high}"
    );
    assert_eq!(of("bent"), Some((-2.3, -0.5)));
    assert_eq!(of("free"), None);
}

#[test]
fn a_joint_that_nothing_moves_stands_as_near_to_0_as_its_limits_allow() {
    let model = model();
    let q = resting_positions(&model);
    let at = |name: &str| q[model.joint_id(name).expect("a joint").index()];
    assert_eq!((at("lead"), at("bent"), at("free")), (0.0, -0.5, 0.0));
}
