//! Why a store cannot be used, and what to do.

use calib_pipeline::ExitCode;

/// What is wrong.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StoreFault {
    /// The program knows no stores.
    #[error("this program was built without object stores")]
    NotBuilt,
    /// No address of a store.
    #[error("is no address of an object store: {0}")]
    Address(String),
    /// Nothing to merge.
    #[error("holds no shards: nothing there ends with `.parquet`")]
    Empty,
    /// There is no such bucket, folder or object.
    #[error("is not there")]
    Missing,
    /// Keys are wrong or missing, or grant too little.
    #[error("access is denied: {0}")]
    Denied(String),
    /// The store cannot be reached, or answers with an error.
    #[error("cannot be read: {0}")]
    Unread(String),
    /// See `Unread`.
    #[error("cannot be written: {0}")]
    Unwritten(String),
    /// The object is no shard of this work.
    #[error("is not the shard that is asked for: {0}")]
    Foreign(String),
}

/// A store, or an object of it, that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{url}: {fault}\n  help: {}", self.remedy())]
pub struct StoreError {
    /// The address.
    pub url: String,
    /// What is wrong.
    pub fault: StoreFault,
}

impl StoreError {
    pub(crate) fn new(url: &str, fault: StoreFault) -> Self {
        Self {
            url: url.to_owned(),
            fault,
        }
    }

    /// What to do.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self.fault {
            StoreFault::NotBuilt => {
                "build it with `--features object-store`, or leave out --store and copy the files of the shards"
            }
            StoreFault::Address(_) => "give `s3://BUCKET/PREFIX` or `file:///FOLDER`",
            StoreFault::Empty => "give the address that the shards were made with",
            StoreFault::Missing => "correct the address, or make the bucket",
            StoreFault::Denied(_) => {
                "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY to keys that may list, read and write there"
            }
            StoreFault::Unread(_) | StoreFault::Unwritten(_) => {
                "check the network, and AWS_ENDPOINT, AWS_REGION, AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY; nothing is lost, the call can be repeated"
            }
            StoreFault::Foreign(_) => {
                "give another address, or start over with --restart, which writes in its place"
            }
        }
    }

    /// The exit code of the program.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self.fault {
            StoreFault::NotBuilt | StoreFault::Address(_) | StoreFault::Foreign(_) => {
                ExitCode::Usage
            }
            StoreFault::Unwritten(_) => ExitCode::NotWritten,
            _ => ExitCode::Data,
        }
    }
}
