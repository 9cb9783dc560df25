//! What the verifier hands out about good containers: loops, dominators, fuel, effects, FOR proofs. Containers are built by hand.

use khz_bytecode::container::*;
use khz_bytecode::ids::*;
use khz_bytecode::instruction::{Instruction, NumericOp};
use khz_bytecode::value::*;
use khz_bytecode::verify::*;

/// Code of a function under construction: labels are numbered, forward ones patched when they are placed.
#[derive(Default)]
struct Code {
    bytes: Vec<u8>,
}

impl Code {
    fn put(&mut self, instruction: &Instruction) -> u32 {
        let at = self.here();
        instruction.encode(&mut self.bytes);
        at
    }

    fn here(&self) -> u32 {
        self.bytes.len() as u32
    }

    fn i32(&mut self, value: i32) -> &mut Self {
        self.put(&Instruction::ConstI32 { value });
        self
    }

    fn load(&mut self, place: SlotPlace, index: u16) -> &mut Self {
        self.put(&Instruction::SlotLoad { place, index: SlotIndex(index) });
        self
    }

    fn store(&mut self, place: SlotPlace, index: u16) -> &mut Self {
        self.put(&Instruction::SlotStore { place, index: SlotIndex(index) });
        self
    }

    /// Puts the position reached so far into the label that ends the instruction at `jump`, a label being its last four bytes.
    fn land(&mut self, end_of_jump: u32) {
        let target = self.here().to_le_bytes();
        let end = end_of_jump as usize;
        self.bytes[end - 4..end].copy_from_slice(&target);
    }

    /// A FOR loop from 1 to `bound`, whose body is what `body` puts.
    fn for_loop(&mut self, id: u16, bound: i32, body: impl FnOnce(&mut Code)) {
        self.i32(1).i32(bound).i32(1);
        self.put(&Instruction::ForEnter { id: ForId(id), exit: Label(0) });
        let header = self.here();
        body(self);
        self.put(&Instruction::ForNext { id: ForId(id), header: Label(header) });
        self.land(header);
    }

    fn done(mut self) -> Vec<u8> {
        self.put(&Instruction::Return {});
        self.bytes
    }
}

const I32: LocalType = LocalType::Scalar(Storage::I32);

fn descriptor(control: ControlPlace, bound: u16) -> ForLoop {
    ForLoop { control, ty: IntegerType::I32, bound: SlotIndex(bound), step: SlotIndex(bound + 1) }
}

fn parameters() -> Parameters {
    Parameters {
        max_stack_depth: 16,
        max_call_depth: 8,
        input_image_bytes: 16,
        output_image_bytes: 16,
        memory_image_bytes: 16,
        data_region_bytes: 64,
        frame_bytes: 64,
        ..Parameters::default()
    }
}

/// A container with `functions` and two shared globals (i32), not run by any task.
fn container(functions: Vec<Function>) -> Container {
    Container {
        parameters: parameters(),
        types: TypeSection {
            types: vec![Type::Scalar(Storage::I32), Type::Scalar(Storage::I16)],
            slots: vec![Storage::I32; 2],
            data: vec![
                DataVariable { offset: 16, ty: TypeId(0), constant: false },
                DataVariable { offset: 20, ty: TypeId(0), constant: false },
                DataVariable { offset: 24, ty: TypeId(1), constant: false },
            ],
            ..TypeSection::default()
        },
        tasks: TaskTable { shared_globals: 2, ..TaskTable::default() },
        functions,
        ..Container::default()
    }
}

fn function(locals: usize, for_loops: Vec<ForLoop>, code: Code) -> Function {
    Function { locals: vec![I32; locals], for_loops, code: code.done(), ..Function::default() }
}

fn facts(functions: Vec<Function>) -> Facts {
    match verify(container(functions)) {
        Ok(verified) => verified.facts().clone(),
        Err(error) => panic!("{error}"),
    }
}

