//! Calls: direct, virtual, and to routines of the host.

use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::{self, AbiParam, InstBuilder, Signature, types};
use khz_bytecode::container::Owner;
use khz_bytecode::ids::{FunctionId, MethodId};
use khz_bytecode::instruction::{HelperOp, HelperOperand, MAX_CAPACITIES};
use khz_bytecode::trap::TrapCode;
use khz_bytecode::value::LocalType;

use super::{Lowerer, clif_type, clif_value_type, signature_with};
use crate::build::ProgramMemory;
use crate::context;
use crate::mir::{Instruction, Op, Value};
use crate::runtime::{FIND_METHOD, string_routine};

impl Lowerer<'_, '_> {
    /// Lowers an instruction that calls.
    pub(super) fn call(&mut self, instruction: &Instruction) {
        match &instruction.op {
            Op::Call(function, arguments) => self.direct(instruction, *function, arguments),
            Op::CallVirtual(method, arguments) => self.call_virtual(instruction, *method, arguments),
            Op::Part(number, arguments) => self.part(instruction, *number, arguments),
            Op::Helper(op, capacities, arguments) => self.helper(instruction, *op, *capacities, arguments),
            _ => {}
        }
    }

    /// Calls a routine of the host.
    pub(super) fn call_routine(
        &mut self,
        name: &'static str,
        parameters: &[ir::Type],
        results: &[ir::Type],
        arguments: &[ir::Value],
    ) -> Option<ir::Value> {
        let mut signature = Signature::new(self.settings.convention);
        signature.params.extend(parameters.iter().map(|ty| AbiParam::new(*ty)));
        signature.returns.extend(results.iter().map(|ty| AbiParam::new(*ty)));
        let routine = self.linker.routine(self.builder.func, name, &signature);
        let call = self.builder.ins().call(routine, arguments);
        self.builder.inst_results(call).first().copied()
    }

    fn direct(&mut self, instruction: &Instruction, function: FunctionId, arguments: &[Value]) {
        let callee = &self.scope.verified.container().functions[function.index()];
        let program = if matches!(callee.owner, Owner::Program(_)) { self.program } else { ProgramMemory::None };
        let frame = self.callee_frame();
        let bytes = self.i64(i64::from(self.scope.verified.function(function).frame_bytes));
        let depth = self.enter(frame, bytes);
        let mut values = vec![self.image, self.context, frame];
        if let (ProgramMemory::Shared, Some((slots, block))) = (program, self.function.program) {
            values.extend([self.value(slots), self.value(block)]);
        }
        values.extend(arguments.iter().map(|value| self.value(*value)));
        let target = self.linker.function(self.builder.func, function, program);
        let call = self.builder.ins().call(target, &values);
        self.finish(instruction, call, depth);
    }

    /// A part works on this call's frame and is none itself: it counts no depth, and what it trapped on is recorded already.
    fn part(&mut self, instruction: &Instruction, number: u32, arguments: &[Value]) {
        let program = self.function.program.into_iter().flat_map(|(slots, block)| [slots, block]);
        let taken: Vec<Value> =
            std::iter::once(self.function.frame).chain(program).chain(arguments.iter().copied()).collect();
        let types =
            |values: &[Value]| values.iter().map(|value| clif_type(self.function.ty(*value))).collect::<Vec<_>>();
        let signature =
            signature_with(&types(&taken), &types(instruction.results.as_slice()), self.settings.convention);
        let mut values = vec![self.image, self.context];
        values.extend(taken.iter().map(|value| self.value(*value)));
        let target = self.linker.part(self.builder.func, number, &signature);
        let call = self.builder.ins().call(target, &values);
        let results = self.builder.inst_results(call).to_vec();
        let Some((status, results)) = results.split_first() else { return };
        self.leave_if_part_trapped(*status);
        for (value, clif) in instruction.results.as_slice().iter().zip(results) {
            self.values[value.index()] = Some(*clif);
        }
    }

    fn call_virtual(&mut self, instruction: &Instruction, method: MethodId, arguments: &[Value]) {
        let Some((address, rest)) = arguments.split_first() else { return };
        let address = self.value(*address);
        let method_number = self.i32(i32::from(method.0));
        let parameters = [types::I64, types::I64, types::I32];
        let arguments = [self.context, address, method_number];
        let found = self.call_routine(FIND_METHOD, &parameters, &[types::I32], &arguments);
        let found = found.unwrap_or(address);
        let missing = self.builder.ins().icmp_imm_s(IntCC::Equal, found, 0);
        let zero = self.i64(0);
        self.trap_if(missing, TrapCode::Reference as u32, [address, zero, zero]);
        let flags = self.host_flags();
        let code = self.builder.ins().load(types::I64, flags, self.context, context::FOUND_CODE);
        let bytes = self.builder.ins().load(types::I64, flags, self.context, context::FOUND_FRAME_BYTES);
        let frame = self.callee_frame();
        let depth = self.enter(frame, bytes);
        let data = i64::from(self.scope.layout.data.start);
        let start = self.builder.ins().iadd_imm_s(self.image, data);
        let this = self.builder.ins().iadd(start, address);
        let mut values = vec![self.image, self.context, frame, this];
        values.extend(rest.iter().map(|value| self.value(*value)));
        let signature = self.method_signature(method);
        let signature = self.builder.import_signature(signature);
        let call = self.builder.ins().call_indirect(signature, code, &values);
        self.finish(instruction, call, depth);
    }

