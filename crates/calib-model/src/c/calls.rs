//! The calls of a control loop.

use std::ffi::c_int;

use super::{CModel, CWork, given, guarded, status};
use crate::approach::Approach;
use crate::correct::{Aim, Correction, Options, Outcome};
use crate::error::ModelError;
use crate::forward::{Under, Work};
use crate::model::{LinkId, Model, Place, Scope};
use crate::pose::Pose;

/// `calib_model_options`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct COptions {
    pub position_only: c_int,
    pub iterations: c_int,
    pub largest_rad: f64,
    pub largest_m: f64,
    pub tolerance_m: f64,
    pub lever_m: f64,
}

/// `calib_model_correction`.
#[repr(C)]
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct CCorrection {
    pub iterations: c_int,
    /// −1: none.
    pub joint: c_int,
    pub before_m: f64,
    pub after_m: f64,
    pub before_rad: f64,
    pub after_rad: f64,
    pub step: f64,
}

impl COptions {
    fn of(options: &Options) -> Self {
        Self {
            position_only: c_int::from(options.aim == Aim::Position),
            iterations: c_int::try_from(options.iterations).unwrap_or(c_int::MAX),
            largest_rad: options.largest_rad,
            largest_m: options.largest_m,
            tolerance_m: options.tolerance_m,
            lever_m: options.lever_m,
        }
    }

    fn options(self) -> Options {
        Options {
            aim: match self.position_only {
                0 => Aim::Pose,
                _ => Aim::Position,
            },
            largest_rad: self.largest_rad,
            largest_m: self.largest_m,
            tolerance_m: self.tolerance_m,
            lever_m: self.lever_m,
            iterations: usize::try_from(self.iterations).unwrap_or(0),
        }
    }
}

/// What every evaluation needs.
struct Call<'a> {
    model: &'a Model,
    work: &'a mut Work,
    approach: &'a Approach,
    held: Option<&'a [f64]>,
    temperature_c: &'a [f64],
}

impl<'a> Call<'a> {
    unsafe fn of(
        model: *const CModel,
        work: *mut CWork,
        held: *const f64,
    ) -> Result<Self, ModelError> {
        let model = &unsafe { given::shared(model) }?.model;
        let CWork {
            work,
            approach,
            temperature_c,
        } = unsafe { given::unique(work) }?;
        let held = match held.is_null() {
            true => None,
            false => Some(unsafe { given::numbers(held, model.joints().len()) }?),
        };
        Ok(Self {
            model,
            work,
            approach,
            held,
            temperature_c,
        })
    }

    fn under(&self) -> Under<'a> {
        Under {
            approach: self.approach.directions(),
            held: self.held,
            temperature_c: self.temperature_c,
        }
    }
}

/// `root_from_link` at q.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_fk(
    model: *const CModel,
    work: *mut CWork,
    q: *const f64,
    held: *const f64,
    link: usize,
    pose: *mut f64,
) -> c_int {
    guarded(|| {
        let call = unsafe { Call::of(model, work, held) }?;
        let q = unsafe { given::numbers(q, call.model.joints().len()) }?;
        call.model.forward(q, &call.under(), call.work)?;
        let at = call.model.root_from(Place::Link(LinkId(link)), call.work)?;
        unsafe { given::room(pose, 12) }?.copy_from_slice(&at.rows());
        Ok(status::OK)
    })
}

/// `root_from_link` of all links at q.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_fk_all(
    model: *const CModel,
    work: *mut CWork,
    q: *const f64,
    held: *const f64,
    poses: *mut f64,
) -> c_int {
    guarded(|| {
        let call = unsafe { Call::of(model, work, held) }?;
        let q = unsafe { given::numbers(q, call.model.joints().len()) }?;
        call.model.forward(q, &call.under(), call.work)?;
        let out = unsafe { given::room(poses, 12 * call.model.links().len()) }?;
        for (out, at) in out.chunks_exact_mut(12).zip(&call.work.at) {
            out.copy_from_slice(&at.rows());
        }
        Ok(status::OK)
    })
}

