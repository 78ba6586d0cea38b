//! What the estimators of centers, axes, frames and hand-eye transforms share.
