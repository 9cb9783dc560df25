//! The mid-level form as text, for `khz disasm --mir` and for the tests of the passes.

use std::fmt::{self, Display, Formatter, Write};

use super::{
    Access, Address, Base, BlockData, Const, Control, ForTest, Function, Instruction, Op, Operands, Place, Slot,
    Target, Terminator, Type, Value,
};

impl Display for Type {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Type::I32 => "i32",
            Type::I64 => "i64",
            Type::F32 => "f32",
            Type::F64 => "f64",
            Type::Ref => "ref",
            Type::F32x4 => "f32x4",
            Type::F64x2 => "f64x2",
        })
    }
}

impl Display for Const {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Const::I32(value) => write!(f, "i32 {value}"),
            Const::I64(value) => write!(f, "i64 {value}"),
            Const::F32(bits) => write!(f, "f32 {:?}", f32::from_bits(*bits)),
            Const::F64(bits) => write!(f, "f64 {:?}", f64::from_bits(*bits)),
        }
    }
}

impl Display for Address {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.base {
            Base::Image => f.write_str("[image")?,
            Base::Value(value) => write!(f, "[{value}")?,
        }
        if self.displacement != 0 {
            write!(f, " {:+}", self.displacement)?;
        }
        if let Some((value, stride)) = self.index {
            write!(f, " + {value} * {stride}")?;
        }
        f.write_char(']')
    }
}

impl Display for Slot {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.place, self.index)
    }
}

impl Display for Access {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.storage)?;
        f.write_str(if self.canonicalise || self.normalise { ".foreign" } else { "" })
    }
}

fn list(f: &mut Formatter<'_>, values: &[Value]) -> fmt::Result {
    for (position, value) in values.iter().enumerate() {
        write!(f, "{}{value}", if position == 0 { "" } else { ", " })?;
    }
    Ok(())
}

impl Display for Target {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.block)?;
        if !self.arguments.is_empty() {
            f.write_char('(')?;
            list(f, &self.arguments)?;
            f.write_char(')')?;
        }
        Ok(())
    }
}

impl Display for ForTest {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} to {} by {}", self.ty, self.control, self.bound, self.step)?;
        f.write_str(if self.not_passed { " proven" } else { "" })
    }
}

impl Display for Op {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Op::Const(value) => value.fmt(f),
            Op::Numeric(op, operands) => {
                let operands: &Operands = operands;
                write!(f, "{} ", op.mnemonic())?;
                list(f, &operands[..op.operands().len().min(2)])
            }
            Op::Select { condition, then, otherwise } => write!(f, "select {condition} ? {then} : {otherwise}"),
            Op::Get(var) => write!(f, "get {var}"),
            Op::Set(var, value) => write!(f, "set {var}, {value}"),
            Op::Splat(value) => write!(f, "splat {value}"),
            Op::Lane(value, lane) => write!(f, "lane {value}.{lane}"),
            Op::Ramp { first, growth } => write!(f, "ramp {first} by {growth}"),
            Op::LoadSlot(slot, access) => write!(f, "slot.load {slot} {access}"),
            Op::StoreSlot(slot, access, value) => write!(f, "slot.store {slot} {access}, {value}"),
            Op::Load(address, access) => write!(f, "load {access} {address}"),
            Op::Store(address, access, value) => write!(f, "store {access} {address}, {value}"),
            Op::LoadBit(address, bit) => write!(f, "load.bit {address}.{bit}"),
            Op::StoreBit(address, bit, value) => write!(f, "store.bit {address}.{bit}, {value}"),
            Op::Reference(address) => write!(f, "ref {address}"),
            Op::RefToInt(value) => write!(f, "ref.to_int {value}"),
            Op::RefCheck { offset, size, write } => {
                write!(f, "ref.check {offset} size {size}{}", if *write { " write" } else { "" })
            }
            Op::CheckIndex { index, lower, upper } => write!(f, "check.index {index} in {lower}..={upper}"),
            Op::CheckRange { value, ty, lower, upper } => write!(f, "check.range {ty} {value} in {lower}..={upper}"),
            Op::CheckDivisor(value) => write!(f, "check.divisor {value}"),
            Op::CheckStep(value) => write!(f, "check.step {value}"),
            Op::ForIsEmpty(test) => write!(f, "for.is_empty {test}"),
            Op::ForContinues(test) => write!(f, "for.continues {test}"),
            Op::Helper(op, capacities, values) => {
                write!(f, "{}", op.mnemonic())?;
                for capacity in &capacities[..op.capacity_count()] {
                    write!(f, " {capacity}")?;
                }
                f.write_str(" (")?;
                list(f, values)?;
                f.write_char(')')
            }
            Op::Copy { destination, source, size } => write!(f, "copy {destination}, {source}, {size}"),
            Op::Zero(address, size) => write!(f, "zero {address}, {size}"),
            Op::Call(function, values) => {
                write!(f, "call f{function}(")?;
                list(f, values)?;
                f.write_char(')')
            }
            Op::CallVirtual(method, values) => {
                write!(f, "call.virtual m{method}(")?;
                list(f, values)?;
                f.write_char(')')
            }
            Op::Part(number, values) => {
                write!(f, "part {number}(")?;
                list(f, values)?;
                f.write_char(')')
            }
            Op::Checkpoint { fuel, deadline } => {
                write!(f, "checkpoint fuel {fuel}{}", if *deadline { "" } else { " no deadline" })
            }
        }
    }
}

