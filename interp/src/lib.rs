//! The interpreter of Kilohertz.
