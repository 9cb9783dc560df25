//! The mid-level form before and after each pass.

mod common;

use common::{form, load_with};
use khz_jit::{JitOptions, Passes};

/// An array summed by a FOR loop over a slot of the program.
const SUM: &str = "global sum i32\ntype n scalar i32\narray v n 0..9\ndata a v\nprogram p_\nslot i i32\nslot flag b1\n\
    function main program p_\nfor k p i i32\nconst.i32 0\nconst.i32 9\nconst.i32 1\nfor.enter k out\ntop:\n\
    slot.load g sum\naddress d a v\nslot.load p i\nref.index v\nref.load i32\ni32.add\nslot.store g sum\n\
    for.next k top\nout:\nreturn\nend\n";

fn only(names: &[&str]) -> Passes {
    names.iter().fold(Passes::NONE, |passes, name| passes.with(name).unwrap())
}

fn count(form: &str, what: &str) -> usize {
    form.lines().filter(|line| line.contains(what)).count()
}

#[test]
fn without_passes_each_instruction_stands_as_it_was() {
    let form = form(SUM, Passes::NONE);
    assert_eq!(count(&form, "check.index"), 1, "{form}");
    assert_eq!((count(&form, "slot.load g0"), count(&form, "slot.load p0")), (1, 2), "{form}");
    assert_eq!((count(&form, "for.is_empty"), count(&form, "for.continues")), (1, 1), "{form}");
    assert!(form.contains("loop0: header b2 counts i32 p0"), "{form}");
}

#[test]
fn promotion_loads_before_the_loop_and_stores_behind_it() {
    let form = form(SUM, only(&["promote"]));
    // One load in front, one store behind; in front of it the store of `for.enter`.
    assert_eq!((count(&form, "slot.load g0"), count(&form, "slot.load p0")), (1, 1), "{form}");
    assert_eq!((count(&form, "slot.store g0"), count(&form, "slot.store p0")), (1, 2), "{form}");
    assert!(form.contains("traps w1") && form.contains("->g0") && form.contains("->p0"), "{form}");
}

#[test]
fn a_slot_that_a_callee_touches_stays_in_memory() {
    let text = SUM.replace("for.next", "call f\nfor.next") + "function f\nslot.load g sum\ndrop\nreturn\nend\n";
    let form = form(&text, only(&["promote"]));
    assert!(count(&form, "slot.store g0") == 1 && !form.contains("->g0") && form.contains("->p0"), "{form}");
}

#[test]
fn a_for_loop_proves_its_index() {
    let checks = |text: &str| count(&form(text, only(&["promote", "fold", "checks"])), "check.index");
    assert_eq!(checks(SUM), 0);
    // Ten is outside; a body that writes the control variable proves nothing.
    assert_eq!(checks(&SUM.replace("const.i32 9", "const.i32 10")), 1);
    assert_eq!(checks(&SUM.replace("for.next", "slot.load g sum\nslot.store p i\nfor.next")), 1);
}

#[test]
fn masks_and_remainders_prove_an_index() {
    let checks = |index: &str| {
        let text = SUM.replace("slot.load p i\nref", &format!("slot.load g sum\n{index}ref"));
        count(&form(&text, only(&["checks"])), "check.index")
    };
    assert_eq!(checks("const.i32 7\ni32.and\n"), 0);
    assert_eq!(checks("const.i32 10\ni32.rem_u\n"), 0);
    assert_eq!(checks("const.i32 10\ni32.rem_s\n"), 1, "the remainder may be negative");
    assert_eq!(checks("const.i32 15\ni32.and\n"), 1);
}

#[test]
fn a_for_loop_becomes_arithmetic_over_an_i64() {
    let form = form(SUM, only(&["promote", "fold", "for_loops"]));
    assert_eq!(count(&form, "for."), 0, "{form}");
    assert_eq!((count(&form, "i32.le_s"), count(&form, "i64.add")), (1, 1), "{form}");
    // The index needs no extension; that of the first value is folded.
    assert_eq!((count(&form, "i64.extend_i32_s"), count(&form, "[image +80 + v")), (0, 1), "{form}");
}

