//! Configurations of many tasks, and what the scheduling rules say of each: a brute-force model to hold a scheduler against.
//!
//! [`generate`] makes a [`Plan`](plan::Plan) of a seed: tasks of every kind, programs that log their own runs, what the world does (input rows, how long
//! each run takes, how late each sleep ends), and what a host commands (start, run, stop, reset). [`text`] and [`assembly`] write it as Structured
//! Text or as a container's assembly, so that the front end and whatever only a container can say are both covered. The user of this module
//! runs that under the real scheduler and writes down what happened as [`Event`](trace::Event)s.
//!
//! [`predict`] says beforehand what must happen. It is written from `architecture.md` §8, `semantics.md` "Resource" and
//! `docs/decisions/0007-scheduler.md` alone, and knows nothing of `khz-scheduler`: due times are found by stepping from one grid point to the
//! next, the order by looking for the best of what is left, values by walking the plan's actions. It is slow, and meant to be obvious.
//!
//! What it does not know beforehand it is told: how much fuel each run of code took, and what memory held when fuel ended in the middle of
//! one ([`Run`](trace::Run)). That the engines are right about both is the business of [`crate::oracle`].

pub mod assembly;
mod generate;
mod memory;
mod model;
pub mod plan;
pub mod shrink;
mod tasks;
pub mod text;
pub mod trace;
pub mod world;

pub use generate::generate;
pub use model::predict;
