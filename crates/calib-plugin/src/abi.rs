//! `calib_plugin.h` in Rust, field by field. A test compares sizes and offsets with what a C compiler says.

use std::ffi::{c_char, c_void};

/// Same major: loads.
pub const MAJOR: u32 = 1;
/// What this side knows of version 1.
pub const MINOR: u32 = 0;
/// The one symbol of a plugin.
pub const SYMBOL: &str = "calib_plugin_entry";

/// `calib_status`.
pub type Status = i32;
/// The result was given to the sink.
pub const OK: Status = 0;
/// The data cannot answer.
pub const NOT_OBSERVABLE: Status = 1;
/// The input is not what this plugin reads.
pub const BAD_INPUT: Status = 2;
/// Parameters that do not go together.
pub const BAD_PARAMETER: Status = 3;
/// Stopped on request.
pub const CANCELLED: Status = 4;
/// Anything else.
pub const FAILED: Status = 5;
/// A panic was stopped at the border.
pub const PANICKED: Status = 6;

/// `CALIB_BOOL`.
pub const BOOL: i32 = 1;
/// `CALIB_INTEGER`.
pub const INTEGER: i32 = 2;
/// `CALIB_NUMBER`.
pub const NUMBER: i32 = 3;
/// `CALIB_TEXT`.
pub const TEXT: i32 = 4;

/// `CALIB_LOST`.
pub const LOST: u8 = 0;
/// `CALIB_MEASURED`.
pub const MEASURED: u8 = 1;
/// `CALIB_FILLED`.
pub const FILLED: u8 = 2;

/// `CALIB_ANGLE`.
pub const ANGLE: i32 = 1;
/// `CALIB_LENGTH`.
pub const LENGTH: i32 = 2;

/// `calib_value`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Value {
    pub kind: i32,
    pub flag: i32,
    pub integer: i64,
    pub number: f64,
    pub text: *const c_char,
}

/// `calib_parameter`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Parameter {
    pub name: *const c_char,
    pub summary: *const c_char,
    pub value: Value,
    pub minimum: f64,
    pub maximum: f64,
    pub choices: *const *const c_char,
    pub choice_count: usize,
    pub required: i32,
    pub reserved: i32,
}

/// `calib_offer`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Offer {
    pub kind: *const c_char,
    pub name: *const c_char,
    pub summary: *const c_char,
    pub source: *const c_char,
    pub shapes: u32,
    pub parameter_size: u32,
    pub parameters: *const Parameter,
    pub parameter_count: usize,
    pub example: *const u8,
    pub example_size: usize,
}

/// `calib_descriptor`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Descriptor {
    pub struct_size: u32,
    pub offer_size: u32,
    pub name: *const c_char,
    pub version: *const c_char,
    pub author: *const c_char,
    pub licence: *const c_char,
    pub offers: *const Offer,
    pub offer_count: usize,
}

/// `calib_entry`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Entry {
    pub abi_major: u32,
    pub abi_minor: u32,
    pub struct_size: u32,
    pub reserved: u32,
    pub describe: Option<unsafe extern "C" fn() -> *const Descriptor>,
    pub find: Option<unsafe extern "C" fn(*const c_char, *const c_char) -> *const c_void>,
}

/// `calib_call`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Call {
    pub struct_size: u32,
    pub reserved: u32,
    pub values: *const Value,
    pub value_count: usize,
    pub text: *mut c_char,
    pub text_size: usize,
    pub context: *mut c_void,
    pub cancelled: Option<unsafe extern "C" fn(*mut c_void) -> i32>,
    pub progress: Option<unsafe extern "C" fn(*mut c_void, f64, *const c_char)>,
}

/// `calib_motion`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Motion {
    pub struct_size: u32,
    pub shape: u32,
    pub tracks: usize,
    pub samples: usize,
    pub seen: *const u8,
    pub points_m: *const f64,
    pub rotations: *const f64,
    pub translations_m: *const f64,
    pub covariances_m2: *const f64,
    pub angles_rad: *const f64,
    pub center_m: *const f64,
    pub towards: *const f64,
    pub sigma_t_m: f64,
    pub sigma_r_rad: f64,
    pub significance: f64,
    pub seed: u64,
}

/// `calib_cor_result`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct CorResult {
    pub struct_size: u32,
    pub weak: i32,
    pub center_m: [f64; 3],
    pub rms_m: f64,
    pub used: usize,
    pub covariance_m2: *const f64,
    pub body_points_m: *const f64,
    pub body_point_count: usize,
    pub radii_m: *const f64,
    pub radius_count: usize,
    pub rejected: *const usize,
    pub rejected_count: usize,
}

/// `calib_aor_result`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct AorResult {
    pub struct_size: u32,
    pub weak: i32,
    pub point_m: [f64; 3],
    pub direction: [f64; 3],
    pub rms_m: f64,
    pub used: usize,
    pub covariance: *const f64,
    pub in_child: *const f64,
    pub rejected: *const usize,
    pub rejected_count: usize,
}

/// Where an estimator gives its result: `calib_cor_sink`, `calib_aor_sink`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct EstimatorSink<R> {
    pub struct_size: u32,
    pub reserved: u32,
    pub context: *mut c_void,
    pub result: Option<unsafe extern "C" fn(*mut c_void, *const R) -> Status>,
}

