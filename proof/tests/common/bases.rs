//! The programs of this repository, as what mutants are made of.
#![allow(dead_code, reason = "each user takes its part")]

use std::path::PathBuf;

use ed25519_dalek::{Signer, SigningKey};
use khz_bytecode::assembler::assemble;
use khz_bytecode::container::{Container, content_hash, debug_hash, signature_section, strip};
use khz_frontend::{CompileOptions, SourceInput, compile};
use khz_proof::bytecode::generate;
use khz_proof::harness::programs::{PROGRAMS, files, root};
use khz_proof::mutate::Pool;
use khz_proof::st;

/// The Structured Text of the repository and of further folders, and `generated` programs of the generator.
pub fn texts(generated: u64, further: &[PathBuf]) -> Vec<Vec<u8>> {
    let own = PROGRAMS.map(|folder| root().join(folder));
    let paths = own.iter().chain(further).flat_map(|folder| files(folder, &["st"]));
    let texts = paths.map(|path| std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())));
    texts.chain((0..generated).map(|seed| st::print::print(&st::generate(seed)).into_bytes())).collect()
}

/// Signs what a container says, and what its debug section says when it has one.
fn sign(container: &mut Container) {
    let key = SigningKey::from_bytes(&[7; 32]);
    let section = |hash: &[u8; 32]| signature_section(key.verifying_key().as_bytes(), &key.sign(hash).to_bytes());
    container.content_signature = section(&content_hash(container).expect("a container that can be written"));
    if container.debug.is_some() {
        container.debug_signature = section(&debug_hash(container).expect("a container that can be written"));
    }
}

/// Containers of all sizes, one in eight of the compiled ones signed: `generated` ones, the assembly texts of the tests, and the programs among the texts, every other one stripped.
pub fn pool(generated: u64, texts: &[Vec<u8>]) -> Pool {
    let assembly =
        ["tests/bytecode", "bytecode/tests/verifier"].map(|folder| files(&root().join(folder), &["kasm", "khza"]));
    let is_sound = |path: &&PathBuf| !path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('v'));
    let assembled = assembly.iter().flatten().filter(is_sound).map(|path| {
        let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        assemble(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
    });
    let compiled = texts.iter().enumerate().flat_map(|(number, text)| {
        let source = SourceInput { name: "base.st".into(), bytes: text.clone() };
        let resources = compile(&[source], &CompileOptions::default()).resources;
        resources.into_iter().map(move |resource| {
            let mut container: Container = resource.container;
            if number % 2 == 0 {
                strip(&mut container);
            }
            // Of stripped and whole ones as many.
            if number % 16 < 2 {
                sign(&mut container);
            }
            container
        })
    });
    let generated = (0..generated).map(|seed| generate(seed).container().clone());
    Pool::new(assembled.chain(compiled).chain(generated))
}
