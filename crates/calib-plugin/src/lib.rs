//! The plugin contract, its host and the Rust side for authors.
//!
//! ```text
//!             host (this program)            |  border: C  |        plugin (shared library)
//!   Registry ── Bound::fit(motion, control)  |             |
//!      built-in: Cor::fit(motion, call)      |             |
//!      loaded:   Cor::fit ── arrays ─────────┼── fit() ────┼──► export! ── Cor::fit(motion, call)
//!                        ◄── copy, verify ───┼── result() ─┼──◄
//! ```
//!
//! The contract is `include/calib_plugin.h` (C11, C++17), version 1; [`abi`] is the same in Rust. One set of traits
//! ([`Cor`], [`Aor`], [`Reader`], [`ReportWriter`], [`JointEffect`]) stands on both sides: a built-in implements it, an author
//! implements it and writes [`export!`], and a loaded library is an object that implements it by calling across. So a
//! profile names all of them the same way, through one [`Registry`] for each kind.
//!
//! Arrays are SI (m, rad, s); sample s of track k stands at `k · samples + s`; lost samples are a mask. Results go
//! through callbacks and are copied, so no memory is freed on the wrong side. What comes back is checked before
//! anybody sees it: sizes, NaN, rotations that are none, directions that are not of unit length.
//!
//! What this does **not** protect against: a plugin is code in this process with the user's rights. A bad pointer, an
//! `abort` or an endless loop that never asks `cancelled` ends or hangs the program. Libraries are never unloaded:
//! their threads and statics may outlive any call, so a loaded plugin is leaked on purpose.
//!
//! ```
//! use calib_plugin::{Control, MotionData, Tables};
//! use std::collections::BTreeMap;
//! # use calib_plugin::{Answer, ByFn, Call, CorFit, Failure, Kind, Motion, Offer, Shape};
//! # let mean = ByFn::new(Offer::new(Kind::Cor, "mean", "").takes(&[Shape::Points]), |m: &Motion<'_>, _: &Call<'_>| {
//! #     let points: Vec<_> = m.points(0).flatten().collect();
//! #     let center_m = [0, 1, 2].map(|i| points.iter().map(|p| p[i]).sum::<f64>() / points.len() as f64);
//! #     Ok::<_, Failure>(Answer::Found(CorFit { center_m, covariance_m2: None, body_points_m: vec![], radii_m: vec![],
//! #         rms_m: 0.0, used: points.len(), rejected: vec![], weak: None }))
//! # });
//! let mut tables = Tables::default();
//! tables.cor.register(calib_plugin::Entry::built_in_cor(mean))?; // or: tables.add(&host.load("my-plugin", None)?)?
//! let estimator = tables.cor.get("mean")?.with(&BTreeMap::new())?;
//! let motion = MotionData::points(&[vec![Some([0.0, 0.0, 0.0]), Some([2.0, 0.0, 0.0])]]);
//! let answer = estimator.fit(&motion.view(), &Control::default())?;
//! assert!(matches!(answer, calib_plugin::Answer::Found(fit) if fit.center_m == [1.0, 0.0, 0.0]));
//! # Ok::<(), calib_plugin::PluginError>(())
//! ```

pub mod abi;
mod answer;
pub mod author;
mod call;
mod effect;
mod kinds;
mod motion;
mod offer;
mod streams;

pub use answer::{Answer, AorFit, AxisLine, CorFit, Failure};
pub use call::Call;
pub use effect::{Coefficient, DependsOn, EffectTerm, JointStates};
pub use kinds::{Aor, ByFn, Cor, JointEffect, Reader, ReportWriter};
pub use motion::{BodyPose, Motion, MotionData, Shape};
pub use offer::{Kind, Offer, Parameter, Value};
pub use streams::{
    BodyTrack, JointTrack, JointUnit, MarkerSample, MarkerTrack, ReportFile, ReportInput, Source,
    Streams, Timeline, TorqueTrack,
};

#[cfg(feature = "host")]
pub mod check;
#[cfg(feature = "host")]
mod host;
#[cfg(feature = "host")]
mod listing;
#[cfg(feature = "host")]
mod new_project;
#[cfg(feature = "host")]
mod own;
#[cfg(feature = "host")]
mod parameters;
#[cfg(feature = "host")]
mod registry;
#[cfg(feature = "host")]
mod verify;

#[cfg(feature = "host")]
pub use host::{
    Cancel, Control, Description, Found, Host, LoadedPlugin, PluginError, Progress, SearchPath,
};
#[cfg(feature = "host")]
pub use new_project::{Language, NewProjectError, kind_from_name, new_project, offered_name};
#[cfg(feature = "host")]
pub use own::OwnEntries;
#[cfg(feature = "host")]
pub use parameters::{ParameterError, schema, typed, validate};
#[cfg(feature = "host")]
pub use registry::{Bound, Entry, Origin, Registry, Tables};

/// The README's example is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// The contract as text: `calib_plugin.h`.
#[cfg(feature = "host")]
pub const HEADER: &str = include_str!("../include/calib_plugin.h");
