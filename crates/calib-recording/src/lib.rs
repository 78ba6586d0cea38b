//! The canonical recording, readers for what laboratories have, data checks.
