//! The verifier under load and under attack: large functions take time in proportion, hostile shapes neither much time nor much
//! memory, and no mutated container makes it panic.

use std::time::{Duration, Instant};

use khz_bytecode::assembler::assemble;
use khz_bytecode::container::*;
use khz_bytecode::ids::*;
use khz_bytecode::instruction::{Instruction, NumericOp};
use khz_bytecode::value::*;
use khz_bytecode::verify::*;

/// Generous for a debug build on a busy machine; quadratic behaviour would take minutes.
const PATIENCE: Duration = Duration::from_secs(60);

fn main_of(code: Vec<u8>, max_stack_depth: u16) -> Container {
    let mut container = assemble("global x i32\nglobal y i32\nfunction main\n return\nend\n").unwrap();
    container.parameters.max_stack_depth = max_stack_depth;
    container.functions[0].code = code;
    container
}

fn encode(instructions: &[Instruction]) -> Vec<u8> {
    let mut code = Vec::new();
    instructions.iter().for_each(|instruction| instruction.encode(&mut code));
    code
}

fn size(instructions: &[Instruction]) -> u32 {
    encode(instructions).len() as u32
}

#[allow(clippy::disallowed_methods, reason = "a test that bounds real time")]
fn timed(container: Container) -> Result<Verified, VerifyError> {
    let start = Instant::now();
    let result = verify(container);
    assert!(start.elapsed() < PATIENCE, "{:?}", start.elapsed());
    result
}

#[test]
fn a_hundred_thousand_instructions_with_branches_verify_quickly() {
    // 12,500 times IF x THEN x := x + y; END_IF.
    let global = |index| Instruction::SlotLoad { place: SlotPlace::Global, index: SlotIndex(index) };
    let body = [
        global(0),
        global(1),
        Instruction::Numeric(NumericOp::I32Add),
        Instruction::SlotStore { place: SlotPlace::Global, index: SlotIndex(0) },
        Instruction::Nop {},
        Instruction::Nop {},
    ];
    let head = size(&[global(0), Instruction::JumpUnless { target: Label(0) }]);
    let mut code = Vec::new();
    for _ in 0..12_500 {
        let target = Label(code.len() as u32 + head + size(&body));
        code.extend(encode(&[global(0), Instruction::JumpUnless { target }]));
        code.extend(encode(&body));
    }
    code.extend(encode(&[Instruction::Return {}]));
    let verified = timed(main_of(code, 16)).unwrap();
    let facts = verified.function(FunctionId(0));
    assert_eq!((facts.instructions.len(), facts.blocks.len()), (100_001, 25_001));
}

/// A chain of tests whose bodies all jump to one end: every join is far from its fork.
#[test]
fn a_long_elsif_chain_is_not_quadratic() {
    let one = [Instruction::ConstI32 { value: 0 }, Instruction::JumpUnless { target: Label(0) }];
    let step = size(&one) + size(&[Instruction::Jump { target: Label(0) }]);
    let count = 20_000;
    let end = Label(step * count);
    let mut code = Vec::new();
    for number in 1..=count {
        let next = Instruction::JumpUnless { target: Label(step * number) };
        code.extend(encode(&[Instruction::ConstI32 { value: 0 }, next, Instruction::Jump { target: end }]));
    }
    code.extend(encode(&[Instruction::Return {}]));
    let verified = timed(main_of(code, 16)).unwrap();
    let blocks = &verified.function(FunctionId(0)).blocks;
    assert_eq!(blocks.last().unwrap().immediate_dominator, Some(BlockId(0)));
}

#[test]
fn stacks_at_block_starts_are_limited_in_total() {
    let push = Instruction::ConstI32 { value: 1 };
    let mut code = encode(&vec![push.clone(); 4090]);
    for _ in 0..3000 {
        let target = Label(code.len() as u32 + size(&[push.clone(), Instruction::JumpIf { target: Label(0) }]));
        code.extend(encode(&[push.clone(), Instruction::JumpIf { target }]));
    }
    code.extend(encode(&vec![Instruction::Drop {}; 4090]));
    code.extend(encode(&[Instruction::Return {}]));
    assert_eq!(timed(main_of(code, 4096)).unwrap_err().rule, Rule::AnalysisSize);
}

/// A chain of functions that all inherit many effects, and callers that call all of them.
#[test]
fn inherited_effects_are_limited_in_total() {
    let mut container = main_of(Vec::new(), 16);
    container.parameters.max_call_depth = 1024;
    container.types.slots = vec![Storage::I32; 60_000];
    container.tasks.shared_globals = 60_000;
    let mut leaf = Vec::new();
    for index in 0..60_000 {
        let place = SlotPlace::Global;
        Instruction::SlotLoad { place, index: SlotIndex(index) }.encode(&mut leaf);
        Instruction::Drop {}.encode(&mut leaf);
    }
    Instruction::Return {}.encode(&mut leaf);
    container.functions[0].code = encode(&[Instruction::Return {}]);
    container.functions.push(Function { code: leaf, ..Function::default() });
    for _ in 0..1000 {
        let code = encode(&[Instruction::Call { function: FunctionId(1) }, Instruction::Return {}]);
        container.functions.push(Function { code, ..Function::default() });
    }
    assert_eq!(timed(container).unwrap_err().rule, Rule::AnalysisSize);
}

