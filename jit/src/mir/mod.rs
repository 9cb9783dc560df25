//! The mid-level form: what stands between bytecode and CLIF.
//!
//! A function is a graph of blocks over the loop tree. *Values* are defined once, by an instruction or as a block parameter, and may be
//! used wherever their definition dominates. *Variables* may be assigned any number of times: `L` slots, and slots that
//! [promotion](crate::passes::promote) took out of memory; the lowering turns them into SSA form. Memory is reached only by
//! instructions that say where, in which storage and in which alias region.
//!
//! Everything that may trap is an explicit guard that names its place in the bytecode (with the chain of inlined calls around it). A block
//! names the *write-back* that a trap in it owes to memory, so that promotion needs no edges of its own.

mod print;

use khz_bytecode::ids::{FunctionId, MethodId, SlotIndex};
use khz_bytecode::instruction::{HelperOp, MAX_CAPACITIES, NumericOp};
use khz_bytecode::value::{IntegerType, SlotPlace, Storage, ValueType};

macro_rules! indices {
    ($($(#[$doc:meta])* $name:ident $prefix:literal;)*) => { $(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);

        impl $name {
            /// As an index into its table.
            #[must_use]
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, concat!($prefix, "{}"), self.0)
            }
        }
    )* };
}

indices! {
    /// A value: position in [`Function::values`].
    Value "v";
    /// A variable: position in [`Function::variables`].
    Var "x";
    /// A block: position in [`Function::blocks`].
    Block "b";
    /// A loop: position in [`Function::loops`].
    LoopId "loop";
    /// A place in bytecode: position in [`Function::places`].
    Place "@";
    /// A write-back: position in [`Function::write_backs`]; 0 writes nothing.
    WriteBack "w";
}

/// Type of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Type {
    /// 32 bits.
    I32,
    /// 64 bits.
    I64,
    /// REAL.
    F32,
    /// LREAL.
    F64,
    /// A verified reference: the address in this process of something inside the image. Never stored in the image.
    Ref,
    /// Four REALs.
    F32x4,
    /// Two LREALs.
    F64x2,
}

impl From<ValueType> for Type {
    fn from(ty: ValueType) -> Type {
        match ty {
            ValueType::I32 => Type::I32,
            ValueType::I64 => Type::I64,
            ValueType::F32 => Type::F32,
            ValueType::F64 => Type::F64,
        }
    }
}

/// A constant, floats as their bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Const {
    /// 32 bits.
    I32(i32),
    /// 64 bits.
    I64(i64),
    /// Bits of a REAL.
    F32(u32),
    /// Bits of an LREAL.
    F64(u64),
}

impl Const {
    /// Its type.
    #[must_use]
    pub fn ty(self) -> Type {
        match self {
            Const::I32(_) => Type::I32,
            Const::I64(_) => Type::I64,
            Const::F32(_) => Type::F32,
            Const::F64(_) => Type::F64,
        }
    }

    /// Its bits, zero-extended: the form in which `khz_machine` takes operands.
    #[must_use]
    pub fn bits(self) -> u64 {
        match self {
            Const::I32(value) => u64::from(value as u32),
            Const::I64(value) => value as u64,
            Const::F32(bits) => u64::from(bits),
            Const::F64(bits) => bits,
        }
    }

    /// The constant of a type with these bits; the upper half is dropped where the type has none.
    #[must_use]
    pub fn from_bits(ty: ValueType, bits: u64) -> Const {
        match ty {
            ValueType::I32 => Const::I32(bits as i32),
            ValueType::I64 => Const::I64(bits as i64),
            ValueType::F32 => Const::F32(bits as u32),
            ValueType::F64 => Const::F64(bits),
        }
    }

    /// As a signed number, if it is an integer.
    #[must_use]
    pub fn as_i64(self) -> Option<i64> {
        match self {
            Const::I32(value) => Some(i64::from(value)),
            Const::I64(value) => Some(value),
            Const::F32(_) | Const::F64(_) => None,
        }
    }
}

/// What an address counts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Base {
    /// The image's first byte.
    Image,
    /// A reference, the call's frame, or the program's memory (all of type [`Type::Ref`]).
    Value(Value),
}

/// Where something lies: base + displacement + index × stride.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Address {
    /// What it counts from.
    pub base: Base,
    /// Bytes added.
    pub displacement: i64,
    /// An i64 value and how many bytes one of it counts.
    pub index: Option<(Value, u32)>,
}

/// Which memory an access may meet. Accesses of different regions never meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Region {
    /// Slots; nothing else ever points there.
    Slots,
    /// Data region, frame bytes, %M, %Q, %I, and whatever a reference points to.
    Bytes,
}

