//! The command line's words: what scripts may rely on. One struct a subcommand.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

/// Structured Text to verified containers, run natively under a scheduler that measures every cycle.
#[derive(Debug, Parser)]
#[command(name = "khz", version, arg_required_else_help = true)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Parse and analyse; report every diagnostic
    Check(CheckArgs),
    /// Say what a diagnostic, verifier rule or trap means
    Explain(ExplainArgs),
    /// Compile to a container for each RESOURCE
    Build(BuildArgs),
    /// Verify a container and say what was proved
    Verify(VerifyArgs),
    /// Show bytecode, mid-level form, Cranelift IR or machine code beside its source
    Disasm(DisasmArgs),
    /// Run a program under the scheduler
    Run(RunArgs),
    /// Measure the time of a scan
    Bench(BenchArgs),
    /// Run unit tests written in Structured Text
    Test(TestArgs),
    /// Run both engines in lock-step and report the first difference
    Diff(DiffArgs),
    /// Format Structured Text in place; comments and blank lines are kept
    Fmt(FmtArgs),
}

/// How results are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For people.
    Human,
    /// For programs: one JSON value on stdout.
    Json,
}

/// What every subcommand takes.
#[derive(Debug, Clone, Args)]
pub struct Common {
    /// How results are printed
    #[arg(long, value_enum, default_value = "human")]
    pub format: Format,
}

/// Which rules of the language hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum DialectArg {
    /// The standard's implicit conversions only.
    Iec,
    /// What vendor code does is accepted, with warnings.
    Default,
}

/// Files, and how they are compiled.
#[derive(Debug, Clone, Args)]
pub struct Sources {
    /// Structured Text files, a folder of them, a project (khz.toml or its folder), or one container (.iplc)
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Which rules of the language hold; without it, what the project says
    #[arg(long, value_enum)]
    pub dialect: Option<DialectArg>,
}

/// How diagnostics are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum CheckFormat {
    /// For people.
    Human,
    /// One JSON array.
    Json,
    /// One SARIF 2.1.0 log, for code hosts and editors.
    Sarif,
}

impl CheckFormat {
    /// How other failures are printed then.
    pub fn failures(self) -> Format {
        if self == CheckFormat::Json { Format::Json } else { Format::Human }
    }
}

/// `khz check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub sources: Sources,
    /// How diagnostics are printed
    #[arg(long, value_enum, default_value = "human")]
    pub format: CheckFormat,
}

/// `khz explain`.
#[derive(Debug, Args)]
pub struct ExplainArgs {
    /// A code such as S0012, V0007 or C0003, or a trap's name; without one, the list of all
    pub code: Option<String>,
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub common: Common,
}

/// `khz build`.
#[derive(Debug, Args)]
pub struct BuildArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub sources: Sources,
    /// Where the container goes; several RESOURCEs give OUT.<resource>.iplc each. A project has a name, so it needs none
    #[arg(short, long, value_name = "OUT.iplc")]
    pub output: Option<PathBuf>,
    /// Leave the debug section out
    #[arg(long)]
    pub strip: bool,
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub common: Common,
}

/// `khz verify`.
#[derive(Debug, Args)]
pub struct VerifyArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub sources: Sources,
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub common: Common,
}

/// What a program is given when it is run, which `khz disasm` only does for `--hot`.
const NEEDS_HOT: [&str; 4] = ["set", "inputs", "watchdog_us", "scans"];

/// `khz disasm`.
#[derive(Debug, Args)]
#[command(mut_args(|arg| if NEEDS_HOT.contains(&arg.get_id().as_str()) { arg.requires("hot") } else { arg }))]
pub struct DisasmArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub sources: Sources,
    /// The JIT's mid-level form, after its passes
    #[arg(long, group = "form")]
    pub mir: bool,
    /// Cranelift's intermediate representation
    #[arg(long, group = "form")]
    pub clif: bool,
    /// Machine code
    #[arg(long, group = "form")]
    pub asm: bool,
    /// Run the program on the virtual clock and say which source lines cost most: machine instructions that were run, counted, not timed
    #[arg(long, requires = "asm")]
    pub hot: bool,
    /// Rounds to run for --hot
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..))]
    pub scans: u64,
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub resource: ResourceArgs,
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub common: Common,
}

/// Which engine runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum EngineArg {
    /// Native code.
    Jit,
    /// The interpreter.
    Interp,
}

/// Which engines are measured, tested or compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum EnginesArg {
    /// Native code.
    Jit,
    /// The interpreter.
    Interp,
    /// Each of them.
    Both,
}

/// What drives the scheduler.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ClockArg {
    /// The machine's monotonic clock.
    Real,
    /// A clock that only moves between rounds: every run is the same.
    Virtual,
}

/// What is written for `perf`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PerfArg {
    /// Names and addresses.
    Map,
    /// Names, addresses, code and source lines.
    Jitdump,
}

