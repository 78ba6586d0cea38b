//! Why a file is not a table.

/// What is wrong with a table.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableFault {
    /// The system refused.
    #[error("cannot be read: {0}")]
    Unreadable(#[source] std::io::Error),
    /// The system refused to write.
    #[error("cannot be written: {0}")]
    Unwritable(#[source] std::io::Error),
    /// It has no whole Parquet footer, or its pages cannot be decoded.
    #[error("is not a whole Parquet file: {0}")]
    Parquet(String),
    /// A column is of a kind that tables of this program do not have.
    #[error("its column `{0}` is not of text, integers, reals or booleans")]
    ForeignColumn(String),
    /// A group of rows is larger than this program writes.
    #[error(
        "a group of {rows} rows was not written by this program, which writes {most} at the most"
    )]
    LargeGroup {
        /// Its rows.
        rows: i64,
        /// What this program writes.
        most: usize,
    },
    /// The cells are not those that were written.
    #[error("its cells are not those that were written: the checksum differs")]
    Changed,
    /// The footer does not state what a table of this program states.
    #[error("its footer does not state `{0}`")]
    NoFact(&'static str),
    /// A row has other columns than its table.
    #[error("a row does not fit the column `{0}`")]
    Unfit(String),
}
