//! What only the tree knows about the tokens.

use crate::syntax::ast::{Ast, Block, Configuration, Declaration, Ident, Pou, StmtKind, TestSuite};

/// Places that lines begin or end at, by offset.
#[derive(Default)]
pub(super) struct Outline {
    /// Where the head of a POU, configuration or resource ends, sorted.
    head_ends: Vec<u32>,
    /// Where arms of CASE begin, sorted; whether the arm is one simple statement.
    arms: Vec<(u32, bool)>,
}

impl Outline {
    /// The outline of a tree without holes.
    pub fn new(ast: &Ast) -> Self {
        let mut outline = Self::default();
        for declaration in ast.declarations() {
            match declaration {
                Declaration::Pou(pou) => outline.pou(pou),
                Declaration::Configuration(configuration) => outline.configuration(configuration),
                Declaration::Type(_) | Declaration::Globals(_) => {}
            }
        }
        for file in &ast.files {
            outline.tests(&file.tests);
        }
        outline.head_ends.sort_unstable();
        outline.arms.sort_unstable();
        outline
    }

    /// Whether the head of a POU, configuration or resource ends with the token that ends at this offset.
    pub fn is_head_end(&self, end: u32) -> bool {
        self.head_ends.binary_search(&end).is_ok()
    }

    /// If an arm of a CASE begins with the token at this offset: whether the arm is one simple statement.
    pub fn arm(&self, start: u32) -> Option<bool> {
        let at = self.arms.binary_search_by_key(&start, |arm| arm.0).ok()?;
        self.arms.get(at).map(|arm| arm.1)
    }

    fn pou(&mut self, pou: &Pou) {
        self.head_ends.push(pou.result.as_ref().map_or(pou.name.span.end, |result| result.span.end));
        self.blocks(&pou.body);
    }

    /// The heads of tests are their name or, of SETUP and TEARDOWN, their word, which the tree does not place.
    fn tests(&mut self, tests: &TestSuite) {
        for test in &tests.tests {
            self.head_ends.push(test.name_span.end);
            self.blocks(&test.part.body);
        }
        for part in tests.setup.iter().chain(&tests.teardown) {
            self.blocks(&part.body);
        }
    }

    fn configuration(&mut self, configuration: &Configuration) {
        self.head_ends.push(configuration.name.span.end);
        // Tasks that stand directly in the configuration are in a resource without a name, which has no head.
        let names = configuration
            .resources
            .iter()
            .filter_map(|resource| resource.processor.as_ref().or(resource.name.as_ref()));
        self.head_ends.extend(names.map(|name: &Ident| name.span.end));
    }

    /// The arms of all CASE statements in a block, at any depth.
    fn blocks(&mut self, body: &Block) {
        let mut open = vec![body];
        while let Some(block) = open.pop() {
            for stmt in &block.statements {
                match &stmt.kind {
                    StmtKind::If { branches, otherwise } => {
                        open.extend(branches.iter().map(|branch| &branch.body));
                        open.extend(otherwise);
                    }
                    StmtKind::Case { arms, otherwise, .. } => {
                        for arm in arms {
                            self.arms.push((arm.span.start, is_simple(&arm.body)));
                            open.push(&arm.body);
                        }
                        open.extend(otherwise);
                    }
                    StmtKind::For { body, .. } | StmtKind::While { body, .. } | StmtKind::Repeat { body, .. } => {
                        open.push(body);
                    }
                    _ => {}
                }
            }
        }
    }
}

/// Whether a block is one statement without statements in it.
fn is_simple(block: &Block) -> bool {
    let [only] = block.statements.as_slice() else { return false };
    !matches!(
        only.kind,
        StmtKind::If { .. }
            | StmtKind::Case { .. }
            | StmtKind::For { .. }
            | StmtKind::While { .. }
            | StmtKind::Repeat { .. }
    )
}
