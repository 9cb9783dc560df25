//! Spoiling containers.
