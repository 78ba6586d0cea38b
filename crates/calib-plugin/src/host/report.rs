//! A loaded report writer: takes files, all or none.

use std::ffi::{c_char, c_void};

use super::{
    call::{Got, across},
    raw::{array, text},
};
use crate::{
    abi,
    answer::Failure,
    call::Call,
    kinds::ReportWriter,
    offer::Offer,
    streams::{ReportFile, ReportInput},
};

/// `write` of the table.
pub(super) type Write = unsafe extern "C" fn(
    *const abi::Call,
    *const abi::ReportInput,
    *const abi::FilesSink,
) -> abi::Status;

pub(super) struct LoadedReport {
    pub offer: Offer,
    pub write: Write,
}

#[derive(Default)]
struct Intake {
    files: Vec<ReportFile>,
    broken: Option<String>,
}

impl ReportWriter for LoadedReport {
    fn offer(&self) -> Offer {
        self.offer.clone()
    }

    fn write(&self, report: &ReportInput<'_>, call: &Call<'_>) -> Result<Vec<ReportFile>, Failure> {
        let scene = report.scene_json;
        let raw = abi::ReportInput {
            struct_size: abi::size::<abi::ReportInput>(),
            reserved: 0,
            report_json: report.report_json.as_ptr(),
            report_size: report.report_json.len(),
            scene_json: scene.map_or(std::ptr::null(), <[u8]>::as_ptr),
            scene_size: scene.map_or(0, <[u8]>::len),
        };
        let mut intake = Intake::default();
        let sink = abi::FilesSink {
            struct_size: abi::size::<abi::FilesSink>(),
            reserved: 0,
            context: (&raw mut intake).cast(),
            file: Some(file),
        };
        // SAFETY: all arguments are alive until the function returns.
        let ended = across(call, |call| unsafe {
            (self.write)(call, &raw const raw, &raw const sink)
        });
        let got = match intake.broken {
            Some(problem) => Got::Broken(problem),
            None => Got::One(intake.files),
        };
        match ended.with(got)? {
            Ok((files, _)) => Ok(files),
            Err(_) => Err(Failure::Contract(
                "a report writer cannot say `not observable`".into(),
            )),
        }
    }
}

unsafe extern "C" fn file(
    context: *mut c_void,
    path: *const c_char,
    bytes: *const u8,
    size: usize,
) -> abi::Status {
    // SAFETY: the context of `write`, used by this thread only.
    let Some(intake) = (unsafe { context.cast::<Intake>().as_mut() }) else {
        return abi::FAILED;
    };
    // SAFETY: path and bytes are alive until this function returns.
    let taken = unsafe { text("the path of a file", path) }.and_then(|path| {
        crate::verify::path(&path)?;
        // SAFETY: as above.
        let bytes = unsafe { array("a file", bytes, size)? }.to_vec();
        Ok(ReportFile { path, bytes })
    });
    match taken {
        Ok(file) if intake.broken.is_none() => {
            intake.files.push(file);
            abi::OK
        }
        Ok(_) => abi::FAILED,
        Err(problem) => {
            intake.broken.get_or_insert(problem);
            abi::FAILED
        }
    }
}
