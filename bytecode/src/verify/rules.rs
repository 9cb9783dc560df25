//! The rules of the verifier: one row a rule. `khz explain`, `docs/verifier.md`, and the filetests are views of this table.
//!
//! Row: `(number, Variant, group, "title", "why it exists")`. A number is never used again for another rule.

macro_rules! rules {
    ($(($number:literal, $variant:ident, $group:ident, $title:literal, $why:literal)),* $(,)?) => {
        /// A rule that every verified container keeps.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u16)]
        pub enum Rule { $(#[doc = $title] $variant = $number),* }

        impl Rule {
            /// Every rule, in the order of its number.
            pub const ALL: &'static [Rule] = &[$(Rule::$variant),*];

            /// What it demands, in one line.
            #[must_use]
            pub fn title(self) -> &'static str {
                match self { $(Rule::$variant => $title),* }
            }

            /// Why it exists.
            #[must_use]
            pub fn explanation(self) -> &'static str {
                match self { $(Rule::$variant => $why),* }
            }

            /// The part of the container that it looks at.
            #[must_use]
            pub fn group(self) -> RuleGroup {
                match self { $(Rule::$variant => RuleGroup::$group),* }
            }
        }
    };
}

/// Parts of a container, in the order in which the verifier looks at them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RuleGroup {
    /// Types, arrays, methods.
    Types,
    /// Variables, instance map, initial and retained values, budget.
    Memory,
    /// Tasks, program instances, system variables.
    Tasks,
    /// Function headers.
    Functions,
    /// Instruction boundaries and control flow.
    Flow,
    /// Operands and the types on the stack.
    Operands,
    /// What holds between functions.
    Calls,
}

impl RuleGroup {
    /// Every group in order.
    pub const ALL: &'static [RuleGroup] = &[
        RuleGroup::Types,
        RuleGroup::Memory,
        RuleGroup::Tasks,
        RuleGroup::Functions,
        RuleGroup::Flow,
        RuleGroup::Operands,
        RuleGroup::Calls,
    ];

    /// Heading in documents.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            RuleGroup::Types => "Types",
            RuleGroup::Memory => "Memory",
            RuleGroup::Tasks => "Tasks and program instances",
            RuleGroup::Functions => "Function headers",
            RuleGroup::Flow => "Control flow",
            RuleGroup::Operands => "Operands and stack",
            RuleGroup::Calls => "Calls",
        }
    }
}

