//! Functions: their memory, and statements to instructions.

use std::collections::BTreeMap;

use khz_bytecode::container::{ControlPlace, Field, ForLoop, Function, Owner};
use khz_bytecode::ids::{ForId, Label, SlotIndex};
use khz_bytecode::instruction::Instruction as I;
use khz_bytecode::value::{BytePlace, LocalType, SlotPlace, Storage, ValueType};

use super::Builder;
use super::emit::Emitter;
use super::place::{Address, Home};
use crate::analysis::tree::{Expr, ExprKind, ForStmt, Place, PouId, Stmt, StmtKind, VarId};
use crate::analysis::types::{Const, Ty, TyKind, integer_type};
use crate::source::Span;

/// A call whose arguments and outputs are being handled.
#[derive(Debug)]
pub(super) struct CallContext {
    pub(super) instance: Home,
    pub(super) outputs: Vec<(VarId, Home)>,
}

/// Where a value waits that an expression needs once more.
pub(super) enum Kept {
    /// A scalar.
    Slot(SlotIndex),
    /// Anything else: its place in the frame.
    Frame(u32),
}

/// A function in the making.
pub(super) struct FunctionBuilder<'b, 'p> {
    pub(super) b: &'b mut Builder<'p>,
    pub(super) e: Emitter,
    /// The unit whose body this is.
    pub(super) unit: Option<PouId>,
    /// Where the unit's variables are.
    pub(super) homes: Vec<Home>,
    pub(super) calls: Vec<CallContext>,
    pub(super) locals: Vec<LocalType>,
    pub(super) parameters: u16,
    pub(super) results: Vec<ValueType>,
    for_loops: Vec<ForLoop>,
    frame: Vec<Field>,
    frame_size: u32,
    free_slots: BTreeMap<Storage, Vec<SlotIndex>>,
    free_temporaries: BTreeMap<Ty, Vec<u32>>,
    used_temporaries: Vec<(Ty, u32)>,
    /// Values of the expression that is made which it needs once more, the next one last.
    pub(super) kept: Vec<Kept>,
    loops: Vec<(Label, Label)>,
    end: Label,
}

impl<'b, 'p> FunctionBuilder<'b, 'p> {
    pub(super) fn new(b: &'b mut Builder<'p>, unit: Option<PouId>) -> Self {
        let mut e = Emitter::default();
        let end = e.label();
        FunctionBuilder {
            b,
            e,
            unit,
            homes: Vec::new(),
            calls: Vec::new(),
            locals: Vec::new(),
            parameters: 0,
            results: Vec::new(),
            for_loops: Vec::new(),
            frame: Vec::new(),
            frame_size: 0,
            free_slots: BTreeMap::new(),
            free_temporaries: BTreeMap::new(),
            used_temporaries: Vec::new(),
            kept: Vec::new(),
            loops: Vec::new(),
            end,
        }
    }

    /// A new `L` slot.
    pub(super) fn local(&mut self, ty: LocalType) -> SlotIndex {
        let index = self.b.id16(self.locals.len(), "local variables of one function");
        self.locals.push(ty);
        SlotIndex(index)
    }

    /// An `L` slot for a value that waits a moment; give it back with `release`.
    pub(super) fn scratch(&mut self, storage: Storage) -> SlotIndex {
        match self.free_slots.get_mut(&storage).and_then(Vec::pop) {
            Some(slot) => slot,
            None => self.local(LocalType::Scalar(storage)),
        }
    }

    pub(super) fn release(&mut self, slot: SlotIndex) {
        if let Some(LocalType::Scalar(storage)) = self.locals.get(slot.index()) {
            self.free_slots.entry(*storage).or_default().push(slot);
        }
    }

    /// Room in the frame.
    pub(super) fn frame_room(&mut self, ty: Ty) -> u32 {
        let ty = self.b.actual(ty);
        let (size, align) = self.b.project.types.extent(ty);
        let id = self.b.type_id(ty);
        let offset = self.frame_size.next_multiple_of(align.max(1));
        match offset.checked_add(size).filter(|end| u64::from(*end) <= khz_bytecode::limits::MAX_IMAGE_BYTES) {
            Some(end) => {
                self.frame.push(Field { offset, ty: id });
                self.frame_size = end;
            }
            None => self.b.fail("bytes of local variables of one function"),
        }
        offset
    }