/// How memory is accessed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Access {
    /// Width and extension.
    pub storage: Storage,
    /// Whether a loaded float may be another NaN than the one, and is made the one.
    pub canonicalise: bool,
    /// Whether a loaded BOOL may be another byte than 0 or 1, and is made 0 or 1.
    pub normalise: bool,
    /// What it may meet.
    pub region: Region,
}

/// A slot outside the call's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Slot {
    /// `Global` or `Program`.
    pub place: SlotPlace,
    /// Which.
    pub index: SlotIndex,
}

/// Operands of a numeric instruction; the second repeats the first where there is only one.
pub type Operands = [Value; 2];

/// What an instruction does.
#[derive(Debug, Clone, PartialEq)]
pub enum Op {
    /// A constant.
    Const(Const),
    /// A pure operation; floats may be vectors, lane by lane. Divisions are guarded by a [`Op::CheckDivisor`] before them and never trap.
    Numeric(NumericOp, Operands),
    /// a if c is not zero, else b.
    Select {
        /// i32.
        condition: Value,
        /// When it is not zero.
        then: Value,
        /// When it is zero.
        otherwise: Value,
    },
    /// A float in every lane of a vector.
    Splat(Value),
    /// One lane of a vector.
    Lane(Value, u8),
    /// A vector of floats: an i32, and in each further lane `growth` more, converted.
    Ramp {
        /// i32.
        first: Value,
        /// From lane to lane.
        growth: i32,
    },
    /// Reads a variable.
    Get(Var),
    /// Assigns a variable.
    Set(Var, Value),
    /// Reads a slot.
    LoadSlot(Slot, Access),
    /// Writes a slot.
    StoreSlot(Slot, Access, Value),
    /// Reads memory.
    Load(Address, Access),
    /// Writes memory.
    Store(Address, Access, Value),
    /// Reads one bit of a byte.
    LoadBit(Address, u8),
    /// Writes one bit (value <> 0) of a byte.
    StoreBit(Address, u8, Value),
    /// An address as a reference.
    Reference(Address),
    /// Offset of a reference from the data region's start.
    RefToInt(Value),
    /// Makes a reference of such an offset; traps unless `size` bytes from there lie in what may be accessed.
    RefCheck {
        /// i64.
        offset: Value,
        /// Bytes of the target.
        size: u32,
        /// Whether it will be written through.
        write: bool,
    },
    /// Traps unless lower ≤ index ≤ upper.
    CheckIndex {
        /// i32.
        index: Value,
        /// Lower bound.
        lower: i32,
        /// Upper bound.
        upper: i32,
    },
    /// Traps unless lower ≤ value ≤ upper in the order of the type.
    CheckRange {
        /// i32 or i64, as the type says.
        value: Value,
        /// Order.
        ty: IntegerType,
        /// Lower bound; an unsigned 64-bit one as its bit pattern.
        lower: i64,
        /// Upper bound.
        upper: i64,
    },
    /// Traps if the divisor is zero.
    CheckDivisor(Value),
    /// Traps if the step of a FOR loop is zero.
    CheckStep(Value),
    /// 1 when a FOR loop makes no pass at all.
    ForIsEmpty(ForTest),
    /// 1 when a FOR loop makes another pass, asked with the control variable before the step is added.
    ForContinues(ForTest),
    /// Works on strings.
    Helper(HelperOp, [u16; MAX_CAPACITIES], Vec<Value>),
    /// Moves bytes; the extents may overlap.
    Copy {
        /// Destination.
        destination: Address,
        /// Source.
        source: Address,
        /// How many bytes.
        size: u32,
    },
    /// Zeroes bytes.
    Zero(Address, u32),
    /// A direct call: `this` first where the function has one.
    Call(FunctionId, Vec<Value>),
    /// A call through the instance map: the address as an i64, then the arguments.
    CallVirtual(MethodId, Vec<Value>),
    /// Runs a part that [was cut out](crate::cut) of this function, on the same frame: the values that it takes.
    Part(u32, Vec<Value>),
    /// Deadline, then fuel: at a function's entry and at a loop's header.
    Checkpoint {
        /// Units charged where fuel is accounted for.
        fuel: u32,
        /// Whether the deadline is looked at.
        deadline: bool,
    },
}

/// What a FOR loop's tests compare.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ForTest {
    /// Order of the control variable.
    pub ty: IntegerType,
    /// Control variable.
    pub control: Value,
    /// Bound.
    pub bound: Value,
    /// Step, signed.
    pub step: Value,
    /// Whether the control variable is known not to have passed the bound.
    pub not_passed: bool,
}