rules! {
    (1, TypeOrder, Types, "A type refers only to types and arrays that stand before it.",
        "A type that held itself would have no size, and a walk through it no end."),
    (2, TypeDepth, Types, "Types nest no deeper than the limit.",
        "Every walk through a type, in the verifier and in the engines, is as deep as the type; the limit bounds it."),
    (3, RecordLayout, Types, "A record's alignment is 1, 2, 4 or 8 and that of its most demanding field, and its size a multiple of it.",
        "Elements of an array stand one size apart; only then is each of them aligned."),
    (4, FieldLayout, Types, "Fields ascend, do not overlap, are aligned and lie inside their record; fields of a union are all at offset 0.",
        "Typed accesses are proven by the declared type at an offset: two fields on one byte would make that proof worthless."),
    (5, TypeSize, Types, "The size of a type can be counted in 32 bits.",
        "Offsets into the memory image are 32 bits wide."),
    (6, ArrayBounds, Types, "An array has one to eight dimensions, each with lower bound <= upper bound.",
        "`ref.index` checks every index against these bounds; an empty dimension would have no valid index."),
    (7, ArrayStride, Types, "The stride of an array is the size of its element.",
        "`ref.index` multiplies by the stride; any other value would point between elements or behind the array."),
    (8, BlockBase, Types, "The base of a function block type is a function block type whose fields are its first fields, and not larger than it.",
        "A method of the base runs on instances of the derived type: the offsets it uses must mean the same there."),
    (9, BlockAddress, Types, "A function block instance has an address of its own: its type is not empty, it does not begin another instance, and it lies in no union.",
        "A virtual call finds the instance by its address alone."),
    (10, BlockMethods, Types, "Methods of a block type ascend by name, exist, belong to the type or a base of it, and have the parameters and results of their name.",
        "A virtual call is typed by the method's name; whichever function it finds must fit."),
    (11, UnionWidth, Types, "The alternatives of nested unions do not multiply beyond the limit.",
        "An access into a union is proven by trying its fields; without a limit a small file could ask for endless tries."),
    (13, MethodSignature, Types, "A method name's signature uses only types that exist, and has no more results than the limit allows.",
        "Virtual calls are typed by it."),
    (20, DataLayout, Memory, "Variables of the data region ascend, do not overlap, are aligned, and lie inside the region behind its first 16 bytes.",
        "Offset 0 is NULL and the bytes behind it are never allocated, so that NULL with a small offset misses every variable."),
    (21, DataType, Memory, "A variable of the data region has a type that exists; a constant one holds no function block instance.",
        "Code of a function block writes its instance, so that a constant instance can not be."),
    (22, ProgramType, Memory, "The data block of a program type is a structure.",
        "Its layout is that of the program's variables."),
    (23, BlockInstances, Memory, "The function block instance table lists each program instance's data block, then every function block instance in it, and at the end those of global variables: all of them, each once.",
        "Programs find their data block there, and virtual calls their target; a missing or wrong row would run code on foreign bytes."),
    (24, InitLayout, Memory, "Runs of the init image are not empty, ascend by region and offset, do not overlap and lie inside their region.",
        "They are copied into the memory image without further checks."),
    (25, InitValue, Memory, "Initial values are values of their variable: in a slot the bytes above the value are 0 and a BOOL is 0 or 1, and a NaN is the one NaN.",
        "Engines keep these forms and never check them again; two of them could otherwise show different results."),
    (26, RetainLayout, Memory, "Retained ranges are not empty, ascend by region and offset, do not overlap, lie inside their region, and hold whole slots.",
        "They are saved and restored as bytes."),
    (27, MemoryBudget, Memory, "The memory image is smaller than 2 GiB.",
        "Offsets are used as signed 32-bit displacements by native code."),
    (28, ConstantNan, Memory, "A NaN in the constant pool is the one NaN.",
        "There is one NaN on every machine, so that both engines show the same bits."),
    (29, HeaderLimits, Memory, "The header asks for no more stack depth, call depth or slots than the limits allow.",
        "An engine reserves what the header asks for."),
    (30, SharedGlobals, Memory, "The shared globals are slots that exist.",
        "`slot.load g` and the scheduler reach them without a check."),
    (40, TaskIds, Tasks, "Task identifiers are unique.",
        "Program instances and reports name tasks by them."),
    (41, InstanceIds, Tasks, "Program instance identifiers are unique.",
        "Reports and tools name instances by them."),
    (42, InstanceTask, Tasks, "A program instance belongs to a task that exists.",
        "No task would ever run it."),
    (43, InstanceEntry, Tasks, "The entry of a program instance is a function that exists, owned by a program type, without parameters and results.",
        "The scheduler calls it with an empty stack; its owner says what the instance's memory looks like."),
    (44, InstancePartition, Tasks, "The slots of a program instance stand behind the shared globals, inside the slots, and apart from those of other instances.",
        "One instance would change the variables of another behind its back."),
    (45, InstanceSlots, Tasks, "The slots of a program instance are those of its program type, in number and form.",
        "One body serves every instance of a type."),
    (46, TaskInterval, Tasks, "A cyclic task has an interval of at least 1 us, other tasks have none, and no time of a task overflows 64 bits of nanoseconds.",
        "The scheduler divides by the interval and adds times without checks."),
    (47, TaskExtensions, Tasks, "There is one task extension for each task.",
        "They are matched by position."),
    (48, SingleSource, Tasks, "A SINGLE source is a BOOL that exists; an event task has one, a freewheeling task none, and the task entry names it when it is the slot of an event task.",
        "The scheduler samples it before each round without a check."),
    (49, SystemVariables, Tasks, "A system variable is a shared global slot of 64 bits, and each kind stands in one slot.",
        "The scheduler writes it before each round without a check."),
    (50, StartFunctions, Tasks, "The startup and the init function exist, belong to no program and no function block, and have no parameters and no results.",
        "They run when there is no instance to run on."),
    (60, FunctionOwner, Functions, "The owner of a function is a program type or a function block type that exists.",
        "It decides what `p`, `b` and `t` mean in its code."),
    (61, FunctionLocals, Functions, "Parameters are among the locals, locals use types that exist, and there are no more of them, and no more results, than the limits allow.",
        "A call stores its arguments into the first locals."),
    (62, FunctionFrame, Functions, "Frame bytes have the type of a structure.",
        "Accesses to them are proven by that type."),
    (63, ForControl, Functions, "The control variable of a FOR descriptor is a writable integer of its type at a place that exists.",
        "`for.enter` and `for.next` store to it without a check."),
    (64, ForSlots, Functions, "Bound and step of a FOR descriptor are `l` slots of 32 or 64 bits as its type asks, used for nothing else.",
        "An engine may keep them in registers or drop them when they are constant."),
    (70, InstructionBoundary, Flow, "Code is a sequence of whole, known instructions.",
        "An engine translates exactly the instructions that were verified."),
    (71, JumpTarget, Flow, "A jump goes to the start of an instruction of its function.",
        "Code that begins inside an instruction was never verified."),
    (72, BackwardJump, Flow, "A backward jump goes to a block that dominates it.",
        "So each loop has one way in, its header: deadline and fuel are checked there and the engines work on a tree of loops."),
    (73, ForwardOnly, Flow, "`switch` and the exit of `for.enter` go forward.",
        "Loops are closed only by `jump`, `jump.if`, `jump.unless` and `for.next`, which keeps the back edges of a loop few and simple."),
    (74, Unreachable, Flow, "Every instruction can be reached.",
        "Code that no path reaches has no stack to type it with."),
    (75, FallOff, Flow, "Code does not run past its end.",
        "There is nothing behind it."),
    (76, ForPair, Flow, "Each FOR descriptor has exactly one `for.enter` and at most one `for.next`, which goes back to the instruction behind the `for.enter`.",
        "Together they are one loop: initial value, bound and step are known when its body runs."),
    (77, ForHeader, Flow, "The header of a FOR loop is reached only from its `for.enter` and its `for.next`.",
        "The control variable is then within its bounds at the start of every pass. A body that begins with another loop begins with a `nop`."),
    (78, LoopDepth, Flow, "Loops nest no deeper than the limit.",
        "A loop lists its blocks, those of inner loops included; the limit keeps the lists in proportion to the code."),
    (80, StackUnderflow, Operands, "An instruction finds its operands on the stack.",
        "There is nothing below the first entry."),
    (81, StackDepth, Operands, "The stack never grows beyond the header's max_stack_depth.",
        "An engine reserves that many entries."),
    (82, OperandType, Operands, "Operands have the types that the instruction takes.",
        "Engines keep integers, floats and references in different registers."),
    (83, MergeStack, Operands, "All ways into a block bring the same stack.",
        "One translation of the block serves all of them."),
    (84, ReturnStack, Operands, "At `return` the stack holds exactly the results.",
        "The caller takes them from there."),
    (85, OperandIndex, Operands, "An immediate names something that exists.",
        "Tables are indexed without a check."),
    (86, PlaceOwner, Operands, "`p` and `b` are used only in functions of a program (with a data block), `t` only in functions of a function block, `f` only with frame bytes.",
        "Elsewhere there is no such memory."),
    (87, TypedAccess, Operands, "An access in d, b, t, f meets a scalar of exactly that storage, an address a variable of exactly that type.",
        "Memory keeps its types, so that engines may hold parts of it in registers and no NaN of a foreign kind comes in."),
    (88, ImageBounds, Operands, "An access to %I, %Q or %M lies inside that image, and its bit is below 8.",
        "Behind it lies other memory."),
    (89, BitPlace, Operands, "Bits are loaded and stored only in %I, %Q and %M.",
        "Elsewhere a BOOL is a byte."),
    (90, InputWrite, Operands, "%I is never written by a program.",
        "It is the frozen snapshot of the round that all tasks see."),
    (91, ConstantWrite, Operands, "Constant variables are not written.",
        "String literals and CONSTANT variables stay what the source says, as far as typed accesses go."),
    (92, ReadOnlyReference, Operands, "A reference that is written through allows writing.",
        "It may point into %I or to a constant."),
    (93, ReferenceTarget, Operands, "A reference points to the type that the instruction works on.",
        "Its extent was proven to lie in the image for that type only."),
    (94, UnassignedReference, Operands, "A reference in an `l` slot is assigned on every path before it is loaded.",
        "Before that it points nowhere."),
    (95, StringOperand, Operands, "The capacities of a string instruction are those of its operands' types.",
        "It reads and writes as many bytes as they say."),
    (96, CheckTarget, Operands, "The target of `ref.check` is not empty.",
        "The check of an empty extent would prove nothing."),
    (97, CheckKind, Operands, "`check.i32` and `check.i64` name an integer type of their width, and a range that is not empty.",
        "No value could pass, or the order would be that of another width."),
    (98, AnalysisSize, Operands, "Stacks along the ways between blocks, lists of effects, lookups in unions and places of floats in initial values stay in proportion: their total is at most the limit.",
        "A small hostile file must not make the verifier use much memory or time."),
    (110, CallOwner, Calls, "A function of a program is called only from functions of the same program.",
        "It would run without an instance, or on one of another type."),
    (111, Recursion, Calls, "Direct calls form no cycle.",
        "IEC 61131-3 forbids recursion, and frames and depth can then be known beforehand."),
    (112, CallDepth, Calls, "The deepest chain of direct calls is within the header's max_call_depth.",
        "It would always trap."),
    (113, FrameBytes, Calls, "The frames of the deepest chain of direct calls fit the header's frame_bytes.",
        "A call's frame bytes lie behind its caller's, without a check."),
}

impl Rule {
    /// Its number.
    #[must_use]
    pub fn number(self) -> u16 {
        self as u16
    }

    /// Its code, for example `V0023`.
    #[must_use]
    pub fn code(self) -> String {
        format!("V{:04}", self.number())
    }

    /// The rule with this code, in any case.
    #[must_use]
    pub fn from_code(code: &str) -> Option<Rule> {
        Rule::ALL.iter().copied().find(|rule| rule.code().eq_ignore_ascii_case(code))
    }
}

impl std::fmt::Display for Rule {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "V{:04}", self.number())
    }
}
