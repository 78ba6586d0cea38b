//! Names of labels that a table reads as something else.

/// What a table takes a column of this name for, where it is not a text; a label of such a name is lost when the recording is written as a
/// table and read again.
#[must_use]
pub fn reserved_label(name: &str) -> Option<&'static str> {
    match name {
        "t_s" | "t_ms" | "t_us" | "host_s" => return Some("a time"),
        "frame" | "pose" | "row" | "sample" | "index" | "config" => {
            return Some("the number of the row");
        }
        "marker" | "body" | "point" => {
            return Some("the name of what the row measures");
        }
        _ => {}
    }
    const MEASURED: [&str; 16] = [
        "_rad", "_deg", "_m", "_cm", "_mm", "_nm", "_Nm", "_qx", "_qy", "_qz", "_qw", ".qx", ".qy",
        ".qz", ".qw", ".state",
    ];
    let measured = MEASURED.iter().any(|end| {
        let head = name.strip_suffix(end);
        head.is_some_and(|head| !head.is_empty())
    });
    (measured || matches!(name, "qx" | "qy" | "qz" | "qw" | "state")).then_some("a measurement")
}
