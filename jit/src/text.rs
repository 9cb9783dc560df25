//! What `khz disasm` prints: the mid-level form, CLIF and machine code, each beside the source lines it comes from.
