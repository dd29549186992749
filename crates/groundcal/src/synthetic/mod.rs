//! Scenes with truth.
