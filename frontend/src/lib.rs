//! Structured Text to containers.
