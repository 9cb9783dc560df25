//! Unit tests, in both notations: `TEST 'name' … END_TEST` with SETUP and TEARDOWN, and `TEST_PROGRAM name … END_TEST_PROGRAM`.
//!
//! They stand beside the declarations and not among them: only `khz test` looks at them, to every other build a file's tests are
//! as good as comments. Within a test, MOCK and MOCK_FUNCTION are statements of their own form; in the tree they are calls of
//! `MOCK(instance)` and `MOCK_FUNCTION(f, value)`, like the assertions, and mean something in a test only.

use super::{Block, Ident, VarSection};
use crate::source::Span;

/// The tests of one file.
#[derive(Clone, Debug, Default)]
pub struct TestSuite {
    /// Runs before each test in blocks; its variables are theirs too.
    pub setup: Option<TestPart>,
    /// Runs after each test in blocks.
    pub teardown: Option<TestPart>,
    /// The tests in order.
    pub tests: Vec<Test>,
    /// Whether an instance is mocked anywhere.
    pub mocks: bool,
    /// The functions that are mocked, once for each time.
    pub mocked_functions: Vec<Ident>,
}

/// Variables and statements.
#[derive(Clone, Debug)]
pub struct TestPart {
    /// Its variables.
    pub sections: Vec<VarSection>,
    /// Its statements.
    pub body: Block,
    /// From its first word to its last.
    pub span: Span,
}

/// A unit test.
#[derive(Clone, Debug)]
pub struct Test {
    /// Its name as people read it.
    pub name: String,
    /// Where its name stands.
    pub name_span: Span,
    /// Whether SETUP and TEARDOWN of its file belong to it: it was written as a block.
    pub in_suite: bool,
    /// What it does.
    pub part: TestPart,
}
