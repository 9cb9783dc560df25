//! Unit tests written in ST: from the tests of the sources to one container for each (`docs/testing.md`).
//!
//! A test is a program. [`desugar`] turns the tests of all files into PROGRAMs of ordinary Structured Text: SETUP's variables and
//! statements stand before the test's own, TEARDOWN in a branch that a second activation takes. The programs under test become
//! function blocks, so that a test can have instances of them and call them; configurations keep nothing but their globals.
//! `analysis` then gives assertions and mocks their meaning, again as ordinary statements: an assertion keeps its operands
//! in hidden variables, and where it does not hold it notes its number and returns. So a test runs on every engine, and the
//! container that runs is verified, like any other.
//!
//! Each test has a resource of its own, with all globals, and so a memory image of its own: nothing passes from test to test.

pub(crate) mod desugar;

use khz_bytecode::container::Container;

use crate::diagnostics::Diagnostic;
use crate::source::{SourceMap, Span};
use crate::syntax::symbol::Symbol;

/// Name of the program instance that runs a test.
pub const TEST_INSTANCE: &str = "test";

/// How many tests one compilation may have.
pub const MAX_TESTS: usize = 10_000;

/// How many bytes of SETUP and TEARDOWN one compilation may come to, each counted once for every test that it belongs to: it is
/// compiled with each.
pub const MAX_FIXTURE_BYTES: u64 = 3 << 20;

/// Tests, compiled.
#[derive(Debug)]
pub struct TestCompilation {
    /// In source order; empty when a diagnostic is an error.
    pub tests: Vec<CompiledTest>,
    /// Everything there is to say, in order of place.
    pub diagnostics: Vec<Diagnostic>,
    /// The sources, for places in messages.
    pub sources: SourceMap,
}

/// One test, ready to be verified and run: one activation of its only program instance, and a second one if it has a TEARDOWN.
#[derive(Debug, Clone)]
pub struct CompiledTest {
    /// Its name.
    pub name: String,
    /// Where its name stands.
    pub span: Span,
    /// Whether the second activation runs a TEARDOWN.
    pub has_teardown: bool,
    /// What it is compiled to.
    pub container: Container,
    /// The variable, of type UDINT, that holds the number of the assertion that failed, from 1; 0: none did. None without assertions.
    pub failed: Option<String>,
    /// Its assertions by number - 1.
    pub assertions: Vec<Assertion>,
}

/// An assertion of a test.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Assertion {
    /// Where it stands.
    pub span: Span,
    /// Its word, in upper case.
    pub word: &'static str,
    /// What was compared, in the order of its parameters.
    pub operands: Vec<Operand>,
    /// The variable that holds its message after it failed.
    pub message: Option<String>,
}

/// A side of an assertion.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Operand {
    /// What it is called in reports: `actual`, `expected`, `bound` …
    pub label: &'static str,
    /// Its value.
    pub value: OperandValue,
}

/// Where the value of an operand is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum OperandValue {
    /// In this variable.
    Variable(String),
    /// It is known.
    Text(&'static str),
}

/// A test as the analysis meets it: a PROGRAM with a name that no source can spell.
#[derive(Debug, Clone)]
pub(crate) struct TestUnit {
    /// Folded name of the PROGRAM.
    pub(crate) symbol: Symbol,
    /// The test's name.
    pub(crate) name: String,
    /// Where that stands.
    pub(crate) span: Span,
    /// Whether it was written as a block: says which of two orders the parameters of ASSERT_NEAR have.
    pub(crate) in_suite: bool,
    /// Whether its second activation is a TEARDOWN.
    pub(crate) has_teardown: bool,
}

/// What the analysis made of a test's assertions.
#[derive(Debug, Default)]
pub(crate) struct TestFindings {
    /// The hidden variable with the number of the one that failed.
    pub(crate) failed: Option<String>,
    /// All of them.
    pub(crate) assertions: Vec<Assertion>,
}