/// Jacobian of a link at q.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_jacobian(
    model: *const CModel,
    work: *mut CWork,
    q: *const f64,
    held: *const f64,
    link: usize,
    jacobian: *mut f64,
) -> c_int {
    guarded(|| {
        let call = unsafe { Call::of(model, work, held) }?;
        let n = call.model.joints().len();
        let q = unsafe { given::numbers(q, n) }?;
        let out = unsafe { given::room(jacobian, 6 * n) }?;
        let under = call.under();
        call.model
            .jacobian(q, LinkId(link), &under, call.work, out)?;
        Ok(status::OK)
    })
}

/// Covariance of a predicted pose.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_sigma(
    model: *const CModel,
    work: *mut CWork,
    q: *const f64,
    held: *const f64,
    link: usize,
    covariance: *mut f64,
) -> c_int {
    guarded(|| {
        let call = unsafe { Call::of(model, work, held) }?;
        let q = unsafe { given::numbers(q, call.model.joints().len()) }?;
        let under = call.under();
        let place = Place::Link(LinkId(link));
        let found = call.model.sigma(q, place, &under, call.work)?;
        unsafe { given::room(covariance, 36) }?.copy_from_slice(found.as_slice());
        Ok(status::OK)
    })
}

/// Whether q lies where the model was fitted; the joint that does not, or −1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_in_scope(
    model: *const CModel,
    q: *const f64,
    joint: *mut c_int,
) -> c_int {
    guarded(|| {
        let model = &unsafe { given::shared(model) }?.model;
        let q = unsafe { given::numbers(q, model.joints().len()) }?;
        let (code, at) = match model.scope(q)? {
            Scope::Inside => (status::OK, None),
            Scope::Outside(i) => (status::OUT_OF_SCOPE, Some(i)),
            Scope::BeyondLimits(i) => (status::BEYOND_LIMITS, Some(i)),
        };
        if let Ok(joint) = unsafe { given::unique(joint) } {
            *joint = index(at);
        }
        Ok(code)
    })
}

fn index(of: Option<usize>) -> c_int {
    of.and_then(|i| c_int::try_from(i).ok()).unwrap_or(-1)
}

/// Options of `calib_model_correct`, or of `calib_model_ik`.
#[unsafe(no_mangle)]
pub extern "C" fn calib_model_default_options(inverse: c_int) -> COptions {
    COptions::of(&match inverse {
        0 => Options::default(),
        _ => Options::inverse(),
    })
}

unsafe fn options(given: *const COptions, otherwise: Options) -> Options {
    // SAFETY: the header asks for valid options or null.
    unsafe { given.as_ref() }.map_or(otherwise, |o| o.options())
}

/// Status of a correction, and its numbers for the caller.
unsafe fn corrected(done: &Correction, out: *mut CCorrection) -> c_int {
    let (code, joint) = match done.outcome {
        Outcome::Reached => (status::OK, None),
        Outcome::OutOfScope(i) => (status::OUT_OF_SCOPE, Some(i)),
        Outcome::Nearer => (status::NEARER, None),
        Outcome::NotReached => (status::NOT_REACHED, None),
        Outcome::BeyondLimits(i) => (status::BEYOND_LIMITS, Some(i)),
    };
    // SAFETY: the header asks for room for one, or null.
    if let Some(out) = unsafe { out.as_mut() } {
        *out = CCorrection {
            iterations: c_int::try_from(done.iterations).unwrap_or(c_int::MAX),
            joint: index(joint),
            before_m: done.before_m,
            after_m: done.after_m,
            before_rad: done.before_rad,
            after_rad: done.after_rad,
            step: done.step,
        };
    }
    code
}

/// A copy of a caller's positions in the memory of the thread, which has to get it back: inputs and outputs may be one array, and an output is not
/// written where a call is refused.
unsafe fn caller(work: &mut Work, q: *const f64, n: usize) -> Result<Vec<f64>, ModelError> {
    let given = unsafe { given::numbers(q, n) }?;
    if work.caller.len() != n {
        return Err(ModelError::ForeignWork);
    }
    let mut kept = std::mem::take(&mut work.caller);
    kept.copy_from_slice(given);
    Ok(kept)
}