    /// Room in the frame until the statement ends.
    pub(super) fn temporary(&mut self, ty: Ty) -> u32 {
        let ty = self.b.actual(ty);
        let offset = match self.free_temporaries.get_mut(&ty).and_then(Vec::pop) {
            Some(offset) => offset,
            None => self.frame_room(ty),
        };
        self.used_temporaries.push((ty, offset));
        offset
    }

    /// Ends the function: code, frame, and what the container says of it.
    pub(super) fn finish(
        mut self,
        owner: Owner,
        epilogue: impl FnOnce(&mut Self),
    ) -> (Function, Vec<(u32, Span)>, super::FunctionCost) {
        let end = self.end;
        self.e.bind(end);
        if self.e.is_reachable() {
            epilogue(&mut self);
            let results = u32::try_from(self.results.len()).unwrap_or(0);
            self.e.push(I::Return {}, results, 0);
        }
        let frame = (!self.frame.is_empty()).then(|| {
            let fields = std::mem::take(&mut self.frame);
            let size = self.frame_size.next_multiple_of(8);
            self.b.struct_type(fields, size, 8)
        });
        let frame_bytes = if frame.is_some() { self.frame_size.next_multiple_of(8) } else { 0 };
        let cost =
            super::FunctionCost { stack: self.e.max_depth, frame_bytes, callees: std::mem::take(&mut self.e.callees) };
        let (code, marks) = self.e.finish();
        let function = Function {
            owner,
            parameters: self.parameters,
            locals: self.locals,
            results: self.results,
            frame,
            for_loops: self.for_loops,
            code,
        };
        (function, marks, cost)
    }

    pub(super) fn statements(&mut self, list: &[Stmt]) {
        for statement in list {
            if !self.e.is_reachable() {
                return;
            }
            self.statement(statement);
        }
    }

    pub(super) fn statement(&mut self, statement: &Stmt) {
        self.e.mark(statement.span);
        let before = self.used_temporaries.len();
        match &statement.kind {
            StmtKind::Assign { target, value } => self.assign(target, value),
            StmtKind::Call(call) => self.call_statement(call),
            StmtKind::Evaluate(expr) => {
                self.value(expr);
                self.e.push(I::Drop {}, 1, 0);
            }
            StmtKind::If { branches, otherwise } => self.if_statement(branches, otherwise),
            StmtKind::Case { selector, arms, otherwise } => self.case(selector, arms, otherwise),
            StmtKind::For(found) => self.for_loop(found, statement.span),
            StmtKind::While { condition, body, end } => self.while_loop(condition, body, *end),
            StmtKind::Repeat { body, until } => self.repeat_loop(body, until),
            StmtKind::Exit => {
                if let Some((_, exit)) = self.loops.last().copied() {
                    self.e.push(I::Jump { target: exit }, 0, 0);
                }
            }
            StmtKind::Continue => {
                if let Some((next, _)) = self.loops.last().copied() {
                    self.e.push(I::Jump { target: next }, 0, 0);
                }
            }
            StmtKind::Return => {
                let target = self.end;
                self.e.push(I::Jump { target }, 0, 0);
            }
        }
        for (ty, offset) in self.used_temporaries.drain(before..).collect::<Vec<_>>() {
            self.free_temporaries.entry(ty).or_default().push(offset);
        }
    }

    fn assign(&mut self, target: &Place, value: &Expr) {
        if self.b.project.types.storage(target.ty).is_some() {
            self.store(target, value);
        } else if target.ty.is_text() {
            self.assign_text(target, value);
        } else {
            self.reference(target);
            self.value(value);
            let id = self.b.type_id(target.ty);
            self.e.push(I::Copy { target: id }, 2, 0);
        }
    }

    fn if_statement(&mut self, branches: &[(Expr, Vec<Stmt>)], otherwise: &[Stmt]) {
        let end = self.e.label();
        for (condition, body) in branches {
            let next = self.e.label();
            self.e.mark(condition.span);
            self.jump_when(condition, next, false);
            self.statements(body);
            self.e.push(I::Jump { target: end }, 0, 0);
            self.e.bind(next);
            if !self.e.is_reachable() {
                break;
            }
        }
        self.statements(otherwise);
        self.e.bind(end);
    }

    fn while_loop(&mut self, condition: &Expr, body: &[Stmt], end: Span) {
        let next = self.e.label();
        let exit = self.e.label();
        let header = self.e.bind_header();
        self.e.mark(condition.span);
        if matches!(condition.kind, ExprKind::Const(_)) {
            // A condition without code: a deadline that ends the loop shall name its WHILE, not its body.
            self.e.push(I::Nop {}, 0, 0);
        }
        self.jump_when(condition, exit, false);
        self.loops.push((next, exit));
        self.statements(body);
        self.loops.pop();
        self.e.bind(next);
        self.e.mark(end);
        self.e.push(I::Jump { target: header }, 0, 0);
        self.e.bind(exit);
    }

