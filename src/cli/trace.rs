//! `--trace`: one row a round with the watched variables, and the live status line.

use std::fs::File;
use std::io::{BufWriter, IsTerminal, Write};
use std::path::Path;

use khz_machine::image::Image;
use khz_machine::variables::{Variable, VariableTable};
use khz_scheduler::{Observer, TaskIndex, TimeNs};

use super::Status;
use super::output::Failure;
use super::stopwatch::Stopwatch;

/// How often the status line is drawn anew, in nanoseconds.
const STATUS_PERIOD_NS: u64 = 250_000_000;

/// Writes the trace file and draws the status line.
pub struct Onlooker {
    trace: Option<Trace>,
    status: Option<StatusLine>,
}

struct Trace {
    out: BufWriter<File>,
    names: VariableTable,
    watched: Vec<Variable>,
    line: String,
    failed: Option<std::io::Error>,
}

struct StatusLine {
    since_drawn: Stopwatch,
    rounds: u64,
    cycles: u64,
}

impl Onlooker {
    /// `trace`: file and names of the watched variables. `status`: draw a status line, when stderr is a terminal.
    pub fn new(trace: Option<(&Path, &[String])>, names: &VariableTable, status: bool) -> Result<Self, Failure> {
        let trace = trace.map(|(path, watch)| Trace::create(path, watch, names)).transpose()?;
        let draw = status && std::io::stderr().is_terminal();
        let status = draw.then(|| StatusLine { since_drawn: Stopwatch::start(), rounds: 0, cycles: 0 });
        Ok(Onlooker { trace, status })
    }

    /// Ends the trace file; an error while writing it is reported here.
    pub fn finish(self) -> Result<(), Failure> {
        if self.status.is_some() {
            // The line is people's only; a closed terminal does not matter.
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
        let Some(mut trace) = self.trace else { return Ok(()) };
        let flushed = trace.out.flush();
        let outcome = trace.failed.map_or(flushed, Err);
        outcome.map_err(|error| Failure::Message(Status::Host, format!("--trace: {error}")))
    }
}

impl Trace {
    fn create(path: &Path, watch: &[String], names: &VariableTable) -> Result<Self, Failure> {
        let watched = watch.iter().map(|name| names.resolve(name.trim()));
        let watched: Vec<Variable> =
            watched.collect::<Result<_, _>>().map_err(|error| Failure::refused(format!("--watch: {error}")))?;
        let refused = |error: std::io::Error| Failure::Message(Status::Host, format!("{}: {error}", path.display()));
        let mut out = BufWriter::new(File::create(path).map_err(refused)?);
        let header: Vec<&str> = std::iter::once("time_us").chain(watched.iter().map(|v| v.name.as_str())).collect();
        writeln!(out, "{}", header.iter().map(|name| quoted(name)).collect::<Vec<_>>().join(",")).map_err(refused)?;
        Ok(Trace { out, names: names.clone(), watched, line: String::new(), failed: None })
    }

    fn row(&mut self, image: &Image, time: TimeNs) {
        self.line.clear();
        self.line.push_str(&time.as_us().to_string());
        for variable in &self.watched {
            self.line.push(',');
            self.line.push_str(&quoted(&self.names.text(image, variable)));
        }
        self.line.push('\n');
        if let Err(error) = self.out.write_all(self.line.as_bytes()) {
            self.failed.get_or_insert(error);
        }
    }
}

/// A CSV cell (RFC 4180): quoted when it must be.
fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n', '\r']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.to_string() }
}

impl StatusLine {
    fn round(&mut self, time: TimeNs, ran: &[TaskIndex]) {
        self.rounds += 1;
        self.cycles += ran.len() as u64;
        if self.since_drawn.ns() < STATUS_PERIOD_NS {
            return;
        }
        let seconds = time.as_us() as f64 / 1e6;
        // The line is people's only; a closed terminal does not matter.
        let _ = write!(
            std::io::stderr(),
            "\r\x1b[K{seconds:9.3} s  {} rounds  {} task cycles  (Ctrl+C stops)",
            self.rounds,
            self.cycles
        );
        self.since_drawn = Stopwatch::start();
    }
}

impl Observer for Onlooker {
    fn round_ended(&mut self, image: &Image, time: TimeNs, ran: &[TaskIndex]) {
        if let Some(trace) = &mut self.trace {
            trace.row(image, time);
        }
        if let Some(status) = &mut self.status {
            status.round(time, ran);
        }
    }
}
