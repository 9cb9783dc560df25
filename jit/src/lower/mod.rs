//! From the mid-level form to CLIF, instruction by instruction. It decides nothing: what shall stay in registers, which checks are made and in
//! which order blocks lie was settled before.
//!
//! A compiled function takes (image, context, frame[, program slots, data block][, this], parameters) and gives (status, results); status 0
//! means that it came to its end. Traps leave through cold blocks at the end, one for each write-back, which take what they record as block parameters.

mod calls;
mod guards;
mod memory;
mod numeric;

use cranelift_codegen::ir::{
    self, AbiParam, AliasRegion, AliasRegionData, BlockArg, BlockCall, InstBuilder, JumpTableData, MemFlagsData,
    Signature, types,
};
use cranelift_codegen::isa::CallConv;
use cranelift_frontend::{FunctionBuilder, FunctionBuilderContext, Variable};
use khz_bytecode::container::Owner;
use khz_bytecode::ids::FunctionId;
use khz_bytecode::value::ValueType;

use crate::build::{ProgramMemory, Scope};
use crate::context;
use crate::mir::{self, Const, Op, Terminator, Type};

/// What code can name: functions of the same module and routines of the host.
pub trait Linker {
    /// A function of the module, as it is compiled for a program's memory.
    fn function(&mut self, into: &mut ir::Function, id: FunctionId, program: ProgramMemory) -> ir::FuncRef;

    /// A part that was cut out of the function at hand.
    fn part(&mut self, into: &mut ir::Function, number: u32, signature: &Signature) -> ir::FuncRef;

    /// A routine of the host. The signature must be the same at every use.
    fn routine(&mut self, into: &mut ir::Function, name: &'static str, signature: &Signature) -> ir::FuncRef;

    /// The number of a place in the engine's table.
    fn place(&mut self, places: &[mir::PlaceData], place: mir::Place) -> u32;
}

/// What all functions of a module are lowered under.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Calling convention of compiled functions and routines.
    pub convention: CallConv,
    /// Whether fuel is charged.
    pub fuel: bool,
    /// Whether the deadline is looked at.
    pub deadline: bool,
    /// Whether calls count their depth and look at the frame limit, because virtual calls may recurse.
    pub depth: bool,
    /// Whether arithmetic itself gives the one NaN (x86-64); elsewhere results are made canonical.
    pub native_nan: bool,
    /// Whether instructions carry their place, for listings.
    pub source_lines: bool,
}

/// CLIF type of a mid-level type.
pub(crate) fn clif_type(ty: Type) -> ir::Type {
    match ty {
        Type::I32 => types::I32,
        Type::I64 | Type::Ref => types::I64,
        Type::F32 => types::F32,
        Type::F64 => types::F64,
        Type::F32x4 => types::F32X4,
        Type::F64x2 => types::F64X2,
    }
}

pub(crate) fn clif_value_type(ty: ValueType) -> ir::Type {
    clif_type(ty.into())
}

/// Signature of a compiled function.
pub fn signature(scope: &Scope<'_>, id: FunctionId, program: ProgramMemory, convention: CallConv) -> Signature {
    let function = &scope.verified.container().functions[id.index()];
    let mut signature = Signature::new(convention);
    let hidden = 3 + if program == ProgramMemory::Shared { 2 } else { 0 };
    let hidden = hidden + usize::from(matches!(function.owner, Owner::Block(_)));
    signature.params.extend((0..hidden).map(|_| AbiParam::new(types::I64)));
    for ty in function.parameter_types() {
        let ty = match ty {
            khz_bytecode::value::LocalType::Scalar(storage) => clif_value_type(storage.value_type()),
            khz_bytecode::value::LocalType::Ref(_) => types::I64,
        };
        signature.params.push(AbiParam::new(ty));
    }
    signature.returns.push(AbiParam::new(types::I32));
    signature.returns.extend(function.results.iter().map(|ty| AbiParam::new(clif_value_type(*ty))));
    signature
}

/// Signature of a form, be it a whole function or a part of one.
fn signature_of(function: &mir::Function, convention: CallConv) -> Signature {
    let types = |values: &[mir::Value]| values.iter().map(|value| clif_type(function.ty(*value))).collect::<Vec<_>>();
    let results: Vec<ir::Type> = function.results.iter().map(|ty| clif_type(*ty)).collect();
    signature_with(&types(&function.blocks[0].parameters), &results, convention)
}

/// Signature of what takes these beside image and context, and gives these beside the status.
fn signature_with(parameters: &[ir::Type], results: &[ir::Type], convention: CallConv) -> Signature {
    let mut signature = Signature::new(convention);
    signature.params.extend([types::I64; 2].iter().chain(parameters).map(|ty| AbiParam::new(*ty)));
    signature.returns.extend([types::I32].iter().chain(results).map(|ty| AbiParam::new(*ty)));
    signature
}