/// The command that brings a link to where the nominal model has it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_correct(
    model: *const CModel,
    work: *mut CWork,
    q_desired: *const f64,
    held: *const f64,
    link: usize,
    with: *const COptions,
    q_command: *mut f64,
    correction: *mut CCorrection,
) -> c_int {
    guarded(|| {
        let call = unsafe { Call::of(model, work, held) }?;
        let n = call.model.joints().len();
        let mut kept = unsafe { caller(call.work, q_desired, n) }?;
        // Only now: the two may be one array.
        let room = unsafe { given::room(q_command, n) };
        let with = unsafe { options(with, Options::default()) };
        let under = call.under();
        let done = room.and_then(|out| {
            let link = LinkId(link);
            call.model
                .correct(&kept, link, &with, &under, call.work, out)
        });
        std::mem::swap(&mut call.work.caller, &mut kept);
        Ok(unsafe { corrected(&done?, correction) })
    })
}

/// The position at which a link stands at a pose, near a seed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_ik(
    model: *const CModel,
    work: *mut CWork,
    pose: *const f64,
    seed: *const f64,
    held: *const f64,
    link: usize,
    with: *const COptions,
    q: *mut f64,
    correction: *mut CCorrection,
) -> c_int {
    guarded(|| {
        let call = unsafe { Call::of(model, work, held) }?;
        let n = call.model.joints().len();
        let mut wanted = [0.0; 12];
        wanted.copy_from_slice(unsafe { given::numbers(pose, 12) }?);
        let mut kept = unsafe { caller(call.work, seed, n) }?;
        let room = unsafe { given::room(q, n) };
        let with = unsafe { options(with, Options::inverse()) };
        let under = call.under();
        let wanted = Pose::from_rows(&wanted);
        let link = LinkId(link);
        let done = room.and_then(|out| {
            let work = (&mut *call.work, out);
            call.model.ik(&wanted, &kept, link, &with, &under, work)
        });
        std::mem::swap(&mut call.work.caller, &mut kept);
        Ok(unsafe { corrected(&done?, correction) })
    })
}

/// Takes the next commanded position: from which side each joint came.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_moved_to(
    model: *const CModel,
    work: *mut CWork,
    q: *const f64,
) -> c_int {
    guarded(|| {
        let model = &unsafe { given::shared(model) }?.model;
        let work = unsafe { given::unique(work) }?;
        let q = unsafe { given::numbers(q, model.joints().len()) }?;
        work.approach.update(model, q)?;
        Ok(status::OK)
    })
}

/// Directions of approach as they are remembered.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_approach(work: *const CWork, directions: *mut f64) -> c_int {
    guarded(|| {
        let own = unsafe { given::shared(work) }?.approach.directions();
        unsafe { given::room(directions, own.len()) }?.copy_from_slice(own);
        Ok(status::OK)
    })
}

/// Forgets or states from which side each joint came.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_set_approach(
    work: *mut CWork,
    directions: *const f64,
) -> c_int {
    guarded(|| {
        let own = &mut unsafe { given::unique(work) }?.approach;
        let n = own.directions().len();
        own.set(unsafe { given::numbers(directions, n) }?)?;
        Ok(status::OK)
    })
}

/// States the temperature of the link before each joint, °C; null: that at which the lengths hold.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_set_temperature(
    model: *const CModel,
    work: *mut CWork,
    celsius: *const f64,
) -> c_int {
    guarded(|| {
        let model = &unsafe { given::shared(model) }?.model;
        let own = &mut unsafe { given::unique(work) }?.temperature_c;
        if celsius.is_null() {
            own.fill(model.reference_temperature_c());
            return Ok(status::OK);
        }
        let given = unsafe { given::numbers(celsius, model.joints().len()) }?;
        model.checked("temperature", given)?;
        if own.len() != given.len() {
            return Err(ModelError::ForeignWork);
        }
        own.copy_from_slice(given);
        Ok(status::OK)
    })
}
