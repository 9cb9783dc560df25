//! Instructions that compute, and the dispatch over all instructions that do not end a block.

use khz_bytecode::container::Constant;
use khz_bytecode::ids::FunctionId;
use khz_bytecode::instruction::{HelperOp, Instruction as Code, MAX_CAPACITIES, NumericOp};
use khz_bytecode::value::IntegerType;

use super::{Builder, Entry};
use crate::mir::{Const, Instruction, Op, Results};

impl Builder<'_> {
    /// Translates an instruction that does not end a block.
    pub(super) fn instruction(&mut self, code: &Code) {
        match code {
            Code::Nop {} => {}
            Code::ConstI32 { value } => {
                let value = self.constant(Const::I32(*value));
                self.push(value);
            }
            Code::Const { id } => {
                let value = match self.scope.verified.container().constants[id.index()] {
                    Constant::I64(value) => Const::I64(value),
                    Constant::F32(bits) => Const::F32(bits),
                    Constant::F64(bits) => Const::F64(bits),
                };
                let value = self.constant(value);
                self.push(value);
            }
            Code::Drop {} => {
                self.pop_entry();
            }
            Code::Dup {} => {
                let entry = self.pop_entry();
                self.stack.extend([entry, entry]);
            }
            Code::Select {} => self.select(),
            Code::Numeric(op) => self.numeric(*op),
            Code::Helper(op, capacities) => self.helper(*op, *capacities),
            Code::CheckI32 { kind, lower, upper } => self.check(*kind, i64::from(*lower), i64::from(*upper)),
            Code::CheckI64 { kind, lower, upper } => self.check(*kind, *lower, *upper),
            Code::Call { function } => self.call(*function),
            Code::CallVirtual { method } => {
                let signature = &self.scope.verified.container().types.methods[method.index()];
                let arguments = self.pop_many(signature.parameters.len() + 1);
                self.finish_call(Op::CallVirtual(*method, arguments), &signature.results);
            }
            memory_or_control => self.memory(memory_or_control),
        }
    }

    fn select(&mut self) {
        let condition = self.pop();
        let (otherwise, then) = (self.pop_entry(), self.pop_entry());
        let image = [otherwise, then].iter().any(|entry| matches!(entry, Entry::Ref(_, true)));
        let is_ref = matches!(then, Entry::Ref(..));
        let (otherwise, then) = (self.materialise(otherwise), self.materialise(then));
        let ty = self.out.ty(then);
        let value = self.define(ty, Op::Select { condition, then, otherwise });
        if is_ref {
            let address = self.at(crate::mir::Base::Value(value), 0);
            self.stack.push(Entry::Ref(address, image));
        } else {
            self.push(value);
        }
    }

    fn numeric(&mut self, op: NumericOp) {
        let value = match *op.operands() {
            [_] => {
                let a = self.pop();
                self.unary(op, a)
            }
            _ => {
                let (b, a) = (self.pop(), self.pop());
                if op.trap().is_some() {
                    self.effect(Op::CheckDivisor(b));
                }
                self.binary(op, a, b)
            }
        };
        self.push(value);
    }

    fn helper(&mut self, op: HelperOp, capacities: [u16; MAX_CAPACITIES]) {
        debug_assert!(op.capacity_count() <= MAX_CAPACITIES);
        let values = self.pop_many(op.operands().len());
        let op_code = Op::Helper(op, capacities, values);
        match op.result() {
            Some(ty) => {
                let value = self.define(ty.into(), op_code);
                self.push(value);
            }
            None => self.effect(op_code),
        }
    }

    fn check(&mut self, ty: IntegerType, lower: i64, upper: i64) {
        let value = self.pop();
        self.effect(Op::CheckRange { value, ty, lower, upper });
        self.push(value);
    }

    fn call(&mut self, function: FunctionId) {
        let callee = &self.scope.verified.container().functions[function.index()];
        let this = usize::from(matches!(callee.owner, khz_bytecode::container::Owner::Block(_)));
        let arguments = self.pop_many(callee.parameter_types().len() + this);
        self.finish_call(Op::Call(function, arguments), &callee.results);
    }

    fn finish_call(&mut self, op: Op, results: &[khz_bytecode::value::ValueType]) {
        let values: Vec<_> = results.iter().map(|ty| self.out.new_value((*ty).into())).collect();
        let results = Results::Many(values.clone());
        self.pending.push(Instruction { op, results, place: self.place });
        values.into_iter().for_each(|value| self.push(value));
    }
}
