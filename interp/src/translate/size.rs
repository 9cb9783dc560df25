//! How many registers the deepest nesting of calls needs, so that running allocates nothing.

use khz_bytecode::container::Owner;
use khz_bytecode::ids::FunctionId;
use khz_bytecode::verify::Verified;

use crate::register_form::Program;

/// A direct call: where in its caller's window the callee's window starts.
#[derive(Debug, Clone, Copy)]
struct CallSite {
    start: u32,
    callee: FunctionId,
}

/// All calls of a program, by caller.
#[derive(Debug, Clone, Default)]
pub(super) struct CallWindows {
    sites: Vec<CallSite>,
    /// Position in `sites` of each function's first.
    begins: Vec<usize>,
    has_virtual_calls: bool,
}

impl CallWindows {
    /// The next function's calls follow.
    pub(super) fn begin_function(&mut self) {
        self.begins.push(self.sites.len());
    }

    /// A direct call.
    pub(super) fn call(&mut self, start: u32, callee: FunctionId) {
        self.sites.push(CallSite { start, callee });
    }

    /// A virtual call.
    pub(super) fn call_virtual(&mut self) {
        self.has_virtual_calls = true;
    }

    fn of(&self, function: usize) -> &[CallSite] {
        let end = self.begins.get(function + 1).copied().unwrap_or(self.sites.len());
        &self.sites[self.begins[function]..end]
    }
}

/// Registers of the deepest nesting of calls.
///
/// Direct calls form no cycle, so what they need is exact. Virtual ones may recurse up to the container's call depth. Then the nesting is,
/// outermost first: functions of a program, which nobody but such functions calls; functions that lead to a further virtual
/// call; and behind the last virtual call direct ones. First and last part are at most what direct calls need at all.
pub(super) fn register_count(verified: &Verified, program: &Program, windows: &CallWindows) -> usize {
    let direct = direct_need(verified, program, windows);
    if !windows.has_virtual_calls {
        return direct;
    }
    let functions = verified.container().functions.iter().zip(&program.functions).enumerate();
    let recursive = functions.filter(|(index, (function, _))| {
        let leads_on = verified.facts().functions[*index].calls_virtual;
        leads_on && !matches!(function.owner, Owner::Program(_))
    });
    let largest = recursive.map(|(_, (_, entry))| entry.registers as usize).max().unwrap_or(0);
    let depth = usize::from(verified.container().parameters.max_call_depth);
    largest.saturating_mul(depth).saturating_add(direct.saturating_mul(2))
}

fn direct_need(verified: &Verified, program: &Program, windows: &CallWindows) -> usize {
    let mut order: Vec<usize> = (0..program.functions.len()).collect();
    order.sort_by_key(|function| verified.facts().functions[*function].call_depth);
    let mut needs = vec![0_usize; program.functions.len()];
    for function in order {
        let own = program.functions[function].registers as usize;
        let calls = windows.of(function).iter();
        let deepest = calls.map(|site| site.start as usize + needs[site.callee.index()]).max().unwrap_or(0);
        needs[function] = own.max(deepest);
    }
    needs.into_iter().max().unwrap_or(0)
}
