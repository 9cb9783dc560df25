//! Start, stop, faults and resets.

mod common;

use common::*;
use khz_bytecode::container::{InitRun, Region, RetainRange};
use khz_bytecode::ids::FunctionId;
use khz_machine::engine::Entry;
use khz_machine::trap::TrapCode;
use khz_scheduler::*;

#[derive(Default)]
struct Outputs(Vec<Vec<u8>>);

impl IoDriver for Outputs {
    fn read_inputs(&mut self, _inputs: &mut [u8]) {}

    fn write_outputs(&mut self, outputs: &[u8]) {
        self.0.push(outputs.to_vec());
    }
}

#[test]
fn a_fault_abandons_the_round_and_holds_the_outputs() {
    let mut container = container(&[cyclic(10_000, 0), cyclic(20_000, 1), cyclic(10_000, 2)]);
    let mut second = container.tasks.instances[1];
    second.id.0 = 50;
    container.tasks.instances.push(second);
    let log = Log::default();
    let seen = log.clone();
    let resource = load(container, move |entry, image, _| {
        seen.add(format!("{entry:?}"));
        let output = image.layout().output.start as usize;
        image.bytes_mut()[output] += 1;
        // The second instance of the second task traps in its second cycle.
        if entry == Entry::Instance(3) && image.bytes()[output] > 4 {
            Err(trap(TrapCode::DivideByZero))
        } else {
            Ok(())
        }
    });
    let mut io = Outputs::default();
    let mut observer = Log::default();
    let mut hooks = Hooks { io: &mut io, inputs: &mut NoInputs, observer: &mut observer };
    let outcome = run(resource.start().unwrap(), &mut hooks, RunOptions::default());
    let RunOutcome::Faulted(faulted) = outcome else { panic!("{outcome:?}") };
    let report = faulted.report();
    assert_eq!(report.place, FaultPlace::Task { task: TaskIndex(1), instance: 3 });
    assert_eq!(report.trap, trap(TrapCode::DivideByZero));
    assert_eq!((report.time.as_us(), report.rounds), (20_000, 2));
    assert_eq!(observer.take(), ["0 [0, 1, 2]", "10000 [0, 2]"], "the abandoned round is no snapshot");
    assert_eq!(io.0, [[4, 0], [6, 0]], "outputs hold");
    assert_eq!(
        faulted.image().bytes()[faulted.image().layout().output.start as usize],
        9,
        "the image is as the trap left it"
    );
    let ran = log.take();
    assert_eq!(ran[ran.len() - 3..], ["Instance(0)", "Instance(1)", "Instance(3)"], "lower priorities do not run");
    let scans: Vec<u64> = faulted.statistics().tasks.iter().map(|task| task.scans).collect();
    assert_eq!(scans, [3, 1, 2]);
}

fn counting() -> Resource<Stopped> {
    let mut container = container(&[cyclic(10_000, 0)]);
    container.parameters.init_function = Some(FunctionId(0));
    let run = |offset: u32, value: i64| InitRun {
        region: Region::Slots,
        offset: offset * 8,
        repeat: 1,
        bytes: value.to_le_bytes().to_vec(),
    };
    container.types.init_image = vec![run(0, 100), run(1, 200)];
    container.types.retain = vec![RetainRange { region: Region::Slots, offset: 8, bytes: 8 }];
    load(container, |entry, image, _| {
        if entry == Entry::Init {
            set(image, 2, 300);
            return Ok(());
        }
        for slot in 0..3 {
            let value = get(image, slot);
            set(image, slot, value + 1);
        }
        if get(image, 0) == 105 { Err(trap(TrapCode::Range)) } else { Ok(()) }
    })
}

fn values(resource: &Resource<Stopped>) -> [i64; 3] {
    [0, 1, 2].map(|slot| get(resource.image(), slot))
}

