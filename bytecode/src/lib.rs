//! Instruction set, container format, verifier, assembler and disassembler of Kilohertz.
