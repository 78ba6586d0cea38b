//! Checks of recordings: what is wrong with the data before anything is fitted.
