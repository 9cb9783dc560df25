//! The third evaluator: bytecode as `docs/bytecode.md` tells it, one instruction at a time, every access checked.
//!
//! Integers are computed in 128 bits, strings on copies, texts and dates are counted out, references carry their types. With the engines it shares the verifier's facts,
//! of `khz_machine` the layout of the image and the bytes of a scalar in it (`load_scalar`, `store_scalar`), and two libraries: `libm` for what is no
//! basic arithmetic (`machine/tests/numeric.rs` holds it near the system's library), and Rust's own digits of floating-point numbers, for which nothing else
//! speaks here. The layout's other oracle is the tree of generated Structured Text, which knows no addresses. Its only aim is that a reader can hold it against the document. Where the verifier's promise is broken (a wrong type on the
//! stack, an access outside the image, a control variable that was proven to be kept and is not), it panics: that is a finding in the verifier, and the panic is its report.

pub(crate) mod calendar;
mod numeric;
mod step;
mod strings;
mod texts;

use std::ops::Range;
use std::sync::Arc;

use khz_bytecode::container::{Container, Owner};
use khz_bytecode::ids::FunctionId;
use khz_bytecode::limits::SLOT_BYTES;
use khz_bytecode::value::{LocalType, RefType, StackType};
use khz_bytecode::verify::Verified;
use khz_machine::engine::{Engine, Entry, Fuel, Limits};
use khz_machine::image::{Image, ImageLayout};
use khz_machine::semantics::{Value, load_scalar, store_scalar};
use khz_machine::trap::{CodePlace, Trap, TrapCode};

use crate::statistics::Executed;

/// The third engine.
#[derive(Debug)]
pub struct Evaluator {
    verified: Arc<Verified>,
    layout: ImageLayout,
    charges_fuel: bool,
    /// For each function and instruction, the fuel of the loop whose header begins there.
    headers: Vec<Vec<Option<u32>>>,
    executed: Executed,
    watches: Vec<Watch>,
}

/// Bytes of the image whose writers are wanted.
#[derive(Debug, Clone)]
struct Watch {
    bytes: Range<u32>,
    /// The instruction that wrote them last, then the calls that led there, innermost first; empty: none did.
    writer: Vec<CodePlace>,
}

impl Evaluator {
    /// For a resource; `layout` must be that of the images it will run on. With `charges_fuel`, [`Limits::fuel`] is looked at.
    #[must_use]
    pub fn new(verified: Arc<Verified>, layout: &ImageLayout, charges_fuel: bool) -> Self {
        let headers = (verified.facts().functions.iter()).map(|facts| {
            let mut headers = vec![None; facts.instructions.len()];
            for found in &facts.loops {
                headers[facts.blocks[found.header.index()].start] = Some(found.fuel);
            }
            headers
        });
        let headers = headers.collect();
        let (executed, watches) = (Executed::default(), Vec::new());
        Evaluator { verified, layout: layout.clone(), charges_fuel, headers, executed, watches }
    }

    /// What it ran so far.
    #[must_use]
    pub fn executed(&self) -> &Executed {
        &self.executed
    }

    /// From now on, who writes to these bytes of the image is remembered; see [`Evaluator::writer`].
    pub fn watch(&mut self, bytes: impl IntoIterator<Item = Range<u32>>) {
        self.watches = bytes.into_iter().map(|bytes| Watch { bytes, writer: Vec::new() }).collect();
    }

    /// The instruction that last wrote to the watched bytes at `position` of [`Evaluator::watch`], and behind it the calls that led there, innermost first;
    /// empty when none did. A write counts whatever it writes.
    #[must_use]
    pub fn writer(&self, position: usize) -> &[CodePlace] {
        self.watches.get(position).map_or(&[], |watch| &watch.writer)
    }

    /// Image offsets of the slots and data block of a program instance.
    fn bases(&self, instance: Option<usize>) -> (u32, Option<u32>) {
        let Some(instance) = instance else { return (0, None) };
        let slot = u32::from(self.verified.container().tasks.instances[instance].slot_offset);
        let block = self.verified.facts().instance_blocks[instance];
        (self.layout.slots.start + slot * SLOT_BYTES, block.map(|block| self.layout.data.start + block))
    }
}

