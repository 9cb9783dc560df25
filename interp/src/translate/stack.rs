//! The operand stack at translation time: entries stay pending until they are used or have to stand in their own register.
//!
//! The *own register* of an entry is that of its depth. A pending entry may name another register: an `L` slot, a base, or the own
//! register of an entry below it (after `dup`), which then holds just that entry's value and does not change while the entry above lives.

use super::Translator;
use crate::register_form::{Code, LoadCodes, Operation};

/// An entry of the operand stack.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    /// Its value.
    pub value: Pending,
    /// For references: whether it may point into %I, %Q or %M.
    pub image: bool,
}

/// A value that may not yet have been computed.
#[derive(Debug, Clone, Copy)]
pub(super) enum Pending {
    /// What a register holds.
    Register(u32),
    /// These bits.
    Constant(u64),
    /// A reference to a known offset.
    Address(Base, u32),
    /// A reference to an array element whose index is not yet checked.
    Element(Element),
}

/// From where an offset counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Base {
    /// From the image's start.
    Image,
    /// From the reference in a register.
    Register(u32),
}

/// An array element whose index is not yet checked.
#[derive(Debug, Clone, Copy)]
pub(super) struct Element {
    /// From where `offset` counts.
    pub base: Base,
    /// Offset of the first element's accessed part.
    pub offset: u32,
    /// Added to the first index.
    pub displacement: i16,
    /// The dimension that is not a constant, or the first of two.
    pub outer: Dimension,
    /// The second of two. Both strides then fit 16 bits.
    pub inner: Option<Dimension>,
    /// Offset of the `ref.index` instruction.
    pub origin: u32,
}

impl Element {
    /// Whether the check of the indexes is the same: then both trap or none does, with the same values.
    pub(super) fn checks_as(&self, other: &Element) -> bool {
        let dimension = |d: &Dimension| (d.index, d.lower, d.extent);
        (self.displacement, dimension(&self.outer), self.inner.as_ref().map(dimension))
            == (other.displacement, dimension(&other.outer), other.inner.as_ref().map(dimension))
    }
}

/// One dimension of an array access.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dimension {
    /// Register of the index.
    pub index: u32,
    /// Lower bound.
    pub lower: i32,
    /// Upper bound - lower bound.
    pub extent: u32,
    /// Bytes from one element to the next.
    pub stride: u32,
}

impl Dimension {
    /// Whether the operations for elements can carry it.
    pub(super) fn is_narrow(&self) -> bool {
        self.stride <= u32::from(u16::MAX)
    }

    fn data(&self, dst: u32) -> Operation {
        // Only asked for narrow ones; the reader takes `x` as unsigned.
        Operation { code: Code::Data, x: self.stride as u16 as i16, dst, a: self.lower as u32, b: self.extent }
    }
}

impl Pending {
    /// Whether it is read from a register.
    pub(super) fn reads(&self, register: u32) -> bool {
        match self {
            Pending::Register(source) => *source == register,
            Pending::Constant(_) => false,
            Pending::Address(base, _) => *base == Base::Register(register),
            Pending::Element(element) => {
                element.outer.index == register
                    || element.inner.is_some_and(|inner| inner.index == register)
                    || element.base == Base::Register(register)
            }
        }
    }
}

