//! Rounds on the virtual clock, line by line.

mod common;

use common::*;
use khz_bytecode::container::{SingleSource, SystemVariable, SystemVariableKind, TaskExtension};
use khz_bytecode::ids::SlotIndex;
use khz_bytecode::value::BytePlace;
use khz_machine::engine::Entry;
use khz_machine::image::Image;
use khz_scheduler::*;

#[test]
fn three_cyclic_tasks_by_grid_and_priority() {
    let tasks = [cyclic(20_000, 1), cyclic(10_000, 2), cyclic(10_000, 0)];
    let (trace, outcome) = traced(load(container(&tasks), |_, _, _| Ok(())), vec![], 4);
    assert_eq!(trace, ["0 [2, 0, 1]", "10000 [2, 1]", "20000 [2, 0, 1]", "30000 [2, 1]"]);
    assert!(matches!(outcome, RunOutcome::Completed(_)));
}

#[test]
fn a_phase_shifts_the_grid_and_empty_rounds_are_no_scans() {
    let (task, extension) = cyclic(10_000, 0);
    let tasks = [(task, TaskExtension { phase_us: 3_000, ..extension })];
    let (trace, _) = traced(load(container(&tasks), |_, _, _| Ok(())), vec![], 2);
    assert_eq!(trace, ["0 []", "3000 [0]", "13000 [0]"]);
}

#[test]
fn an_event_task_runs_one_microsecond_after_the_write() {
    let tasks = [cyclic(10_000, 0), event(slot(3), 1)];
    // The cyclic task toggles the flag: up in its 1st and 3rd cycle, down in the others.
    let resource = load(container(&tasks), |entry, image, _| {
        if entry == Entry::Instance(0) {
            let value = get(image, 3);
            set(image, 3, 1 - value);
        }
        Ok(())
    });
    let (trace, _) = traced(resource, vec![], 5);
    assert_eq!(trace, ["0 [0]", "1 [1]", "10000 [0]", "20000 [0]", "20001 [1]"]);
}

#[test]
fn an_edge_is_relative_to_false_before_the_first_round() {
    let tasks = [event(SingleSource::Literal(true), 0), event(SingleSource::Literal(false), 0)];
    let (trace, outcome) = traced(load(container(&tasks), |_, _, _| Ok(())), vec![], 9);
    assert_eq!(trace, ["0 [0]"]);
    assert!(matches!(outcome, RunOutcome::NothingDue(_)));
}

#[test]
fn sources_in_data_and_image_bits() {
    let bit = |place| SingleSource::Bit { place, offset: 1, bit: 5 };
    let tasks = [event(SingleSource::Data(20), 0), event(bit(BytePlace::Memory), 0), event(bit(BytePlace::Output), 0)];
    for chosen in 0..3u16 {
        let mut resource = load(container(&tasks), |_, _, _| Ok(()));
        let image = resource.image_mut();
        let at = match chosen {
            0 => image.layout().data.start + 20,
            1 => image.layout().memory.start + 1,
            _ => image.layout().output.start + 1,
        };
        image.bytes_mut()[at as usize] = if chosen == 0 { 1 } else { 0b0010_0000 };
        let (trace, _) = traced(resource, vec![], 9);
        assert_eq!(trace, [format!("0 [{chosen}]")]);
    }
}

#[test]
fn freewheeling_alone_ticks_by_milliseconds_and_else_goes_along() {
    let (trace, _) = traced(load(container(&[freewheeling()]), |_, _, _| Ok(())), vec![], 3);
    assert_eq!(trace, ["0 [0]", "1000 [0]", "2000 [0]"]);
    let (trace, _) = traced(load(container(&[freewheeling(), cyclic(7_000, 0)]), |_, _, _| Ok(())), vec![], 3);
    assert_eq!(trace, ["0 [1, 0]", "7000 [1, 0]", "14000 [1, 0]"]);
}

#[test]
fn input_rows_make_rounds_and_hold_before_sampling() {
    let rows = vec![(0, 3, 0), (4_000, 3, 1), (5_000, 3, 0), (12_000, 3, 1)];
    let (trace, outcome) = traced(load(container(&[event(slot(3), 0)]), |_, _, _| Ok(())), rows, 9);
    assert_eq!(trace, ["0 []", "4000 [0]", "5000 []", "12000 [0]"]);
    assert!(matches!(outcome, RunOutcome::NothingDue(_)));
}

#[test]
fn a_gated_task_is_held_while_its_single_is_true() {
    let rows = vec![(5_000, 3, 1), (25_000, 3, 0)];
    let (trace, _) = traced(load(container(&[gated(10_000, slot(3))]), |_, _, _| Ok(())), rows, 3);
    assert_eq!(trace, ["0 [0]", "5000 []", "25000 []", "30000 [0]", "40000 [0]"]);
    let rows = vec![(5_000, 3, 1), (20_000, 3, 0)];
    let (trace, outcome) = traced(load(container(&[gated(10_000, slot(3))]), |_, _, _| Ok(())), rows, 3);
    assert_eq!(trace, ["0 [0]", "5000 []", "20000 [0]", "30000 [0]"], "a fall on a grid point is due at once");
    let RunOutcome::Completed(resource) = outcome else { panic!() };
    assert_eq!(resource.statistics().tasks[0].lost_cycles, 0, "a held task loses nothing");
}

