//! Signature sections: Ed25519 over the content hash or the debug hash.
//!
//! A section is a count (u16, 1), an algorithm (u8, 1 = Ed25519), the public key (32 bytes) and the signature (64 bytes) of the 32 bytes of
//! the hash. Whether a key is trusted is the host's business; a signature that does not fit its key and hash is refused here, always.

use ed25519_dalek::{Signature, VerifyingKey};

use super::error::ReadCode;
use super::layout::{HeaderField, Record as Fixed, Section};
use super::model::Hash;

/// Bytes of a signature section.
pub const SIGNATURE_SECTION_BYTES: usize = 2 + 1 + 32 + 64;
/// Count and algorithm.
const PREFIX: [u8; 3] = [1, 0, 1];

/// The section for a public key and its signature of [`content_hash`](super::content_hash) or [`debug_hash`](super::debug_hash).
#[must_use]
pub fn signature_section(public_key: &[u8; 32], signature: &[u8; 64]) -> Vec<u8> {
    [&PREFIX[..], public_key, signature].concat()
}

/// Holds the signatures against the hashes of the header; `Err` names the section, the rule and the reason.
pub(super) fn check_signatures(
    header: &Fixed<HeaderField>,
    content: &[u8],
    debug: &[u8],
) -> Result<(), ((Section, ReadCode), String)> {
    let content_hash = header.get_hash(HeaderField::ContentHash);
    check(content, &content_hash).map_err(|(code, reason)| ((Section::ContentSignature, code), reason))?;
    let debug_size = header.get(HeaderField::DebugSize);
    if !debug.is_empty() && debug_size == 0 {
        let reason = "a debug signature without a debug section".to_string();
        return Err(((Section::DebugSignature, ReadCode::SignatureForm), reason));
    }
    let debug_hash = header.get_hash(HeaderField::DebugHash);
    check(debug, &debug_hash).map_err(|(code, reason)| ((Section::DebugSignature, code), reason))
}

fn check(section: &[u8], hash: &Hash) -> Result<(), (ReadCode, String)> {
    if section.is_empty() {
        return Ok(());
    }
    let parts = section.split_first_chunk::<3>().and_then(|(prefix, rest)| {
        let (key, signature) = rest.split_first_chunk::<32>()?;
        let signature: &[u8; 64] = signature.try_into().ok()?;
        (*prefix == PREFIX).then_some((key, signature))
    });
    let form = || (ReadCode::SignatureForm, "this is no Ed25519 signature section".to_string());
    let (key, signature) = parts.ok_or_else(form)?;
    let wrong = |_| (ReadCode::Signature, "the signature does not belong to this hash and key".to_string());
    let key = VerifyingKey::from_bytes(key).map_err(wrong)?;
    key.verify_strict(hash, &Signature::from_bytes(signature)).map_err(wrong)
}
