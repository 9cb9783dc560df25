//! Panics as findings: caught with their words and their place, and without noise on standard error, where a search meets the same one thousands of times.

use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Whether this thread runs something whose panics are caught here.
    static IS_QUIET: Cell<bool> = const { Cell::new(false) };
    /// What the last such panic said.
    static WORDS: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Runs `work`; where it panics, what it said and where, in one line. What `work` changed until then stays as it is.
///
/// # Errors
/// The words of the panic.
pub fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    // Other panics go on to whatever told of them before.
    HOOK.call_once(|| {
        let others = take_hook();
        set_hook(Box::new(move |panic| {
            if IS_QUIET.get() {
                WORDS.replace(panic.to_string().lines().collect::<Vec<_>>().join(" "));
            } else {
                others(panic);
            }
        }));
    });
    let before = IS_QUIET.replace(true);
    let result = catch_unwind(AssertUnwindSafe(work));
    IS_QUIET.set(before);
    result.map_err(|_| WORDS.take())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_told_with_its_place_and_the_rest_goes_on() {
        assert_eq!(caught(|| 7), Ok(7));
        let told = caught(|| caught(|| panic!("in here")).map_err(|inner| panic!("{inner} and out there")));
        let told = told.map(|_: Result<(), ()>| ()).unwrap_err();
        assert!(told.contains("in here") && told.contains("out there") && told.contains("panics.rs:"), "{told}");
        assert!(!IS_QUIET.get());
    }
}
