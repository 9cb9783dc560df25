//! What of the language stands in generated programs: a search that never wrote a thing proves nothing about it.

use std::collections::{BTreeMap, BTreeSet};

use super::functions::row;
use super::generate::Size;
use super::moments;
use super::tree::{Arg, Base, Class, Def, Edge, ExprKind, Kind, Op, Source, Step, Stmt, Ty, UnitKind};
use super::visit::{Node, each};
use crate::campaign::Figures;
use khz_bytecode::trap::TrapCode;
use khz_machine::library;
use khz_machine::library::functions::{ResultRule, TABLE};

/// Everything of the language that is no function, block, conversion or operator. A program with one that does not stand here is a panic, and a search of some
/// size has to reach each of them.
pub const FEATURES: [&str; 56] = [
    "=>",
    "ARRAY",
    "AT",
    "CASE",
    "CHAR to STRING",
    "CONFIGURATION",
    "CONTINUE",
    "EN",
    "ENO",
    "EXIT",
    "FOR",
    "F_EDGE",
    "IF",
    "NOT",
    "REPEAT",
    "RETAIN",
    "R_EDGE",
    "RETURN",
    "SINGLE",
    "SINGLE and INTERVAL",
    "STRUCT",
    "VAR",
    "VAR CONSTANT",
    "VAR_INPUT",
    "VAR_IN_OUT",
    "VAR_IN_OUT argument",
    "VAR_OUTPUT",
    "VAR_TEMP",
    "WCHAR to WSTRING",
    "WHILE",
    "WITH",
    "argument",
    "array of blocks",
    "assignment",
    "assignment of a whole",
    "bit access",
    "block call",
    "character of a string",
    "composite result",
    "connection",
    "direct address",
    "element",
    "element of several dimensions",
    "enumeration",
    "enumeration with a base",
    "field",
    "function call",
    "function statement",
    "function without result",
    "instance without task",
    "part access",
    "result",
    "sign",
    "startup function",
    "statement of a standard function",
    "subrange",
];

/// Why no generated program ends in a trap; none: some do.
#[must_use]
pub fn not_shown(code: TrapCode) -> Option<&'static str> {
    match code {
        TrapCode::DivideByZero | TrapCode::ArrayIndex | TrapCode::Range => None,
        TrapCode::Reference => Some("the tree has no references"),
        TrapCode::CallDepth => Some("functions call only those before them, and the verifier counts how deep they go"),
        TrapCode::Watchdog => Some("the tree has no fuel: what does not end is counted as too long"),
        TrapCode::Stopped => Some("nobody ends a run from outside"),
    }
}