/// A union of unions, whose lookup must not try every combination.
#[test]
fn hostile_types_are_refused_quickly() {
    let field = |ty| Field { offset: 0, ty: TypeId(ty) };
    let mut types = vec![Type::Scalar(Storage::I32)];
    for ty in 0..60 {
        types.push(Type::Union(Record { size: 4, align: 4, fields: vec![field(ty), field(ty)] }));
    }
    let container = Container { types: TypeSection { types, ..TypeSection::default() }, ..Container::default() };
    assert_eq!(timed(container).unwrap_err().rule, Rule::UnionWidth);
}

/// Ten million blocks in an array of structures with arrays: more than anyone lists.
#[test]
fn hostile_instance_tables_are_refused_quickly() {
    let mut container = assemble(
        "type number scalar i8\ntype tiny block number\narray inner tiny 1..3000\narray outer inner 1..3000\ndata all outer\n\
         block_instance 16 tiny stride 1 count 9000000\nfunction main\n return\nend\n",
    )
    .unwrap();
    assert_eq!(timed(container.clone()).unwrap_err().rule, Rule::BlockInstances);
    container.types.block_instances.clear();
    assert_eq!(timed(container).unwrap_err().rule, Rule::BlockInstances);
}

/// Every instance claims all slots: comparing them all with those of the program type would take minutes.
#[test]
fn overlapping_partitions_are_refused_quickly() {
    let mut container = main_of(encode(&[Instruction::Return {}]), 16);
    container.types.slots = vec![Storage::I32; 60_000];
    container.tasks =
        TaskTable { shared_globals: 0, tasks: vec![Task { interval_us: 1, ..Task::default() }], instances: Vec::new() };
    container.types.task_extensions = vec![TaskExtension::default()];
    container.types.programs = vec![ProgramType { slots: vec![Storage::I32; 60_000], block: None }];
    container.functions[0].owner = Owner::Program(ProgramId(0));
    container.tasks.instances = (0..60_000)
        .map(|id| ProgramInstance { id: InstanceId(id), slot_count: 60_000, ..ProgramInstance::default() })
        .collect();
    assert_eq!(timed(container).unwrap_err().rule, Rule::InstancePartition);
}

/// A run of initial bytes whose length fits no stride: hundreds of millions of floats that all begin otherwise.
#[test]
fn initial_values_of_nested_arrays_are_limited_in_total() {
    let array =
        |element, stride, count| ArrayDescriptor { element: TypeId(element), stride, dimensions: vec![(1, count)] };
    let mut container = main_of(encode(&[Instruction::Return {}]), 16);
    let types = &mut container.types;
    types.types = vec![Type::Scalar(Storage::F32), Type::Array(ArrayId(0)), Type::Array(ArrayId(1))];
    types.arrays = vec![array(0, 4, 10_008), array(1, 40_032, 10_007)];
    types.data = vec![DataVariable { offset: 16, ty: TypeId(2), constant: false }];
    let bytes = 40_032 * 10_007;
    container.parameters.data_region_bytes = bytes + 16;
    let run = |length: u32| InitRun {
        region: Region::Data,
        offset: 16,
        repeat: bytes / length,
        bytes: vec![0; length as usize],
    };
    container.types.init_image = vec![run(40_028)];
    assert_eq!(timed(container.clone()).unwrap_err().rule, Rule::AnalysisSize);
    // Honest runs repeat whole elements, and need few looks.
    for length in [4, 40_032] {
        container.types.init_image = vec![run(length)];
        timed(container.clone()).unwrap();
    }
}

/// Few blocks with high stacks, and very many ways between them.
#[test]
fn stacks_along_edges_are_limited_in_total() {
    let push = Instruction::ConstI32 { value: 1 };
    let (height, arms, switches) = (4000, 1000, 400);
    // Each arm goes on behind the next one; each switch leads to all arms.
    let prologue = size(std::slice::from_ref(&push)) * height;
    let one = size(&[push.clone(), Instruction::Switch { targets: vec![Label(0); arms as usize + 1] }]);
    let first_arm = prologue + one * switches;
    let arm = size(&[Instruction::Jump { target: Label(0) }]);
    let mut code = encode(&vec![push.clone(); height as usize]);
    for number in 1..=switches {
        let targets = (0..arms).map(|at| Label(first_arm + at * arm)).chain([Label(prologue + one * number)]).collect();
        code.extend(encode(&[push.clone(), Instruction::Switch { targets }]));
    }
    for at in 1..=arms {
        code.extend(encode(&[Instruction::Jump { target: Label(first_arm + at * arm) }]));
    }
    code.extend(encode(&vec![Instruction::Drop {}; height as usize]));
    code.extend(encode(&[Instruction::Return {}]));
    assert_eq!(timed(main_of(code, 4096)).unwrap_err().rule, Rule::AnalysisSize);
}

