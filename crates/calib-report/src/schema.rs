use crate::{Report, Scene};
use calib_model::file::RobotModelFile;
use serde_json::Value;

/// JSON Schema (draft 2020-12) of `report.json`, from the same structs.
#[must_use]
pub fn report_schema() -> Value {
    titled(schemars::schema_for!(Report).to_value(), "calib report")
}

/// JSON Schema (draft 2020-12) of the scene.
#[must_use]
pub fn scene_schema() -> Value {
    titled(schemars::schema_for!(Scene).to_value(), "calib scene")
}

/// JSON Schema (draft 2020-12) of the robot's model.
#[must_use]
pub fn model_schema() -> Value {
    titled(
        schemars::schema_for!(RobotModelFile).to_value(),
        "calib model",
    )
}

fn titled(mut schema: Value, title: &str) -> Value {
    schema["title"] = Value::from(title);
    schema
}
