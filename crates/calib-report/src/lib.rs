//! The report as data; Markdown, JSON and HTML; scene export.
