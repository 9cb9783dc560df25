//! A trap, told to people on stderr and to programs on stdout.

use khz_bytecode::container::Container;
use khz_machine::engine::Entry;
use khz_machine::report::TrapReport;
use khz_scheduler::{FaultPlace, FaultReport};

use super::args::Format;
use super::output::{people, result};

/// What a report is made of beside the trap.
pub struct FaultContext<'a> {
    /// The program.
    pub container: &'a Container,
}

/// Prints a fault.
pub fn report_fault(fault: &FaultReport, context: &FaultContext<'_>, format: Format) {
    let entry = match fault.place {
        FaultPlace::Init => Entry::Init,
        FaultPlace::Startup => Entry::Startup,
        FaultPlace::Task { instance, .. } => Entry::Instance(instance),
    };
    let report = TrapReport::new(&fault.trap, entry, context.container);
    if format == Format::Json {
        result(&report.to_json());
    }
    people(&format!("{report}"));
    people(&format!(
        "  in round {}, at {:.6} s; its outputs were not written",
        fault.rounds + 1,
        fault.time.0 as f64 / 1e9
    ));
}