/// Alias regions of a function.
#[derive(Debug, Clone, Copy)]
struct Regions {
    slots: AliasRegion,
    bytes: AliasRegion,
    host: AliasRegion,
}

pub(crate) struct Lowerer<'a, 'b> {
    builder: FunctionBuilder<'b>,
    scope: &'a Scope<'a>,
    program: ProgramMemory,
    settings: Settings,
    linker: &'a mut dyn Linker,
    function: &'a mir::Function,
    values: Vec<Option<ir::Value>>,
    /// Constants by value, for choices that depend on them.
    constants: Vec<Option<Const>>,
    variables: Vec<Variable>,
    blocks: Vec<ir::Block>,
    trap_exits: Vec<Option<ir::Block>>,
    call_exits: Vec<Option<ir::Block>>,
    part_exits: Vec<Option<ir::Block>>,
    regions: Regions,
    image: ir::Value,
    context: ir::Value,
    deadline: ir::Value,
    place: mir::Place,
    write_back: mir::WriteBack,
}

/// Lowers a function into `into`, whose signature it sets.
pub fn lower(
    scope: &Scope<'_>,
    function: &mir::Function,
    program: ProgramMemory,
    settings: Settings,
    linker: &mut dyn Linker,
    into: &mut ir::Function,
    builder_context: &mut FunctionBuilderContext,
) {
    into.signature = signature_of(function, settings.convention);
    let region = |into: &mut ir::Function, user_id, description: &'static str| {
        into.dfg.alias_regions.insert(AliasRegionData { user_id, description: description.into() })
    };
    let regions =
        Regions { slots: region(into, 1, "slots"), bytes: region(into, 2, "bytes"), host: region(into, 3, "host") };
    let mut builder = FunctionBuilder::new(into, builder_context);
    let blocks: Vec<ir::Block> = function.blocks.iter().map(|_| builder.create_block()).collect();
    let entry = blocks[0];
    builder.append_block_params_for_function_params(entry);
    builder.switch_to_block(entry);
    let parameters = builder.block_params(entry).to_vec();
    let variables = function.variables.iter().map(|ty| builder.declare_var(clif_type(*ty))).collect();
    let mut lowerer = Lowerer {
        builder,
        scope,
        program,
        settings,
        linker,
        function,
        values: vec![None; function.values.len()],
        constants: vec![None; function.values.len()],
        variables,
        blocks,
        trap_exits: vec![None; function.write_backs.len()],
        call_exits: vec![None; function.write_backs.len()],
        part_exits: vec![None; function.write_backs.len()],
        regions,
        image: parameters[0],
        context: parameters[1],
        deadline: parameters[1],
        place: mir::Place(0),
        write_back: mir::WriteBack(0),
    };
    for (value, clif) in function.blocks[0].parameters.iter().zip(&parameters[2..]) {
        lowerer.values[value.index()] = Some(*clif);
    }
    lowerer.run();
}

impl Lowerer<'_, '_> {
    fn run(mut self) {
        let flags = self.host_flags().with_readonly().with_can_move();
        self.deadline = self.builder.ins().load(types::I64, flags, self.context, context::DEADLINE);
        self.add_parameters();
        let reachable = self.function.reachable();
        for number in (0..self.function.blocks.len()).filter(|number| reachable[*number]) {
            let data = &self.function.blocks[number];
            if number > 0 {
                self.builder.switch_to_block(self.blocks[number]);
            }
            self.write_back = data.write_back;
            // What is added for a block without instructions, such as the way out of a function, belongs to no line.
            self.builder.set_srcloc(ir::SourceLoc::default());
            for instruction in &data.instructions {
                self.place = instruction.place;
                if self.settings.source_lines {
                    self.builder.set_srcloc(ir::SourceLoc::new(self.place.0));
                }
                self.instruction(instruction);
            }
            self.terminator(&data.terminator);
        }
        self.builder.set_srcloc(ir::SourceLoc::default());
        self.finish_exits();
        self.builder.seal_all_blocks();
        let config = self.frontend_config();
        self.builder.finalize(config);
    }

    fn frontend_config(&self) -> cranelift_codegen::isa::TargetFrontendConfig {
        cranelift_codegen::isa::TargetFrontendConfig {
            default_call_conv: self.settings.convention,
            pointer_width: target_lexicon::PointerWidth::U64,
            page_size_align_log2: 12,
        }
    }

    fn add_parameters(&mut self) {
        for (number, data) in self.function.blocks.iter().enumerate().skip(1) {
            for value in &data.parameters {
                let ty = clif_type(self.function.ty(*value));
                let clif = self.builder.append_block_param(self.blocks[number], ty);
                self.values[value.index()] = Some(clif);
            }
        }
    }

