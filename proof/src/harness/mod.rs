//! Where the generators meet what they are there for: the front end, both engines and the scheduler.
//!
//! Everything else of this crate knows an engine only as a trait and the compiler only as a function from a text. Here they are named, once, for
//! tests, long runs and `khz diff --random`: [`engines`] makes what is compared, [`meaning`] holds generated Structured Text against its own meaning,
//! [`schedule`] holds the scheduler against the model of its rules, [`round_trips`] looks whether what is written, formatted or stripped comes back;
//! [`programs`] says where the repository has programs.

pub mod engines;
pub mod meaning;
pub mod programs;
pub mod round_trips;
pub mod schedule;
