//! Calls: direct ones to later functions, virtual ones to whatever stands at an address.

use khz_bytecode::container::{Owner, Type};
use khz_bytecode::ids::{FunctionId, MethodId, TypeId};
use khz_bytecode::instruction::Instruction;
use khz_bytecode::value::{LocalType, ValueType};

use super::body::Body;

impl Body<'_> {
    /// Functions that this one may call. Calls go to later functions only, so they form no cycle.
    fn callees(&self) -> Vec<FunctionId> {
        let functions = self.world.container.functions.iter().enumerate().skip(self.id.index() + 1);
        let allowed = functions.filter(|(_, function)| {
            !matches!(function.owner, Owner::Program(_)) || function.owner == self.function.owner
        });
        // An entry function is a program's affair alone, but a call to it is as good as any other.
        allowed.map(|(at, _)| FunctionId(at as u16)).collect()
    }

    fn arguments(&mut self, parameters: &[LocalType], depth: usize) {
        for parameter in parameters {
            match parameter {
                LocalType::Scalar(storage) => self.expression(storage.value_type(), depth),
                LocalType::Ref(ty) => {
                    self.reference(ty.target, ty.write, !ty.image, depth);
                }
            }
            self.waiting += 1;
        }
        self.waiting -= parameters.len();
    }

    /// Block types that are `ancestor` or derive from it.
    fn derived(&self, ancestor: TypeId) -> Vec<TypeId> {
        let mut found = vec![ancestor];
        for (at, ty) in self.world.container.types.types.iter().enumerate() {
            if let Type::Block { base: Some(base), .. } = ty
                && found.contains(base)
            {
                found.push(TypeId(at as u16));
            }
        }
        found
    }

    fn call(&mut self, id: FunctionId, depth: usize) -> Vec<ValueType> {
        let callee = &self.world.container.functions[id.index()];
        let (owner, parameters, results) = (callee.owner, callee.parameter_types().to_vec(), callee.results.clone());
        let is_method = if let Owner::Block(ty) = owner {
            let derived = self.derived(ty);
            let ty = derived[self.world.random.below(derived.len())];
            self.reference(ty, true, true, depth);
            1
        } else {
            0
        };
        self.waiting += is_method;
        self.arguments(&parameters, depth);
        self.waiting -= is_method;
        self.put(Instruction::Call { function: id });
        results
    }

    fn call_virtual(&mut self, method: MethodId, depth: usize) -> Vec<ValueType> {
        let signature = self.world.container.types.methods[method.index()].clone();
        let types = self.world.container.types.types.iter().enumerate();
        let has =
            |ty: &Type| matches!(ty, Type::Block { methods, .. } if methods.iter().any(|(name, _)| *name == method));
        let blocks: Vec<TypeId> = types.filter(|(_, ty)| has(ty)).map(|(at, _)| TypeId(at as u16)).collect();
        let careful = self.world.random.chance(self.world.profile.care);
        match self.world.random.pick(&blocks).copied().filter(|_| careful) {
            Some(block) => {
                let derived = self.derived(block);
                let ty = derived[self.world.random.below(derived.len())];
                self.reference(ty, false, true, depth);
                self.put(Instruction::RefToInt {});
            }
            None => self.expression(ValueType::I64, depth),
        }
        self.waiting += 1;
        self.arguments(&signature.parameters, depth);
        self.waiting -= 1;
        self.put(Instruction::CallVirtual { method });
        signature.results
    }

    /// A call whose first result has this type; another expression when there is none.
    pub fn called(&mut self, ty: ValueType, depth: usize) {
        let first = |results: &[ValueType]| results.first() == Some(&ty);
        let mut callees = self.callees();
        callees.retain(|id| first(&self.world.container.functions[id.index()].results));
        let methods = self.world.container.types.methods.iter().enumerate();
        let methods: Vec<MethodId> =
            methods.filter(|(_, method)| first(&method.results)).map(|(at, _)| MethodId(at as u16)).collect();
        let is_virtual = self.world.profile.virtual_calls && self.world.random.chance(40);
        let results = if let Some(method) = self.world.random.pick(&methods).copied().filter(|_| is_virtual) {
            self.call_virtual(method, depth - 1)
        } else if let Some(callee) = self.world.random.pick(&callees).copied() {
            self.call(callee, depth - 1)
        } else {
            return self.expression(ty, depth - 1);
        };
        results.iter().skip(1).for_each(|_| self.put(Instruction::Drop {}));
    }

    /// A call whose results are stored or dropped.
    pub fn call_statement(&mut self, depth: usize) {
        let callees = self.callees();
        let methods = self.world.container.types.methods.len();
        let is_virtual = self.world.profile.virtual_calls && self.world.random.chance(40);
        let results = if is_virtual {
            let method = MethodId(self.world.random.below(methods) as u16);
            self.call_virtual(method, depth)
        } else if let Some(callee) = self.world.random.pick(&callees).copied() {
            self.call(callee, depth)
        } else {
            Vec::new()
        };
        if results.is_empty() {
            self.put(Instruction::Nop {});
        }
        for result in results.iter().rev() {
            if self.world.random.chance(75) {
                let variable = self.variable(*result, true);
                self.put(variable.store());
            } else {
                self.put(Instruction::Drop {});
            }
        }
    }
}
