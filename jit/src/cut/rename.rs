//! A part as a function: everything that it names gets a number of its own, so that a part is as small as its stretch.

use std::collections::BTreeMap;

use crate::mir::{
    Block, BlockData, Control, Function, Instruction, LoopData, Op, Place, Results, Target, Terminator, Type, Value,
    Var, WriteBack,
};

/// Numbers of a function that become those of a part.
pub(super) struct Renamer<'a> {
    old: &'a Function,
    new: Function,
    values: BTreeMap<Value, Value>,
    variables: BTreeMap<Var, Var>,
    places: BTreeMap<Place, Place>,
    entry: BlockData,
}

impl<'a> Renamer<'a> {
    /// A part that takes values and variables of a function and gives variables.
    pub fn new(old: &'a Function, inputs: &[Value], variables: &[Var], results: &[Var]) -> Self {
        let mut new = Function {
            id: old.id,
            values: Vec::new(),
            variables: Vec::new(),
            blocks: Vec::new(),
            loops: Vec::new(),
            places: old.places[..1].to_vec(),
            write_backs: vec![Vec::new()],
            results: results.iter().map(|var| old.variables[var.index()]).collect(),
            frame: Value(0),
            program: None,
        };
        new.frame = new.new_value(Type::Ref);
        new.program = old.program.map(|_| (new.new_value(Type::Ref), new.new_value(Type::Ref)));
        let mut values = BTreeMap::from([(old.frame, new.frame)]);
        if let (Some(old), Some(new)) = (old.program, new.program) {
            values.extend([(old.0, new.0), (old.1, new.1)]);
        }
        let hidden = 1 + if new.program.is_some() { 2 } else { 0 };
        let entry = BlockData {
            parameters: (0..hidden).map(Value).collect(),
            instructions: Vec::new(),
            terminator: Terminator::Jump(Target { block: Block(1), arguments: Vec::new() }),
            innermost_loop: None,
            write_back: WriteBack(0),
        };
        let places = BTreeMap::from([(Place(0), Place(0))]);
        let mut renamer = Renamer { old, new, values, variables: BTreeMap::new(), places, entry };
        for value in inputs {
            let own = renamer.value(*value);
            renamer.entry.parameters.push(own);
        }
        for var in variables {
            let value = renamer.new.new_value(old.variables[var.index()]);
            renamer.entry.parameters.push(value);
            let op = Op::Set(renamer.variable(*var), value);
            renamer.entry.instructions.push(Instruction { op, results: Results::None, place: Place(0) });
        }
        renamer
    }

    /// The part of these blocks and loops, which name values, variables and places of the function, and each other by position.
    pub fn part(mut self, blocks: Vec<BlockData>, loops: Vec<LoopData>) -> Function {
        self.new.blocks = Vec::with_capacity(blocks.len() + 1);
        self.new.blocks.push(self.entry.clone());
        for mut data in blocks {
            data.parameters.iter_mut().for_each(|value| *value = self.value(*value));
            for instruction in &mut data.instructions {
                self.instruction(instruction);
            }
            data.terminator.for_each_operand(|value| *value = self.value(*value));
            data.terminator.targets_mut().into_iter().for_each(|target| target.block.0 += 1);
            self.new.blocks.push(data);
        }
        for mut data in loops {
            data.header.0 += 1;
            if let Some(counted) = &mut data.counted {
                for value in [&mut counted.initial, &mut counted.bound, &mut counted.step] {
                    *value = self.value(*value);
                }
                if let Control::Var(var) = &mut counted.control {
                    *var = self.variable(*var);
                }
            }
            self.new.loops.push(data);
        }
        self.new
    }

    fn instruction(&mut self, instruction: &mut Instruction) {
        instruction.op.for_each_operand(|value| *value = self.value(*value));
        if let Op::Get(var) | Op::Set(var, _) = &mut instruction.op {
            *var = self.variable(*var);
        }
        match &mut instruction.results {
            Results::None => {}
            Results::One(value) => *value = self.value(*value),
            Results::Many(values) => values.iter_mut().for_each(|value| *value = self.value(*value)),
        }
        instruction.place = self.place(instruction.place);
    }

    fn value(&mut self, value: Value) -> Value {
        let Renamer { old, new, values, .. } = self;
        *values.entry(value).or_insert_with(|| new.new_value(old.ty(value)))
    }

    fn variable(&mut self, var: Var) -> Var {
        let Renamer { old, new, variables, .. } = self;
        *variables.entry(var).or_insert_with(|| new.new_variable(old.variables[var.index()]))
    }

    fn place(&mut self, place: Place) -> Place {
        if let Some(known) = self.places.get(&place) {
            return *known;
        }
        let mut data = self.old.places[place.index()];
        // Inlining nests at most as deep as calls may.
        data.caller = data.caller.map(|caller| self.place(caller));
        self.new.places.push(data);
        let own = Place(self.new.places.len() as u32 - 1);
        self.places.insert(place, own);
        own
    }
}