/// Counts of programs, by what they hold.
#[derive(Debug, Clone, Default)]
pub struct Coverage {
    /// Programs with a standard function, by its name and the type of its result, of comparisons that of their inputs.
    pub functions: BTreeMap<(&'static str, String), u64>,
    /// Programs that call a standard function block.
    pub blocks: BTreeMap<String, u64>,
    /// Programs with a conversion: from, to, whether it cuts.
    pub conversions: BTreeMap<(String, String, bool), u64>,
    /// Programs in which a value becomes one of another type by itself: from, to.
    pub widenings: BTreeMap<(Kind, Kind), u64>,
    /// Programs with an operator, by the type of its left operand.
    pub operators: BTreeMap<(Op, String), u64>,
    /// Programs with anything else that has a name here.
    pub features: BTreeMap<&'static str, u64>,
    /// Programs by size.
    pub sizes: BTreeMap<Size, u64>,
}

/// What one program holds.
#[derive(Default)]
struct Found {
    functions: BTreeSet<(&'static str, String)>,
    blocks: BTreeSet<String>,
    conversions: BTreeSet<(String, String, bool)>,
    widenings: BTreeSet<(Kind, Kind)>,
    operators: BTreeSet<(Op, String)>,
    features: BTreeSet<&'static str>,
}

fn name(source: &Source, ty: Ty) -> String {
    match ty {
        Ty::K(kind) => kind.name().to_string(),
        Ty::S(_) => "STRING".to_string(),
        Ty::W(_) => "WSTRING".to_string(),
        Ty::N(id) => match &source.types[id].def {
            Def::Enum(..) => "enumeration".to_string(),
            Def::Subrange(..) => "subrange".to_string(),
            _ => "composite".to_string(),
        },
    }
}

impl Found {
    fn node(&mut self, source: &Source, unit: usize, node: Node<'_>) {
        match node {
            Node::Stmt(stmt) => self.stmt(source, stmt),
            Node::Expr(expr) => match &expr.kind {
                ExprKind::Std(function, inputs) => {
                    let ty = if row(*function).result == ResultRule::Bool { inputs[0].ty } else { expr.ty };
                    self.functions.insert((row(*function).name, name(source, ty)));
                }
                ExprKind::Conv(inner) | ExprKind::Trunc(inner) => {
                    let cuts = matches!(expr.kind, ExprKind::Trunc(_));
                    self.conversions.insert((name(source, inner.ty), name(source, expr.ty), cuts));
                }
                ExprKind::Widen(inner) => {
                    if let (Ty::K(from), Ty::K(to)) = (inner.ty, expr.ty) {
                        self.widenings.insert((from, to));
                    } else {
                        self.features.insert(if expr.ty.is_wide() { "WCHAR to WSTRING" } else { "CHAR to STRING" });
                    }
                }
                ExprKind::Bin(op, left, _) => drop(self.operators.insert((*op, name(source, left.ty)))),
                ExprKind::Neg(_) => drop(self.features.insert("sign")),
                ExprKind::Not(_) => drop(self.features.insert("NOT")),
                ExprKind::Call(_, args) => {
                    self.features.insert("function call");
                    self.args(args);
                    if !source.units[unit].name.is_empty() && matches!(expr.ty, Ty::N(_)) {
                        self.features.insert("composite result");
                    }
                }
                ExprKind::Lit(..) | ExprKind::Get(_) => {}
            },
            Node::Place(place) => {
                let located = match place.base {
                    Base::Direct(_) => true,
                    Base::Global(at) => source.globals[at].at.is_some(),
                    Base::Var(at) => source.units[unit].vars[at].at.is_some(),
                };
                if located {
                    self.features.insert(if matches!(place.base, Base::Direct(_)) { "direct address" } else { "AT" });
                }
                let mut ty = source.base(&source.units[unit], place);
                for step in &place.steps {
                    let whole = ty;
                    ty = source.behind(whole, step);
                    self.features.insert(match step {
                        Step::Index(_) if whole.capacity().is_some() => "character of a string",
                        Step::Field(_) => "field",
                        Step::Index(indices) if indices.len() > 1 => "element of several dimensions",
                        Step::Index(_) => "element",
                        Step::Part(_, 1) => "bit access",
                        Step::Part(..) => "part access",
                    });
                }
            }
        }
    }

    fn args(&mut self, args: &[Arg]) {
        for arg in args {
            self.features.insert(match arg {
                Arg::In(..) => "argument",
                Arg::InOut(..) => "VAR_IN_OUT argument",
                Arg::Out(..) => "=>",
                Arg::En(_) => "EN",
                Arg::Eno(_) => "ENO",
            });
        }
    }

    fn stmt(&mut self, source: &Source, stmt: &Stmt) {
        let word = match stmt {
            Stmt::Assign(place, _) if !matches!(source.plain(place.ty), Ty::N(_)) => "assignment",
            Stmt::Assign(..) => "assignment of a whole",
            Stmt::If(..) => "IF",
            Stmt::Case(..) => "CASE",
            Stmt::For(..) => "FOR",
            Stmt::While(..) => "WHILE",
            Stmt::Repeat(..) => "REPEAT",
            Stmt::Call(_, args) | Stmt::Do(_, args) => {
                self.args(args);
                if matches!(stmt, Stmt::Do(..)) { "function statement" } else { "block call" }
            }
            Stmt::Split(function, args) => {
                self.args(args);
                let split = moments::splits(*function).map_or_else(String::new, |kind| kind.name().to_string());
                self.functions.insert((row(*function).name, split));
                "statement of a standard function"
            }
            Stmt::Exit => "EXIT",
            Stmt::Continue => "CONTINUE",
            Stmt::Return => "RETURN",
        };
        self.features.insert(word);
        if let Stmt::Call(place, _) = stmt
            && let Ty::N(id) = place.ty
            && let Def::Standard(standard) = &source.types[id].def
        {
            self.blocks.insert(standard.name());
        }
    }