impl Engine for Evaluator {
    fn name(&self) -> &'static str {
        "evaluator"
    }

    fn run(&mut self, entry: Entry, image: &mut Image, limits: Limits<'_>) -> Result<(), Trap> {
        let verified = self.verified.clone();
        let container = verified.container();
        let (function, instance) = match entry {
            Entry::Init => (container.parameters.init_function, None),
            Entry::Startup => (container.parameters.startup_function, None),
            Entry::Instance(index) => (container.tasks.instances.get(index).map(|i| i.entry), Some(index)),
        };
        let Some(function) = function else { return Ok(()) };
        let (program, block) = self.bases(instance);
        let frames = self.layout.frames[limits.task_index].clone();
        let mut run = Run {
            verified: &verified,
            container,
            layout: &self.layout,
            image: image.bytes_mut(),
            deadline: limits.deadline,
            fuel: limits.fuel.filter(|_| self.charges_fuel),
            program,
            block,
            frames: frames.clone(),
            stack: Vec::new(),
            calls: Vec::new(),
            headers: &self.headers,
            executed: &mut self.executed,
            watches: &mut self.watches,
        };
        let result = run.enter(function, frames.start, 0).and_then(|()| run.go());
        let result = result.map_err(|stop| run.trap(stop));
        if let Err(trap) = &result {
            self.executed.trapped(trap.code);
        }
        result
    }

    fn code_bytes(&self) -> usize {
        self.verified.container().functions.iter().map(|function| function.code.len()).sum()
    }
}

/// Why a run ends early.
#[derive(Debug, Clone, Copy)]
struct Stop {
    code: TrapCode,
    values: [i64; 3],
}

fn stop<T>(code: TrapCode, values: [i64; 3]) -> Result<T, Stop> {
    Err(Stop { code, values })
}

/// An entry of the operand stack.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Item {
    Value(Value),
    /// An offset into the image.
    Ref(u32, RefType),
}

impl Item {
    fn stack_type(self) -> StackType {
        match self {
            Item::Value(value) => StackType::Value(value.value_type()),
            Item::Ref(_, ty) => StackType::Ref(ty),
        }
    }
}

/// What an `l` slot holds.
#[derive(Debug, Clone, Copy)]
enum Local {
    /// The 8 bytes of a scalar.
    Bytes([u8; 8]),
    Ref(u32),
    Unassigned,
}

/// An open call.
#[derive(Debug)]
struct Activation {
    function: FunctionId,
    /// The instruction that runs now; in a caller, its call.
    at: usize,
    locals: Vec<Local>,
    /// For each FOR loop, what its last `for.enter` or `for.next` left in the control variable.
    controls: Vec<i64>,
    /// Image offset of its frame bytes.
    frame: u32,
    /// Image offset of the instance it was called on.
    this: u32,
    /// Entries of the operand stack that are its caller's.
    base: usize,
}

struct Run<'a> {
    verified: &'a Verified,
    container: &'a Container,
    layout: &'a ImageLayout,
    image: &'a mut [u8],
    deadline: &'a khz_machine::engine::DeadlineCell,
    fuel: Option<&'a mut Fuel>,
    /// Image offset of the instance's slots.
    program: u32,
    /// Image offset of the instance's data block.
    block: Option<u32>,
    /// Frame bytes of the task.
    frames: Range<u32>,
    stack: Vec<Item>,
    calls: Vec<Activation>,
    headers: &'a [Vec<Option<u32>>],
    executed: &'a mut Executed,
    watches: &'a mut [Watch],
}