#[test]
fn a_gated_task_that_holds_itself_ends_the_run() {
    let resource = load(container(&[gated(10_000, slot(3))]), |_, image, _| {
        set(image, 3, 1);
        Ok(())
    });
    let (trace, outcome) = traced(resource, vec![], 9);
    assert_eq!(trace, ["0 [0]"]);
    assert!(matches!(outcome, RunOutcome::NothingDue(_)));
}

#[test]
fn nothing_to_run_ends_at_once() {
    let (mut task, extension) = cyclic(10_000, 0);
    task.enabled = false;
    for tasks in [vec![], vec![(task, extension)]] {
        let (trace, outcome) = traced(load(container(&tasks), |_, _, _| Ok(())), vec![], 9);
        assert_eq!(trace, ["0 []"]);
        assert!(matches!(outcome, RunOutcome::NothingDue(_)));
    }
}

#[test]
fn all_instances_of_a_task_run_in_declaration_order() {
    let log = Log::default();
    let mut container = container(&[cyclic(10_000, 1), cyclic(10_000, 0)]);
    for position in 0..3 {
        let mut more = container.tasks.instances[position % 2];
        more.id.0 = 10 + position as u16;
        container.tasks.instances.push(more);
    }
    let seen = log.clone();
    let resource = load(container, move |entry, _, limits| {
        seen.add(format!("{entry:?} of {}", limits.task_index));
        Ok(())
    });
    traced(resource, vec![], 1);
    let expected = [(1, 1), (3, 1), (0, 0), (2, 0), (4, 0)].map(|(i, t)| format!("Instance({i}) of {t}"));
    assert_eq!(log.take(), expected);
}

#[test]
fn up_times_are_the_rounds_time() {
    let mut container = container(&[cyclic(1_500, 0)]);
    let variable = |kind, slot| SystemVariable { kind, slot: SlotIndex(slot) };
    container.types.system_variables =
        vec![variable(SystemVariableKind::UpTime, 1), variable(SystemVariableKind::UpLtime, 2)];
    let log = Log::default();
    let seen = log.clone();
    let resource = load(container, move |_, image, _| {
        seen.add(format!("{} {}", get(image, 1), get(image, 2)));
        Ok(())
    });
    traced(resource, vec![], 3);
    assert_eq!(log.take(), ["0 0", "1000000 1500000", "3000000 3000000"]);
}

/// A driver that notes what it is asked.
struct Driver(Log);

impl IoDriver for Driver {
    fn read_inputs(&mut self, inputs: &mut [u8]) {
        self.0.add(format!("read {}", inputs.len()));
        inputs[0] += 1;
    }

    fn write_outputs(&mut self, outputs: &[u8]) {
        self.0.add(format!("write {outputs:?}"));
    }
}

#[test]
fn a_round_in_order() {
    let log = Log::default();
    let mut container = container(&[cyclic(10_000, 1), cyclic(10_000, 0)]);
    container.parameters.init_function = Some(khz_bytecode::ids::FunctionId(0));
    container.parameters.startup_function = Some(khz_bytecode::ids::FunctionId(0));
    let seen = log.clone();
    let resource = load(container, move |entry, image: &mut Image, _| {
        let (input, output) = (image.layout().input.start as usize, image.layout().output.start as usize);
        seen.add(format!("{entry:?} sees {}", image.bytes()[input]));
        if let Entry::Instance(position) = entry {
            image.bytes_mut()[output + position] += 1;
        }
        Ok(())
    });
    let mut driver = Driver(log.clone());
    let mut observer = log.clone();
    let mut hooks = Hooks { io: &mut driver, inputs: &mut NoInputs, observer: &mut observer };
    run(resource.start().unwrap(), &mut hooks, RunOptions { scans: Some(2) });
    log.add("end");
    assert_eq!(
        log.take(),
        [
            "Init sees 0",
            "Startup sees 0",
            "read 2",
            "Instance(1) sees 1",
            "Instance(0) sees 1",
            "write [1, 1]",
            "0 [1, 0]",
            "read 2",
            "Instance(1) sees 2",
            "Instance(0) sees 2",
            "write [2, 2]",
            "10000 [1, 0]",
            "end"
        ]
    );
}

#[test]
fn two_runs_are_alike() {
    let make = || {
        let tasks = [cyclic(3_000, 2), cyclic(5_000, 1), event(slot(3), 0), freewheeling(), gated(4_000, slot(4))];
        load(container(&tasks), |entry, image, _| {
            let Entry::Instance(position) = entry else { return Ok(()) };
            let count = get(image, 10 + position) + 1;
            set(image, 10 + position, count);
            set(image, 3, i64::from(count % 3 == 0));
            set(image, 4, i64::from(count % 4 == 0));
            Ok(())
        })
    };
    let (first, _) = traced(make(), vec![], 200);
    let (second, _) = traced(make(), vec![], 200);
    assert_eq!(first, second);
    assert!(first.iter().any(|line| line.contains('2')));
}