const LOCAL: SlotPlace = SlotPlace::Local;
const GLOBAL: SlotPlace = SlotPlace::Global;

#[test]
fn nested_for_loops_form_a_tree_with_fuel() {
    let mut code = Code::default();
    code.for_loop(0, 10, |code| {
        code.put(&Instruction::Nop {});
        code.for_loop(1, 10, |code| {
            code.load(LOCAL, 0).load(LOCAL, 1);
            code.put(&Instruction::Numeric(NumericOp::I32Add));
            code.store(GLOBAL, 0);
        });
    });
    let loops = vec![
        descriptor(ControlPlace::Slot(LOCAL, SlotIndex(0)), 2),
        descriptor(ControlPlace::Slot(LOCAL, SlotIndex(1)), 4),
    ];
    let facts = facts(vec![function(6, loops, code)]);
    let own = &facts.functions[0];
    assert_eq!(own.loops.len(), 2);
    let (outer, inner) = (&own.loops[0], &own.loops[1]);
    assert_eq!((outer.depth, inner.depth), (1, 2));
    assert_eq!((outer.parent, inner.parent), (None, Some(LoopId(0))));
    assert_eq!((outer.for_loop, inner.for_loop), (Some(ForId(0)), Some(ForId(1))));
    assert!(outer.control_is_proven && inner.control_is_proven);
    assert!(inner.blocks.iter().all(|block| outer.blocks.contains(block)));
    assert_eq!(outer.back_edges.len(), 1);
    // Three constants and the `for.enter`, and the `return`.
    assert_eq!(own.entry_fuel, 3 + 3 + 1);
    // The nop, the inner loop's entry, the `for.next`.
    assert_eq!(outer.fuel, 3 + 3 + 2);
    // Load, load, add, store, `for.next`.
    assert_eq!(inner.fuel, 1 + 1 + 1 + 1 + 2);
    assert_eq!(own.max_stack, 3);
    assert!(!own.effects.traps, "the steps are constants other than 0");
    assert_eq!(own.effects.globals_written.iter().copied().collect::<Vec<_>>(), [SlotIndex(0)]);
}

/// IF c THEN … ELSE … END_IF: blocks entry, then, else, join.
#[test]
fn a_join_is_dominated_by_the_fork() {
    let mut code = Code::default();
    code.load(LOCAL, 0);
    code.put(&Instruction::JumpIf { target: Label(0) });
    let fork = code.here();
    code.i32(1).store(LOCAL, 1);
    code.put(&Instruction::Jump { target: Label(0) });
    let end_of_then = code.here();
    code.land(fork);
    code.i32(2).store(LOCAL, 1);
    code.land(end_of_then);
    let facts = facts(vec![function(2, vec![], code)]);
    let blocks = &facts.functions[0].blocks;
    assert_eq!(blocks.len(), 4);
    let dominators: Vec<_> = blocks.iter().map(|block| block.immediate_dominator).collect();
    assert_eq!(dominators, [None, Some(BlockId(0)), Some(BlockId(0)), Some(BlockId(0))]);
    assert_eq!(blocks[0].successors, [BlockId(2), BlockId(1)], "target first, then fall-through");
    assert_eq!(blocks[3].predecessors, [BlockId(1), BlockId(2)]);
    assert!(facts.functions[0].loops.is_empty());
}

#[test]
fn a_while_loop_with_two_back_edges_is_one_loop() {
    let mut code = Code::default();
    let header = code.here();
    code.load(LOCAL, 0);
    code.put(&Instruction::JumpIf { target: Label(header) });
    code.load(LOCAL, 1);
    code.put(&Instruction::JumpIf { target: Label(header) });
    let facts = facts(vec![function(2, vec![], code)]);
    let own = &facts.functions[0];
    assert_eq!(own.loops.len(), 1);
    assert_eq!(own.loops[0].header, BlockId(0));
    assert_eq!(own.loops[0].back_edges, [BlockId(0), BlockId(1)]);
    assert_eq!(own.loops[0].blocks, [BlockId(0), BlockId(1)]);
    assert_eq!((own.loops[0].fuel, own.entry_fuel), (4, 1));
    assert_eq!(own.loops[0].for_loop, None);
}