impl Translator<'_> {
    /// Own register of the entry at a depth.
    pub(super) fn own_register(&self, depth: usize) -> u32 {
        self.registers.stack + depth as u32
    }

    /// Own register of the next entry to be pushed.
    pub(super) fn next_register(&self) -> u32 {
        self.own_register(self.stack.len())
    }

    /// Pushes a number, or a reference that can not point into %I, %Q or %M.
    pub(super) fn push(&mut self, value: Pending) {
        self.stack.push(Entry { value, image: false });
    }

    /// Pushes what an operation just wrote into the next own register.
    pub(super) fn push_result(&mut self) {
        self.push(Pending::Register(self.next_register()));
    }

    /// Takes the top and its own register.
    pub(super) fn pop(&mut self) -> (Entry, u32) {
        // The verifier proved that the stack holds what each instruction takes.
        let entry = self.stack.pop().unwrap_or(Entry { value: Pending::Constant(0), image: false });
        (entry, self.next_register())
    }

    /// Computes a pending value into a register.
    pub(super) fn compute(&mut self, value: &Pending, dst: u32) {
        match *value {
            Pending::Register(source) if source == dst => {}
            Pending::Register(a) => self.value(Operation { code: Code::Move, x: 0, dst, a, b: 0 }),
            Pending::Constant(bits) => self.load_constant(bits, dst),
            Pending::Address(Base::Image, offset) => self.load_constant(u64::from(offset), dst),
            Pending::Address(Base::Register(a), 0) if a == dst => {}
            Pending::Address(Base::Register(a), 0) => {
                self.value(Operation { code: Code::Move, x: 0, dst, a, b: 0 });
            }
            Pending::Address(Base::Register(a), b) => self.value(Operation { code: Code::Offset, x: 0, dst, a, b }),
            Pending::Element(element) => self.compute_element(&element, dst),
        }
    }

    /// Checks the index of an element and computes its reference, dimension by dimension.
    fn compute_element(&mut self, element: &Element, dst: u32) {
        let Element { base, offset, displacement: x, outer, inner, origin } = *element;
        if outer.is_narrow() {
            let (code, b) = match base {
                Base::Image => (Code::Index, 0),
                Base::Register(b) => (Code::IndexBased, b),
            };
            let operation = Operation { code, x, dst, a: outer.index, b };
            self.value_from(operation, origin);
            self.data(&[outer.data(offset)], origin);
        } else {
            let b = match base {
                Base::Image => u32::MAX,
                Base::Register(b) => b,
            };
            let operation = Operation { code: Code::IndexWide, x, dst, a: outer.index, b };
            let stride = Operation { code: Code::Data, x: 0, dst: 0, a: outer.stride, b: 0 };
            let data = Dimension { stride: 1, ..outer }.data(offset);
            self.value_from(operation, origin);
            self.data(&[data, stride], origin);
        }
        if let Some(inner) = inner {
            let operation = Operation { code: Code::IndexBased, x: 0, dst, a: inner.index, b: dst };
            self.value_from(operation, origin);
            self.data(&[inner.data(0)], origin);
        }
    }

    /// Appends the load or store of an element; `dst` is the register of the value.
    pub(super) fn access_element(&mut self, codes: LoadCodes, is_load: bool, element: &Element, dst: u32) {
        let (plain, based) = match element.inner {
            None => (codes.element, codes.element_based),
            Some(_) => (codes.plane, codes.plane_based),
        };
        let (code, b) = match element.base {
            Base::Image => (plain, 0),
            Base::Register(b) => (based, b),
        };
        let operation = Operation { code, x: element.displacement, dst, a: element.outer.index, b };
        let outer = element.outer.data(element.offset);
        if is_load {
            self.value_from(operation, element.origin);
        } else {
            self.effect_from(operation, element.origin);
        }
        match element.inner {
            None => self.data(&[outer], element.origin),
            Some(inner) => self.data(&[outer, inner.data(inner.index)], element.origin),
        }
    }

    fn load_constant(&mut self, bits: u64, dst: u32) {
        self.value(Operation { code: Code::Constant, x: 0, dst, a: bits as u32, b: (bits >> 32) as u32 });
    }

    /// A register that holds a popped value: where it is, or else `own`.
    pub(super) fn in_register(&mut self, value: &Pending, own: u32) -> u32 {
        match value {
            Pending::Register(register) | Pending::Address(Base::Register(register), 0) => *register,
            other => {
                self.compute(other, own);
                own
            }
        }
    }

    /// Puts the entry at a depth into its own register.
    pub(super) fn settle(&mut self, depth: usize) {
        let own = self.own_register(depth);
        let value = self.stack[depth].value;
        self.compute(&value, own);
        self.stack[depth].value = Pending::Register(own);
    }

    /// Puts every entry into its own register.
    pub(super) fn settle_all(&mut self) {
        for depth in 0..self.stack.len() {
            self.settle(depth);
        }
    }

    /// Puts entries that read a register into their own ones, because it is about to change.
    pub(super) fn settle_readers(&mut self, register: u32) {
        for depth in 0..self.stack.len() {
            if self.stack[depth].value.reads(register) {
                self.settle(depth);
            }
        }
    }

    /// Makes all pending index checks, because something that may trap or that writes memory comes next.
    pub(super) fn settle_elements(&mut self) {
        for depth in 0..self.stack.len() {
            if matches!(self.stack[depth].value, Pending::Element(_)) {
                self.settle(depth);
            }
        }
    }

    pub(super) fn drop_top(&mut self) {
        // An index check that nothing else made must still be made.
        self.settle_elements();
        self.pop();
    }

    pub(super) fn duplicate(&mut self) {
        let top = self.stack.len() - 1;
        // The copy reads the register below it, so that register must hold the final value.
        if !matches!(self.stack[top].value, Pending::Register(_) | Pending::Constant(_)) {
            self.settle(top);
        }
        self.stack.push(self.stack[top]);
    }

    pub(super) fn select(&mut self) {
        let image = self.stack[self.stack.len() - 3..].iter().any(|entry| entry.image);
        self.settle_elements();
        let first = self.stack.len() - 3;
        self.settle(first);
        let (condition, condition_own) = self.pop();
        let (second, second_own) = self.pop();
        let b = self.in_register(&second.value, second_own);
        let a = self.in_register(&condition.value, condition_own);
        let dst = self.own_register(first);
        self.effect(Operation { code: Code::SelectUnless, x: 0, dst, a, b });
        self.stack[first].image = image;
    }
}
