//! A trap, told to people on stderr and to programs on stdout.

use khz_bytecode::container::Container;
use khz_machine::report::TrapReport;
use khz_scheduler::FaultReport;

use super::args::Format;
use super::output::{people, result};

/// Prints a fault of a program.
pub fn report_fault(fault: &FaultReport, container: &Container, format: Format) {
    let report = TrapReport::new(&fault.trap, fault.place.entry(), container);
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