/// `fit` of an estimator's table.
pub type Fit<R> =
    unsafe extern "C" fn(*const Call, *const Motion, *const EstimatorSink<R>) -> Status;

/// The table of an estimator: `calib_cor_1`, `calib_aor_1`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct EstimatorTable<R> {
    pub struct_size: u32,
    pub reserved: u32,
    pub fit: Option<Fit<R>>,
}

/// `calib_cor_sink`.
pub type CorSink = EstimatorSink<CorResult>;
/// `calib_cor_1`.
pub type Cor1 = EstimatorTable<CorResult>;
/// `calib_aor_sink`.
pub type AorSink = EstimatorSink<AorResult>;
/// `calib_aor_1`.
pub type Aor1 = EstimatorTable<AorResult>;

/// `calib_source`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Source {
    pub struct_size: u32,
    pub reserved: u32,
    pub name: *const c_char,
    pub bytes: *const u8,
    pub size: usize,
}

/// `timeline` of [`RecordingSink`].
pub type AddTimeline = unsafe extern "C" fn(
    *mut c_void,
    *const c_char,
    *const u64,
    *const f64,
    usize,
    *mut usize,
) -> Status;
/// `label` of [`RecordingSink`].
pub type AddLabel =
    unsafe extern "C" fn(*mut c_void, usize, *const c_char, *const *const c_char, usize) -> Status;
/// `marker` of [`RecordingSink`].
pub type AddMarker =
    unsafe extern "C" fn(*mut c_void, *const c_char, usize, *const f64, *const u8, usize) -> Status;
/// `body` of [`RecordingSink`].
pub type AddBody = unsafe extern "C" fn(
    *mut c_void,
    *const c_char,
    usize,
    *const f64,
    *const f64,
    *const u8,
    usize,
) -> Status;
/// `joint` of [`RecordingSink`].
pub type AddJoint = unsafe extern "C" fn(
    *mut c_void,
    *const c_char,
    usize,
    i32,
    *const f64,
    *const u8,
    usize,
) -> Status;
/// `torque` of [`RecordingSink`].
pub type AddTorque =
    unsafe extern "C" fn(*mut c_void, *const c_char, usize, *const f64, *const u8, usize) -> Status;
/// `note` of [`RecordingSink`].
pub type AddNote = unsafe extern "C" fn(*mut c_void, *const c_char) -> Status;

/// `calib_recording_sink`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct RecordingSink {
    pub struct_size: u32,
    pub reserved: u32,
    pub context: *mut c_void,
    pub timeline: Option<AddTimeline>,
    pub label: Option<AddLabel>,
    pub marker: Option<AddMarker>,
    pub body: Option<AddBody>,
    pub joint: Option<AddJoint>,
    pub torque: Option<AddTorque>,
    pub note: Option<AddNote>,
}

/// `calib_reader_1`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Reader1 {
    pub struct_size: u32,
    pub reserved: u32,
    pub read:
        Option<unsafe extern "C" fn(*const Call, *const Source, *const RecordingSink) -> Status>,
    pub recognizes: Option<unsafe extern "C" fn(*const u8, usize) -> i32>,
}

/// `calib_report_input`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct ReportInput {
    pub struct_size: u32,
    pub reserved: u32,
    pub report_json: *const u8,
    pub report_size: usize,
    pub scene_json: *const u8,
    pub scene_size: usize,
}

/// `calib_files_sink`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct FilesSink {
    pub struct_size: u32,
    pub reserved: u32,
    pub context: *mut c_void,
    pub file: Option<unsafe extern "C" fn(*mut c_void, *const c_char, *const u8, usize) -> Status>,
}

/// `calib_report_1`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Report1 {
    pub struct_size: u32,
    pub reserved: u32,
    pub write:
        Option<unsafe extern "C" fn(*const Call, *const ReportInput, *const FilesSink) -> Status>,
}

/// `calib_joint_states`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct JointStates {
    pub struct_size: u32,
    pub prismatic: i32,
    pub samples: usize,
    pub readings: *const f64,
    pub motor_rad: *const f64,
    pub loads: *const f64,
    pub approaches: *const f64,
}

/// `calib_effect_sink`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct EffectSink {
    pub struct_size: u32,
    pub reserved: u32,
    pub context: *mut c_void,
    pub result: Option<unsafe extern "C" fn(*mut c_void, *const f64, usize) -> Status>,
}

/// `regressors` of [`Effect1`].
pub type Regressors =
    unsafe extern "C" fn(*const Call, *const JointStates, *const EffectSink) -> Status;

/// `calib_effect_1`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct Effect1 {
    pub struct_size: u32,
    pub depends_on: i32,
    pub coefficient: i32,
    pub revolute_only: i32,
    pub prior_sigma: f64,
    pub regressors: Option<Regressors>,
}

/// `size_of::<T>()` as the `struct_size` of the contract.
#[must_use]
pub const fn size<T>() -> u32 {
    // Every struct of the contract is a few hundred bytes.
    size_of::<T>() as u32
}