#[test]
fn folding_computes_what_is_known_and_drops_wraps_that_change_nothing() {
    let text = "global r i32\nglobal f b1\nfunction main\nconst.i32 6\nconst.i32 7\ni32.mul\nslot.store g r\n\
        slot.load g r\nconst.i32 3\ni32.lt_s\nslot.store g f\nconst.i32 0\njump.if never\nreturn\nnever:\nreturn\nend\n";
    let before = form(text, Passes::NONE);
    let after = form(text, only(&["fold"]));
    assert_eq!((count(&before, "i32.mul"), count(&before, "i32.nez"), count(&before, "branch")), (1, 1, 1), "{before}");
    assert_eq!((count(&after, "i32.mul"), count(&after, "i32.nez"), count(&after, "branch")), (0, 0, 0), "{after}");
    assert_eq!(count(&after, "i32 42"), 1, "{after}");
}

#[test]
fn a_division_by_zero_is_not_folded_away() {
    let text = "global r i32\nfunction main\nconst.i32 6\nconst.i32 0\ni32.div_s\nslot.store g r\nreturn\nend\n";
    let after = form(text, Passes::ALL);
    assert_eq!((count(&after, "check.divisor"), count(&after, "i32.div_s")), (1, 1), "{after}");
}

#[test]
fn a_short_if_over_integers_becomes_a_select() {
    let text = |arm: &str| {
        format!(
            "global c i32\nglobal x f32\nfunction main\nlocal k i32\nfor loop l k i32\nconst.i32 0\nconst.i32 7\nconst.i32 1\nfor.enter loop out\n\
             top:\nslot.load g c\nconst.i32 1\ni32.and\njump.unless other\n{arm}jump end_\nother:\nslot.load g c\nconst.i32 1\n\
             i32.shr_u\nslot.store g c\nend_:\nfor.next loop top\nout:\nreturn\nend\n"
        )
    };
    let short = "slot.load g c\nconst.i32 1\ni32.shr_u\nconst.i32 12345\ni32.xor\nslot.store g c\n";
    let converted = form(&text(short), Passes::ALL);
    assert_eq!(count(&converted, "select"), 1, "{converted}");
    for other in ["const f32 1.0\nslot.store g x\n", "const.i32 1\nslot.load g c\ni32.div_u\nslot.store g c\n"] {
        let kept = form(&text(other), Passes::ALL);
        assert_eq!(count(&kept, "select"), 0, "{kept}");
    }
}

#[test]
fn a_loop_that_is_short_by_proof_does_not_look_at_the_deadline() {
    let looks = |text: &str| count(&form(text, only(&["deadlines"])), "no deadline");
    assert_eq!(looks(SUM), 1);
    assert_eq!(looks(&SUM.replace("const.i32 9", "const.i32 100000")), 0);
    assert_eq!(looks(&SUM.replace("const.i32 9", "slot.load g sum")), 0);
    let calling = SUM.replace("for.next", "call f\nfor.next") + "function f\nslot.load g sum\ndrop\nreturn\nend\n";
    assert_eq!(looks(&calling), 0);
    assert_eq!(looks("function main\ntop:\njump top\nend\n"), 0);
}

#[test]
fn not_of_a_bool_needs_no_test_unless_a_branch_asks() {
    let text = "global a b1\nglobal b b1\nglobal n i32\nfunction main\nslot.load g a\ni32.eqz\nslot.store g b\n\
        slot.load g n\ni32.eqz\nslot.store g b\nslot.load g a\ni32.eqz\njump.if end_\nnop\nend_:\nreturn\nend\n";
    let form = form(text, only(&["fold", "bools"]));
    assert_eq!((count(&form, "i32.xor"), count(&form, "i32.eqz")), (1, 2), "{form}");
}