/// Whether a FOR loop over `control` keeps it when `body` is its body; function 1 stores to global 0 and data 16.
fn proven(control: ControlPlace, body: impl FnOnce(&mut Code)) -> bool {
    let mut code = Code::default();
    code.for_loop(0, 10, body);
    let mut callee = Code::default();
    callee.i32(0).store(GLOBAL, 0);
    callee.i32(0);
    callee.put(&Instruction::Store { place: BytePlace::Data, storage: Storage::I32, offset: 16 });
    let facts = facts(vec![function(4, vec![descriptor(control, 2)], code), function(0, vec![], callee)]);
    assert_eq!(facts.functions[0].loops[0].for_loop, Some(ForId(0)));
    facts.functions[0].loops[0].control_is_proven
}

#[test]
fn a_store_to_a_control_slot_breaks_the_proof() {
    let local = ControlPlace::Slot(LOCAL, SlotIndex(0));
    assert!(proven(local, |code| _ = code.i32(0).store(LOCAL, 1)));
    assert!(!proven(local, |code| _ = code.i32(0).store(LOCAL, 0)));
    let global = |slot| ControlPlace::Slot(GLOBAL, SlotIndex(slot));
    let call = |code: &mut Code| _ = code.put(&Instruction::Call { function: FunctionId(1) });
    assert!(proven(local, call));
    assert!(proven(global(1), call));
    assert!(!proven(global(0), call), "the callee writes it");
}

#[test]
fn a_store_that_may_meet_a_control_variable_in_bytes_breaks_the_proof() {
    let data = |offset| ControlPlace::Bytes(BytePlace::Data, offset);
    let store = |place, offset| {
        move |code: &mut Code| {
            code.i32(0);
            code.put(&Instruction::Store { place, storage: Storage::I32, offset });
        }
    };
    assert!(proven(data(16), store(BytePlace::Data, 20)));
    assert!(!proven(data(16), store(BytePlace::Data, 16)));
    assert!(proven(data(16), store(BytePlace::Memory, 0)));
    assert!(!proven(ControlPlace::Bytes(BytePlace::Memory, 4), store(BytePlace::Memory, 6)), "two bytes are the same");
    assert!(proven(ControlPlace::Bytes(BytePlace::Memory, 4), store(BytePlace::Memory, 8)));
    let call = |code: &mut Code| _ = code.put(&Instruction::Call { function: FunctionId(1) });
    assert!(!proven(data(16), call));
    assert!(proven(data(20), call));
    let through = |offset: u32| {
        move |code: &mut Code| {
            code.put(&Instruction::Address { place: BytePlace::Data, offset, target: TypeId(0) });
            code.i32(0);
            code.put(&Instruction::RefStore { storage: Storage::I32 });
        }
    };
    assert!(proven(data(16), through(20)), "the reference comes from elsewhere");
    assert!(!proven(data(16), through(16)));
    let raw = |code: &mut Code| {
        code.put(&Instruction::Address { place: BytePlace::Data, offset: 24, target: TypeId(1) });
        code.put(&Instruction::RefToInt {});
        code.put(&Instruction::RefCheck { target: TypeId(1), write: true });
        code.i32(0);
        code.put(&Instruction::RefStore { storage: Storage::I16 });
    };
    assert!(!proven(data(16), raw), "an integer may point anywhere");
}