/// What a running resource is given.
#[derive(Debug, Clone, Args)]
pub struct ResourceArgs {
    /// Which RESOURCE, when there are several
    #[arg(long, value_name = "NAME")]
    pub resource: Option<String>,
    /// A variable's value before the first scan
    #[arg(long = "set", value_name = "NAME=VALUE")]
    pub set: Vec<String>,
    /// Values over time: first column time_us, then a column for each variable or address
    #[arg(long, value_name = "CSV")]
    pub inputs: Option<PathBuf>,
    /// Watchdog for tasks that set none, in microseconds (default 0: none; `diff`: 100000, which 0 stands for there)
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub watchdog_us: u64,
    /// Largest memory image, in bytes
    #[arg(long, value_name = "BYTES", default_value_t = khz_bytecode::limits::MAX_IMAGE_BYTES)]
    pub max_image: u64,
}

/// `khz run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub sources: Sources,
    /// Which engine runs
    #[arg(long, value_enum, default_value = "jit")]
    pub engine: EngineArg,
    /// End after N rounds in which a task ran
    #[arg(long, value_name = "N")]
    pub scans: Option<u64>,
    /// Run until stopped, whatever --scans says (the default without --scans)
    #[arg(long)]
    pub continuous: bool,
    /// What drives the scheduler
    #[arg(long, value_enum, default_value = "real")]
    pub clock: ClockArg,
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub resource: ResourceArgs,
    /// All variables at the end, also after a trap: .json, or any other ending for text
    #[arg(long, value_name = "PATH")]
    pub dump_vars: Option<PathBuf>,
    /// One row a round with the watched variables
    #[arg(long, value_name = "CSV", requires = "watch")]
    pub trace: Option<PathBuf>,
    /// Variables of the trace
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', requires = "trace")]
    pub watch: Vec<String>,
    /// Task statistics at the end, as JSON
    #[arg(long, value_name = "PATH")]
    pub stats: Option<PathBuf>,
    /// Real-time priority (SCHED_FIFO, 1 to 98)
    #[arg(long, value_name = "PRIO", value_parser = clap::value_parser!(u8).range(1..=98))]
    pub rt: Option<u8>,
    /// Tell `perf` about native code: /tmp/perf-PID.map, or jit-PID.dump in this folder, with source lines
    #[arg(long, value_enum, value_name = "WHAT")]
    pub perf: Option<PerfArg>,
    /// Processor to run on
    #[arg(long, value_name = "N")]
    pub cpu: Option<u32>,
    /// Spin for the last microseconds of a wait
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub spin_us: u64,
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub common: Common,
}

/// `khz bench`.
#[derive(Debug, Args)]
pub struct BenchArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub sources: Sources,
    /// Which engines are measured
    #[arg(long, value_enum, default_value = "both")]
    pub engine: EnginesArg,
    /// Scans to time; without it, until the median is stable
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub scans: Option<u64>,
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub resource: ResourceArgs,
    /// Figures as a JSON array, one object an engine
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
    /// Figures as one self-contained HTML page
    #[arg(long, value_name = "OUT.html")]
    pub report: Option<PathBuf>,
    /// Tell `perf` about native code: /tmp/perf-PID.map, or jit-PID.dump in this folder, with source lines
    #[arg(long, value_enum, value_name = "WHAT")]
    pub perf: Option<PerfArg>,
    /// Measure start latency per task on the real clock instead
    #[arg(long)]
    pub jitter: bool,
    /// How long to measure jitter, in seconds
    #[arg(long, value_name = "S", default_value_t = 10, requires = "jitter")]
    pub duration: u64,
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub common: Common,
}

/// How the results of tests are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TestFormat {
    /// For people.
    Human,
    /// One JSON object.
    Json,
    /// JUnit's XML.
    Junit,
    /// Test Anything Protocol, version 14.
    Tap,
}

impl TestFormat {
    /// How diagnostics and other failures are printed then.
    pub fn failures(self) -> Format {
        if self == TestFormat::Json { Format::Json } else { Format::Human }
    }
}

/// `khz test`.
#[derive(Debug, Args)]
pub struct TestArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub sources: Sources,
    /// On which engines each test must pass
    #[arg(long, value_enum, default_value = "both")]
    pub engine: EnginesArg,
    /// How results are printed
    #[arg(long, value_enum, default_value = "human")]
    pub format: TestFormat,
    /// Only tests whose name holds this text, in any case
    #[arg(long, value_name = "TEXT")]
    pub filter: Option<String>,
    /// Name the tests and run none
    #[arg(long)]
    pub list: bool,
    /// How long a test may compute, in microseconds of fuel: about 1000 instructions each; 0: without end
    #[arg(long, value_name = "N", default_value_t = 1_000_000)]
    pub watchdog_us: u64,
    /// Largest memory image, in bytes
    #[arg(long, value_name = "BYTES", default_value_t = khz_bytecode::limits::MAX_IMAGE_BYTES)]
    pub max_image: u64,
}