/// Accesses into a union of many alternatives, each a deep structure: all of them are tried for each access.
#[test]
fn lookups_in_unions_are_limited_in_total() {
    let field = |ty| Field { offset: 0, ty: TypeId(ty) };
    let mut container = main_of(Vec::new(), 16);
    let mut types = vec![Type::Scalar(Storage::I32)];
    for ty in 0..61 {
        types.push(Type::Struct(Record { size: 4, align: 4, fields: vec![field(ty)] }));
    }
    types.push(Type::Union(Record { size: 4, align: 4, fields: vec![field(61); 255] }));
    types.push(Type::Scalar(Storage::F32));
    types.push(Type::Union(Record { size: 4, align: 4, fields: vec![field(63), field(62)] }));
    container.types.types = types;
    container.types.data = vec![DataVariable { offset: 16, ty: TypeId(64), constant: false }];
    container.parameters.data_region_bytes = 32;
    let load = Instruction::Load { place: BytePlace::Data, storage: Storage::F32, offset: 16 };
    let mut code = encode(&vec![[load, Instruction::Drop {}]; 200_000].concat());
    code.extend(encode(&[Instruction::Return {}]));
    container.functions[0].code = code;
    assert_eq!(timed(container).unwrap_err().rule, Rule::AnalysisSize);
}

/// Small deterministic generator (xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % bound as u64) as usize
    }
}

/// Flips bytes in the code of every accepted file, and numbers in its tables: whatever comes out, no panic.
#[test]
fn mutated_containers_never_panic() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/verifier");
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let (mut accepted, mut rejected) = (0, 0);
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    for path in paths {
        let original = assemble(&std::fs::read_to_string(&path).unwrap()).unwrap();
        for _ in 0..100 {
            let mut container = original.clone();
            for _ in 0..=random.below(3) {
                mutate(&mut container, &mut random);
            }
            // An image near 2 GiB may well be accepted, and is never allocated here.
            match verify(container) {
                Ok(_) => accepted += 1,
                Err(_) => rejected += 1,
            }
        }
    }
    assert!(
        accepted > 100 && rejected > 1000,
        "{accepted} accepted, {rejected} rejected: the mutations miss their purpose"
    );
}

fn mutate(container: &mut Container, random: &mut Random) {
    const NUMBERS: [u32; 8] = [0, 1, 2, 7, 0x7FFF_FFFF, 0x8000_0000, u32::MAX - 3, u32::MAX];
    let number = NUMBERS[random.below(NUMBERS.len())];
    let functions = container.functions.len();
    match random.below(12) {
        0..=5 if functions > 0 => {
            let code = &mut container.functions[random.below(functions)].code;
            if !code.is_empty() {
                let at = random.below(code.len());
                code[at] = [0, 1, 2, 3, 255, code[at] ^ 1, code[at].wrapping_add(1)][random.below(7)];
            }
        }
        6 if functions > 0 => {
            let function = &mut container.functions[random.below(functions)];
            function.parameters = number as u16;
            function.owner =
                [Owner::None, Owner::Program(ProgramId(number as u16)), Owner::Block(TypeId(number as u16))]
                    [random.below(3)];
        }
        7 if !container.types.types.is_empty() => {
            let at = random.below(container.types.types.len());
            if let Type::Struct(record) | Type::Union(record) | Type::Block { record, .. } =
                &mut container.types.types[at]
            {
                record.size = number;
                if let Some(field) = record.fields.last_mut() {
                    field.offset = NUMBERS[random.below(8)];
                }
            }
        }
        8 if !container.types.arrays.is_empty() => {
            let at = random.below(container.types.arrays.len());
            container.types.arrays[at].dimensions =
                vec![(number as i32, NUMBERS[random.below(8)] as i32); 1 + random.below(3)];
        }
        9 if !container.types.data.is_empty() => {
            let at = random.below(container.types.data.len());
            container.types.data[at].offset = number;
            container.parameters.data_region_bytes = NUMBERS[random.below(8)];
        }
        10 if !container.types.init_image.is_empty() => {
            let at = random.below(container.types.init_image.len());
            container.types.init_image[at].repeat = number;
            container.types.init_image[at].offset = NUMBERS[random.below(8)];
        }
        11 if !container.types.block_instances.is_empty() => {
            let at = random.below(container.types.block_instances.len());
            container.types.block_instances[at].count = number;
            container.types.block_instances[at].stride = NUMBERS[random.below(8)];
        }
        _ => container.parameters.max_stack_depth = number as u16,
    }
}
