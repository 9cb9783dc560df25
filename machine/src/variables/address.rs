//! Direct addresses of IEC 61131-3, clause 6.5.5 (table 16): `%IX0.1`, `%QW2`, `%MD4`.

use khz_bytecode::container::{DebugPlace, ElementaryType};
use khz_bytecode::value::BytePlace;

/// A direct address: where it points, and the bit string type of its width.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DirectAddress {
    /// `Bit` for width X, else `Bytes`, in %I, %Q or %M.
    pub place: DebugPlace,
    /// BOOL, BYTE, WORD, DWORD or LWORD.
    pub ty: ElementaryType,
}

impl DirectAddress {
    /// Reads an address, in any case. The number counts units of the width, as in CODESYS: `%QW2` is bytes 4 and 5; X and no width take `byte.bit`.
    #[must_use]
    pub fn parse(text: &str) -> Option<DirectAddress> {
        let mut rest = text.strip_prefix('%')?.chars();
        let place = match rest.next()?.to_ascii_uppercase() {
            'I' => BytePlace::Input,
            'Q' => BytePlace::Output,
            'M' => BytePlace::Memory,
            _ => return None,
        };
        let number = rest.as_str();
        let width = rest.next()?.to_ascii_uppercase();
        let ty = match width {
            'B' => ElementaryType::Byte,
            'W' => ElementaryType::Word,
            'D' => ElementaryType::Dword,
            'L' => ElementaryType::Lword,
            'X' => return Self::bit(place, rest.as_str()),
            _ => return Self::bit(place, number),
        };
        let offset = decimal(rest.as_str())?.checked_mul(ty.storage().bytes())?;
        Some(DirectAddress { place: DebugPlace::Bytes(place, offset), ty })
    }

    fn bit(place: BytePlace, number: &str) -> Option<DirectAddress> {
        let (byte, bit) = number.split_once('.')?;
        let bit = decimal(bit).filter(|bit| *bit < 8)?;
        Some(DirectAddress { place: DebugPlace::Bit(place, decimal(byte)?, bit as u8), ty: ElementaryType::Bool })
    }
}

/// Digits only: `parse` alone would take a sign.
fn decimal(text: &str) -> Option<u32> {
    text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse().ok()).flatten()
}