    fn declarations(&mut self, source: &Source) {
        for unit in &source.units {
            let has_result = unit.vars.first().is_some_and(|var| var.class == Class::Return);
            if unit.kind == UnitKind::Function && !has_result {
                self.features.insert("function without result");
            }
            for var in &unit.vars {
                self.features.extend(var.edge.map(|edge| if edge == Edge::Rising { "R_EDGE" } else { "F_EDGE" }));
                self.features.insert(match var.class {
                    Class::Input => "VAR_INPUT",
                    Class::Output => "VAR_OUTPUT",
                    Class::InOut => "VAR_IN_OUT",
                    Class::Var if var.retain => "RETAIN",
                    Class::Var => "VAR",
                    Class::Temp => "VAR_TEMP",
                    Class::Constant => "VAR CONSTANT",
                    Class::Return => "result",
                });
            }
        }
        for ty in &source.types {
            match &ty.def {
                Def::Enum(base, _) => {
                    self.features.insert(if base.is_some() { "enumeration with a base" } else { "enumeration" });
                }
                Def::Subrange(..) => drop(self.features.insert("subrange")),
                Def::Struct(_) => drop(self.features.insert("STRUCT")),
                Def::Array(_, Ty::N(id)) if matches!(source.types[*id].def, Def::Block(_) | Def::Standard(_)) => {
                    self.features.insert("array of blocks");
                }
                Def::Array(..) => drop(self.features.insert("ARRAY")),
                Def::Block(_) | Def::Standard(_) => {}
            }
        }
        if let Some(config) = &source.config {
            self.features.insert("CONFIGURATION");
            self.features.extend(config.startup.map(|_| "startup function"));
            self.features.extend(config.tasks.iter().find_map(|task| task.single.map(|_| "SINGLE")));
            let with_both = |task: &&super::tree::Task| task.single.is_some() && task.interval_us.is_some();
            self.features.extend(config.tasks.iter().find(with_both).map(|_| "SINGLE and INTERVAL"));
            for instance in &config.instances {
                self.features.insert(if instance.task.is_some() { "WITH" } else { "instance without task" });
                self.features.extend(instance.args.first().map(|_| "connection"));
            }
        }
    }
}

impl Coverage {
    /// Counts what a program holds.
    pub fn count(&mut self, source: &Source, size: Size) {
        let mut found = Found::default();
        for (unit, own) in source.units.iter().enumerate() {
            each(&own.body, &mut |node| found.node(source, unit, node));
        }
        found.declarations(source);
        found.functions.into_iter().for_each(|key| *self.functions.entry(key).or_default() += 1);
        found.blocks.into_iter().for_each(|key| *self.blocks.entry(key).or_default() += 1);
        found.conversions.into_iter().for_each(|key| *self.conversions.entry(key).or_default() += 1);
        found.widenings.into_iter().for_each(|key| *self.widenings.entry(key).or_default() += 1);
        found.operators.into_iter().for_each(|key| *self.operators.entry(key).or_default() += 1);
        let unknown: Vec<_> = found.features.iter().filter(|word| !FEATURES.contains(word)).collect();
        assert!(unknown.is_empty(), "FEATURES does not name {unknown:?}");
        found.features.into_iter().for_each(|key| *self.features.entry(key).or_default() += 1);
        *self.sizes.entry(size).or_default() += 1;
    }

    /// The types that a standard function was written with.
    #[must_use]
    pub fn types_of(&self, function: &str) -> usize {
        self.functions.keys().filter(|(name, _)| *name == function).count()
    }

    /// The figures as text.
    #[must_use]
    pub fn report(&self) -> String {
        let mut calls: BTreeMap<&str, (u64, usize)> = BTreeMap::new();
        for ((name, _), count) in &self.functions {
            let call = calls.entry(name).or_default();
            *call = (call.0 + count, call.1 + 1);
        }
        let functions: Vec<&str> = TABLE.iter().map(|row| row.name).filter(|name| !calls.contains_key(name)).collect();
        let library_blocks: Vec<String> = library::blocks::all().map(|block| block.name).collect();
        let blocks: Vec<&String> = library_blocks.iter().filter(|name| !self.blocks.contains_key(*name)).collect();
        let calls: Vec<String> = calls.iter().map(|(name, (count, types))| format!("{name} {count}/{types}")).collect();
        format!(
            "sizes {:?}\nstandard functions {} of {}, not reached: {functions:?} (programs/types): {}\nstandard blocks {} of {}, not reached: {blocks:?}: {:?}\nconversions {}, implicit ones {}, operators by type {}\nfeatures {:?}",
            self.sizes,
            calls.len(),
            TABLE.len(),
            calls.join(", "),
            self.blocks.len(),
            library_blocks.len(),
            self.blocks,
            self.conversions.len(),
            self.widenings.len(),
            self.operators.len(),
            self.features
        )
    }
}

fn add<K: Ord>(own: &mut BTreeMap<K, u64>, later: BTreeMap<K, u64>) {
    later.into_iter().for_each(|(key, count)| *own.entry(key).or_default() += count);
}

impl Figures for Coverage {
    fn merge(&mut self, later: Self) {
        add(&mut self.functions, later.functions);
        add(&mut self.blocks, later.blocks);
        add(&mut self.conversions, later.conversions);
        add(&mut self.widenings, later.widenings);
        add(&mut self.operators, later.operators);
        add(&mut self.features, later.features);
        add(&mut self.sizes, later.sizes);
    }
}