impl Run<'_> {
    fn top(&mut self) -> &mut Activation {
        self.calls.last_mut().expect("a function runs")
    }

    /// Where it is, then the calls that led there, innermost first.
    fn places(&self) -> impl Iterator<Item = CodePlace> + '_ {
        self.calls.iter().rev().map(|call| {
            let offset = self.verified.function(call.function).instructions[call.at].offset;
            CodePlace { function: call.function, offset }
        })
    }

    /// Notes that the running instruction writes `size` bytes at `at`.
    fn writes(&mut self, at: u32, size: u32) {
        let is_meant = |watch: &Watch| watch.bytes.start < at.saturating_add(size) && at < watch.bytes.end;
        if !self.watches.iter().any(is_meant) {
            return;
        }
        let places: Vec<CodePlace> = self.places().collect();
        for watch in self.watches.iter_mut().filter(|watch| is_meant(watch)) {
            watch.writer.clone_from(&places);
        }
    }

    fn trap(&self, stop: Stop) -> Trap {
        let mut places = self.places();
        let mut trap = Trap::new(stop.code, places.next().expect("a function ran"), stop.values);
        places.for_each(|place| trap.push_caller(place));
        trap
    }

    /// Deadline, then fuel.
    fn charge(&mut self, units: u32) -> Result<(), Stop> {
        if let Some(code) = self.deadline.expired() {
            return stop(code, [0; 3]);
        }
        let Some(fuel) = &mut self.fuel else { return Ok(()) };
        match fuel.left.checked_sub(u64::from(units)) {
            Some(rest) => fuel.left = rest,
            None => {
                fuel.left = 0;
                return stop(TrapCode::Watchdog, [0; 3]);
            }
        }
        Ok(())
    }

    /// Opens a call; its arguments lie on the stack (`this` was taken already).
    fn enter(&mut self, id: FunctionId, frame: u32, this: u32) -> Result<(), Stop> {
        let function = &self.container.functions[id.index()];
        let facts = self.verified.function(id);
        let fresh = |local: &LocalType| match local {
            LocalType::Scalar(_) => Local::Bytes([0; 8]),
            LocalType::Ref(_) => Local::Unassigned,
        };
        let locals = function.locals.iter().map(fresh).collect();
        let parameters = usize::from(function.parameters);
        let base = self.stack.len() - parameters;
        let controls = vec![0; function.for_loops.len()];
        self.calls.push(Activation { function: id, at: 0, locals, controls, frame, this, base });
        for index in (0..parameters).rev() {
            self.store_local(index);
        }
        let size = function.frame.map_or(0, |ty| self.verified.facts().type_extents[ty.index()].size);
        self.bytes(frame, size.next_multiple_of(8)).fill(0);
        self.charge(facts.entry_fuel)
    }

    /// Runs until the entry function returns.
    fn go(&mut self) -> Result<(), Stop> {
        let verified = self.verified;
        while !self.calls.is_empty() {
            let (function, at) = (self.top().function, self.top().at);
            if let Some(fuel) = self.headers[function.index()][at] {
                self.charge(fuel)?;
            }
            let placed = &verified.function(function).instructions[at];
            self.executed.ran(&placed.instruction);
            self.step(&placed.instruction)?;
        }
        Ok(())
    }

    fn bytes(&mut self, at: u32, size: u32) -> &mut [u8] {
        let end = at.checked_add(size).filter(|end| *end as usize <= self.image.len());
        let end = end.unwrap_or_else(|| panic!("{size} bytes at {at} lie outside the image"));
        &mut self.image[at as usize..end as usize]
    }

    fn push(&mut self, value: Value) {
        self.stack.push(Item::Value(value));
    }

    fn pop(&mut self) -> Item {
        let base = self.top().base;
        assert!(self.stack.len() > base, "the stack is empty");
        self.stack.pop().expect("it is longer than its base")
    }

    fn pop_value(&mut self) -> Value {
        match self.pop() {
            Item::Value(value) => value,
            Item::Ref(..) => panic!("a reference where a value is due"),
        }
    }

    fn pop_i32(&mut self) -> i32 {
        match self.pop_value() {
            Value::I32(value) => value,
            other => panic!("{other:?} where an i32 is due"),
        }
    }

    fn pop_i64(&mut self) -> i64 {
        match self.pop_value() {
            Value::I64(value) => value,
            other => panic!("{other:?} where an i64 is due"),
        }
    }

    fn pop_ref(&mut self) -> (u32, RefType) {
        match self.pop() {
            Item::Ref(at, ty) => (at, ty),
            Item::Value(value) => panic!("{value:?} where a reference is due"),
        }
    }

    /// Stores the top of the stack into an `l` slot.
    fn store_local(&mut self, index: usize) {
        let item = self.pop_argument();
        let id = self.top().function;
        let value = match (self.container.functions[id.index()].locals[index], item) {
            (LocalType::Scalar(storage), Item::Value(value)) => {
                assert_eq!(storage.value_type(), value.value_type(), "an argument of another type");
                let mut bytes = [0; 8];
                store_scalar(&mut bytes, storage, value);
                Local::Bytes(bytes)
            }
            (LocalType::Ref(wanted), Item::Ref(at, found)) => {
                let is_this_kind =
                    found.target == wanted.target && (found.write || !wanted.write) && (wanted.image || !found.image);
                assert!(is_this_kind, "{found} stored as {wanted}");
                Local::Ref(at)
            }
            (local, item) => panic!("{item:?} stored as {local:?}"),
        };
        self.top().locals[index] = value;
    }

    /// The top of the stack, which may be an argument that the new call's base counts as its own.
    fn pop_argument(&mut self) -> Item {
        self.stack.pop().expect("an argument")
    }

    fn load_local(&mut self, index: usize) -> Item {
        let id = self.top().function;
        match (self.container.functions[id.index()].locals[index], self.top().locals[index]) {
            (LocalType::Scalar(storage), Local::Bytes(bytes)) => Item::Value(load_scalar(&bytes, storage)),
            (LocalType::Ref(ty), Local::Ref(at)) => Item::Ref(at, ty),
            (ty, local) => panic!("l {index} of {ty:?} holds {local:?}"),
        }
    }

    fn owner(&mut self) -> Owner {
        let id = self.top().function;
        self.container.functions[id.index()].owner
    }
}
