//! The border of a report writer.

use super::border::{accepted, c_text, guarded, slice};
use crate::{abi, answer::Failure, kinds::ReportWriter, offer::Offer, streams::ReportInput};

/// `write` of `calib_report_1`.
///
/// # Safety
/// The pointers are the host's, as the contract says.
pub unsafe fn write(
    it: &dyn ReportWriter,
    offer: fn() -> &'static Offer,
    call: *const abi::Call,
    report: *const abi::ReportInput,
    sink: *const abi::FilesSink,
) -> abi::Status {
    let body = |call: &crate::Call<'_>| {
        // SAFETY: the host's, valid until this function returns.
        let (Some(raw), Some(sink)) = (unsafe { (report.as_ref(), sink.as_ref()) }) else {
            return Err(Failure::Failed("the host gave no report or no sink".into()));
        };
        // SAFETY: as above.
        let report = unsafe {
            ReportInput {
                report_json: slice(raw.report_json, raw.report_size),
                scene_json: (!raw.scene_json.is_null())
                    .then(|| slice(raw.scene_json, raw.scene_size)),
            }
        };
        for file in it.write(&report, call)? {
            let path = c_text(&file.path);
            // SAFETY: the sink is the host's; path and bytes live until the callback returns.
            accepted(sink.file.map(|give| unsafe {
                give(
                    sink.context,
                    path.as_ptr(),
                    file.bytes.as_ptr(),
                    file.bytes.len(),
                )
            }))?;
        }
        Ok((abi::OK, None))
    };
    // SAFETY: the call is the host's.
    unsafe { guarded(offer, call, body) }
}
