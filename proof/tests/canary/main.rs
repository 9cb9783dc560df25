//! Faults that were planted on purpose (`khz_bytecode::canary`): each is found by a search over fixed seeds, is not found where it is not planted, and
//! is made small. `cargo test -p khz-proof --features canary --test canary -- --nocapture` also shows how long each took.
//!
//! One file for each kind of search. A fault of the table without a test here fails [`every_fault_is_hunted`].

mod containers;
mod frontend;
mod hunt;
mod scheduler;

use khz_bytecode::canary::Fault;

#[test]
fn every_fault_is_hunted() {
    let sources = [include_str!("containers.rs"), include_str!("frontend.rs"), include_str!("scheduler.rs")];
    for fault in Fault::ALL {
        let name = format!("Fault::{fault:?}");
        assert!(sources.iter().any(|source| source.contains(&name)), "{name} is hunted nowhere: {}", fault.text());
    }
}
