//! What `calib diff` says of a xacro, which it does not expand.

use calib_apply::diff_table;

/// What xacro composes is not compared, and never called equal, added or removed.
#[test]
fn what_xacro_composes_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("written");
        path
    };
    let robot = |inside: &str| {
        format!(
            "<robot name=\"r\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\"><link name=\"a\"/><link name=\"b\"/>{inside}</robot>"
        )
    };
    let joint = |name: &str, origin: &str| {
        format!(
            "<joint name=\"{name}\" type=\"revolute\"><parent link=\"a\"/><child link=\"b\"/>{origin}<axis xyz=\"0 0 1\"/>\
             <limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>"
        )
    };
    let origin = |x: f64| format!("<origin xyz=\"{x} 0 0\"/>");
    let block = |x: f64| {
        let joint = joint("${name}", "<xacro:insert_block name=\"place\"/>");
        robot(&format!(
            "<xacro:macro name=\"axis\" params=\"name *place\">{joint}</xacro:macro><xacro:axis name=\"elbow\">{}</xacro:axis>",
            origin(x)
        ))
    };
    let chosen = |x: f64| {
        let inside = format!("<xacro:if value=\"1\">{}</xacro:if>", origin(x));
        robot(&joint("elbow", &inside))
    };
    let prefix = |x: f64| robot(&joint("${side}_elbow", &origin(x)));
    let plain = |name: &str, x: f64| robot(&joint(name, &origin(x)));
    for (a, b, joint) in [
        (block(0.62), block(0.63), "${name}"),
        (plain("elbow", 0.62), block(0.62), "elbow"),
        (chosen(0.62), chosen(0.63), "elbow"),
        (plain("left_elbow", 0.62), prefix(0.62), "left_elbow"),
    ] {
        let (a, b) = (file("a.xacro", &a), file("b.xacro", &b));
        for (a, b) in [(&a, &b), (&b, &a)] {
            let said = diff_table(a, b).expect("read");
            let line = said
                .lines()
                .find(|l| l.starts_with("not compared, xacro computes them: "));
            assert!(line.is_some_and(|l| l.contains(joint)), "{said}");
            assert!(
                !said.contains("removed") && !said.contains("added"),
                "{said}"
            );
        }
    }
    let (a, b) = (
        file("a.xacro", &prefix(0.62)),
        file("b.xacro", &prefix(0.63)),
    );
    let said = diff_table(&a, &b).expect("read");
    assert!(said.contains("10.000"), "{said}");
}