#[test]
fn a_bound_beyond_the_type_of_the_control_variable_proves_nothing() {
    // An i8 passes 127, wraps and never reaches 200: the loop is endless, and its index may be anything.
    let text = SUM.replace("slot i i32", "slot i i8").replace("for k p i i32", "for k p i i8");
    assert_eq!(count(&form(&text, Passes::ALL), "check.index"), 0);
    let text = text.replace("const.i32 9", "const.i32 200").replace("0..9", "0..500");
    let form = form(&text, Passes::ALL);
    assert_eq!((count(&form, "check.index"), count(&form, "no deadline")), (1, 0), "{form}");
    assert_eq!(count(&form, "i64.extend_i32_s"), 1, "{form}");
}

#[test]
fn a_small_function_is_put_where_it_is_called_and_its_traps_name_the_call() {
    let text = "global r i32\ntype n scalar i32\ndata d n\nfunction main\naddress d d n\ncall half\nslot.store g r\nreturn\nend\n\
        function half\nparam p ref:n\nresult i32\nconst.i32 6\nslot.load l p\nref.load i32\ni32.div_s\nreturn\nend\n";
    let before = form(text, Passes::NONE);
    let after = form(text, only(&["inline"]));
    assert_eq!((count(&before, "call f1"), count(&before, "i32.div_s")), (1, 0), "{before}");
    assert_eq!((count(&after, "call f1"), count(&after, "i32.div_s")), (0, 1), "{after}");
    let called = load_with(text, JitOptions { passes: Passes::NONE, ..JitOptions::default() }).run();
    let inlined = load_with(text, JitOptions { passes: only(&["inline"]), ..JitOptions::default() }).run();
    assert!(called.is_err());
    assert_eq!(inlined, called);
}

#[test]
fn a_function_with_a_loop_or_behind_virtual_calls_is_called() {
    let text =
        "global r i32\nfunction main\ncall f\nreturn\nend\nfunction f\ntop:\nslot.load g r\njump.if top\nreturn\nend\n";
    assert_eq!(count(&form(text, Passes::ALL), "call f1"), 1);
}

#[test]
fn a_flag_that_ends_a_loop_leaves_it_at_once() {
    let text = "global go b1\nglobal n i32\nfunction main\nconst.i32 1\nslot.store g go\ntop:\nslot.load g go\njump.unless out\n\
        slot.load g n\nconst.i32 5\ni32.gt_s\njump.if end_\nslot.load g n\nconst.i32 1\ni32.add\nslot.store g n\njump top\n\
        end_:\nconst.i32 0\nslot.store g go\njump top\nout:\nreturn\nend\n";
    let names = ["promote", "fold"];
    let before = form(text, only(&names));
    let after = form(text, only(&[names[0], names[1], "threads"]));
    // The way charges what the header charges, and does not come back to it.
    assert_eq!(count(&before, "no deadline"), 0, "{before}");
    assert_eq!(count(&after, "no deadline"), 1, "{after}");
}

#[test]
fn an_index_is_checked_once_on_a_way() {
    let element = "address d a v\nslot.load g sum\nref.index v\n";
    let text = format!(
        "global sum i32\ntype n scalar i32\narray v n 0..9\ndata a v\nfunction main\nlocal x i32\n{element}ref.load i32\nslot.store l x\n\
         top:\nslot.load l x\ndrop\n{}slot.load l x\njump.if top\nreturn\nend\n",
        "address d a v\nslot.load l x\nref.index v\nref.load i32\ndrop\naddress d a v\nslot.load l x\nref.index v\nref.load i32\ndrop\n"
    );
    let checks = |passes: &[&str]| count(&form(&text, only(passes)), "check.index");
    assert_eq!((checks(&[]), checks(&["repeats"])), (3, 2));
    let changed = text.replace("drop\naddress d a v\nslot.load l x", "slot.store l x\naddress d a v\nslot.load l x");
    assert_eq!(count(&form(&changed, only(&["repeats"])), "check.index"), 3);
}

