//! Tasks: PRIORITY, INTERVAL, SINGLE and attributes (IEC 61131-3 6.8.2.3, table 63).

use khz_bytecode::container::OverrunPolicy;
use khz_bytecode::limits::MIN_INTERVAL_US;

use super::Analyzer;
use super::expr::{Checker, Environment};
use super::tree::{ExprKind, ResourcePlan, Root, SinglePlan, TaskPlan, VarClass, VarId};
use super::types::{BOOL, Const, Ty, is_duration};
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::source::Span;
use crate::syntax::ast::{Attribute, Expr, ExprKind as AstKind, Task, TaskParamKind};
use crate::syntax::symbol::Symbol;

const NS_PER_US: i64 = 1_000;

impl<'a> Analyzer<'a> {
    /// A task without its SINGLE, which may name program instances.
    pub(super) fn task(&mut self, task: &'a Task) -> TaskPlan {
        let mut plan = TaskPlan {
            name: self.spelling(&task.name).to_owned(),
            priority: 0,
            interval_us: None,
            single: SinglePlan::None,
            watchdog_us: 0,
            watchdog_sensitivity: 0,
            phase_us: 0,
            overrun_policy: OverrunPolicy::Grid,
        };
        let mut seen: Vec<TaskParamKind> = Vec::new();
        for param in &task.params {
            if seen.contains(&param.kind) {
                let message = format!("{} is given twice", self.spelling(&param.name));
                self.report(&rules::PARAMETER_TWICE, param.name.span, message);
                continue;
            }
            seen.push(param.kind);
            match param.kind {
                TaskParamKind::Priority => plan.priority = self.priority(&param.value),
                TaskParamKind::Interval => plan.interval_us = self.interval(&param.value),
                TaskParamKind::Single => {}
            }
        }
        if !seen.contains(&TaskParamKind::Priority) {
            let message = format!("the task `{}` has no PRIORITY", plan.name);
            self.report(&rules::PRIORITY, task.name.span, message);
        }
        if !seen.contains(&TaskParamKind::Interval) && !seen.contains(&TaskParamKind::Single) {
            let message =
                format!("the task `{}` has neither INTERVAL nor SINGLE, so it runs in every round", plan.name);
            self.report(&rules::FREEWHEELING, task.name.span, message);
        }
        for attribute in &task.attributes {
            self.task_attribute(attribute, &mut plan);
        }
        plan
    }

    fn priority(&mut self, value: &'a Expr) -> u16 {
        let Some(found) = Checker::declarations(self, None).constant(value, Ty::Void) else { return 0 };
        let number = match &found.1 {
            Const::Wide(number) => Some(*number),
            Const::Int(number)
                if found.0 != BOOL && self.types.elementary(found.0).is_some_and(|ty| !is_duration(ty)) =>
            {
                Some(i128::from(*number))
            }
            _ => None,
        };
        let priority = number.and_then(|number| u16::try_from(number).ok());
        if priority.is_none() {
            self.report(&rules::PRIORITY, value.span, "PRIORITY is a whole number from 0 (the highest) to 65535");
        }
        priority.unwrap_or(0)
    }

    fn interval(&mut self, value: &'a Expr) -> Option<u64> {
        let (ty, found) = Checker::declarations(self, None).constant(value, Ty::Void)?;
        let elementary = self.types.elementary(ty).filter(|ty| is_duration(*ty));
        let (Some(_), Const::Int(ns)) = (elementary, found) else {
            let message = format!("INTERVAL is a TIME, as in T#10ms, not {}", self.types.name(ty));
            self.report(&rules::INTERVAL, value.span, message);
            return None;
        };
        let interval_us = whole_microseconds(ns).filter(|us| *us >= MIN_INTERVAL_US);
        if interval_us.is_none() {
            self.report(&rules::INTERVAL, value.span, "INTERVAL is at least 1 µs and a whole number of microseconds");
        }
        interval_us
    }

    fn task_attribute(&mut self, attribute: &Attribute, plan: &mut TaskPlan) {
        let value = attribute.value.as_deref().unwrap_or("");
        let duration = || parse_duration_ns(value).and_then(whole_microseconds);
        let sound = match attribute.name.to_ascii_lowercase().as_str() {
            "watchdog" => duration().filter(|us| *us > 0).map(|us| plan.watchdog_us = us),
            "watchdog_sensitivity" => value.parse().ok().map(|count| plan.watchdog_sensitivity = count),
            "phase" => duration().map(|us| plan.phase_us = us),
            "overrun" => overrun_policy(value).map(|policy| plan.overrun_policy = policy),
            _ => {
                let message = format!("a task has no attribute `{}`, so it is ignored", attribute.name);
                self.report(&rules::UNKNOWN_ATTRIBUTE, attribute.span, message);
                return;
            }
        };
        if sound.is_none() {
            let message = format!("`{value}` is no value for the attribute `{}`", attribute.name);
            self.report(&rules::ATTRIBUTE, attribute.span, message);
        }
    }

    /// The SINGLE of a task.
    pub(super) fn single(
        &mut self,
        task: &'a Task,
        at: usize,
        plan: &mut ResourcePlan,
        instances: &[Symbol],
        environment: &Environment,
    ) {
        let Some(param) = task.params.iter().find(|param| param.kind == TaskParamKind::Single) else { return };
        let found = self.single_source(&param.value, plan, instances, environment);
        if let (Some(found), Some(task)) = (found, plan.tasks.get_mut(at)) {
            task.single = found;
        }
    }