    fn method_signature(&self, method: MethodId) -> Signature {
        let declared = &self.scope.verified.container().types.methods[method.index()];
        let mut signature = Signature::new(self.settings.convention);
        signature.params.extend([AbiParam::new(types::I64); 4]);
        for ty in &declared.parameters {
            signature.params.push(AbiParam::new(match ty {
                LocalType::Scalar(storage) => clif_value_type(storage.value_type()),
                LocalType::Ref(_) => types::I64,
            }));
        }
        signature.returns.push(AbiParam::new(types::I32));
        signature.returns.extend(declared.results.iter().map(|ty| AbiParam::new(clif_value_type(*ty))));
        signature
    }

    /// Where a callee's frame bytes start: where this call's end.
    fn callee_frame(&mut self) -> ir::Value {
        let bytes = self.scope.verified.function(self.function.id).frame_bytes;
        let frame = self.value(self.function.frame);
        if bytes == 0 { frame } else { self.builder.ins().iadd_imm_s(frame, i64::from(bytes)) }
    }

    /// Counts the depth and holds the frame inside its region; gives the depth to go back to.
    fn enter(&mut self, frame: ir::Value, frame_bytes: ir::Value) -> Option<ir::Value> {
        if !self.settings.depth {
            return None;
        }
        let flags = self.host_flags();
        let limit = i64::from(self.scope.verified.container().parameters.max_call_depth);
        let depth = self.builder.ins().load(types::I32, flags, self.context, context::DEPTH);
        let deeper = self.builder.ins().iadd_imm_s(depth, 1);
        let reached = self.builder.ins().uextend(types::I64, deeper);
        let zero = self.i64(0);
        let too_deep = self.builder.ins().icmp_imm_u(IntCC::UnsignedGreaterThan, deeper, limit);
        let end = self.builder.ins().iadd(frame, frame_bytes);
        let frame_limit = self.builder.ins().load(types::I64, flags, self.context, context::FRAME_LIMIT);
        let too_long = self.builder.ins().icmp(IntCC::UnsignedGreaterThan, end, frame_limit);
        let refused = self.builder.ins().bor(too_deep, too_long);
        self.trap_if(refused, TrapCode::CallDepth as u32, [reached, zero, zero]);
        self.builder.ins().store(flags, deeper, self.context, context::DEPTH);
        Some(depth)
    }

    fn finish(&mut self, instruction: &Instruction, call: ir::Inst, depth: Option<ir::Value>) {
        let results = self.builder.inst_results(call).to_vec();
        let Some((status, results)) = results.split_first() else { return };
        self.leave_if_trapped(*status);
        if let Some(depth) = depth {
            let flags = self.host_flags();
            self.builder.ins().store(flags, depth, self.context, context::DEPTH);
        }
        for (value, clif) in instruction.results.as_slice().iter().zip(results) {
            self.values[value.index()] = Some(*clif);
        }
    }

    fn helper(
        &mut self,
        instruction: &Instruction,
        op: HelperOp,
        capacities: [u16; MAX_CAPACITIES],
        operands: &[Value],
    ) {
        let mut capacities = capacities.into_iter();
        let mut types = vec![types::I64];
        let mut arguments = vec![self.context];
        for (operand, value) in op.operands().iter().zip(operands) {
            let value = self.value(*value);
            match operand {
                HelperOperand::Value(ty) => {
                    types.push(clif_value_type(*ty));
                    arguments.push(value);
                }
                _ => {
                    // Offset in the image in the low half, capacity above.
                    let capacity = i64::from(capacities.next().unwrap_or(0)) << 32;
                    let offset = self.builder.ins().isub(value, self.image);
                    types.push(types::I64);
                    arguments.push(self.builder.ins().iadd_imm_s(offset, capacity));
                }
            }
        }
        let results: Vec<ir::Type> = op.result().map(clif_value_type).into_iter().collect();
        let result = self.call_routine(string_routine(op).name, &types, &results, &arguments);
        if let Some(result) = result {
            self.define(&instruction.results, result);
        }
    }
}