#[test]
fn resets_restore_initial_values() {
    for (kind, expected, scans) in [
        (ResetKind::Warm, [100, 205, 300], 4),
        (ResetKind::Cold, [100, 200, 300], 4),
        (ResetKind::Origin, [100, 200, 300], 0),
    ] {
        let resource = counting();
        assert_eq!(values(&resource), [100, 200, 300]);
        let RunOutcome::Faulted(faulted) = run_plain(resource.start().unwrap(), None) else { panic!() };
        let resource = faulted.reset(kind).unwrap();
        assert_eq!(values(&resource), expected, "{kind:?}");
        assert_eq!((resource.time(), resource.rounds()), (TimeNs::ZERO, 0));
        assert_eq!(resource.statistics().tasks[0].scans, scans, "{kind:?}");
        let (trace, _) = traced(resource, vec![], 2);
        assert_eq!(trace, ["0 [0]", "10000 [0]"], "{kind:?}: the grid begins anew");
    }
}

#[test]
fn a_stopped_resource_goes_on_where_it_was() {
    let (trace, outcome) = traced(counting(), vec![], 2);
    assert_eq!(trace, ["0 [0]", "10000 [0]"]);
    let RunOutcome::Completed(resource) = outcome else { panic!() };
    assert_eq!(values(&resource), [102, 202, 302]);
    let (trace, _) = traced(resource, vec![], 1);
    assert_eq!(trace, ["10000 []", "20000 [0]"]);
}

#[test]
fn time_stands_still_from_the_stop_on_not_from_the_last_round_on() {
    let mut hooks = Hooks { io: &mut NoIo, inputs: &mut NoInputs, observer: &mut NoObserver };
    let (mut running, round) = counting().start().unwrap().run_round(&mut hooks).ok().unwrap();
    assert_eq!(round.time, TimeNs::ZERO);
    let wake = running.next_wake(&mut hooks);
    running.wait(wake);
    let stopped = running.stop();
    assert_eq!(stopped.time(), TimeNs::ZERO, "no round has begun since");
    let (_, round) = stopped.start().unwrap().run_round(&mut hooks).ok().unwrap();
    assert_eq!((round.time, round.tasks), (TimeNs::from_us(10_000), 1));
}

#[test]
fn traps_in_init_and_startup_fault_too() {
    let options = LoadOptions::default();
    let mut bad_init = container(&[cyclic(10_000, 0)]);
    bad_init.parameters.init_function = Some(FunctionId(0));
    let result = load_with(bad_init, Box::new(VirtualClock::new()), &options, |_, _, _| Err(trap(TrapCode::Reference)));
    let Err(LoadError::Faulted(faulted)) = result else { panic!() };
    assert_eq!(faulted.report().place, FaultPlace::Init);
    assert!(faulted.reset(ResetKind::Cold).is_err(), "the init function traps again");

    let mut bad_startup = container(&[cyclic(10_000, 0)]);
    bad_startup.parameters.startup_function = Some(FunctionId(0));
    let faulted = load(bad_startup, |_, _, limits| endless(limits)).start().unwrap_err();
    assert_eq!(faulted.report().place, FaultPlace::Startup);
    assert_eq!(faulted.report().trap.code, TrapCode::Watchdog, "1 s of fuel on the virtual clock");
}

#[test]
fn an_image_over_the_cap_is_refused() {
    let options = LoadOptions { max_image_bytes: 100, ..LoadOptions::default() };
    let result = load_with(container(&[]), Box::new(VirtualClock::new()), &options, |_, _, _| Ok(()));
    assert!(matches!(result, Err(LoadError::Image(_))));
}

#[test]
fn hostile_tables_do_no_harm() {
    // Nothing of this passes the verifier; the scheduler does not rely on it.
    let mut hostile = container(&[gated(0, slot(u16::MAX)), event(slot(9), 0)]);
    hostile.tasks.instances[1].task.0 = 9999;
    hostile.types.task_extensions.pop();
    hostile.types.retain = vec![RetainRange { region: Region::Slots, offset: u32::MAX, bytes: u32::MAX }];
    hostile.types.system_variables = vec![khz_bytecode::container::SystemVariable {
        kind: khz_bytecode::container::SystemVariableKind::UpTime,
        slot: khz_bytecode::ids::SlotIndex(u16::MAX),
    }];
    let (trace, outcome) = traced(load(hostile, |_, _, _| Ok(())), vec![], 2);
    assert_eq!(trace, ["0 [0]", "1 [0]"]);
    let RunOutcome::Completed(resource) = outcome else { panic!() };
    assert!(resource.reset(ResetKind::Warm).is_ok());
}