#[test]
fn a_load_shortly_behind_a_store_takes_its_value() {
    let text = |between: &str| {
        format!(
            "global a i32\nglobal b i16\nglobal c i32\ntype n scalar i32\narray v n 0..9\ndata d v\nfunction main\nlocal r ref:n\n\
             address d d v\nconst.i32 3\nref.index v\nslot.store l r\nslot.load g c\nslot.store g a\nslot.load g c\nslot.store g b\n\
             slot.load g c\nstore d i32 d+4\n{between}slot.load g a\nslot.load g b\ni32.add\nload d i32 d+4\ni32.add\nslot.store g c\nreturn\nend\n\
             function f\nreturn\nend\n"
        )
    };
    // Loads of a, b (made narrow), d+4, and c besides its first one.
    let loads = |between: &str| {
        let form = form(&text(between), only(&["forward"]));
        assert_eq!(count(&form, "slot.store"), 3 + count(between, "slot.store g"), "{form}");
        let of = |what| count(&form, what);
        (of("slot.load g0"), of("slot.load g1"), of("slot.load g2"), of("= load"), of("extend16_s"))
    };
    assert_eq!(loads(""), (0, 0, 1, 0, 1));
    assert_eq!(loads("const.i32 1\nslot.store g a\n"), (0, 0, 1, 0, 1), "the newest value");
    assert_eq!(loads("const.i32 1\nstore d i32 d+8\n"), (0, 0, 1, 0, 1), "beside it");
    assert_eq!(loads("slot.load l r\nconst.i32 1\nref.store i32\n"), (0, 0, 1, 1, 1), "it may point there");
    assert_eq!(loads("call f\n"), (1, 1, 1, 1, 0));
    assert_eq!(
        loads("top:\nslot.load g a\njump.if top\n"),
        (1, 1, 1, 1, 0),
        "a loop's header is reached on two ways; what it loads serves behind it"
    );
    assert_eq!(loads("slot.load g a\njump.if next\nnop\nnext:\n"), (1, 1, 1, 1, 0), "ways join");
    assert_eq!(loads(&"nop\nconst.i32 1\ndrop\n".repeat(60)), (1, 1, 1, 1, 0), "too far");
}

#[test]
fn loops_over_independent_floats_run_in_vectors() {
    let text = |store: &str, last: u32| {
        format!(
            "type n scalar f32\narray v n 0..99\ndata a v\ndata b v\nprogram p_\nslot i i32\nslot s f32\nfunction main program p_\nfor k p i i32\n\
             const.i32 0\nconst.i32 {last}\nconst.i32 1\nfor.enter k out\ntop:\naddress d a v\n{store}ref.index v\n\
             address d b v\nslot.load p i\nref.index v\nref.load f32\nconst f32 2.0\nf32.mul\nref.store f32\n\
             slot.load p s\naddress d b v\nslot.load p i\nref.index v\nref.load f32\nf32.add\nslot.store p s\nfor.next k top\nout:\nreturn\nend\n"
        )
    };
    let own = "slot.load p i\n";
    let vectors = form(&text(own, 15), Passes::ALL);
    assert!(vectors.contains("f32x4") && count(&vectors, "lane v") == 4, "{vectors}");
    // A number of passes that does not divide, an element of another pass, code that charges fuel: one pass after the other.
    for other in [text(own, 14), text("slot.load p i\nconst.i32 2\ni32.mul\n", 15), text("const.i32 3\n", 15)] {
        assert!(!form(&other, Passes::ALL).contains("f32x4"));
    }
    let recurrence = text("slot.load p i\nconst.i32 1\ni32.add\n", 15).replace("address d b v", "address d a v");
    assert!(!form(&recurrence, Passes::ALL).contains("f32x4"));
}

#[test]
fn it_is_noted_which_passes_changed_something() {
    let fired = |text: &str, passes: Passes| {
        let options = JitOptions { passes, note_passes: true, ..JitOptions::default() };
        let fired = load_with(text, options).engine.passes_fired().unwrap();
        fired.rows().filter(|row| row.1).map(|row| row.0).collect::<Vec<_>>()
    };
    assert_eq!(fired(SUM, Passes::ALL), ["promote", "fold", "for_loops", "checks", "deadlines", "forward"]);
    assert_eq!(fired(SUM, only(&["promote", "bools"])), ["promote"]);
    assert_eq!(fired("function main\nreturn\nend\n", Passes::ALL), Vec::<&str>::new());
    assert_eq!(load_with(SUM, JitOptions::default()).engine.passes_fired(), None);
}