    fn repeat_loop(&mut self, body: &[Stmt], until: &Expr) {
        let next = self.e.label();
        let exit = self.e.label();
        let header = self.e.bind_header();
        self.loops.push((next, exit));
        self.statements(body);
        self.loops.pop();
        self.e.bind(next);
        self.e.mark(until.span);
        self.jump_when(until, header, false);
        self.e.bind(exit);
    }

    fn for_loop(&mut self, found: &ForStmt, span: Span) {
        let elementary = self.elementary(found.control.ty);
        let Some(kind) = integer_type(elementary) else { return };
        let register = if kind.value_type() == ValueType::I64 { Storage::I64 } else { Storage::I32 };
        let ranged = matches!(self.b.project.types.kind(found.control.ty), Some(TyKind::Subrange { .. }));
        let direct = if ranged { None } else { self.known_control(&found.control) };
        let hidden = match direct {
            Some(_) => None,
            None => Some(self.local(LocalType::Scalar(kind.storage()))),
        };
        let control = match (direct, hidden) {
            (Some(control), _) => control,
            (None, slot) => ControlPlace::Slot(SlotPlace::Local, slot.unwrap_or_default()),
        };
        // Slots of a loop are its own for the whole function, so that an engine may drop them.
        let bound = self.local(LocalType::Scalar(register));
        let step = self.local(LocalType::Scalar(register));
        let id = ForId(self.b.id16(self.for_loops.len(), "FOR loops of one function"));
        self.for_loops.push(ForLoop { control, ty: kind, bound, step });
        let exit = self.e.label();
        let done = self.e.label();
        let next = self.e.label();
        self.value(&found.from);
        self.value(&found.to);
        self.value(&found.by);
        // A step of 0 is the statement's, wherever its value came from.
        self.e.mark(span);
        self.e.push(I::ForEnter { id, exit: done }, 3, 0);
        let header = self.e.bind_for_header();
        if let Some(slot) = hidden {
            self.copy_control(found, slot, true);
        }
        self.loops.push((next, exit));
        self.statements(&found.body);
        self.loops.pop();
        self.e.bind(next);
        self.e.mark(found.end);
        if let Some(slot) = hidden {
            // What the body wrote to the variable counts.
            self.load(&found.control);
            self.e.push(I::SlotStore { place: SlotPlace::Local, index: slot }, 1, 0);
        }
        self.e.push(I::ForNext { id, header }, 0, 0);
        self.e.bind(done);
        if let Some(slot) = hidden {
            self.copy_control(found, slot, false);
        }
        self.e.bind(exit);
    }

    /// Gives the control variable the value of the hidden one; its range holds for the passes, not for the value after the last.
    fn copy_control(&mut self, found: &ForStmt, slot: SlotIndex, checks: bool) {
        if !self.e.is_reachable() {
            return;
        }
        let elementary = self.elementary(found.control.ty);
        let address = self.address(&found.control);
        self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
        if let (true, Some(TyKind::Subrange { low, high, .. })) = (checks, self.b.project.types.kind(found.control.ty))
        {
            self.check(elementary, *low, *high, found.control.span);
        }
        self.store_at(address, elementary.storage());
    }

    /// The place of a control variable when it is known and no reference is needed.
    fn known_control(&mut self, control: &Place) -> Option<ControlPlace> {
        let is_known = control.path.iter().all(|step| match step {
            crate::analysis::tree::Step::Field(..) => true,
            crate::analysis::tree::Step::Index(_, indices) => {
                indices.iter().all(|index| matches!(index.kind, ExprKind::Const(Const::Int(_))))
            }
            crate::analysis::tree::Step::Part(..) | crate::analysis::tree::Step::Character(..) => false,
        });
        let by_reference = match control.root {
            crate::analysis::tree::Root::Var(var) => matches!(self.homes.get(var.0 as usize), Some(Home::Ref(_))),
            _ => false,
        };
        if !is_known || by_reference {
            return None;
        }
        match self.address(control) {
            Address::Slot(place, index) => Some(ControlPlace::Slot(place, index)),
            Address::Bytes(place, offset) if place != BytePlace::Input => Some(ControlPlace::Bytes(place, offset)),
            _ => None,
        }
    }
}