/// One instruction.
#[derive(Debug, Clone, PartialEq)]
pub struct Instruction {
    /// What it does.
    pub op: Op,
    /// What it defines.
    pub results: Results,
    /// Where it stands in the bytecode.
    pub place: Place,
}

/// Values that an instruction defines. Only calls define more than one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Results {
    /// Nothing.
    None,
    /// One value.
    One(Value),
    /// Results of a call.
    Many(Vec<Value>),
}

impl Results {
    /// As a list.
    #[must_use]
    pub fn as_slice(&self) -> &[Value] {
        match self {
            Results::None => &[],
            Results::One(value) => std::slice::from_ref(value),
            Results::Many(values) => values,
        }
    }
}

/// A block to go to, with the values of its parameters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Target {
    /// Which block.
    pub block: Block,
    /// One for each of its parameters.
    pub arguments: Vec<Value>,
}

/// How a block ends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Terminator {
    /// Goes on.
    Jump(Target),
    /// Goes one of two ways.
    Branch {
        /// i32.
        condition: Value,
        /// When it is not zero.
        then: Target,
        /// When it is zero.
        otherwise: Target,
    },
    /// Goes to the target with the number of the value (unsigned), or to the default.
    Switch {
        /// i32.
        value: Value,
        /// Targets from 0 on.
        targets: Vec<Target>,
        /// Where there is no target.
        default: Target,
    },
    /// Ends the call.
    Return(Vec<Value>),
}

impl Terminator {
    /// Where it may go.
    #[must_use]
    pub fn targets(&self) -> Vec<&Target> {
        match self {
            Terminator::Jump(target) => vec![target],
            Terminator::Branch { then, otherwise, .. } => vec![then, otherwise],
            Terminator::Switch { targets, default, .. } => targets.iter().chain([default]).collect(),
            Terminator::Return(_) => Vec::new(),
        }
    }

    /// Calls `f` with every value that it reads.
    pub fn for_each_operand(&mut self, mut f: impl FnMut(&mut Value)) {
        match self {
            Terminator::Branch { condition, .. } => f(condition),
            Terminator::Switch { value, .. } => f(value),
            Terminator::Return(values) => values.iter_mut().for_each(&mut f),
            Terminator::Jump(_) => {}
        }
        for target in self.targets_mut() {
            target.arguments.iter_mut().for_each(&mut f);
        }
    }

    /// Where it may go.
    pub fn targets_mut(&mut self) -> Vec<&mut Target> {
        match self {
            Terminator::Jump(target) => vec![target],
            Terminator::Branch { then, otherwise, .. } => vec![then, otherwise],
            Terminator::Switch { targets, default, .. } => targets.iter_mut().chain([default]).collect(),
            Terminator::Return(_) => Vec::new(),
        }
    }
}

/// A run of instructions that is entered only at its start.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockData {
    /// Values that each way in supplies.
    pub parameters: Vec<Value>,
    /// In order.
    pub instructions: Vec<Instruction>,
    /// How it ends.
    pub terminator: Terminator,
    /// Innermost loop.
    pub innermost_loop: Option<LoopId>,
    /// What a trap in this block owes to memory.
    pub write_back: WriteBack,
}

/// A loop.
#[derive(Debug, Clone, PartialEq)]
pub struct LoopData {
    /// The only block that is entered from outside.
    pub header: Block,
    /// The loop around it.
    pub parent: Option<LoopId>,
    /// For a FOR loop whose control variable nothing else writes: what is known of it.
    pub counted: Option<Counted>,
}

/// A FOR loop in which only `for.enter` and `for.next` write the control variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Counted {
    /// Order and width of the control variable.
    pub ty: IntegerType,
    /// Control variable, when it is a slot outside the call's own.
    pub control: Control,
    /// Its first value, as `for.enter` stored it.
    pub initial: Value,
    /// Bound.
    pub bound: Value,
    /// Step.
    pub step: Value,
}

/// Where a control variable lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// A variable.
    Var(Var),
    /// A slot.
    Slot(Slot),
    /// Bytes in memory: nothing is derived from it.
    Memory,
}

/// A place in bytecode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlaceData {
    /// Function whose bytecode it is.
    pub function: FunctionId,
    /// Byte offset of the instruction.
    pub offset: u32,
    /// The call that was inlined around it.
    pub caller: Option<Place>,
}

/// A variable and the slot whose newest value it holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dirty {
    /// Holds the value.
    pub var: Var,
    /// Where it belongs.
    pub slot: Slot,
    /// How it is stored.
    pub access: Access,
}

