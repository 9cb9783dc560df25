//! Machine code as text, for x86-64. What is no code (constants, tables of jumps) is told apart by following the code from where blocks start.

use std::collections::BTreeMap;

use iced_x86::{Decoder, DecoderOptions, FlowControl, Formatter, GasFormatter, Instruction};

/// One instruction.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Decoded {
    /// Bytes.
    pub bytes: u32,
    /// As an assembler writes it; jumps go to offsets in the function.
    pub text: String,
}

/// The instructions of a function by their offsets; `starts`: where blocks of code start.
#[must_use]
pub fn decode(code: &[u8], starts: &[u32]) -> BTreeMap<u32, Decoded> {
    let mut formatter = GasFormatter::new();
    let options = formatter.options_mut();
    options.set_space_after_operand_separator(true);
    options.set_branch_leading_zeros(false);
    options.set_uppercase_hex(false);
    options.set_small_hex_numbers_in_decimal(false);
    options.set_gas_show_mnemonic_size_suffix(true);
    options.set_rip_relative_addresses(false);
    let mut found = BTreeMap::new();
    let mut open = starts.to_vec();
    while let Some(start) = open.pop() {
        let Some(rest) = code.get(start as usize..) else { continue };
        let mut decoder = Decoder::with_ip(64, rest, u64::from(start), DecoderOptions::NONE);
        while decoder.can_decode() {
            // Offsets of a function fit into 32 bits.
            let at = decoder.ip() as u32;
            if found.contains_key(&at) {
                break;
            }
            let instruction = decoder.decode();
            if instruction.is_invalid() {
                break;
            }
            let mut text = String::new();
            formatter.format(&instruction, &mut text);
            found.insert(at, Decoded { bytes: instruction.len() as u32, text });
            if let Some(target) = target(&instruction) {
                open.push(target);
            }
            if ends(&instruction) {
                break;
            }
        }
    }
    found
}

/// Where a direct jump goes.
fn target(instruction: &Instruction) -> Option<u32> {
    match instruction.flow_control() {
        FlowControl::ConditionalBranch | FlowControl::UnconditionalBranch => {
            u32::try_from(instruction.near_branch_target()).ok()
        }
        _ => None,
    }
}

/// Whether what lies behind it is not run after it.
fn ends(instruction: &Instruction) -> bool {
    use FlowControl::{Exception, IndirectBranch, Return, UnconditionalBranch};
    matches!(instruction.flow_control(), UnconditionalBranch | IndirectBranch | Return | Exception)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_behind_a_jump_are_no_code_and_what_jumps_reach_is() {
        // jmp +2; two bytes that would be one instruction with what follows; xor eax, eax; ret; a constant.
        let code = [0xeb, 0x02, 0x48, 0xb8, 0x31, 0xc0, 0xc3, 0x00, 0x00];
        let found = decode(&code, &[0]);
        let texts: Vec<(u32, &str)> = found.iter().map(|(at, decoded)| (*at, decoded.text.as_str())).collect();
        assert_eq!(texts, [(0, "jmp 0x4"), (4, "xorl %eax, %eax"), (6, "retq")]);
    }

    #[test]
    fn what_is_cut_short_ends_the_listing() {
        assert!(decode(&[0x48, 0xb8, 0x01], &[0, 7]).is_empty());
    }
}