    fn single_source(
        &mut self,
        value: &'a Expr,
        plan: &mut ResourcePlan,
        instances: &[Symbol],
        environment: &Environment,
    ) -> Option<SinglePlan> {
        if let AstKind::Member { base, member } = &value.kind
            && let AstKind::Name(name) = &base.kind
            && let Some(at) = instances.iter().position(|symbol| *symbol == name.symbol)
        {
            let program = plan.instances.get(at)?.program;
            let info = self.info(program)?;
            let found = (0u32..).map(VarId).zip(&info.vars).find(|(_, var)| var.symbol == member.symbol);
            return match found {
                Some((id, var)) if var.ty == BOOL && is_stored(var.class) => match var.located {
                    Some(located) => Some(SinglePlan::Bit(located)),
                    None => Some(SinglePlan::Instance(u32::try_from(at).unwrap_or(u32::MAX), id)),
                },
                _ => {
                    let message = format!("{} has no BOOL variable `{}`", info.name, self.spelling(member));
                    self.report(&rules::SINGLE, value.span, message);
                    None
                }
            };
        }
        let mut checker = Checker::body(self, None, environment);
        let expr = checker.expr(value, BOOL);
        let usage = std::mem::take(&mut checker.usage);
        plan.usage.merge(usage);
        let source = match (&expr.kind, expr.ty) {
            (_, Ty::Error) => return None,
            (ExprKind::Const(Const::Int(value)), BOOL) => Some(SinglePlan::Literal(*value != 0)),
            (ExprKind::Load(place), BOOL) if place.path.is_empty() => match place.root {
                Root::Global(global) => {
                    let located = self.globals.get(global.0 as usize).and_then(|global| global.located);
                    Some(located.map_or(SinglePlan::Global(global), SinglePlan::Bit))
                }
                Root::Direct(located) => Some(SinglePlan::Bit(located)),
                _ => None,
            },
            _ => None,
        };
        if source.is_none() {
            self.wrong_single(value.span, expr.ty);
        }
        source
    }

    fn wrong_single(&mut self, span: Span, ty: Ty) {
        let message = if ty == BOOL {
            "SINGLE is a BOOL global, a variable of a program instance, a bit address or a literal".to_owned()
        } else {
            format!("SINGLE is a BOOL, not {}", self.types.name(ty))
        };
        let help = if ty == BOOL {
            "assign what it is to a global BOOL in a program, and name that"
        } else {
            "compare it in a program, and name the global BOOL that the result is assigned to"
        };
        self.push(Diagnostic::new(&rules::SINGLE, span, message).help(help));
    }
}

fn is_stored(class: VarClass) -> bool {
    matches!(class, VarClass::Input | VarClass::Output | VarClass::Local)
}

fn whole_microseconds(ns: i64) -> Option<u64> {
    let whole = ns % NS_PER_US == 0;
    u64::try_from(ns / NS_PER_US).ok().filter(|_| whole)
}

/// The overrun policy of this name.
fn overrun_policy(name: &str) -> Option<OverrunPolicy> {
    match name.to_ascii_lowercase().as_str() {
        "grid" => Some(OverrunPolicy::Grid),
        "at-once" => Some(OverrunPolicy::AtOnce),
        "realign" => Some(OverrunPolicy::Realign),
        _ => None,
    }
}

/// `T#1s500ms` of an attribute, in nanoseconds.
pub(crate) fn parse_duration_ns(text: &str) -> Option<i64> {
    let upper = text.trim().to_ascii_uppercase();
    let mut rest = ["LTIME#", "TIME#", "LT#", "T#"].iter().find_map(|prefix| upper.strip_prefix(prefix))?;
    if rest.is_empty() {
        return None;
    }
    let units: [(&str, i64); 7] = [
        ("MS", 1_000_000),
        ("US", 1_000),
        ("NS", 1),
        ("D", 86_400_000_000_000),
        ("H", 3_600_000_000_000),
        ("M", 60_000_000_000),
        ("S", 1_000_000_000),
    ];
    let mut total: i64 = 0;
    while !rest.is_empty() {
        let digits = rest.find(|c: char| !c.is_ascii_digit() && c != '_')?;
        let number: i64 = rest.get(..digits)?.replace('_', "").parse().ok()?;
        rest = rest.get(digits..)?;
        let (unit, ns) = units.iter().find(|(unit, _)| rest.starts_with(unit))?;
        total = total.checked_add(number.checked_mul(*ns)?)?;
        rest = rest.get(unit.len()..)?.trim_start_matches('_');
    }
    Some(total)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_of_attributes() {
        assert_eq!(parse_duration_ns("T#10ms"), Some(10_000_000));
        assert_eq!(parse_duration_ns("LTIME#1s500us"), Some(1_000_500_000));
        assert_eq!(parse_duration_ns("T#1d2h3m4s"), Some(93_784_000_000_000));
        assert_eq!(parse_duration_ns("10ms"), None);
        assert_eq!(parse_duration_ns("T#"), None);
        assert_eq!(parse_duration_ns("T#99999999999d"), None);
    }
}