#[test]
fn effects_frames_and_depth_include_callees() {
    let mut leaf = Code::default();
    leaf.load(GLOBAL, 1).store(GLOBAL, 0);
    let mut middle = Code::default();
    middle.put(&Instruction::Call { function: FunctionId(2) });
    middle.i32(7);
    middle.i32(0);
    middle.put(&Instruction::Numeric(NumericOp::I32DivS));
    middle.put(&Instruction::Drop {});
    let mut top = Code::default();
    top.put(&Instruction::Call { function: FunctionId(1) });
    let mut container =
        container(vec![function(0, vec![], top), function(0, vec![], middle), function(0, vec![], leaf)]);
    let record = Record { size: 12, align: 4, fields: vec![Field { offset: 0, ty: TypeId(0) }] };
    container.types.types.push(Type::Struct(record));
    container.functions[2].frame = Some(TypeId(2));
    container.functions[0].frame = Some(TypeId(2));
    let verified = verify(container).unwrap();
    let top = verified.function(FunctionId(0));
    assert_eq!((top.call_depth, verified.function(FunctionId(2)).call_depth), (3, 1));
    assert_eq!((top.frame_bytes, top.frame_bytes_with_callees), (16, 32));
    assert!(top.effects.traps, "the division of its callee");
    assert!(!verified.function(FunctionId(2)).effects.traps);
    assert!(top.effects.globals_read.contains(&SlotIndex(1)) && top.effects.globals_written.contains(&SlotIndex(0)));
    assert!(!verified.facts().foreign_floats);
    // 16 bytes of slots, 64 of data, 64 of frame, 3 images of 16 bytes, each on a cache line.
    assert_eq!(verified.facts().image_bytes, 5 * 64 + 16);
}

/// A function block whose FOR loop over a field of its own calls a nested block: the call can not reach the field, unless the
/// nested block's body reaches out to other variables.
#[test]
fn a_nested_block_can_not_write_the_control_variable_of_the_outer_one() {
    let proven = |nested_body: &str| {
        let text = format!(
            "type number scalar i32\ntype inner block number\ntype outer block number inner\ndata one outer\n\
             function main\n return\nend\n\
             function run block outer\n for each t #0 i32\n const.i32 0\n const.i32 9\n const.i32 1\n for.enter each done\n\
             pass:\n address t #1 inner\n call nested\n for.next each pass\ndone:\n return\nend\n\
             function nested block inner\n{nested_body}\n return\nend\n"
        );
        let verified = verify(khz_bytecode::assembler::assemble(&text).unwrap()).unwrap();
        (verified.function(FunctionId(1)).loops[0].control_is_proven, verified.function(FunctionId(2)).is_confined)
    };
    assert_eq!(proven("const.i32 1\n store t i32 #0"), (true, true));
    assert_eq!(proven("address t #0 number\n const.i32 1\n ref.store i32"), (true, true));
    assert_eq!(proven("const.i32 1\n store d i32 one"), (false, false));
    assert_eq!(proven("address d one outer\n ref.field outer 0\n const.i32 1\n ref.store i32"), (false, false));
}

#[test]
fn foreign_floats_come_from_raw_writes_unions_and_copies_out_of_images() {
    let foreign = |declarations: &str, code: &str| {
        let text = format!(
            "inputs 8\ntype real scalar f32\ntype number scalar i32\n{declarations}data x real\ndata y number\n\
             function main\n{code}\n return\nend\n"
        );
        verify(khz_bytecode::assembler::assemble(&text).unwrap()).unwrap().facts().foreign_floats
    };
    assert!(!foreign("", "const.i32 1\n store d i32 y"));
    assert!(foreign("type either union real number\n", "nop"));
    assert!(!foreign("type either union number number\n", "nop"));
    assert!(foreign("", "const i64 16\n ref.check number 1\n drop"));
    assert!(!foreign("", "const i64 16\n ref.check number 0\n drop"), "it only reads");
    assert!(foreign("", "address d x real\n address i 0 real\n copy real"));
    assert!(!foreign("", "address d y number\n address i 0 number\n copy number"), "no float comes in");
    assert!(!foreign("", "address d x real\n address d x real\n copy real"));
}
