//! Live capture: from what a tracker sends over the network to the canonical recording, row by row.
//!
//! ```text
//! socket ── Source ──► Frame ── Order ──► Session ──► Table      a row per frame while a pose is held
//!                                          ▲    │
//!                     joint values ────────┘    ├──► Screen      next pose, lost bodies, progress
//!                                               └◄─► Planner     which pose is next, where a plan decides it
//! ```
//!
//! A frame has two times: that of the device, and that of its arrival. Both are written (`t_s`,
//! `host_s`). Late or duplicate frames are dropped and counted, never inserted. The rows of a hold are written when it is
//! complete, those of a motion every second: if the program is killed, at most the hold in progress is lost.
//!
//! The pose that a row belongs to is decided by stillness: within a time window the tracked bodies must not move
//! ([`Stillness`]). This crate estimates nothing.
//!
//! ```
//! use calib_capture::dtrack;
//!
//! let frames = dtrack::datagram(b"fr 7\r\n6d 1 [0 1.000][1 2 3 0 0 0][1 0 0 0 1 0 0 0 1]\r\n\0")?;
//! assert_eq!(frames[0].number, Some(7));
//! assert_eq!(frames[0].bodies["body_0"].translation.x, 0.001);
//! # Ok::<(), calib_recording::Error>(())
//! ```
//!
//! What this crate cannot check: whether the robot is at the stated joint values, and whether a tracker's name belongs to the
//! right body.

pub mod dtrack;
mod follow;
mod frame;
mod guide;
mod joints;
mod order;
mod screen;
mod session;
mod source;
mod still;
mod survey;
mod table;
pub mod vrpn;

pub use follow::{Held, Instead, Outcome, Planner, Progress, asked_is_reached};
pub use frame::Frame;
pub use guide::{Guide, Step, grid};
pub use joints::{JointColumn, JointListener, JointSource, Unit, parse_joints};
pub use order::{Arrival, Order};
pub use screen::{Lines, Screen, Terminal, WIDTH};
pub use session::{CaptureError, Ended, Key, Moved, Plan, Session, Summary, Watched, WatchedKind};
pub use source::{Address, BadAddress, Group, Input, Source, SourceError};
pub use still::{StillSettings, Stillness};
pub use survey::{Survey, map_names, survey};
pub use table::{Mark, POSES, Table, TableError};