    /// The CLIF value of a value.
    ///
    /// # Panics
    /// When it is used where its definition does not dominate, which no pass may bring about; the compiler's caller turns it into an error.
    fn value(&self, value: mir::Value) -> ir::Value {
        self.values[value.index()].expect("a definition dominates its uses")
    }

    fn define(&mut self, results: &mir::Results, value: ir::Value) {
        if let mir::Results::One(result) = results {
            self.values[result.index()] = Some(value);
        }
    }

    fn host_flags(&self) -> MemFlagsData {
        MemFlagsData::trusted().with_alias_region(Some(self.regions.host))
    }

    fn i32(&mut self, value: i32) -> ir::Value {
        self.builder.ins().iconst(types::I32, i64::from(value as u32))
    }

    fn i64(&mut self, value: i64) -> ir::Value {
        self.builder.ins().iconst(types::I64, value)
    }

    fn constant(&mut self, value: Const) -> ir::Value {
        match value {
            Const::I32(value) => self.i32(value),
            Const::I64(value) => self.i64(value),
            Const::F32(bits) => self.builder.ins().f32const(ir::immediates::Ieee32::with_bits(bits)),
            Const::F64(bits) => self.builder.ins().f64const(ir::immediates::Ieee64::with_bits(bits)),
        }
    }

    fn instruction(&mut self, instruction: &mir::Instruction) {
        let results = &instruction.results;
        match &instruction.op {
            Op::Const(value) => {
                if let mir::Results::One(result) = results {
                    self.constants[result.index()] = Some(*value);
                }
                let clif = self.constant(*value);
                self.define(results, clif);
            }
            Op::Numeric(op, operands) => {
                let clif = self.numeric(*op, *operands);
                self.define(results, clif);
            }
            Op::Select { condition, then, otherwise } => {
                let (condition, then, otherwise) = (self.value(*condition), self.value(*then), self.value(*otherwise));
                let clif = if self.builder.func.dfg.value_type(condition).is_vector() {
                    self.builder.ins().bitselect(condition, then, otherwise)
                } else {
                    self.builder.ins().select(condition, then, otherwise)
                };
                self.define(results, clif);
            }
            Op::Splat(_) | Op::Lane(..) | Op::Ramp { .. } => self.vector(instruction),
            Op::Get(var) => {
                let clif = self.builder.use_var(self.variables[var.index()]);
                self.define(results, clif);
            }
            Op::Set(var, value) => {
                let value = self.value(*value);
                self.builder.def_var(self.variables[var.index()], value);
            }
            Op::ForIsEmpty(test) => {
                let clif = self.for_is_empty(test);
                self.define(results, clif);
            }
            Op::ForContinues(test) => {
                let clif = self.for_continues(test);
                self.define(results, clif);
            }
            Op::Call(..) | Op::CallVirtual(..) | Op::Part(..) | Op::Helper(..) => self.call(instruction),
            Op::CheckIndex { .. }
            | Op::CheckRange { .. }
            | Op::CheckDivisor(_)
            | Op::CheckStep(_)
            | Op::Checkpoint { .. }
            | Op::RefCheck { .. } => self.guard(instruction),
            _ => self.memory(instruction),
        }
    }

    fn arguments(&self, target: &mir::Target) -> Vec<BlockArg> {
        target.arguments.iter().map(|value| BlockArg::Value(self.value(*value))).collect()
    }

    fn terminator(&mut self, terminator: &Terminator) {
        match terminator {
            Terminator::Jump(target) => {
                let arguments = self.arguments(target);
                self.builder.ins().jump(self.blocks[target.block.index()], &arguments);
            }
            Terminator::Branch { condition, then, otherwise } => {
                let condition = self.value(*condition);
                let (then_arguments, otherwise_arguments) = (self.arguments(then), self.arguments(otherwise));
                let (then, otherwise) = (self.blocks[then.block.index()], self.blocks[otherwise.block.index()]);
                self.builder.ins().brif(condition, then, &then_arguments, otherwise, &otherwise_arguments);
            }
            Terminator::Switch { value, targets, default } => {
                let value = self.value(*value);
                let default = self.block_call(default);
                let calls: Vec<BlockCall> = targets.iter().map(|target| self.block_call(target)).collect();
                let table = self.builder.create_jump_table(JumpTableData::new(default, &calls));
                self.builder.ins().br_table(value, table);
            }
            Terminator::Return(values) => {
                let mut results = vec![self.i32(0)];
                results.extend(values.iter().map(|value| self.value(*value)));
                self.builder.ins().return_(&results);
            }
        }
    }

    fn block_call(&mut self, target: &mir::Target) -> BlockCall {
        let arguments = self.arguments(target);
        let block = self.blocks[target.block.index()];
        BlockCall::new(block, arguments, &mut self.builder.func.dfg.value_lists)
    }
}