impl Display for Terminator {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Terminator::Jump(target) => write!(f, "jump {target}"),
            Terminator::Branch { condition, then, otherwise } => write!(f, "branch {condition} ? {then} : {otherwise}"),
            Terminator::Switch { value, targets, default } => {
                write!(f, "switch {value} [")?;
                for target in targets {
                    write!(f, "{target} ")?;
                }
                write!(f, "else {default}]")
            }
            Terminator::Return(values) => {
                f.write_str("return ")?;
                list(f, values)
            }
        }
    }
}

impl Function {
    fn write_instruction(&self, f: &mut Formatter<'_>, instruction: &Instruction) -> fmt::Result {
        f.write_str("  ")?;
        for (position, value) in instruction.results.as_slice().iter().enumerate() {
            write!(f, "{}{value}:{}", if position == 0 { "" } else { ", " }, self.ty(*value))?;
        }
        if !instruction.results.as_slice().is_empty() {
            f.write_str(" = ")?;
        }
        writeln!(f, "{}", instruction.op)
    }

    fn write_block_head(&self, f: &mut Formatter<'_>, number: usize, block: &BlockData) -> fmt::Result {
        write!(f, "b{number}(")?;
        for (position, value) in block.parameters.iter().enumerate() {
            write!(f, "{}{value}:{}", if position == 0 { "" } else { ", " }, self.ty(*value))?;
        }
        f.write_char(')')?;
        if let Some(id) = block.innermost_loop {
            write!(f, " in {id}")?;
        }
        if block.write_back.0 != 0 {
            write!(f, " traps {}", block.write_back)?;
        }
        f.write_str(":\n")
    }

    fn write_loops(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for (number, data) in self.loops.iter().enumerate() {
            write!(f, "loop{number}: header {}", data.header)?;
            if let Some(parent) = data.parent {
                write!(f, " in {parent}")?;
            }
            if let Some(counted) = data.counted {
                let control = match counted.control {
                    Control::Var(var) => var.to_string(),
                    Control::Slot(slot) => slot.to_string(),
                    Control::Memory => "memory".into(),
                };
                write!(
                    f,
                    " counts {} {control} from {} to {} by {}",
                    counted.ty, counted.initial, counted.bound, counted.step
                )?;
            }
            f.write_char('\n')?;
        }
        Ok(())
    }
}

/// A function as text, with what `lines` says of each place: a line of its own where it changes.
struct Listing<'a> {
    function: &'a Function,
    lines: &'a dyn Fn(Place) -> Option<String>,
}

impl Display for Listing<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.function.write(f, self.lines)
    }
}

impl Display for Function {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.write(f, &|_| None)
    }
}

impl Function {
    /// As text with source lines: `lines` gives the line of a place.
    #[must_use]
    pub fn text(&self, lines: &dyn Fn(Place) -> Option<String>) -> String {
        Listing { function: self, lines }.to_string()
    }

    fn write(&self, f: &mut Formatter<'_>, lines: &dyn Fn(Place) -> Option<String>) -> fmt::Result {
        let mut last = None;
        writeln!(f, "function f{}", self.id)?;
        self.write_loops(f)?;
        for (number, dirty) in self.write_backs.iter().enumerate().skip(1) {
            write!(f, "w{number}:")?;
            for one in dirty {
                write!(f, " {}->{}", one.var, one.slot)?;
            }
            f.write_char('\n')?;
        }
        for (number, block) in self.blocks.iter().enumerate() {
            self.write_block_head(f, number, block)?;
            for instruction in &block.instructions {
                let line = lines(instruction.place);
                if line.is_some() && line != last {
                    writeln!(f, "  ; {}", line.as_deref().unwrap_or_default())?;
                    last = line;
                }
                self.write_instruction(f, instruction)?;
            }
            writeln!(f, "  {}", block.terminator)?;
        }
        Ok(())
    }
}
