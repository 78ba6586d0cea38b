//! The border of a plugin written in Rust: [`export!`](crate::export) puts C functions around the safe traits.
//!
//! Panics stop here, arrays become slices, results go to the host's callbacks. An author writes no `unsafe`.
#![allow(unsafe_code)] // It speaks C: raw pointers from the host become references here and nowhere else.

mod aor;
mod border;
mod cor;
mod effect;
mod estimator;
mod exported;
mod motion;
mod reader;
mod report;

pub use aor::fit as fit_aor;
pub use cor::fit as fit_cor;
pub use effect::regressors;
pub use exported::{Exported, Item, describe, find};
pub use reader::{read, recognizes};
pub use report::write;

/// Makes a shared library's crate a plugin: exports the one symbol of the contract.
///
/// Each kind (`cor`, `aor`, `reader`, `report`, `effect`) lists expressions that implement its trait. They are constants or
/// unit structs: a plugin keeps no state between calls.
///
/// ```no_run
/// use calib_plugin::{Answer, Call, Cor, CorFit, Failure, Kind, Motion, Offer};
///
/// struct Mean;
/// impl Cor for Mean {
///     fn offer(&self) -> Offer {
///         Offer::new(Kind::Cor, "mean", "never answers")
///     }
///     fn fit(&self, _: &Motion<'_>, _: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
///         Ok(Answer::NotObservable("a mean is no center".into()))
///     }
/// }
///
/// calib_plugin::export! {
///     name: "means",
///     version: "1.0.0",
///     author: "A. Author",
///     licence: "MIT",
///     cor: [Mean],
/// }
/// # fn main() {}
/// ```
#[macro_export]
macro_rules! export {
    ($($description:tt)*) => {
        $crate::entry! { calib_plugin_border: $($description)* }
        #[doc(hidden)]
        #[allow(unsafe_code, missing_docs, non_upper_case_globals)]
        #[unsafe(no_mangle)]
        pub static calib_plugin_entry: $crate::abi::Entry = calib_plugin_border::ENTRY;
    };
}

/// The entry of a plugin as a constant, `MODULE::ENTRY`, for a plugin that is linked into the program:
/// `entry! { MODULE: name: …, version: …, … }`. [`export!`](crate::export) is this and the symbol.
#[macro_export]
macro_rules! entry {
    ($module:ident: name: $name:expr, version: $version:expr, author: $author:expr, licence: $licence:expr
     $(, $kind:ident: [$($offer:expr),* $(,)?])* $(,)?) => {
        #[doc(hidden)]
        #[allow(unsafe_code, missing_docs, unused_imports)]
        pub mod $module {
            use super::*;
            static EXPORTED: ::std::sync::OnceLock<$crate::author::Exported> = ::std::sync::OnceLock::new();
            fn exported() -> &'static $crate::author::Exported {
                EXPORTED.get_or_init(|| {
                    $crate::author::Exported::new(
                        [$name, $version, $author, $licence],
                        ::std::vec![$($($crate::entry!(@$kind $offer)),*),*],
                    )
                })
            }
            unsafe extern "C" fn describe() -> *const $crate::abi::Descriptor {
                $crate::author::describe(exported)
            }
            unsafe extern "C" fn find(
                kind: *const ::std::ffi::c_char,
                name: *const ::std::ffi::c_char,
            ) -> *const ::std::ffi::c_void {
                // SAFETY: the host passes two texts that end with zero, as the contract says.
                unsafe { $crate::author::find(exported, kind, name) }
            }
            pub const ENTRY: $crate::abi::Entry = $crate::abi::Entry {
                abi_major: $crate::abi::MAJOR,
                abi_minor: $crate::abi::MINOR,
                struct_size: $crate::abi::size::<$crate::abi::Entry>(),
                reserved: 0,
                describe: Some(describe),
                find: Some(find),
            };
        }
    };
    (@offer $trait:ident $offer:expr) => {
        fn offer() -> &'static $crate::Offer {
            static OFFER: ::std::sync::OnceLock<$crate::Offer> = ::std::sync::OnceLock::new();
            OFFER.get_or_init(|| $crate::$trait::offer(&$offer))
        }
    };
    (@cor $offer:expr) => {{
        $crate::entry!(@offer Cor $offer);
        unsafe extern "C" fn fit(
            call: *const $crate::abi::Call,
            motion: *const $crate::abi::Motion,
            sink: *const $crate::abi::CorSink,
        ) -> $crate::abi::Status {
            // SAFETY: the host keeps the contract of `calib_cor_1::fit`.
            unsafe { $crate::author::fit_cor(&$offer, offer, call, motion, sink) }
        }
        $crate::author::Item::cor(offer().clone(), fit)
    }};
    (@aor $offer:expr) => {{
        $crate::entry!(@offer Aor $offer);
        unsafe extern "C" fn fit(
            call: *const $crate::abi::Call,
            motion: *const $crate::abi::Motion,
            sink: *const $crate::abi::AorSink,
        ) -> $crate::abi::Status {
            // SAFETY: the host keeps the contract of `calib_aor_1::fit`.
            unsafe { $crate::author::fit_aor(&$offer, offer, call, motion, sink) }
        }
        $crate::author::Item::aor(offer().clone(), fit)
    }};
    (@reader $offer:expr) => {{
        $crate::entry!(@offer Reader $offer);
        unsafe extern "C" fn read(
            call: *const $crate::abi::Call,
            source: *const $crate::abi::Source,
            sink: *const $crate::abi::RecordingSink,
        ) -> $crate::abi::Status {
            // SAFETY: the host keeps the contract of `calib_reader_1::read`.
            unsafe { $crate::author::read(&$offer, offer, call, source, sink) }
        }
        unsafe extern "C" fn recognizes(head: *const u8, size: usize) -> i32 {
            // SAFETY: the host keeps the contract of `calib_reader_1::recognizes`.
            unsafe { $crate::author::recognizes(&$offer, head, size) }
        }
        $crate::author::Item::reader(offer().clone(), read, recognizes)
    }};
    (@report $offer:expr) => {{
        $crate::entry!(@offer ReportWriter $offer);
        unsafe extern "C" fn write(
            call: *const $crate::abi::Call,
            report: *const $crate::abi::ReportInput,
            sink: *const $crate::abi::FilesSink,
        ) -> $crate::abi::Status {
            // SAFETY: the host keeps the contract of `calib_report_1::write`.
            unsafe { $crate::author::write(&$offer, offer, call, report, sink) }
        }
        $crate::author::Item::report(offer().clone(), write)
    }};
    (@effect $offer:expr) => {{
        $crate::entry!(@offer JointEffect $offer);
        unsafe extern "C" fn regressors(
            call: *const $crate::abi::Call,
            states: *const $crate::abi::JointStates,
            sink: *const $crate::abi::EffectSink,
        ) -> $crate::abi::Status {
            // SAFETY: the host keeps the contract of `calib_effect_1::regressors`.
            unsafe { $crate::author::regressors(&$offer, offer, call, states, sink) }
        }
        $crate::author::Item::effect(offer().clone(), $crate::JointEffect::term(&$offer), regressors)
    }};
}