/// What says nothing about generated programs.
const NOT_WITH_RANDOM: [&str; 11] = [
    "files",
    "dialect",
    "against",
    "inputs",
    "random_inputs",
    "random_variables",
    "scans",
    "resource",
    "set",
    "watchdog_us",
    "max_image",
];

/// `khz diff`.
#[derive(Debug, Args)]
#[command(mut_arg("files", |files| files.required(false).required_unless_present("random")))]
pub struct DiffArgs {
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub sources: Sources,
    /// Rounds to compare (default 1000); along a trace how many it may take to its end (default 10000000)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub scans: Option<u64>,
    /// Give the inputs new values each round: what is located at %I, or where nothing is, VAR_INPUT of the programs
    #[arg(long, conflicts_with = "inputs")]
    pub random_inputs: bool,
    /// Seed of the random inputs, which it asks for, or of the first generated program (default 0)
    #[arg(long, value_name = "S", conflicts_with = "inputs")]
    pub seed: Option<u64>,
    /// With random inputs: give other variables new values now and then, too, for states that the program hardly comes to
    #[arg(long, conflicts_with_all = ["inputs", "against"])]
    pub random_variables: bool,
    /// Compare N generated programs instead: from --seed on, 10 scans each
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..), conflicts_with_all = NOT_WITH_RANDOM)]
    pub random: Option<u64>,
    /// Threads for --random; they do not change what is printed (default: one for each processor)
    #[arg(long, value_name = "N", requires = "random")]
    pub threads: Option<usize>,
    /// A fault of `khz_bytecode::canary` to plant, for tests
    #[cfg(feature = "canary")]
    #[arg(long, hide = true)]
    pub plant: Option<String>,
    /// Compare with a trace that was recorded elsewhere: first column time_us, then a column for each variable
    #[arg(long, value_name = "TRACE.csv", conflicts_with_all = ["inputs", "random_inputs", "seed"])]
    pub against: Option<PathBuf>,
    /// Lines COLUMN,VARIABLE[,FACTOR[,OFFSET]]: what the columns of the trace are
    #[arg(long, value_name = "NAMES.csv", requires = "against")]
    pub map: Option<PathBuf>,
    /// How far a variable may lie from the trace: ABS + REL × |value|; without a name: every other REAL and LREAL
    #[arg(long, value_name = "[NAME=]ABS[,REL]", requires = "against")]
    pub tolerance: Vec<String>,
    /// Microseconds to add to the trace's times, or `auto`: look for them
    #[arg(long, value_name = "US|auto", requires = "against", allow_hyphen_values = true)]
    pub align: Option<String>,
    /// Columns that drive the program and are not compared (default: those located at %I); `none`
    #[arg(long, value_name = "NAME,...", requires = "against")]
    pub drive: Option<String>,
    /// Rows of the trace are changes, not samples: between them its values hold, and each round is compared
    #[arg(long, requires = "against")]
    pub on_change: bool,
    /// Both curves of every variable as one self-contained HTML page
    #[arg(long, value_name = "OUT.html", requires = "against")]
    pub report: Option<PathBuf>,
    /// Which engines run along the trace, both in lock-step (default both)
    #[arg(long, value_enum, requires = "against")]
    pub engine: Option<EnginesArg>,
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub resource: ResourceArgs,
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub common: Common,
}

impl DiffArgs {
    /// Whether the inputs are random.
    pub fn is_random(&self) -> bool {
        self.random_inputs || self.random_variables || self.seed.is_some()
    }

    /// An option that says nothing without another one: clap lets it pass when that other one conflicts with what is given.
    pub fn check(&self) -> Result<(), String> {
        let along = [
            ("map", self.map.is_some()),
            ("tolerance", !self.tolerance.is_empty()),
            ("align", self.align.is_some()),
            ("drive", self.drive.is_some()),
            ("on-change", self.on_change),
            ("report", self.report.is_some()),
            ("engine", self.engine.is_some()),
        ];
        if self.threads.is_some() && self.random.is_none() {
            return Err("--threads is for --random N".to_string());
        }
        match along.iter().find(|(_, given)| *given && self.against.is_none()) {
            Some((option, _)) => Err(format!("--{option} is for --against TRACE.csv")),
            None => Ok(()),
        }
    }
}

/// How reserved words are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum KeywordsArg {
    /// In upper case.
    Upper,
    /// As they are.
    Keep,
}

/// `khz fmt`.
#[derive(Debug, Args)]
pub struct FmtArgs {
    /// Structured Text files or folders of them; `-` alone formats stdin to stdout
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Write nothing; list the files that are formatted otherwise, and exit with 1 if there are any
    #[arg(long)]
    pub check: bool,
    /// Spaces of one level
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u8).range(0..=i64::from(khz_frontend::format::MAX_INDENT)))]
    pub indent: u8,
    /// Characters after which a line is broken
    #[arg(long, value_name = "N", default_value_t = 100)]
    pub width: usize,
    /// How reserved words are written
    #[arg(long, value_enum, default_value = "upper")]
    pub keywords: KeywordsArg,
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it as help of the group")]
    pub common: Common,
}