/// A function in the mid-level form. Block 0 is the entry; its parameters are the function's: frame first, then program slots and
/// data block (shared code of a program type only), then `this` (functions of a block type only), then the declared ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Function {
    /// Which function.
    pub id: FunctionId,
    /// Types of all values.
    pub values: Vec<Type>,
    /// Types of all variables.
    pub variables: Vec<Type>,
    /// All blocks, in the order in which they are laid out.
    pub blocks: Vec<BlockData>,
    /// The loop tree, outer before inner.
    pub loops: Vec<LoopData>,
    /// Places in bytecode.
    pub places: Vec<PlaceData>,
    /// What traps owe to memory; the first is empty.
    pub write_backs: Vec<Vec<Dirty>>,
    /// Types of the results.
    pub results: Vec<Type>,
    /// The call's frame bytes.
    pub frame: Value,
    /// Start of the program's slots and of its data block, where code is shared by the instances of a program type.
    pub program: Option<(Value, Value)>,
}

impl Function {
    /// A new value.
    pub fn new_value(&mut self, ty: Type) -> Value {
        self.values.push(ty);
        Value(self.values.len() as u32 - 1)
    }

    /// A new variable.
    pub fn new_variable(&mut self, ty: Type) -> Var {
        self.variables.push(ty);
        Var(self.variables.len() as u32 - 1)
    }

    /// Type of a value.
    #[must_use]
    pub fn ty(&self, value: Value) -> Type {
        self.values[value.index()]
    }

    /// Appends a block.
    pub fn add_block(&mut self, block: BlockData) -> Block {
        self.blocks.push(block);
        Block(self.blocks.len() as u32 - 1)
    }

    /// Which blocks the entry leads to.
    #[must_use]
    pub fn reachable(&self) -> Vec<bool> {
        let mut reached = vec![false; self.blocks.len()];
        let mut open = vec![Block(0)];
        while let Some(block) = open.pop() {
            if !std::mem::replace(&mut reached[block.index()], true) {
                open.extend(self.blocks[block.index()].terminator.targets().iter().map(|target| target.block));
            }
        }
        reached
    }

    /// The parts that it calls.
    pub fn parts(&self) -> impl Iterator<Item = u32> {
        let instructions = self.blocks.iter().flat_map(|block| &block.instructions);
        instructions.filter_map(|instruction| match instruction.op {
            Op::Part(number, _) => Some(number),
            _ => None,
        })
    }

    /// Whether `inner` is `outer` or lies in it.
    #[must_use]
    pub fn loop_contains(&self, outer: LoopId, inner: Option<LoopId>) -> bool {
        let mut at = inner;
        while let Some(id) = at {
            if id == outer {
                return true;
            }
            at = self.loops[id.index()].parent;
        }
        false
    }
}

impl Op {
    /// Calls `f` with every value that it reads.
    pub fn for_each_operand(&mut self, mut f: impl FnMut(&mut Value)) {
        let address = |address: &mut Address, f: &mut dyn FnMut(&mut Value)| {
            if let Base::Value(value) = &mut address.base {
                f(value);
            }
            if let Some((value, _)) = &mut address.index {
                f(value);
            }
        };
        match self {
            Op::Const(_) | Op::Get(_) | Op::LoadSlot(..) | Op::Checkpoint { .. } => {}
            Op::Numeric(_, operands) => operands.iter_mut().for_each(f),
            Op::Select { condition, then, otherwise } => [condition, then, otherwise].into_iter().for_each(f),
            Op::Splat(value)
            | Op::Lane(value, _)
            | Op::Ramp { first: value, .. }
            | Op::Set(_, value)
            | Op::StoreSlot(_, _, value)
            | Op::RefToInt(value)
            | Op::RefCheck { offset: value, .. }
            | Op::CheckIndex { index: value, .. }
            | Op::CheckRange { value, .. }
            | Op::CheckDivisor(value)
            | Op::CheckStep(value) => f(value),
            Op::Load(at, _) | Op::LoadBit(at, _) | Op::Reference(at) | Op::Zero(at, _) => address(at, &mut f),
            Op::Store(at, _, value) | Op::StoreBit(at, _, value) => {
                address(at, &mut f);
                f(value);
            }
            Op::ForIsEmpty(test) | Op::ForContinues(test) => {
                [&mut test.control, &mut test.bound, &mut test.step].into_iter().for_each(f);
            }
            Op::Copy { destination, source, .. } => {
                address(destination, &mut f);
                address(source, &mut f);
            }
            Op::Helper(_, _, values) | Op::Call(_, values) | Op::CallVirtual(_, values) | Op::Part(_, values) => {
                values.iter_mut().for_each(f);
            }
        }
    }
}
