//! Direction memory.

use calib_model::{Approach, Model, Under};

const ARM: &str = include_str!("arm.model.json");

#[test]
fn slow_motion_counts_and_noise_does_not() {
    let model = Model::from_json(ARM.as_bytes()).expect("a model");
    let mut approach = Approach::new(&model);
    assert_eq!(approach.directions(), [0.0, 0.0]);
    approach.update(&model, &[0.5, 0.5]).expect("finite");
    assert_eq!(approach.directions(), [0.0, 0.0]);
    // A thousand steps of a tenth of the threshold each.
    for k in 1..1000 {
        approach
            .update(&model, &[0.5 + 1e-6 * f64::from(k), 0.5])
            .expect("finite");
    }
    assert_eq!(approach.directions(), [1.0, 0.0]);
    approach
        .update(&model, &[0.500_999 - 9e-6, 0.4])
        .expect("finite");
    assert_eq!(
        approach.directions(),
        [1.0, -1.0],
        "below the threshold nothing turns round"
    );
    approach.update(&model, &[0.4, 0.4]).expect("finite");
    assert_eq!(approach.directions(), [-1.0, -1.0]);
    assert!(approach.update(&model, &[f64::NAN, 0.0]).is_err());
    assert_eq!(approach.directions(), [-1.0, -1.0]);
    approach.set(&[0.0, 2.0]).expect("two joints");
    assert_eq!(approach.directions(), [0.0, 1.0]);
}

#[test]
fn backlash_lies_on_the_side_that_the_joint_came_from() {
    let model = Model::from_json(ARM.as_bytes()).expect("a model");
    let mut work = model.work();
    let tool = model.link("tool").expect("a link");
    let mut at = |direction: f64| {
        let approach = [0.0, direction];
        let under = Under {
            approach: &approach,
            held: None,
            temperature_c: &[],
        };
        model
            .forward(&[0.2, 0.3], &under, &mut work)
            .expect("a pose");
        work.root_from_link(tool)
    };
    let (below, middle, above) = (at(1.0), at(0.0), at(-1.0));
    // Half a clearance of 5e-4 rad to either side, at 0.4 m.
    for side in [below, above] {
        assert!(((side.t - middle.t).norm() - 0.4 * 5e-4).abs() < 1e-7);
    }
    assert!(((below.t - above.t).norm() - 0.8 * 5e-4).abs() < 1e-7);
}
