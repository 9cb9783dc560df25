//! Text, containers and files that must come back as they were: formatted, written and read, as assembly text and without names.

use std::sync::Arc;

use super::engines;
use crate::campaign::Figures;
use crate::round_trip::{Rounds, through_bytes, through_text, without_names};
use crate::st::generate;
use crate::st::print::print;
use khz_bytecode::container::{self, Container};
use khz_bytecode::verify::verify;
use khz_frontend::diagnostics::has_errors;
use khz_frontend::format::{FormatOptions, KeywordCase, format};
use khz_frontend::syntax::lexer::{TokenKind, lex};
use khz_frontend::{CompileOptions, SourceInput};

const ROUNDS: Rounds = Rounds { count: 4, seed: 7, fuel: 200_000, image_limit_bytes: 1 << 22 };

/// The containers of a text; none when it is refused.
#[must_use]
pub fn compile(text: &str) -> Option<Vec<Container>> {
    let input = SourceInput { name: "a.st".to_string(), bytes: text.as_bytes().to_vec() };
    let compilation = khz_frontend::compile(&[input], &CompileOptions::default());
    if has_errors(&compilation.diagnostics) {
        return None;
    }
    Some(compilation.resources.into_iter().map(|resource| resource.container).collect())
}

/// What engines see of a program: all sections but the debug section, and nothing of the text itself.
fn content(containers: &[Container]) -> Vec<Result<Vec<u8>, String>> {
    let bytes = |container: &Container| {
        let mut bare = container.clone();
        container::strip(&mut bare);
        bare.source_hash = Default::default();
        container::write(&bare).map_err(|error| error.to_string())
    };
    containers.iter().map(bytes).collect()
}

/// Everything that holds for any sound container. Stripping is looked at in the first `engines` engines.
///
/// # Errors
/// What does not come back as it was.
pub fn check_container(container: &Container, engines: usize) -> Result<(), String> {
    through_bytes(container)?;
    through_text(container)?;
    let mut stripped = container.clone();
    container::strip(&mut stripped);
    through_bytes(&stripped)?;
    through_text(&stripped)?;
    let verified = Arc::new(verify(container.clone()).map_err(|error| error.to_string())?);
    without_names(&verified, &engines::makers()[..engines], &ROUNDS)
}

/// What formatting may not change: the tokens, comments and pragmas among them, but for the case of words and white space inside of comments. The formatter makes sure
/// of that itself; this is the second reading.
fn tokens(text: &str) -> Vec<(TokenKind, String)> {
    let tokens = lex(text).into_iter().map(|token| {
        let words = text.get(token.start as usize..token.end as usize).unwrap_or_default();
        let words = match token.kind {
            TokenKind::Keyword(_) | TokenKind::Ident => words.to_ascii_uppercase(),
            TokenKind::Comment | TokenKind::Pragma => words.split_whitespace().collect::<Vec<_>>().join(" "),
            _ => words.to_string(),
        };
        (token.kind, words)
    });
    tokens.collect()
}

/// Formats a text in several ways: each has the same tokens, is its own formatting and compiles to the same content. How many differ from the text; none: it
/// does not compile.
///
/// # Errors
/// What formatting changes.
pub fn check_format(text: &str) -> Result<Option<usize>, String> {
    let Some(before) = compile(text) else { return Ok(None) };
    let all_options = [
        FormatOptions::default(),
        FormatOptions { width: 40, ..FormatOptions::default() },
        FormatOptions { width: 0, indent: 3, keywords: KeywordCase::Keep },
    ];
    let mut changed = 0;
    for options in &all_options {
        let once = format(text, options).map_err(|error| format!("{error:?}"))?;
        let twice = format(&once, options).map_err(|error| format!("{error:?}"))?;
        if once != twice {
            return Err(format!("formatting the formatted text changes it\n{once}\n=====\n{twice}"));
        }
        if tokens(&once) != tokens(text) {
            return Err(format!("the formatted text has other tokens\n{once}"));
        }
        let after = compile(&once).ok_or_else(|| format!("the formatted text is refused\n{once}"))?;
        if content(&after) != content(&before) {
            return Err(format!("the formatted text means something else\n{once}"));
        }
        changed += usize::from(once != text);
    }
    Ok(Some(changed))
}

/// What a search reached.
#[derive(Debug, Default)]
pub struct Tally {
    /// Generated texts that were formatted.
    pub texts: u64,
    /// Formatted texts that are not the text that they were made of.
    pub changed: u64,
    /// Compiled and generated containers that were written, read and run.
    pub containers: u64,
}

impl Figures for Tally {
    fn merge(&mut self, later: Self) {
        self.texts += later.texts;
        self.changed += later.changed;
        self.containers += later.containers;
    }
}

/// The generated text of a seed and what it compiles to, and the generated container of the seed; what is wrong with them.
pub fn check_seed(seed: u64, tally: &mut Tally) -> Option<String> {
    let look = |tally: &mut Tally| {
        let text = print(&generate(seed));
        let changed = check_format(&text)?.ok_or("the text is refused")?;
        tally.texts += 1;
        tally.changed += changed as u64;
        let generated = crate::bytecode::generate(seed);
        for container in compile(&text).unwrap_or_default().iter().chain([generated.container()]) {
            check_container(container, engines::makers().len())?;
            tally.containers += 1;
        }
        Ok(())
    };
    look(tally).err().map(|what: String| format!("seed {seed}: {what}"))
}
