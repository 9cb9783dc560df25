//! One engine's side: its resource, and what it says of a round.

use std::sync::Arc;

use khz_machine::image::Image;
use khz_machine::trap::{Trap, TrapCode};
use khz_scheduler::{
    FaultPlace, FaultReport, Faulted, HoldsContainer, Hooks, InputSource, LoadError, LoadOptions, NoInputs, NoIo,
    NoObserver, ResetKind, Resource, Round, Running, Stopped, VirtualClock, Wake,
};

use super::{EngineUnderTest, OpenError, Options, Prepare};
use crate::pipeline::Program;

/// One engine's side of the comparison.
pub(super) struct Side {
    pub name: String,
    pub fuel: bool,
    pub state: State,
    pub inputs: Option<Box<dyn InputSource>>,
    /// What it said last; `None`: it sat out.
    pub step: Option<Step>,
}

pub(super) enum State {
    Stopped(Resource<Stopped>),
    Running(Resource<Running>),
    Faulted(Resource<Faulted>),
    /// While a transition runs, and where the init function does not end without fuel.
    Absent,
}

/// What a side says of a round, to be compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    pub round: Option<Round>,
    pub wake: Option<Wake>,
    pub fault: Option<(Trap, FaultPlace)>,
}

impl Step {
    /// Of a transition that is no round.
    pub fn of_fault(side: &Side) -> Step {
        Step { round: None, wake: None, fault: side.fault().map(|report| (report.trap, report.place)) }
    }
}

impl Side {
    pub fn load(
        program: &Program,
        under_test: EngineUnderTest,
        options: &Options<'_>,
        sits_out: bool,
    ) -> Result<Side, OpenError> {
        let EngineUnderTest { name, engine, fuel } = under_test;
        let mut side = Side { name, fuel, state: State::Absent, inputs: None, step: None };
        if sits_out {
            return Ok(side);
        }
        let load = LoadOptions {
            max_image_bytes: options.max_image_bytes,
            watchdog_us: options.watchdog_us,
            stop: None,
            real_time_priority: None,
        };
        let holder: Arc<dyn HoldsContainer> = program.verified.clone();
        side.state = match Resource::load(holder, engine, Box::new(VirtualClock::new()), &load) {
            Ok(resource) => State::Stopped(resource),
            Err(LoadError::Faulted(faulted)) => State::Faulted(*faulted),
            Err(LoadError::Image(error)) => return Err(error.into()),
            Err(error @ LoadError::Monitor(_)) => return Err(OpenError::Host(error.to_string())),
        };
        side.step = Some(Step::of_fault(&side));
        Ok(side)
    }

    pub fn image(&self) -> Option<&Image> {
        match &self.state {
            State::Stopped(resource) => Some(resource.image()),
            State::Running(resource) => Some(resource.image()),
            State::Faulted(resource) => Some(resource.image()),
            State::Absent => None,
        }
    }

    /// The memory of a side that runs.
    pub fn running_image(&mut self) -> Option<&mut Image> {
        match &mut self.state {
            State::Running(resource) => Some(resource.image_mut()),
            _ => None,
        }
    }

    pub fn fault(&self) -> Option<&FaultReport> {
        match &self.state {
            State::Faulted(resource) => Some(resource.report()),
            _ => None,
        }
    }

    pub fn trap(&self) -> Option<TrapCode> {
        self.fault().map(|report| report.trap.code)
    }

    /// Sets values before it starts.
    pub fn prepare(&mut self, prepare: &Prepare<'_>) {
        if let State::Stopped(resource) = &mut self.state {
            prepare(resource.image_mut());
        }
    }

    pub fn start(&mut self) {
        self.state = match std::mem::replace(&mut self.state, State::Absent) {
            State::Stopped(resource) => resource.start().map_or_else(State::Faulted, State::Running),
            other => other,
        };
    }

    pub fn reset(&mut self) {
        let outcome = match std::mem::replace(&mut self.state, State::Absent) {
            State::Running(resource) => resource.stop().reset(ResetKind::Cold),
            State::Faulted(resource) => resource.reset(ResetKind::Cold),
            State::Stopped(resource) => resource.reset(ResetKind::Cold),
            State::Absent => return,
        };
        self.state = outcome.map_or_else(State::Faulted, State::Stopped);
    }

    /// A round, and the wait behind it.
    pub fn round(&mut self, idle_goes_on: bool) -> Step {
        let mut no_rows = NoInputs;
        let inputs: &mut dyn InputSource = match &mut self.inputs {
            Some(rows) => &mut **rows,
            None => &mut no_rows,
        };
        let (mut io, mut observer) = (NoIo, NoObserver);
        let mut hooks = Hooks { io: &mut io, inputs, observer: &mut observer };
        let mut step = Step { round: None, wake: None, fault: None };
        self.state = match std::mem::replace(&mut self.state, State::Absent) {
            State::Running(resource) => match resource.run_round(&mut hooks) {
                Ok((mut resource, round)) => {
                    let wake = resource.next_wake(&mut hooks);
                    resource.wait(if wake == Wake::Never && idle_goes_on { Wake::Freewheel } else { wake });
                    step.round = Some(round);
                    step.wake = Some(wake);
                    State::Running(resource)
                }
                Err(faulted) => State::Faulted(faulted),
            },
            other => other,
        };
        step.fault = self.fault().map(|report| (report.trap, report.place));
        step
    }
}
